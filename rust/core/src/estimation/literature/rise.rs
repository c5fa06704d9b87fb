//! The beginning of a step response: its first movement, and the line through two shares of the step.

/// Share of the step that a response has risen to after its first movement.
const RISEN: f64 = 0.5;

/// The first sample from which on the output stays above `least`, a share of the step; none where it is above
/// from the first on, or never.
pub fn first_movement(travelled: &[f64], least: f64) -> Option<usize> {
    let after_still = |part: &[f64]| {
        let last = part.iter().rposition(|x| *x <= least);
        last.map_or(0, |last| last + 1)
    };
    let mut moved = after_still(travelled);
    // An unstable response returns to the start later: take its first movement.
    let half = travelled.iter().position(|x| *x >= RISEN).unwrap_or(0);
    if moved > half {
        moved = after_still(&travelled[..half]);
    }
    (moved > 0 && moved < travelled.len()).then_some(moved)
}

/// Time after the step at which the line through two shares meets the initial output.
pub fn line_through(since: &[f64], travelled: &[f64], (low, high): (f64, f64)) -> f64 {
    let time_of = |share: f64| {
        let row = travelled.iter().position(|x| *x >= share).unwrap_or(0);
        if row == 0 {
            return since[0];
        }
        let (before, after) = (travelled[row - 1], travelled[row]);
        let part = (share - before) / (after - before);
        since[row - 1] + part * (since[row] - since[row - 1])
    };
    let times = (time_of(low), time_of(high));
    times.0 - (times.1 - times.0) * low / (high - low)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_response_that_returns_has_its_first_movement() {
        assert_eq!(first_movement(&[0.0, 0.0, 0.3, 0.9, 1.0], 0.1), Some(2));
        assert_eq!(first_movement(&[0.0, 0.2, 0.9, -0.5, 1.0], 0.1), Some(1));
        assert_eq!(first_movement(&[0.2, 0.9], 0.1), None);
        assert_eq!(first_movement(&[0.0, 0.0], 0.1), None);
    }

    #[test]
    fn a_line_meets_the_initial_output_where_it_began() {
        let since: Vec<f64> = (0..8).map(f64::from).collect();
        let travelled: Vec<f64> = since.iter().map(|t| (0.2 * (t - 1.5)).max(0.0)).collect();
        let found = line_through(&since, &travelled, (0.15, 0.6));
        assert!((found - 1.5).abs() < 1e-12);
    }
}
