//! Value and slope with bounds on their errors.

use num_complex::Complex64;

/// 2⁻¹⁰¹⁰: u times this is far above the errors of an underflow.
pub(super) const TINY: f64 = f64::MIN_POSITIVE * 4096.0;

/// Larger than every effect of underflow on a sum of terms.
pub(super) const FLOOR: f64 = 1e-290;

/// |s| within 4u where it is a normal number: two squares and their sum have the relative error 2
/// u, of which the correctly rounded root keeps half. Where the squares leave the range, the
/// quotient by the larger part is used.
pub(crate) fn modulus(s: Complex64) -> f64 {
    let square = s.norm_sqr();
    if square > 1e-280 && square < 1e300 {
        return square.sqrt();
    }
    let large = s.re.abs().max(s.im.abs());
    if square.is_nan() {
        f64::NAN
    } else if large == 0.0 || large.is_infinite() {
        large
    } else {
        (s / large).norm_sqr().sqrt() * large
    }
}

/// Value and slope of g at a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Jet {
    /// g(s).
    pub value: Complex64,
    /// g′(s).
    pub slope: Complex64,
    /// Bound on the error of `value`.
    pub value_error: f64,
    /// Bound on the error of `slope`.
    pub slope_error: f64,
    /// Index of the largest term, if it exceeds the reference term fourfold.
    pub overtaken_by: Option<usize>,
}
