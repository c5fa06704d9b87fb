//! The response of x′ = A x + Σ g_i v_i with constant v_i over a step h.
//!
//!   x(h) = Φ x(0) + Σ Γ_i v_i,   Φ = e^{A h},   Γ_i = ∫₀ʰ e^{A s} ds g_i.
//!
//! Φ − I and Γ are summed by Taylor for h / 2^q with ‖A‖₁ h / 2^q ≤ 1/2 and doubled q times: F(2h)
//! = 2 F + F² for F = Φ − I, Γ(2h) = 2 Γ + F Γ. Working with Φ − I keeps slow modes beside fast
//! ones, and keeping Γ apart from Φ keeps a large input gain from forcing more doublings than A
//! needs. Sastre et al. and Higham (Functions of Matrices, 2008, section 10.3) treat scaling and
//! squaring in general; this is its plain form for a few states. The norm is that of A balanced:
//! with states scaled by powers of two every operation here gives the same bits, so that badly
//! chosen units of the states do not cost doublings. Guaranteed: the truncated series is below
//! rounding. Not guaranteed: full relative accuracy of entries far below ‖Φ‖ for strongly
//! non-normal A.

use super::scalar::Scalar;
use crate::linear_algebra::balance;

/// Largest ‖A‖₁ h for which the series is summed without doubling.
const REACH: f64 = 0.5;

/// Number of terms: 0.5^17/17! is below 1e-19.
const TERMS: u32 = 17;

/// Φ and the Γ_i of one step length.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Propagator<S = f64> {
    n: usize,
    /// Φ − I, row-major.
    growth: Vec<S>,
    /// Γ_i, one after the other.
    gamma: Vec<S>,
}

impl<S: Scalar> Propagator<S> {
    /// For A (n × n row-major), input columns g_i (n each) and step length `h` ≥ 0.
    pub(crate) fn new(a: &[S], inputs: &[&[S]], h: S) -> Self {
        let n = inputs.first().map_or_else(|| side(a), |g| g.len());
        let doublings = doublings(balanced_norm(a, n) * h.value());
        let step = h * S::from(0.5_f64.powi(doublings));
        let mut growth = vec![S::default(); n * n];
        let mut gamma = vec![S::default(); n * inputs.len()];
        // Columns are independent: F by A^j step^j / j! applied to A step, Γ_i by the same
        // series of (e^z − 1)/z applied to g_i step.
        let mut term = vec![S::default(); n];
        let mut next = vec![S::default(); n];
        for column in 0..n {
            for row in 0..n {
                term[row] = a[row * n + column] * step;
            }
            let mut sum = term.clone();
            accumulate(a, step, &mut term, &mut next, &mut sum);
            for row in 0..n {
                growth[row * n + column] = sum[row];
            }
        }
        for (g, sum) in inputs.iter().zip(gamma.chunks_exact_mut(n.max(1))) {
            for row in 0..n {
                term[row] = g[row] * step;
            }
            sum.copy_from_slice(&term);
            accumulate(a, step, &mut term, &mut next, sum);
        }
        let mut propagator = Self { n, growth, gamma };
        for _ in 0..doublings {
            propagator.double();
        }
        propagator
    }

    /// Φ, row-major.
    pub(crate) fn phi(&self) -> Vec<S> {
        let mut phi = self.growth.clone();
        for i in 0..self.n {
            phi[i * self.n + i] += S::from(1.0);
        }
        phi
    }

    /// Φ − I, row-major.
    pub(crate) fn growth(&self) -> &[S] {
        &self.growth
    }

    /// Γ of input `i`.
    pub(crate) fn gamma(&self, i: usize) -> &[S] {
        &self.gamma[i * self.n..(i + 1) * self.n]
    }

    /// `out` = Φ x + Σ Γ_i v_i.
    #[inline]
    pub(crate) fn apply(&self, x: &[S], inputs: &[S], out: &mut [S]) {
        for (row, out) in out.iter_mut().enumerate() {
            let mut change = S::default();
            for (&f, &x) in self.growth[row * self.n..(row + 1) * self.n].iter().zip(x) {
                change += f * x;
            }
            for (i, &v) in inputs.iter().enumerate() {
                change += self.gamma[i * self.n + row] * v;
            }
            *out = x[row] + change;
        }
    }

    fn double(&mut self) {
        let n = self.n;
        for gamma in self.gamma.chunks_exact_mut(n.max(1)) {
            let old = gamma.to_vec();
            multiply_add(&self.growth, &old, gamma);
            for (new, &old) in gamma.iter_mut().zip(&old) {
                *new += old;
            }
        }
        let old = self.growth.clone();
        for column in 0..n {
            for row in 0..n {
                let mut sum = S::default();
                for inner in 0..n {
                    sum += old[row * n + inner] * old[inner * n + column];
                }
                self.growth[row * n + column] = sum + S::from(2.0) * old[row * n + column];
            }
        }
    }
}

/// Number of halvings that bring `size` below [`REACH`].
fn doublings(size: f64) -> i32 {
    let mut count = 0;
    let mut size = size;
    while size > REACH && count < 1100 {
        size *= 0.5;
        count += 1;
    }
    count
}

/// `sum` += Σ_{j ≥ 1} (A step)^j term / (j + 1)!, the first term being in `sum` already.
fn accumulate<S: Scalar>(a: &[S], step: S, term: &mut [S], next: &mut [S], sum: &mut [S]) {
    for j in 2..=TERMS {
        next.fill(S::default());
        multiply_add(a, term, next);
        let factor = step / S::from(f64::from(j));
        let mut alive = false;
        for ((term, next), sum) in term.iter_mut().zip(next.iter()).zip(sum.iter_mut()) {
            *term = *next * factor;
            *sum += *term;
            alive |= !term.is_nothing();
        }
        if !alive {
            break;
        }
    }
}

