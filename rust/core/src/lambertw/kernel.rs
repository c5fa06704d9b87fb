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

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use proptest::prelude::*;

    use super::*;

    /// Numbers where something happens: any exponent, next to -1/e, on the axes.
    fn troublesome() -> impl Strategy<Value = Complex64> {
        let anywhere = (-1070.0..1020.0_f64, -4.0..4.0_f64)
            .prop_map(|(power, angle)| Complex64::from_polar(power.exp2(), angle));
        let near_branch_point = (-54.0..1.0_f64, -4.0..4.0_f64)
            .prop_map(|(power, angle)| Complex64::from_polar(power.exp2(), angle) - INVERSE_E);
        let on_axes = (-60.0..60.0_f64, 0..4_u8, any::<bool>()).prop_map(|(power, axis, side)| {
            let (length, zero) = (power.exp2(), if side { 0.0 } else { -0.0 });
            match axis {
                0 => Complex64::new(length, zero),
                1 => Complex64::new(-length, zero),
                2 => Complex64::new(zero, length),
                _ => Complex64::new(zero, -length),
            }
        });
        prop_oneof![anywhere, near_branch_point, on_axes]
    }

    fn branch() -> impl Strategy<Value = i64> {
        prop_oneof![
            -2..3_i64,
            -1000..1000_i64,
            -(1_i64 << 21)..(1_i64 << 21),
            any::<i64>()
        ]
    }

    fn bits(w: Complex64) -> (u64, u64) {
        (w.re.to_bits(), w.im.to_bits())
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4096))]

        #[test]
        fn conjugates_belong_together(z in troublesome(), k in branch()) {
            prop_assume!(k != i64::MIN);
            prop_assert_eq!(bits(lambertw(z.conj(), -k)), bits(lambertw(z, k).conj()));
        }

        #[test]
        fn the_branch_is_the_one_asked_for(z in troublesome(), k in branch()) {
            let w = lambertw(z, k);
            prop_assume!(w != Complex64::ZERO);
            let angle = |z: Complex64| libm::atan2(z.im, z.re);
            let turns = (w.im + angle(w) - angle(z)) / TAU;
            // Rounding of w, and of the angle where 1 + w nearly vanishes.
            prop_assert!((turns - k as f64).abs() <= 1e-7 + 1e-15 * turns.abs(), "{w} {turns}");
        }

        #[test]
        fn it_solves_its_equation(z in troublesome(), k in -1000..1000_i64) {
            let w = lambertw(z, k);
            prop_assume!(w.norm() > 1e-300);
            let lost = residual(Scaled::new(z), w).norm() / w.norm();
            // Half an ulp of w moves w e^w by |1 + w| times as much; the residual itself is
            // good to 2^-64.
            let allowed = 0.51 * f64::EPSILON * (1.0 + w).norm() + 1.0 / (1_u64 << 62) as f64;
            prop_assert!(lost <= allowed, "{w} {lost:e}");
        }
    }

    #[test]
    fn rational_and_series_meet_without_a_step() {
        for distance in [SERIES_ANSWERS, SERIES_STARTS, BEHIND_RADIUS] {
            for k in [-1, 0, 1] {
                for side in [0.0, -0.0] {
                    let at = |d: f64| lambertw(Complex64::new(d - INVERSE_E, side), k);
                    let (below, above) =
                        (at(distance * (1.0 - 1e-13)), at(distance * (1.0 + 1e-13)));
                    assert!((below - above).norm() < 1e-12);
                }
            }
        }
    }
}
