//! The response of a plant to an input that steps to one:
//!
//!   Γ(s) = ∫₀ˢ e^{A r} b dr = Σ A^k b s^(k+1)/(k+1)!,   Γ′(s) = A Γ(s) + b.
//!
//! Each delay of a bank has a step length of its own in every row, so that nothing can be kept: the
//! vectors A^k b/(k+1)! are made once and the series is a polynomial in s.

use super::super::propagation::Square;

/// Largest ‖A‖₁ s for which the series is summed; longer steps are made of these.
const REACH: f64 = 2.0;

/// Terms of the series: 2^31/31! is below 1e-24.
const TERMS: usize = 30;

/// Γ of one plant.
#[derive(Debug, Clone)]
pub(super) struct StepResponse<const N: usize> {
    a: Square<N>,
    b: [f64; N],
    /// A^k b/(k+1)!.
    terms: Vec<[f64; N]>,
    /// Longest step that the series takes.
    longest: f64,
}

impl<const N: usize> StepResponse<N> {
    pub(super) fn new(a: Square<N>, b: [f64; N]) -> Self {
        let norm = (0..N)
            .map(|j| a.iter().map(|row| row[j].abs()).sum::<f64>())
            .fold(0.0, f64::max);
        let mut terms = vec![b];
        let mut last = b;
        for k in 2..=TERMS {
            last = times(&a, &last).map(|entry| entry / k as f64);
            terms.push(last);
        }
        Self {
            a,
            b,
            terms,
            longest: REACH / norm.max(f64::MIN_POSITIVE),
        }
    }

    /// Γ(s) for s of at least zero.
    pub(super) fn at(&self, s: f64) -> [f64; N] {
        let parts = (s / self.longest).ceil().max(1.0);
        let step = s / parts;
        let one = self.series(step);
        let mut found = one;
        // Γ(s + h) = Γ(h) + e^{A h} Γ(s).
        for _ in 1..parts as u64 {
            let moved = self.moved(step, &found);
            found = std::array::from_fn(|i| one[i] + moved[i]);
        }
        found
    }

    /// Γ′, the response to an impulse, from Γ.
    pub(super) fn rate(&self, gamma: &[f64; N]) -> [f64; N] {
        let moved = times(&self.a, gamma);
        std::array::from_fn(|i| moved[i] + self.b[i])
    }

    fn series(&self, s: f64) -> [f64; N] {
        let mut sum = [0.0; N];
        for term in self.terms.iter().rev() {
            for (sum, term) in sum.iter_mut().zip(term) {
                *sum = *sum * s + term;
            }
        }
        sum.map(|sum| sum * s)
    }

    /// e^{A s} x for s within the reach of the series.
    fn moved(&self, s: f64, x: &[f64; N]) -> [f64; N] {
        let (mut sum, mut term) = (*x, *x);
        for k in 1..=TERMS {
            term = times(&self.a, &term).map(|entry| entry * s / k as f64);
            for (sum, term) in sum.iter_mut().zip(&term) {
                *sum += term;
            }
        }
        sum
    }
}

pub(super) fn times<const N: usize>(a: &Square<N>, x: &[f64; N]) -> [f64; N] {
    std::array::from_fn(|i| a[i].iter().zip(x).map(|(a, x)| a * x).sum())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_response_of_a_lag_and_an_integrator_is_that_in_closed_form() {
        for lag in [0.01, 0.17, 3.0] {
            let a = [[-1.0 / lag, 0.0], [1.0, 0.0]];
            let response = StepResponse::new(a, [1.0 / lag, 0.0]);
            for s in [0.0, 1e-3, 0.065, 0.4, 2.0] {
                let gamma = response.at(s);
                let fall = -(-s / lag).exp_m1();
                assert!((gamma[0] - fall).abs() < 1e-13, "{lag} {s}");
                assert!((gamma[1] - (s - lag * fall)).abs() < 1e-13, "{lag} {s}");
                let rate = response.rate(&gamma);
                assert!((rate[0] - (-s / lag).exp() / lag).abs() < 1e-11);
                assert!((rate[1] - fall).abs() < 1e-13);
            }
        }
    }
}
