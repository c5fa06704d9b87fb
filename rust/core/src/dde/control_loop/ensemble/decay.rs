//! Do all poles of the loops decay fast enough?
//!
//! With the transition x ↦ Φ x + G₁ w₁ + G₀ w₀ of a sample, whose commands are u of m + 1 and of m
//! samples ago, the poles of the loop without its limit are the zeros of
//!
//!   z^{m+1} a(z) − L a(z) − K adj(z − Φ) (G₁ + z G₀),   a(z) = det(z − Φ),
//!
//! with a and the adjugate by Faddeev and LeVerrier. All of them lie inside the circle |z| = ρ if the
//! recursion of Schur and Cohn (Jury 1964) for the polynomial in z/ρ has coefficients |k| < 1
//! alone. Each step divides errors by 1 − k²; where their product leaves too few digits, the answer
//! is left to the eigenvalues.

use crate::simd::{Mask, Real, Simd};

use super::loops::{Controllers, Runs};
use super::transition::{Matrix, product, row};

/// Largest degree: the work grows with its square, and few digits remain.
const MOST_DEGREE: usize = 64;

/// Least product of all 1 − k² that leaves enough digits.
const LEAST_PRODUCT: f64 = 1e-9;

/// The answers.
pub(super) struct Decay<S: Simd> {
    /// All poles are inside of the circle.
    pub(super) yes: Mask<S>,
    /// Some pole is not.
    pub(super) no: Mask<S>,
}

impl<S: Simd, const N: usize> Controllers<S, N> {
    /// Are all poles within `radius` of zero?
    #[inline(always)]
    pub(super) fn decay(&self, runs: &Runs<S>, radius: Real<S>) -> Decay<S> {
        let (zero, no_lane) = (runs.zero, runs.no_lane);
        let degree = N + runs.samples + 1;
        if degree > MOST_DEGREE {
            return Decay {
                yes: no_lane,
                no: no_lane,
            };
        }
        let mut terms = [zero; MOST_DEGREE + 1];
        self.characteristic(zero, &mut terms, runs.samples + 1);
        let mut power = radius;
        for term in terms.iter_mut().take(degree + 1).skip(1) {
            *term = *term * power;
            power = power * radius;
        }
        let one = zero.constant(1.0);
        let (mut product, mut no) = (one, no_lane);
        for n in (1..=degree).rev() {
            let k = terms[0] / terms[n];
            let rest = k.negated_mul_add(k, one);
            let is_known = product.ge(LEAST_PRODUCT);
            no = no | (is_known & rest.le(0.0));
            product = product * rest.larger(zero);
            let old = terms;
            for i in 0..n {
                terms[i] = k.negated_mul_add(old[n - 1 - i], old[i + 1]);
            }
        }
        Decay {
            yes: product.ge(LEAST_PRODUCT) & !no,
            no,
        }
    }

    /// The coefficients of the characteristic polynomial, ascending.
    #[inline(always)]
    fn characteristic(&self, zero: Real<S>, terms: &mut [Real<S>], shift: usize) {
        let Self { k, l, step: map } = self;
        let mut phi: Matrix<S, N> = map.growth;
        for (i, row) in phi.iter_mut().enumerate() {
            row[i] = row[i] + 1.0;
        }
        // M of each step is the coefficient of z^{N−j} in the adjugate.
        let mut adjugate = [[zero; N]; N];
        let mut coefficient = zero.constant(1.0);
        for j in 1..=N {
            for (i, row) in adjugate.iter_mut().enumerate() {
                row[i] = row[i] + coefficient;
            }
            add(terms, N + 1 - j, coefficient, shift, *l);
            let (mut before, mut after) = (zero, zero);
            for i in 0..N {
                before = k[i].mul_add(row(&adjugate[i], &map.before, zero), before);
                after = k[i].mul_add(row(&adjugate[i], &map.after, zero), after);
            }
            terms[N - j] = terms[N - j] - before;
            terms[N - j + 1] = terms[N - j + 1] - after;
            adjugate = product(&phi, &adjugate);
            let mut trace = zero;
            for (i, row) in adjugate.iter().enumerate() {
                trace = trace + row[i];
            }
            coefficient = trace * (-1.0 / j as f64);
        }
        add(terms, 0, coefficient, shift, *l);
    }
}

/// Add a term of a(z) (z^`shift` − L).
#[inline(always)]
fn add<S: Simd>(
    terms: &mut [Real<S>],
    power: usize,
    coefficient: Real<S>,
    shift: usize,
    l: Real<S>,
) {
    terms[power + shift] = terms[power + shift] + coefficient;
    terms[power] = l.negated_mul_add(coefficient, terms[power]);
}
