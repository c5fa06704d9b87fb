//! Rows of an output that is rounded.

use super::tolerances::{COARSE, ROUNDED};

/// The step of a sensor that is coarse for how far its output moves, and beside noise of this deviation;
/// zero of others. Rows that are not finite do not count.
pub fn coarse_step(output: &[f64], noise: f64) -> f64 {
    let known: Vec<f64> = output.iter().copied().filter(|y| y.is_finite()).collect();
    let ends = known
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), y| {
            (low.min(*y), high.max(*y))
        });
    let span = ends.1 - ends.0;
    let moves = known.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    let moves: Vec<f64> = moves.filter(|x| *x > COARSE.rounding * span).collect();
    let step = moves.iter().copied().fold(f64::INFINITY, f64::min);
    let is_multiple = |x: &f64| {
        let whole = (x / step).round_ties_even();
        (x / step - whole).abs() <= COARSE.alike.0 + COARSE.alike.1 * whole
    };
    let is_coarse = span < COARSE.levels * step && noise < COARSE.noise * step;
    if !moves.is_empty() && is_coarse && moves.iter().all(is_multiple) {
        step
    } else {
        0.0
    }
}

/// The step to which an output was rounded, if its rows often stay on one step; else zero.
///
/// None counts where noise moves the output to and fro over its steps: rounding errors are then as good
/// as white, and every row tells (Widrow 1961).
pub(super) fn rounding_of(output: &[f64]) -> f64 {
    let changes = output.windows(2).map(|pair| pair[1] - pair[0]);
    let moves: Vec<f64> = changes.filter(|change| *change != 0.0).collect();
    let turns = moves.windows(2).filter(|pair| pair[0] * pair[1] < 0.0);
    let count = output.len() as f64;
    if turns.count() as f64 > ROUNDED.dithered * count {
        return 0.0;
    }
    let mut levels = output.to_vec();
    levels.sort_by(f64::total_cmp);
    levels.dedup();
    let steps: Vec<f64> = levels.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let step = steps.iter().copied().fold(f64::INFINITY, f64::min);
    let is_multiple = |own: &f64| {
        let whole = step * (own / step).round_ties_even();
        (own - whole).abs() < ROUNDED.alike * step
    };
    let still = (output.len().saturating_sub(1) - moves.len()) as f64;
    let stays = still >= ROUNDED.still * (count - 1.0);
    if !steps.is_empty() && stays && steps.iter().all(is_multiple) {
        step
    } else {
        0.0
    }
}

/// Rows of a rounded output that tell nothing besides another row on the same step.
///
/// Neighbours on one step of the sensor have the same rounding error. Of those the middle row stays, where
/// that error is least; of two in the middle the earlier and the later one in turn, so that none makes the
/// output early.
pub(super) fn on_same_step(output: &[f64]) -> Vec<bool> {
    let mut found = vec![true; output.len()];
    let (mut first, mut number) = (0, 0);
    for row in 1..=output.len() {
        if row == output.len() || output[row] != output[first] {
            found[(first + row - 1 + number % 2) / 2] = false;
            (first, number) = (row, number + 1);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_rows_on_one_step_the_middle_one_stays() {
        let output = [0.1, 0.1, 0.1, 0.12, 0.12, 0.12, 0.12];
        let same = [true, false, true, true, false, true, true];
        assert_eq!(on_same_step(&output)[..3], same[..3]);
        // Of two in the middle the later one, and then the earlier one.
        assert_eq!(on_same_step(&output)[3..], [true, true, false, true]);
        assert_eq!(
            on_same_step(&[1.0, 1.0, 2.0, 2.0])[..],
            [false, true, true, false]
        );
    }

    #[test]
    fn a_ramp_is_rounded_until_noise_moves_it_to_and_fro() {
        let ramp = |noise: f64| -> Vec<f64> {
            let row = |k: u32| {
                let wave = f64::from((k * 7919) % 13) / 6.0 - 1.0;
                (0.1 * f64::from(k) + noise * wave).round()
            };
            (0..200).map(row).collect()
        };
        assert_eq!(rounding_of(&ramp(0.0)), 1.0);
        assert_eq!(rounding_of(&ramp(0.8)), 0.0);
        assert_eq!(rounding_of(&[0.0; 9]), 0.0);
    }
}
