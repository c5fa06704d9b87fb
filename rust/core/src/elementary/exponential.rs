//! e^x within 1.25 u (u = 2⁻⁵³), by a table of 32 powers (Tang 1989).
//!
//! L = ln 2/32 = L₁ + L₂, L₁ of 37 bits, |L₂| < 2⁻⁴⁴. With k the integer next to x/L,
//! e^x = 2^(k/32) e^r, r = x − kL, |r| ≤ 0.010831 < 2⁻⁶·⁵.
//! *Reduction.* |k| < 2¹⁶, so k L₁ is exact; x is a multiple of 2⁻⁵⁹ unless k = 0, k L₁ of 2⁻⁴²,
//! their difference below 2⁻⁶: exact too. Rounding k L₂ costs 2⁻⁸², L₂ itself 2⁻⁸², the last
//! difference 2⁻⁶⁰: r is within 1.01 · 2⁻⁶⁰ = 0.008 u, a relative error of e^r.
//! *Series.* p = r + r² (1/2 + r (1/6 + … + r/720)) is cut by less than |r|⁷/5040 · 1.01 < 2⁻⁵⁷·⁹ =
//! 0.034 u. Its second part, below 2⁻¹³, carries less than 6 u of itself: 0.001 u; the sum, below
//! 2⁻⁶, loses 2⁻⁶⁰: 0.008 u.
//! *Result.* T = 2^(j/32) in [1, 2) is kept as T₁ + T₂ within 2⁻¹⁰⁶, and T₁ + (T₂ + T₁ p) loses,
//! relative to T, 0.011 u in the product, 0.011 u in the inner sum, and in the last sum u.
//! Together less than 1.1 u, of T: 1.12 u of e^r T. The power of two is exact down to 2⁻¹⁰²²,
//! below it costs one rounding, 2⁻¹⁰⁷⁵.

use super::nearest::nearest;
use super::tables::POWERS;

pub(super) const STEPS_PER_UNIT: f64 = 46.166_241_308_446_83;
/// ln 2/32 in pieces.
pub(super) const STEP: [f64; 2] = [0.021_660_849_392_446_835, 5.145_609_244_655_338e-14];

/// e^x within 1.25 · 2⁻⁵³ of itself, or 2⁻¹⁰⁷⁵ where that is more.
///
/// ```
/// use deadtime::elementary::exp;
/// assert_eq!(exp(0.0), 1.0);
/// assert_eq!((exp(f64::NEG_INFINITY), exp(f64::INFINITY)), (0.0, f64::INFINITY));
/// assert!(exp(f64::NAN).is_nan());
/// ```
#[inline]
pub fn exp(x: f64) -> f64 {
    if x > 710.0 {
        return f64::INFINITY;
    }
    if x < -745.2 {
        // The result is less than 2⁻¹⁰⁷⁵.
        return 0.0;
    }
    let k = nearest(x * STEPS_PER_UNIT);
    let r = (x - k * STEP[0]) - k * STEP[1];
    let square = r * r;
    let tail = (0.5 + r * (1.0 / 6.0))
        + square * ((1.0 / 24.0 + r * (1.0 / 120.0)) + square * (1.0 / 720.0));
    let p = r + square * tail;
    let k = k as i64;
    let (high, low) = POWERS[(k & 31) as usize];
    let factor = high + (low + high * p);
    let m = k >> 5;
    if (-1021..=1022).contains(&m) {
        factor * power_of_two(m)
    } else {
        factor * power_of_two(m / 2) * power_of_two(m - m / 2)
    }
}

/// An upper bound of e^x, larger by less than 1e-15 of it.
#[inline]
pub fn exp_above(x: f64) -> f64 {
    // 1.25 u + u for this product < 4 u; the last 2^-1074 covers underflow.
    exp(x) * (1.0 + 2.0 * f64::EPSILON) + f64::from_bits(1)
}

/// 2^m for |m| ≤ 1022.
#[inline(always)]
fn power_of_two(m: i64) -> f64 {
    f64::from_bits(((m + 1023) as u64) << 52)
}
