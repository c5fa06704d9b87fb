//! From the weights of cells to means and intervals of the delay.
//!
//! The weight of a cell over its width is the density at its delay. Between cells the logarithm of
//! the density is a parabola through the three nearest, which is exact for a Gaussian however few
//! cells it covers.

use crate::order::sort_up;

/// Points in each cell at which the density is taken.
const POINTS: usize = 8;

/// Logarithms this far below the largest are as good as nothing.
const NOTHING: f64 = 45.0;

/// What is known of one quantity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Known {
    /// Posterior mean.
    pub mean: f64,
    /// Posterior standard deviation.
    pub deviation: f64,
    /// Ends of the interval with equal tails.
    pub low: f64,
    /// Ends of the interval with equal tails.
    pub high: f64,
}

impl Known {
    /// Of masses at values in increasing order; each spreads over `width`.
    fn of(points: &[(f64, f64)], width: f64, tail: f64) -> Self {
        let total: f64 = points.iter().map(|(_, mass)| mass).sum();
        let mean = points.iter().map(|(x, mass)| x * mass).sum::<f64>() / total;
        let square = points.iter().map(|(x, mass)| (x - mean).powi(2) * mass);
        let deviation = (square.sum::<f64>() / total).sqrt();
        let end = |share: f64| {
            let mut left = share * total;
            for (x, mass) in points {
                if left <= *mass {
                    return x + width * (left / mass - 0.5);
                }
                left -= mass;
            }
            points.last().map_or(mean, |(x, _)| x + 0.5 * width)
        };
        Self {
            mean,
            deviation,
            low: end(tail),
            high: end(1.0 - tail),
        }
    }
}

/// The delay, and delay and lags together, from weights by set of lags and delay.
pub(super) fn known(delays: &[f64], lags: &[f64], weights: &[f64], tail: f64) -> (Known, Known) {
    let count = delays.len();
    let edges: Vec<f64> = (0..=count)
        .map(|i| match (i.checked_sub(1), i < count) {
            (Some(before), true) => 0.5 * (delays[before] + delays[i]),
            (Some(before), false) => delays[before],
            _ => delays[0],
        })
        .collect();
    let width = |i: usize| edges[i + 1] - edges[i];
    let density: Vec<f64> = weights
        .iter()
        .enumerate()
        .map(|(place, weight)| (weight / width(place % count)).ln())
        .collect();
    let top = density.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let step = (delays[count - 1] - delays[0]) / (count * POINTS) as f64;
    let mut together = Vec::with_capacity(lags.len() * count * POINTS);
    let mut alone = vec![0.0; count * POINTS];
    for (lag, own) in lags.iter().zip(density.chunks_exact(count)) {
        let of = |i: usize| own[i].max(top - 2.0 * NOTHING);
        for i in 0..count {
            if of(i) < top - NOTHING {
                continue;
            }
            // Newton's form through three cells.
            let m = i.clamp(1, count - 2);
            let (x0, x1, x2) = (delays[m - 1], delays[m], delays[m + 1]);
            let first = (of(m) - of(m - 1)) / (x1 - x0);
            let second = ((of(m + 1) - of(m)) / (x2 - x1) - first) / (x2 - x0);
            for k in 0..POINTS {
                let x = edges[i] + width(i) * (k as f64 + 0.5) / POINTS as f64;
                let log = of(m - 1) + (x - x0) * (first + second * (x - x1));
                let mass = (log - top).min(NOTHING).exp() * width(i);
                alone[i * POINTS + k] += mass;
                together.push((x + lag, mass));
            }
        }
    }
    if lags.len() > 1 {
        sort_up(&mut together, |part| part.0);
    }
    let places = (0..count).flat_map(|i| {
        let (low, width) = (edges[i], width(i));
        (0..POINTS).map(move |k| low + width * (k as f64 + 0.5) / POINTS as f64)
    });
    let alone: Vec<(f64, f64)> = places.zip(alone).filter(|(_, mass)| *mass > 0.0).collect();
    (
        Known::of(&alone, step, tail),
        Known::of(&together, step, tail),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gaussian_has_its_mean_and_interval_on_few_cells() {
        let delays: Vec<f64> = (0..40).map(|i| 0.1 + 0.02 * f64::from(i)).collect();
        for deviation in [0.006, 0.02, 0.08] {
            for mean in [0.4, 0.4071, 0.41] {
                let weights: Vec<f64> = delays
                    .iter()
                    .map(|t| (-0.5 * ((t - mean) / deviation).powi(2)).exp())
                    .collect();
                let (delay, total) = known(&delays, &[0.15], &weights, 0.025);
                assert!((delay.mean - mean).abs() < 3e-4, "{delay:?}");
                assert!(
                    (delay.deviation / deviation - 1.0).abs() < 0.03,
                    "{delay:?}"
                );
                assert!((delay.low - (mean - 1.96 * deviation)).abs() < 0.04 * deviation + 4e-4);
                assert!((delay.high - (mean + 1.96 * deviation)).abs() < 0.04 * deviation + 4e-4);
                assert!((total.low - delay.low - 0.15).abs() < 1e-9);
            }
        }
    }
}
