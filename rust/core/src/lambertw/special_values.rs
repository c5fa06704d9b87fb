//! Zero, infinities and NaN.
//!
//! The limits along the direction of z, with the argument of a signed zero as in C99: the
//! imaginary part of w = log z + 2 pi i k - log w tends to arg z + 2 pi k where z grows, and to
//! that less pi (of the sign of k, or of Im w) where z shrinks and k is not zero.

use std::f64::consts::{PI, TAU};

use num_complex::Complex64;

/// W_k at zero or where a part is not finite.
pub(super) fn lambertw(z: Complex64, k: i64) -> Complex64 {
    if z.re.is_nan() || z.im.is_nan() {
        return Complex64::new(f64::NAN, f64::NAN);
    }
    let argument = libm::atan2(z.im, z.re);
    if z.re == 0.0 && z.im == 0.0 {
        return match k {
            0 => z,
            // The two branches that are real on (-1/e, 0): the sum cancels exactly, to a zero with
            // the sign of k.
            _ => {
                let side = if k > 0 { PI } else { -PI };
                let im = k as f64 * TAU + (argument - side);
                let im = if im == 0.0 { im.copysign(side) } else { im };
                Complex64::new(f64::NEG_INFINITY, im)
            }
        };
    }
    // Nothing is added for k = 0, so that a zero keeps its sign.
    let im = if k == 0 {
        argument
    } else {
        argument + k as f64 * TAU
    };
    Complex64::new(f64::INFINITY, im)
}
