//! Starting values, good to 5e-4 in log(z/w) - w and better where 1 + w is small.
//!
//! Around the branch point a rational function of sqrt(2 (e z + 1)); elsewhere w = log z +
//! 2 pi i k and one or two steps of Fritsch, Shafer & Crowley (1973) on w + log w = log z +
//! 2 pi i k. The half plane Im w >= 0 belongs to k >= 0 (for k = 0 with Im z >= 0): a step that
//! leaves it by rounding is folded back, so no step can land on another branch.

use num_complex::Complex64;

use super::branch_point::square_root;
use super::coefficients::{
    BEHIND_DENOMINATOR, BEHIND_NUMERATOR, PRINCIPAL_DENOMINATOR, PRINCIPAL_NUMERATOR,
};
use super::refine::fritsch_step;

/// Largest component of z up to which [`principal`] is used.
pub(super) const PRINCIPAL_RADIUS: f64 = 16.0;
/// Distance from -1/e up to which [`behind`] is used.
pub(super) const BEHIND_RADIUS: f64 = 0.25;

/// A polynomial with real coefficients at a complex argument, by Goertzel's recurrence
/// (Knuth, The Art of Computer Programming 2, section 4.6.4, eq. 3).
#[inline(always)]
fn real_polynomial(coefficients: &[f64], y: Complex64) -> Complex64 {
    let (trace, square) = (2.0 * y.re, y.re * y.re + y.im * y.im);
    let (last, before) = coefficients
        .iter()
        .skip(1)
        .rev()
        .fold((0.0, 0.0), |(b1, b2), &c| {
            (c + trace * b1 - square * b2, b1)
        });
    let constant = coefficients.first().copied().unwrap_or(0.0);
    Complex64::new(constant + y.re * last - square * before, y.im * last)
}

/// Quotient of numbers whose squares stay in range.
#[inline(always)]
pub(super) fn quotient(a: Complex64, b: Complex64) -> Complex64 {
    let inverse = 1.0 / (b.re * b.re + b.im * b.im);
    Complex64::new(
        (a.re * b.re + a.im * b.im) * inverse,
        (a.im * b.re - a.re * b.im) * inverse,
    )
}

/// W_0(z) within [`PRINCIPAL_RADIUS`], from `offset` = z + 1/e.
#[inline(always)]
pub(super) fn principal(z: Complex64, offset: Complex64) -> Complex64 {
    let y = square_root(offset * (2.0 * std::f64::consts::E));
    z * quotient(
        real_polynomial(&PRINCIPAL_NUMERATOR, y),
        real_polynomial(&PRINCIPAL_DENOMINATOR, y),
    )
}

/// W_1 at or below the negative real axis, `offset` = z + 1/e within [`BEHIND_RADIUS`] of zero.
#[inline(always)]
pub(super) fn behind(offset: Complex64) -> Complex64 {
    let y = -square_root(offset * (2.0 * std::f64::consts::E));
    quotient(
        real_polynomial(&BEHIND_NUMERATOR, y),
        real_polynomial(&BEHIND_DENOMINATOR, y),
    )
}

/// Logarithm of a number whose square stays in range.
#[inline(always)]
pub(super) fn logarithm(w: Complex64) -> Complex64 {
    Complex64::new(
        0.5 * libm::log(w.re * w.re + w.im * w.im),
        libm::atan2(w.im, w.re),
    )
}

/// W_k from `log` = log z + 2 pi i k, its imaginary part not negative.
#[inline(always)]
pub(super) fn from_logarithm(log: Complex64, steps: u32) -> Complex64 {
    (0..steps).fold(log, |w, _| {
        let next = fritsch_step(w, log - w - logarithm(w));
        Complex64::new(next.re, next.im.abs())
    })
}
