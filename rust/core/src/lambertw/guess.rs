//! Starting values, good to 8e-4 in log(z/w) - w and better where 1 + w is small.
//!
//! Around the branch point a rational function of sqrt(2 (e z + 1)); elsewhere w = log z + 2 pi i k
//! and one or two steps of Fritsch, Shafer & Crowley (1973) on w + log w = log z + 2 pi i k. The
//! half plane Im w >= 0 belongs to k >= 0 (for k = 0 with Im z >= 0): a step that leaves it by
//! rounding errors is reflected back, so that no step can lead to another branch.

use crate::simd::{Complex, Simd};

use super::coefficients::{
    BEHIND_DENOMINATOR, BEHIND_NUMERATOR, PRINCIPAL_DENOMINATOR, PRINCIPAL_NUMERATOR,
};
use super::elementary::{rough_angle, rough_log};
use super::refine::fritsch_step;

/// Largest component of z up to which [`principal`] is used.
pub(super) const PRINCIPAL_RADIUS: f64 = 1_024.0;
/// Distance from -1/e up to which [`behind`] is used.
pub(super) const BEHIND_RADIUS: f64 = 0.25;

/// A polynomial with real coefficients at a complex argument, by Goertzel's recurrence
/// (Knuth, The Art of Computer Programming 2, section 4.6.4, eq. 3).
#[inline(always)]
fn real_polynomial<S: Simd, const N: usize>(coefficients: &[f64; N], y: Complex<S>) -> Complex<S> {
    let (trace, square) = (y.re + y.re, y.square_modulus());
    let mut last = y.re.constant(0.0);
    let mut before = last;
    let mut constant = 0.0;
    for (power, &coefficient) in coefficients.iter().enumerate().rev() {
        if power == 0 {
            constant = coefficient;
        } else {
            let next = trace.mul_add(last, square.negated_mul_add(before, coefficient));
            (last, before) = (next, last);
        }
    }
    Complex::new(
        y.re.mul_add(last, square.negated_mul_add(before, constant)),
        y.im * last,
    )
}

/// W_0(z) within [`PRINCIPAL_RADIUS`], from `root` = sqrt(2 (1 + e z)).
#[inline(always)]
pub(super) fn principal<S: Simd>(z: Complex<S>, root: Complex<S>) -> Complex<S> {
    let quotient = real_polynomial(&PRINCIPAL_NUMERATOR, root)
        .over(real_polynomial(&PRINCIPAL_DENOMINATOR, root));
    z * quotient
}

/// W_1 at or below the negative real axis within [`BEHIND_RADIUS`] of -1/e, from `root` =
/// sqrt(2 (1 + e z)).
#[inline(always)]
pub(super) fn behind<S: Simd>(root: Complex<S>) -> Complex<S> {
    let y = -root;
    real_polynomial(&BEHIND_NUMERATOR, y).over(real_polynomial(&BEHIND_DENOMINATOR, y))
}

/// `log w`, to a few 1e-6.
#[inline(always)]
pub(super) fn logarithm<S: Simd>(w: Complex<S>) -> Complex<S> {
    Complex::new(rough_log(w.square_modulus()) * 0.5, rough_angle(w))
}

/// `w` after one step on `w + log w = log`, folded into the upper half plane.
#[inline(always)]
pub(super) fn logarithmic_step<S: Simd>(w: Complex<S>, log: Complex<S>) -> Complex<S> {
    fritsch_step(w, log - w - logarithm(w)).folded()
}
