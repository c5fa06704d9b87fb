//! One Kalman filter: a delay and lags, and what is known of the states if they are right.
//!
//! The states are those of the plant, air and coloured noise, then the gain, the trim and the
//! offset, as far as they are there. Given the command the output is linear in all of them.
//! Covariances are in variances of the white noise.

use super::super::propagation::{Propagation, Square, product};

/// Mean and covariance of the states, and how the mean changes with the delay.
#[derive(Debug, Clone)]
pub(super) struct Cell<const N: usize> {
    pub(super) mean: [f64; N],
    pub(super) cov: Square<N>,
    /// Derivative of the mean by the delay.
    pub(super) slope: [f64; N],
}

/// What the input does between two rows, for one delay and set of lags.
#[derive(Debug, Clone, Copy)]
pub(super) struct Column<const N: usize> {
    /// The change of the states, for a gain of one.
    pub(super) moved: [f64; N],
    /// Its derivative by the delay.
    pub(super) slope: [f64; N],
    /// How the states are seen at the later row.
    pub(super) seen: [f64; N],
}

/// What a row says to a cell.
#[derive(Debug, Clone, Copy)]
pub(super) struct Look<const N: usize> {
    /// The output less its prediction.
    pub(super) innovation: f64,
    /// Variance of that, in variances of the white noise.
    pub(super) variance: f64,
    /// Derivative of the prediction by the delay.
    pub(super) slope: f64,
    shared: [f64; N],
}

impl<const N: usize> Look<N> {
    /// Of a cell that rests.
    pub(super) const NONE: Self = Self {
        innovation: 0.0,
        variance: 1.0,
        slope: 0.0,
        shared: [0.0; N],
    };
}

impl<const N: usize> Cell<N> {
    /// Go to the next row. `gain` is the place of the gain among the states.
    #[inline(always)]
    pub(super) fn go(&mut self, step: &Propagation<N>, column: &Column<N>, gain: usize) {
        let mut phi = step.phi;
        for (row, moved) in phi.iter_mut().zip(&column.moved) {
            row[gain] += moved;
        }
        let times = |x: &[f64; N]| -> [f64; N] { std::array::from_fn(|i| inner(&phi[i], x)) };
        let factor = self.mean[gain];
        self.mean = times(&self.mean);
        let moved = times(&self.slope);
        self.slope = std::array::from_fn(|i| moved[i] + factor * column.slope[i]);
        let left = product(&phi, &self.cov);
        let mut next = step.q;
        for i in 0..N {
            for j in 0..=i {
                next[i][j] += inner(&left[i], &phi[j]);
                next[j][i] = next[i][j];
            }
        }
        self.cov = next;
    }

    /// What the output at this row says, with white noise of variance one.
    #[inline(always)]
    pub(super) fn look(&self, column: &Column<N>, output: f64) -> Look<N> {
        let seen = &column.seen;
        let shared: [f64; N] = std::array::from_fn(|i| inner(&self.cov[i], seen));
        Look {
            innovation: output - inner(seen, &self.mean),
            variance: 1.0 + inner(seen, &shared),
            slope: inner(seen, &self.slope),
            shared,
        }
    }

    /// Take the row in: P − K (P c)ᵀ − (P c) Kᵀ + K S Kᵀ, Joseph's form for one output.
    #[inline(always)]
    pub(super) fn take(&mut self, look: &Look<N>) {
        let inverse = 1.0 / look.variance;
        let gain = look.shared.map(|shared| shared * inverse);
        for i in 0..N {
            self.mean[i] += gain[i] * look.innovation;
            self.slope[i] -= gain[i] * look.slope;
            for j in 0..=i {
                let less = gain[i] * look.shared[j] + look.shared[i] * gain[j];
                self.cov[i][j] += gain[i] * look.variance * gain[j] - less;
                self.cov[j][i] = self.cov[i][j];
            }
        }
    }

    /// The Gaussian with the mean and covariance of a mixture; the shares sum to one. The white
    /// noise has the variance `white`.
    #[expect(
        clippy::needless_range_loop,
        reason = "entries of a matrix and of two vectors by the same numbers"
    )]
    pub(super) fn blend(parts: &[(f64, &Self)], white: f64) -> Self {
        let mut sum = Self {
            mean: [0.0; N],
            cov: [[0.0; N]; N],
            slope: [0.0; N],
        };
        for (share, cell) in parts {
            for i in 0..N {
                sum.mean[i] += share * cell.mean[i];
                sum.slope[i] += share * cell.slope[i];
            }
        }
        for (share, cell) in parts {
            let away: [f64; N] = std::array::from_fn(|i| cell.mean[i] - sum.mean[i]);
            let scaled = away.map(|away| away / white);
            for i in 0..N {
                for j in 0..=i {
                    sum.cov[i][j] += share * (cell.cov[i][j] + scaled[i] * away[j]);
                }
            }
        }
        for i in 0..N {
            for j in 0..i {
                sum.cov[j][i] = sum.cov[i][j];
            }
        }
        sum
    }
}

#[inline(always)]
fn inner<const N: usize>(x: &[f64; N], y: &[f64; N]) -> f64 {
    x.iter().zip(y).map(|(x, y)| x * y).sum()
}
