//! Means of neighbours, over the length that predicts each value best from the rest.

use super::super::median::median;
use super::tolerances::{LENGTHS, REACH};

/// Weighted means of neighbours, and their deviation by white noise of one.
pub(super) fn smoothed(values: &[f64]) -> (Vec<f64>, f64) {
    let mut best = (f64::INFINITY, Vec::new(), Vec::new());
    for length in LENGTHS {
        let weights: Vec<f64> = (1..=REACH).map(|k| (-(k as f64) / length).exp()).collect();
        let sums = with_neighbours(values, &weights);
        let away = values.iter().zip(&sums);
        let away = away.map(|(value, (sum, share))| (value - sum / share).abs());
        let middle = median(away.collect());
        if middle < best.0 || best.1.is_empty() {
            best = (middle, weights, sums);
        }
    }
    let (_, half, sums) = best;
    // At an end, as beside a hole, there are neighbours on one side.
    let squares: f64 = half.iter().map(|weight| weight * weight).sum();
    let error = (1.0 + squares).sqrt() / (1.0 + half.iter().sum::<f64>());
    let means = values.iter().zip(&sums);
    let means = means.map(|(value, (sum, share))| (sum + value) / (share + 1.0));
    (means.collect(), error)
}

/// The weighted sum of the neighbours of each value, and the sum of their weights.
fn with_neighbours(values: &[f64], weights: &[f64]) -> Vec<(f64, f64)> {
    let one = |place: usize| {
        let (mut sum, mut share) = (0.0, 0.0);
        for (k, weight) in weights.iter().enumerate() {
            let before = place.checked_sub(k + 1).and_then(|at| values.get(at));
            for value in [before, values.get(place + k + 1)].into_iter().flatten() {
                sum += weight * value;
                share += weight;
            }
        }
        (sum, share)
    };
    (0..values.len()).map(one).collect()
}