/// `out` += A x.
pub(crate) fn multiply_add<S: Scalar>(a: &[S], x: &[S], out: &mut [S]) {
    for (row, out) in a.chunks_exact(x.len().max(1)).zip(out) {
        for (&a, &x) in row.iter().zip(x) {
            *out += a * x;
        }
    }
}

/// ‖D⁻¹ A D‖₁ of the values of A, balanced.
pub(crate) fn balanced_norm<S: Scalar>(a: &[S], n: usize) -> f64 {
    let values: Vec<f64> = a.iter().map(|a| a.value()).collect();
    balance::balanced_norm(&values, n)
}

fn side<S>(a: &[S]) -> usize {
    (0..).find(|n| n * n >= a.len()).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn close(found: &[f64], truth: &[f64], relative: f64) {
        let scale = truth.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        for (found, truth) in found.iter().zip(truth) {
            assert!(
                (found - truth).abs() <= relative * scale,
                "{found} is not {truth}"
            );
        }
    }

    #[test]
    fn a_rotation_turns() {
        let h = 2.0;
        let found = Propagator::new(&[0.0, 1.0, -1.0, 0.0], &[&[0.0, 1.0]], h);
        close(
            &found.phi(),
            &[h.cos(), h.sin(), -h.sin(), h.cos()],
            4.0 * f64::EPSILON,
        );
        close(
            found.gamma(0),
            &[1.0 - h.cos(), h.sin()],
            4.0 * f64::EPSILON,
        );
    }

    #[test]
    fn an_integrator_is_exact() {
        let found = Propagator::new(&[0.0], &[&[1.0]], 0.065);
        assert_eq!(found.phi(), [1.0]);
        assert_eq!(found.gamma(0), [0.065]);
    }

    #[test]
    fn a_non_normal_matrix_with_a_large_input_agrees_with_forty_digits() {
        let a = [-3.0, 2000.0, 0.5, 0.0, -0.25, -7.0, 1.0, 0.0, -40.0];
        let found = Propagator::new(&a, &[&[1e6, 2.0, -3.0]], 0.375);
        let phi = [
            1.726_542_984_080_49,
            43.851_079_621_243_18,
            5.257_939_972_085_656,
            0.002_619_769_464_083_126,
            1.787_025_344_949_991,
            -0.250_410_248_845_426_8,
            0.036_802_087_838_807_91,
            -0.748_505_561_166_607_5,
            0.364_865_734_044_597_43,
        ];
        // Eight doublings each have an error of about one unit in the last place of the largest
        // entry.
        close(&found.phi(), &phi, 1e-14);
        close(
            found.gamma(0),
            &[
                21_254.403_061_251_527,
                395.286_236_384_093_2,
                -388.702_329_230_797_95,
            ],
            1e-14,
        );
    }

    #[test]
    fn units_of_the_states_do_not_matter() {
        // Poles −1000, −1300 and −1 in observable canonical form: entries up to 1.3e6, rates up
        // to 1.3e3.
        let a = [-2301.0, 1.0, 0.0, -1_302_300.0, 0.0, 1.0, -1.3e6, 0.0, 0.0];
        // x₁ after a unit impulse on the last state, by partial fractions.
        let h: f64 = 0.0325;
        let found = Propagator::new(&a, &[&[0.0, 0.0, 1.0]], h).phi()[2];
        let truth = (-h).exp() / (999.0 * 1299.0) - (-1000.0 * h).exp() / (999.0 * 300.0)
            + (-1300.0 * h).exp() / (1299.0 * 300.0);
        assert!(
            (found / truth - 1.0).abs() < 2e-14,
            "{found:e} is not {truth:e}"
        );
    }

    #[test]
    fn no_states_and_no_time_are_fine() {
        let empty = Propagator::new(&[], &[&[]], 1.0);
        assert!(empty.phi().is_empty() && empty.gamma(0).is_empty());
        let still = Propagator::new(&[5.0], &[&[3.0]], 0.0);
        assert_eq!((still.phi(), still.gamma(0)), (vec![1.0], &[0.0][..]));
    }

    proptest! {
        /// Two steps are one step of the sum, and A Γ = (Φ − I) g.
        #[test]
        fn steps_compose(
            a in prop::collection::vec(-4.0..4.0, 9),
            g in prop::collection::vec(-2.0..2.0, 3),
            x in prop::collection::vec(-1.0..1.0, 3),
            (first, second) in (0.0..1.5, 0.0..1.5),
        ) {
            let step = |h: f64, x: &[f64]| {
                let mut out = vec![0.0; 3];
                Propagator::new(&a, &[&g], h).apply(x, &[0.7], &mut out);
                out
            };
            let whole = step(first + second, &x);
            let parts = step(second, &step(first, &x));
            let size = (balance::norm(&a, 3) * (first + second)).exp();
            for (whole, part) in whole.iter().zip(&parts) {
                prop_assert!((whole - part).abs() <= 1e-14 * size);
            }
            let one = Propagator::new(&a, &[&g], first);
            let mut left = vec![0.0; 3];
            multiply_add(&a, one.gamma(0), &mut left);
            let mut right = vec![0.0; 3];
            multiply_add(&one.growth, &g, &mut right);
            for (left, right) in left.iter().zip(&right) {
                prop_assert!((left - right).abs() <= 1e-14 * size);
            }
        }
    }
}
