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
    /// Of values in increasing order, each with the width that its mass spreads over and that mass.
    fn of(points: &[(f64, f64, f64)], tail: f64) -> Self {
        let total: f64 = points.iter().map(|(_, _, mass)| mass).sum();
        let mean = points.iter().map(|(x, _, mass)| x * mass).sum::<f64>() / total;
        let square = points.iter().map(|(x, _, mass)| (x - mean).powi(2) * mass);
        let deviation = (square.sum::<f64>() / total).sqrt();
        let end = |share: f64| {
            let mut left = share * total;
            for (x, width, mass) in points {
                if left <= *mass {
                    return x + width * (left / mass - 0.5);
                }
                left -= mass;
            }
            points.last().map_or(mean, |(x, width, _)| x + 0.5 * width)
        };
        Self {
            mean,
            deviation,
            low: end(tail),
            high: end(1.0 - tail),
        }
    }
}

/// Logarithm of the density over the delay, for one set of lags.
pub(super) struct Density<'a> {
    delays: &'a [f64],
    logs: Vec<f64>,
}

impl<'a> Density<'a> {
    /// Of weights of cells at these delays.
    pub(super) fn of(delays: &'a [f64], weights: &[f64]) -> Self {
        let logs = weights.iter().zip(widths(delays));
        Self {
            delays,
            logs: logs.map(|(weight, width)| (weight / width).ln()).collect(),
        }
    }

    fn top(&self) -> f64 {
        self.logs.iter().copied().fold(f64::NEG_INFINITY, f64::max)
    }

    /// At `x` beside cell `i`, where none is below `least`: Newton's form through three cells.
    fn at(&self, i: usize, x: f64, least: f64) -> f64 {
        let of = |i: usize| self.logs[i].max(least);
        let m = i.clamp(1, self.delays.len() - 2);
        let (x0, x1, x2) = (self.delays[m - 1], self.delays[m], self.delays[m + 1]);
        let first = (of(m) - of(m - 1)) / (x1 - x0);
        let second = ((of(m + 1) - of(m)) / (x2 - x1) - first) / (x2 - x0);
        of(m - 1) + (x - x0) * (first + second * (x - x1))
    }

    /// Weights of cells at other delays, with the same sum.
    pub(super) fn weights(&self, delays: &[f64]) -> Vec<f64> {
        let top = self.top();
        let total = self.total();
        let nearest = |x: f64| {
            let after = self.delays.partition_point(|one| *one < x);
            let after = after.min(self.delays.len() - 1);
            let before = after.saturating_sub(1);
            if x - self.delays[before] < self.delays[after] - x {
                before
            } else {
                after
            }
        };
        let mut found: Vec<f64> = delays
            .iter()
            .zip(widths(delays))
            .map(|(x, width)| {
                let i = nearest(*x);
                if self.logs[i] < top - NOTHING || self.logs[i].is_nan() {
                    return 0.0;
                }
                let log = self.at(i, *x, top - 2.0 * NOTHING);
                (log - top).min(NOTHING).exp() * width
            })
            .collect();
        let sum: f64 = found.iter().sum();
        if sum > 0.0 {
            found.iter_mut().for_each(|weight| *weight *= total / sum);
        }
        found
    }

    fn total(&self) -> f64 {
        let masses = self.logs.iter().zip(widths(self.delays));
        masses.map(|(log, width)| log.exp() * width).sum()
    }
}

/// Of the cells around delays: to the middles between neighbours, at the ends to the delay itself.
fn widths(delays: &[f64]) -> impl Iterator<Item = f64> + '_ {
    edges(delays)
        .collect::<Vec<f64>>()
        .into_iter()
        .scan(None, |before, edge| {
            Some(before.replace(edge).map(|before| edge - before))
        })
        .flatten()
}

fn edges(delays: &[f64]) -> impl Iterator<Item = f64> + '_ {
    let middles = delays.windows(2).map(|pair| 0.5 * (pair[0] + pair[1]));
    delays
        .first()
        .copied()
        .into_iter()
        .chain(middles)
        .chain(delays.last().copied())
}

/// The delay, and delay and lags together, from weights by set of lags and delay.
pub(super) fn known(delays: &[f64], lags: &[f64], weights: &[f64], tail: f64) -> (Known, Known) {
    let count = delays.len();
    let edges: Vec<f64> = edges(delays).collect();
    let densities: Vec<Density<'_>> = weights
        .chunks_exact(count)
        .map(|own| Density::of(delays, own))
        .collect();
    let top = densities
        .iter()
        .map(Density::top)
        .fold(f64::NEG_INFINITY, f64::max);
    let mut together = Vec::with_capacity(lags.len() * count * POINTS);
    let mut alone = vec![0.0; count * POINTS];
    let place = |i: usize, k: usize| {
        let width = edges[i + 1] - edges[i];
        (edges[i] + width * (k as f64 + 0.5) / POINTS as f64, width)
    };
    for (lag, own) in lags.iter().zip(&densities) {
        for i in 0..count {
            // A cell without a weight has minus infinity.
            if own.logs[i].max(top - 2.0 * NOTHING) < top - NOTHING {
                continue;
            }
            for k in 0..POINTS {
                let (x, width) = place(i, k);
                let log = own.at(i, x, top - 2.0 * NOTHING);
                let mass = (log - top).min(NOTHING).exp() * width;
                alone[i * POINTS + k] += mass;
                together.push((x + lag, width / POINTS as f64, mass));
            }
        }
    }
    if lags.len() > 1 {
        sort_up(&mut together, |part| part.0);
    }
    let places = (0..count).flat_map(|i| (0..POINTS).map(move |k| (i, k)));
    let alone: Vec<(f64, f64, f64)> = places
        .zip(alone)
        .filter(|(_, mass)| *mass > 0.0)
        .map(|((i, k), mass)| {
            let (x, width) = place(i, k);
            (x, width / POINTS as f64, mass)
        })
        .collect();
    (Known::of(&alone, tail), Known::of(&together, tail))
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
