//! The delay as a random walk over cells: the filters are mixed as interacting multiple models
//! (Blom & Bar-Shalom 1988).
//!
//! A walk that gains the variance v between two rows goes from a cell to its neighbours at h₋ and h₊
//! with the probabilities v/(h₋ (h₋ + h₊)) and v/(h₊ (h₋ + h₊)), which have mean zero and variance
//! v. At the ends it stays.

use super::cell::Cell;

/// Largest probability to leave a cell in one step of the walk.
const MOST: f64 = 0.4;

/// Shares of a mixture below this one are left out.
const NOTHING: f64 = 1e-9;

/// Probabilities to go down and up from each cell, of a walk that gains a variance of one.
#[derive(Debug, Clone)]
pub(super) struct Walk {
    rates: Vec<(f64, f64)>,
    top: f64,
}

impl Walk {
    pub(super) fn new(delays: &[f64]) -> Self {
        let count = delays.len();
        let rates: Vec<(f64, f64)> = (0..count)
            .map(|i| {
                let below = i.checked_sub(1).map(|j| delays[i] - delays[j]);
                let above = delays.get(i + 1).map(|next| next - delays[i]);
                let (near, far) = (below.or(above), above.or(below));
                match (near, far) {
                    (Some(near), Some(far)) => (
                        below.map_or(0.0, |h| 1.0 / (h * (near + far))),
                        above.map_or(0.0, |h| 1.0 / (h * (near + far))),
                    ),
                    _ => (0.0, 0.0),
                }
            })
            .collect();
        let top = rates.iter().map(|(d, u)| d + u).fold(0.0, f64::max);
        Self { rates, top }
    }

    /// Mix cells and weights, which need not sum to one, by a walk that gains `variance`.
    pub(super) fn mix<const N: usize>(
        &self,
        cells: &mut [Cell<N>],
        weights: &mut [f64],
        variance: f64,
        white: f64,
    ) {
        if variance <= 0.0 || cells.len() < 2 {
            return;
        }
        let steps = (variance * self.top / MOST).ceil().max(1.0);
        let each = variance / steps;
        for _ in 0..steps as u32 {
            self.step(cells, weights, each, white);
        }
    }

    fn step<const N: usize>(
        &self,
        cells: &mut [Cell<N>],
        weights: &mut [f64],
        variance: f64,
        white: f64,
    ) {
        let (old, before) = (cells.to_vec(), weights.to_vec());
        for j in 0..cells.len() {
            let up = |i: usize| before[i] * self.rates[i].1 * variance;
            let down = |i: usize| before[i] * self.rates[i].0 * variance;
            let stays = before[j] * (1.0 - variance * (self.rates[j].0 + self.rates[j].1));
            let from_below = j.checked_sub(1).map_or(0.0, up);
            let from_above = if j + 1 < old.len() { down(j + 1) } else { 0.0 };
            let total = stays + from_below + from_above;
            weights[j] = total;
            if total <= 0.0 || stays >= total * (1.0 - NOTHING) {
                continue;
            }
            let mut parts: [(f64, &Cell<N>); 3] = [(stays / total, &old[j]); 3];
            let mut count = 1;
            for (share, place) in [(from_below, j.wrapping_sub(1)), (from_above, j + 1)] {
                if let Some(cell) = old.get(place).filter(|_| share > NOTHING * total) {
                    parts[count] = (share / total, cell);
                    count += 1;
                }
            }
            cells[j] = Cell::blend(&parts[..count], white);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_walk_keeps_the_mean_and_gains_its_variance() {
        let delays: Vec<f64> = (0..60)
            .map(|i| 0.1 + 0.01 * f64::from(i) * (1.0 + 0.01 * f64::from(i)))
            .collect();
        let walk = Walk::new(&delays);
        let cell = |x: f64| Cell {
            mean: [x],
            cov: [[1.0]],
            slope: [0.0],
        };
        let mut cells: Vec<Cell<1>> = delays.iter().map(|t| cell(*t)).collect();
        let mut weights = vec![0.0; 60];
        weights[30] = 1.0;
        for _ in 0..10 {
            walk.mix(&mut cells, &mut weights, 2e-4, 1.0);
        }
        let total: f64 = weights.iter().sum();
        let mean: f64 = weights.iter().zip(&delays).map(|(w, t)| w * t).sum();
        let square: f64 = weights
            .iter()
            .zip(&delays)
            .map(|(w, t)| w * (t - mean).powi(2))
            .sum();
        assert!((total - 1.0).abs() < 1e-12);
        assert!((mean - delays[30]).abs() < 1e-12);
        assert!((square - 2e-3).abs() < 1e-9, "{square}");
        // The states came from the cell where the walk began: they were moved, not made.
        let middle: f64 = weights.iter().zip(&cells).map(|(w, c)| w * c.mean[0]).sum();
        assert!((middle - delays[30]).abs() < 1e-9);
    }
}
