//! Rows whose time stamps scatter around samples of a controller.

/// Farthest stamp from its regular time, in rows.
const FARTHEST: f64 = 0.45;

/// Largest relative difference of the clocks of log and controller.
const CLOCKS: f64 = 5e-3;

/// Difference of the two, in its deviations, below which they are one clock.
const SAME_CLOCK: f64 = 3.0;

/// The regular times that stamps scatter around, about so far from each other; none where there are none.
pub fn regular_times(time: &[f64], between: f64) -> Option<Vec<f64>> {
    let mut number = 0.0;
    let mut numbers = vec![0.0];
    for pair in time.windows(2) {
        number += ((pair[1] - pair[0]) / between).round_ties_even().max(1.0);
        numbers.push(number);
    }
    let count = time.len() as f64;
    if count < 3.0 {
        return None;
    }
    let centre = numbers.iter().sum::<f64>() / count;
    let mean = time.iter().sum::<f64>() / count;
    let rows = || numbers.iter().map(|x| x - centre).zip(time);
    let power: f64 = rows().map(|(x, _)| x * x).sum();
    let mut spacing = rows().map(|(x, t)| x * (t - mean)).sum::<f64>() / power;
    let left: f64 = rows().map(|(x, t)| (t - mean - spacing * x).powi(2)).sum();
    let start = mean - spacing * centre;
    if (spacing / between - 1.0).abs() > CLOCKS {
        return None;
    }
    if (spacing - between).abs() < SAME_CLOCK * (left / (count - 2.0) / power).sqrt() {
        spacing = between;
    }
    let regular: Vec<f64> = numbers.iter().map(|x| start + spacing * x).collect();
    let mut pairs = time.iter().zip(&regular);
    let is_near = pairs.all(|(t, own)| (t - own).abs() <= FARTHEST * between);
    is_near.then_some(regular)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_around_samples_have_regular_times() {
        let scatter = |i: usize| (((i * 7919) % 101) as f64 / 101.0 - 0.5) * 0.004;
        let time: Vec<f64> = (0..300)
            .map(|i| 2.0 + 0.02 * i as f64 + scatter(i))
            .collect();
        let regular = regular_times(&time, 0.02).unwrap();
        for (i, t) in regular.iter().enumerate() {
            assert!((t - 2.0 - 0.02 * i as f64).abs() < 5e-4);
        }
        // Those of a clock that is off by more than clocks are, or that scatter by half a row, are not.
        assert_eq!(regular_times(&time, 0.021), None);
        let far: Vec<f64> = (0..300)
            .map(|i| 0.02 * i as f64 + 5.0 * scatter(i))
            .collect();
        assert_eq!(regular_times(&far, 0.02), None);
    }
}
