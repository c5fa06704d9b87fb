//! Properties of W and of the roots computed from it, at difficult arguments.

use std::f64::consts::TAU;

use num_complex::Complex64;
use proptest::prelude::*;

use super::branch_point::INVERSE_E;
use super::guess::{BEHIND_RADIUS, PRINCIPAL_RADIUS};
use super::kernel::{SERIES_ANSWERS, SERIES_STARTS};
use super::{block, dde_root, lambertw, lambertw_log};

/// Difficult numbers: any exponent, next to -1/e, on the axes.
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
        // The rounding error of w, and of the angle where 1 + w nearly vanishes.
        prop_assert!((turns - k as f64).abs() <= 1e-7 + 1e-15 * turns.abs(), "{w} {turns}");
    }

    #[test]
    fn the_log_form_is_the_same_function(z in troublesome(), k in -1000..1000_i64) {
        if !(1e-300..1e300).contains(&z.norm()) || z.im.abs() < 1e-3 * z.re.abs() {
            // Rounding errors of the logarithm may move it to the other side of the cut.
            return Ok(());
        }
        let (w, other) = (lambertw(z, k), lambertw_log(z.ln(), k));
        // The logarithm is rounded, and may be large.
        let moved = 1e-15 * (z.ln().norm() + 1.0) * (w / (w + 1.0)).norm();
        prop_assert!((w - other).norm() <= moved + 1e-15 * w.norm(), "{w} {other}");
    }
}

#[test]
fn rational_and_series_meet_without_a_step() {
    for distance in [
        SERIES_ANSWERS,
        SERIES_STARTS,
        BEHIND_RADIUS,
        PRINCIPAL_RADIUS,
    ] {
        for k in [-1, 0, 1] {
            for side in [0.0, -0.0] {
                let at = |d: f64| lambertw(Complex64::new(d - INVERSE_E, side), k);
                let (below, above) = (at(distance * (1.0 - 1e-13)), at(distance * (1.0 + 1e-13)));
                assert!((below - above).norm() < 1e-12);
            }
        }
    }
}

fn relative_residual(a0: f64, a1: f64, delay: f64, s: Complex64) -> f64 {
    let feedback = a1 * (-s * delay).exp();
    // The rounding of e^(-s T) is proportional to |s T|.
    let scale = s.norm() + a0.abs() + feedback.norm() * (1.0 + (s * delay).norm());
    (s - a0 - feedback).norm() / scale
}

proptest! {
    #[test]
    fn every_root_solves_the_characteristic_equation(
        a0 in -50.0..50.0_f64, a1 in -50.0..50.0_f64, delay in 0.001..5.0_f64, k in -40_i64..40,
    ) {
        let s = dde_root(a0, a1, delay, k);
        prop_assert!(relative_residual(a0, a1, delay, s) < 1e-14, "{s}");
    }

    #[test]
    fn the_root_of_branch_zero_is_rightmost(
        a0 in -5.0..5.0_f64, a1 in -5.0..5.0_f64, delay in 0.01..5.0_f64,
    ) {
        let rightmost = dde_root(a0, a1, delay, 0).re;
        for k in -4..4 {
            prop_assert!(dde_root(a0, a1, delay, k).re <= rightmost + 1e-12 * rightmost.abs());
        }
    }

    #[test]
    fn the_sum_of_the_coefficients_is_kept(a in 0.001..0.9_f64, gap in 1e-18..1e-9_f64) {
        // Next to a0 + a1 = 0 the root is (a0 + a1)/(1 + a1 T) to first order.
        let s = dde_root(-a, a + gap, 1.0, 0);
        let sum = -a + (a + gap);
        prop_assert!((s.re - sum / (1.0 + a)).abs() <= 1e-8 * sum.abs());
    }
}

#[test]
fn a_double_root_is_met_exactly() {
    assert_eq!(dde_root(1.0, -1.0, 1.0, 0), Complex64::new(0.0, 0.0));
    assert_eq!(dde_root(1.0, -1.0, 1.0, -1).re, 0.0);
}

#[test]
fn without_a_delayed_term_one_root_is_left() {
    assert_eq!(dde_root(-2.0, 0.0, 1.0, 0).re, -2.0);
    assert_eq!(dde_root(-2.0, 0.0, 1.0, 3).re, f64::NEG_INFINITY);
    assert!(dde_root(f64::NAN, 1.0, 1.0, 0).re.is_nan());
    assert!(dde_root(1.0, 1.0, -1.0, 0).re.is_nan());
}

/// Elements of every kind and size, and a branch for each.
fn mixture() -> (Vec<Complex64>, Vec<i64>) {
    let z = (0..3000).map(|i| {
        let t = f64::from(i);
        let z = Complex64::from_polar((t * 0.4 - 600.0).exp(), t);
        match i % 5 {
            0 => Complex64::new(-z.re.abs(), if i % 2 == 0 { 0.0 } else { -0.0 }),
            1 => Complex64::from_polar((-t * 0.01).exp(), t) - INVERSE_E,
            _ => z,
        }
    });
    (z.collect(), (0..3000).map(|i| i % 9 - 4).collect())
}

#[test]
fn neighbours_and_position_do_not_change_a_bit() {
    let (z, k) = mixture();
    let mut whole = vec![Complex64::ZERO; z.len()];
    block::lambertw(&z, &k, &mut whole);
    for ((z, k), w) in z.iter().zip(&k).zip(&whole) {
        assert_eq!(bits(lambertw(*z, *k)), bits(*w));
    }
    let mut tail = vec![Complex64::ZERO; 77];
    block::lambertw(&z[2923..], &k[2923..], &mut tail);
    assert!(
        tail.iter()
            .zip(&whole[2923..])
            .all(|(a, b)| bits(*a) == bits(*b))
    );
}
