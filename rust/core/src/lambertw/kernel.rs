//! One element: which starting value, which last step.

use num_complex::Complex64;

use super::branch_point::{INVERSE_E, offset, one_plus_w, square_root};
use super::guess::{BEHIND_RADIUS, PRINCIPAL_RADIUS, behind, from_logarithm, principal};
use super::huge_branch::{self, HUGE_BRANCH};
use super::refine::{Scaled, correction, residual};
use super::special_values;

/// Distance from -1/e below which the series is the answer.
const SERIES_ANSWERS: f64 = 1.0 / 16_384.0;
/// Distance from -1/e below which the series is the starting value.
const SERIES_STARTS: f64 = 0.046;
/// Angle between z and the real axis up to which dw/dz there is taken for the starting value.
const NARROW: f64 = 1e-9;
/// Modulus below which W_0(z) = z - z^2 to working precision.
const SMALL: f64 = 1e-9;

pub(super) fn lambertw(z: Complex64, k: i64) -> Complex64 {
    if !(z.re.is_finite() && z.im.is_finite()) || (z.re == 0.0 && z.im == 0.0) {
        return special_values::lambertw(z, k);
    }
    // W_k(conj z) = conj W_-k(z) brings every case to k >= 0 and, for k = 0, to Im z >= 0;
    // there Im w >= 0.
    let mirrored = if k == 0 {
        z.im.is_sign_negative()
    } else {
        k < 0
    };
    let z = if mirrored { z.conj() } else { z };
    let w = upper(z, k.unsigned_abs());
    Complex64::new(w.re, if mirrored { -w.im.abs() } else { w.im.abs() })
}

#[inline(always)]
fn upper(z: Complex64, k: u64) -> Complex64 {
    if k >= HUGE_BRANCH {
        return huge_branch::lambertw(Scaled::new(z), k);
    }
    let largest = z.re.abs().max(z.im.abs());
    if k == 0 && largest < SMALL {
        return Complex64::new(
            z.re - (z.re - z.im) * (z.re + z.im),
            z.im - 2.0 * z.re * z.im,
        );
    }
    // Only these two sheets are joined at -1/e.
    let joined = k == 0 || (k == 1 && z.im.is_sign_negative());
    let offset = offset(z);
    let distance = offset.norm_sqr();
    let start = if joined && distance < SERIES_STARTS * SERIES_STARTS {
        let p = square_root(offset * (2.0 * std::f64::consts::E));
        let w = one_plus_w(if k == 0 { p } else { -p }) - 1.0;
        if distance < SERIES_ANSWERS * SERIES_ANSWERS {
            return w;
        }
        w
    } else if k == 0 && largest < PRINCIPAL_RADIUS {
        principal(z, offset)
    } else if k == 1 && joined && distance < BEHIND_RADIUS * BEHIND_RADIUS {
        behind(offset)
    } else {
        let log = Complex64::new(
            Scaled::new(z).log_modulus(),
            libm::atan2(z.im, z.re) + std::f64::consts::TAU * k as f64,
        );
        let w = from_logarithm(log, if k == 1 { 2 } else { 1 });
        // Along the segment on which W_1 is real from below, log z + 2 pi i - log w leaves an
        // imaginary part of rounding errors; the true one is Im z dw/dz, zero where Im z is.
        if joined && z.re < 0.0 && z.re > -INVERSE_E && z.im.abs() <= NARROW * z.re.abs() {
            Complex64::new(w.re, (z.im / z.re) * (w.re / (w.re + 1.0)))
        } else {
            w
        }
    };
    let w = Complex64::new(start.re, start.im.abs());
    w + correction(w, residual(Scaled::new(z), w))
}
