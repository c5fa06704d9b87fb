//! Covariance of the numbers that all recordings share: gain, delay, lags, zero.

use super::super::likelihood::Evaluation;
use super::super::point::Quantity;
use super::fit::FlightFit;
use super::tolerances::INTERVALS;
use crate::linear_algebra::singular::Singular;
use crate::{Error, Task};

impl FlightFit {
    /// Covariance of the numbers that all recordings share, row-major.
    ///
    /// # Errors
    ///
    /// As for `parts`.
    pub fn covariance(&self, task: &Task) -> Result<Vec<f64>, Error> {
        Ok(Common::new(self, task)?.covariance(self.parts(task)?))
    }
}

/// The covariances of one fit, under any noise.
pub(super) struct Common<'a> {
    fit: &'a FlightFit,
    numbers: Vec<Quantity>,
    unresolved: Vec<usize>,
}

impl<'a> Common<'a> {
    pub(super) fn new(fit: &'a FlightFit, task: &Task) -> Result<Self, Error> {
        let mut found = Self {
            fit,
            numbers: fit.plant.common(),
            unresolved: Vec::new(),
        };
        found.unresolved = found.unresolved(fit.parts(task)?);
        Ok(found)
    }

    /// The covariance for these likelihoods of the recordings, row-major.
    pub(super) fn covariance(&self, parts: &[Evaluation]) -> Vec<f64> {
        self.held(self.plain(parts), &self.unresolved)
    }

    /// A quantity as a sum of the common numbers.
    pub(super) fn weights(&self, quantity: Quantity) -> Vec<f64> {
        let weight = |number: &Quantity| match (quantity, *number) {
            (Quantity::Total, Quantity::Gain) => 0.0,
            (Quantity::Total, Quantity::Zero) => -1.0,
            (Quantity::Total, _) => 1.0,
            (own, number) => f64::from(u8::from(own == number)),
        };
        self.numbers.iter().map(weight).collect()
    }

    /// Places of the lags that the rows do not resolve, the shortest first.
    ///
    /// Far below the time between rows a lag has the effect of a delay, and beside one of about the
    /// same size that of this one: the linear model takes them for unknown to any size.
    fn unresolved(&self, parts: &[Evaluation]) -> Vec<usize> {
        let (plain, n, row) = (self.plain(parts), self.numbers.len(), self.row_time());
        let spans = self.fit.runs.iter().map(|run| run.rows.span());
        let longest = spans.fold(0.0, f64::max);
        let lags = &self.fit.fit.point.lags;
        let mut sizes: Vec<(usize, f64)> = Vec::new();
        for (place, number) in self.numbers.iter().enumerate() {
            if let Quantity::Lag(i) = number {
                sizes.push((place, lags.get(*i).copied().unwrap_or(0.0)));
            }
        }
        sizes.sort_by(|one, other| one.1.total_cmp(&other.1));
        let mut held = Vec::new();
        for (place, size) in sizes {
            let cov = self.held(plain.clone(), &held);
            let square = |place: usize| cov.get(place * (n + 1)).copied().unwrap_or(0.0);
            let short = size < row && square(place) > (INTERVALS.unresolved * row).powi(2);
            let mut times = (0..n).filter(|at| self.numbers[*at] != Quantity::Gain);
            if !short && times.all(|at| square(at) > 0.0 && square(at) < longest * longest) {
                break;
            }
            held.push(place);
        }
        held
    }

    /// The covariance where what such a lag is longer the delay is shorter.
    fn held(&self, mut cov: Vec<f64>, held: &[usize]) -> Vec<f64> {
        let n = self.numbers.len();
        for place in held {
            let own = cov[place * n + place];
            if own > 0.0 && own < f64::INFINITY {
                let before = cov.clone();
                for (at, entry) in cov.iter_mut().enumerate() {
                    *entry -= before[at / n * n + place] * before[place * n + at % n] / own;
                }
            }
            for at in 0..n {
                cov[place * n + at] = 0.0;
                cov[at * n + place] = 0.0;
            }
        }
        let square = (INTERVALS.split * self.row_time()).powi(2);
        for place in held {
            let shift = |at: usize| {
                let of_lag = f64::from(u8::from(at == *place));
                of_lag - f64::from(u8::from(self.numbers[at] == Quantity::Delay))
            };
            for (at, entry) in cov.iter_mut().enumerate() {
                *entry += square * shift(at / n) * shift(at % n);
            }
        }
        cov
    }

    fn plain(&self, parts: &[Evaluation]) -> Vec<f64> {
        let n = self.numbers.len();
        let mut blocks = parts.iter().map(|part| self.block(part));
        if parts.len() < 2 {
            return blocks.next().unwrap_or_default();
        }
        together(blocks, n)
    }

    /// The block of the common numbers of one recording.
    fn block(&self, part: &Evaluation) -> Vec<f64> {
        let size = part.inverse.len().isqrt();
        // A gain that is eliminated comes before the other linear unknowns.
        let first = self.fit.gain_is_eliminated().then_some(0);
        let own: Vec<usize> = first.into_iter().chain(part.linear.len()..size).collect();
        let pairs = own
            .iter()
            .flat_map(|i| own.iter().map(move |j| i * size + j));
        pairs.map(|at| part.inverse[at] * part.variance).collect()
    }

    fn row_time(&self) -> f64 {
        self.fit.runs.first().map_or(1.0, |run| run.row_time)
    }
}

/// The covariance of n numbers that several recordings tell.
fn together(blocks: impl Iterator<Item = Vec<f64>>, n: usize) -> Vec<f64> {
    // A recording whose derivatives are singular tells nothing here, which is the safe side.
    let told = blocks.filter(|block| block.iter().all(|entry| entry.is_finite()));
    // A number that one recording does not move at all, as a second lag of zero, has no variance.
    let inverse = |matrix: &[f64]| Singular::new(matrix, n).pseudo_inverse(INTERVALS.told);
    let sum = told.fold(None, |sum: Option<Vec<f64>>, block| {
        let own = inverse(&block);
        Some(match sum {
            None => own,
            Some(sum) => sum.iter().zip(&own).map(|(a, b)| a + b).collect(),
        })
    });
    sum.map_or_else(|| vec![f64::NAN; n * n], |sum| inverse(&sum))
}

/// The variance of a sum of numbers with these weights.
pub(super) fn variance(cov: &[f64], weights: &[f64]) -> f64 {
    let n = weights.len();
    let entries = cov.iter().enumerate();
    let terms = entries.map(|(at, entry)| weights[at / n] * entry * weights[at % n]);
    terms.sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The windows of a log of a real firmware had one such, and the report of the log ended there.
    #[test]
    fn a_recording_whose_derivatives_are_singular_tells_nothing() {
        let of = |pairs: [(f64, f64); 2]| {
            let found = together(pairs.iter().map(|(a, b)| vec![*a, 0.0, 0.0, *b]), 2);
            (found[0], found[3])
        };
        let (a, b) = of([(4.0, 1.0), (4.0, 1.0)]);
        assert!((a - 2.0).abs() < 1e-14 && (b - 0.5).abs() < 1e-14);
        let (a, b) = of([(4.0, 1.0), (f64::INFINITY, f64::NAN)]);
        assert!((a - 4.0).abs() < 1e-14 && (b - 1.0).abs() < 1e-14);
        assert!(of([(f64::INFINITY, 1.0), (f64::NAN, f64::NAN)]).0.is_nan());
    }
}
