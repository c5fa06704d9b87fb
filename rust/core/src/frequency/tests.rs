//! Closed forms, values by complex arithmetic, and what a fine grid shows.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};

use num_complex::Complex64;
use proptest::prelude::*;

use super::chains::Lead;
use super::squares::DifferenceOfSquares;
use super::two_sided::TwoSided;
use super::waves::Waves;
use super::zeros::{ORDER, RealFunction, zeros_between};
use super::*;
use crate::quasipoly::{QuasiPolynomial, make};
use crate::stability::{Affine, Family, Term};
use crate::{Error, Task};

/// Coefficient, power of the parameter, power of s, constant delay, slope of the delay.
fn family(terms: &[(f64, u32, u32, f64, f64)]) -> Family {
    let term = |&(coefficient, exponent, power, constant, slope): &_| Term {
        coefficient,
        exponents: vec![exponent],
        power,
        delay: Affine {
            constant,
            slopes: vec![slope],
        },
    };
    Family::new(vec!["p".to_owned()], terms.iter().map(term).collect()).unwrap()
}

/// Two rows with few coefficients.
fn function() -> impl Strategy<Value = QuasiPolynomial> {
    let number = || prop_oneof![Just(0.0), Just(1.0), -3.0..3.0f64];
    let row = || prop::collection::vec(number(), 1..4);
    let delay = prop_oneof![Just(0.0), Just(0.3), 0.01..2.0f64];
    let functions = (row(), row(), delay).prop_map(|(a, b, tau)| make(&[&a, &b], &[0.0, tau]));
    functions.prop_filter("zero", |h| !h.is_zero())
}

fn on_axis(h: &QuasiPolynomial, omega: f64) -> Complex64 {
    h.value(Complex64::new(0.0, omega))
}

/// Values and Taylor's formula of `f`, which is `factor` ω^−`power` times `exact`.
fn check_taylor(
    f: &mut impl RealFunction,
    exact: impl Fn(f64) -> (f64, f64),
    omega: f64,
    r: f64,
) -> Result<(), TestCaseError> {
    let here = f.taylor(omega);
    let (value, margin) = exact(omega);
    prop_assert!((here.values[0] - value).abs() <= here.errors[0] + margin);
    prop_assert!((f.value(omega) - value).abs() <= here.errors[0] + margin);
    let (mut sum, mut off, mut power) = (0.0, margin, 1.0);
    for k in 0..ORDER {
        sum += here.values[k] * power;
        off += here.errors[k] * power;
        power *= r / (k + 1) as f64;
    }
    off += f.bound(omega + r) * power;
    let (there, margin) = exact(omega + r);
    prop_assert!((there - sum).abs() <= off + margin + f.taylor(omega + r).errors[0]);
    let (change, _) = here.change(r, f.bound(omega + r));
    prop_assert!((there - value).abs() <= change + here.errors[0] + off);
    Ok(())
}

proptest! {
    #[test]
    fn waves_are_what_complex_arithmetic_says(
        n in function(), d in function(), q in 0..4usize, omega in 0.0..30.0f64, r in 0.0..0.5f64,
    ) {
        let sum = TwoSided::of(&n).times(&TwoSided::of(&d).mirrored());
        let exact = |omega| {
            let product = Complex64::I.powu(q as u32) * on_axis(&n, omega) * on_axis(&d, omega).conj();
            (product.im, 1e-13 * (1.0 + omega).powi(6))
        };
        check_taylor(&mut Waves::new(&sum, q), exact, omega, r)?;
    }

    #[test]
    fn differences_of_squares_are_known_to_their_errors(
        n in function(), d in function(), omega in 0.0..30.0f64, r in 0.0..0.5f64,
    ) {
        let exact = |omega| {
            let sizes = (on_axis(&d, omega).norm_sqr(), on_axis(&n, omega).norm_sqr());
            (sizes.0 - sizes.1, 1e-14 * (sizes.0 + sizes.1))
        };
        check_taylor(&mut DifferenceOfSquares::new(&d, &n), exact, omega, r)?;
    }

    #[test]
    fn no_change_of_sign_is_missed(n in function(), d in function(), q in 0..4usize) {
        let sum = TwoSided::of(&n).times(&TwoSided::of(&d).mirrored());
        let mut f = Waves::cleaned(&sum, q);
        if !f.is_zero() {
            let top = 20.0;
            let zeros = zeros_between(&mut f, 0.0, top, &Task::new()).unwrap();
            prop_assert!(zeros.windows(2).all(|pair| pair[0] <= pair[1]));
            let grid: Vec<f64> = (1..4000).map(|k| top * f64::from(k) / 4000.0).collect();
            for ends in grid.windows(2) {
                let known = |omega| {
                    let here = f.taylor(omega);
                    if here.values[0].abs() > here.errors[0] { here.values[0].signum() } else { 0.0 }
                };
                let signs: Vec<f64> = ends.iter().copied().map(known).collect();
                let between = zeros.iter().filter(|zero| ends[0] < **zero && **zero <= ends[1]);
                if signs[0] * signs[1] < 0.0 {
                    prop_assert_eq!(between.count() % 2, 1);
                }
            }
        }
    }

    #[test]
    fn the_last_zero_is_the_last(n in function(), d in function(), q in 0..4usize) {
        let sum = TwoSided::of(&n).times(&TwoSided::of(&d).mirrored());
        let mut f = Waves::cleaned(&sum, q);
        let last = f.last_zero();
        if !f.is_zero() && last.is_finite() {
            let sign = f.value(1.001 * last + 1e-3).signum();
            for factor in [1.1, 2.0, 7.0, 100.0] {
                prop_assert_eq!(f.value(factor * last + 1e-3 * factor).signum(), sign);
            }
        }
    }

    #[test]
    fn the_gain_stays_below_beyond_its_end(n in function(), d in function(), level in 0.1..3.0f64) {
        let end = end_of_gain(&n, &d, level, 0);
        if end.is_finite() {
            for factor in [1.0, 1.5, 10.0, 1e3] {
                let omega = factor * end + 1e-6;
                prop_assert!(on_axis(&n, omega).norm() < level * on_axis(&d, omega).norm());
            }
        }
    }

    #[test]
    fn margins_of_an_integrator(gain in 0.1..10.0f64, part in 0.01..0.99f64) {
        let delay = part * FRAC_PI_2 / gain;
        let n = make(&[&[gain]], &[delay]);
        let found = margins(&n, &QuasiPolynomial::variable(), &Task::new()).unwrap();
        prop_assert!(found.stable);
        prop_assert!((found.gain_margin * part - 1.0).abs() < 1e-12);
        prop_assert!((found.delay_margin - (FRAC_PI_2 / gain - delay)).abs() < 1e-12 / gain);
        prop_assert!((found.phase_margin - 90.0 * (1.0 - part)).abs() < 1e-10);
        prop_assert_eq!(found.gain_reduction, 0.0);
    }

    #[test]
    fn the_phase_is_the_argument_up_to_whole_turns(h in function(), omega in 0.01..300.0f64) {
        let size = super::bounds::moduli(&h).iter().sum::<f64>();
        let value = on_axis(&h, omega);
        prop_assume!(value.norm() > 1e-6 * size);
        let found = argument(&h, &[omega], &Task::new()).unwrap();
        let turns = (found[0] - value.arg()) / TAU;
        prop_assert!((turns - turns.round()).abs() < 1e-8);
        let many = argument(&h, &[0.5 * omega, omega, 0.3 * omega], &Task::new()).unwrap();
        prop_assert!((many[1] - found[0]).abs() < 1e-8 * (1.0 + found[0].abs()));
    }
}

#[test]
fn functions_that_only_touch_zero_are_listed_once() {
    // |s² + 1|² − |s e^(−s)|² has (ω² − 1)² − ω²; |s² + s/2 + 1|² − |s/2|² = (1 − ω²)².
    let (d, n) = (
        make(&[&[1.0, 0.5, 1.0]], &[0.0]),
        make(&[&[0.0, 0.5]], &[0.7]),
    );
    let found = zeros_between(
        &mut DifferenceOfSquares::new(&d, &n),
        0.0,
        9.0,
        &Task::new(),
    );
    let found = found.unwrap();
    assert!(!found.is_empty() && found.len() <= 2, "{found:?}");
    assert!(
        found.iter().all(|zero| (zero - 1.0).abs() < 1e-6),
        "{found:?}"
    );
}

#[test]
fn too_many_zeros_are_refused() {
    let (d, n) = (
        make(&[&[1.0], &[1.0]], &[0.0, 1e7]),
        make(&[&[1.0]], &[0.0]),
    );
    let mut f = DifferenceOfSquares::new(&d, &n);
    let found = zeros_between(&mut f, 0.0, 10.0, &Task::new());
    assert!(matches!(found, Err(Error::Argument(_))));
}

#[test]
fn chains_are_reached_where_the_leading_terms_balance() {
    // |1 + 0.2 k| against |0.3 k|: from k = 10 on, and from −2 down.
    let a = make(&[&[0.0, 1.0]], &[0.0]);
    let b = make(&[&[0.0, 0.2], &[1.0, 0.3]], &[0.0, 0.5]);
    let lead = Lead::of(&a, &b, 0.0);
    assert!((lead.lost_above_one() - 10.0).abs() < 1e-12);
    assert_eq!(lead.lost_below_one(), 0.0);
    let parts = lead.lost(-20.0, 20.0);
    assert!(
        parts
            .iter()
            .all(|(low, high)| *high <= -2.0 + 1e-12 || *low >= 10.0 - 1e-12)
    );
    assert!(!lead.is_lost_by_delay());
    assert!(Lead::of(&a, &make(&[&[0.0, 1.0]], &[0.0]), 0.0).is_lost_by_delay());
}

#[test]
fn crossings_of_a_delay_and_of_its_multiples() -> Result<(), Error> {
    let task = Task::new();
    // s + 2 e^(−s p): p = (π/2 + 2πn)/2 at ω = 2.
    let one = family(&[(1.0, 0, 1, 0.0, 0.0), (2.0, 0, 0, 0.0, 1.0)]);
    let found = crossings(&one, (0.0, 5.0), &task)?.crossings;
    assert_eq!(found.len(), 2);
    for (turn, crossing) in found.iter().enumerate() {
        assert!((crossing.value - (FRAC_PI_4 + PI * turn as f64)).abs() < 1e-14);
        assert!((crossing.omega - 2.0).abs() < 1e-14 && crossing.direction == 2);
    }
    assert!((delay_margin(&one, 0.1, &task)? - (FRAC_PI_4 - 0.1)).abs() < 1e-14);
    assert_eq!(delay_range(&one, 0.1, &task)?.0, 0.0);
    // s + e^(−s p) + e^(−2 s p): π/(3√3) at √3.
    let two = family(&[
        (1.0, 0, 1, 0.0, 0.0),
        (1.0, 0, 0, 0.0, 1.0),
        (1.0, 0, 0, 0.0, 2.0),
    ]);
    let found = crossings(&two, (0.0, 3.0), &task)?.crossings;
    assert_eq!(found.len(), 1);
    assert!((found[0].value - PI / (3.0 * 3f64.sqrt())).abs() < 1e-13);
    assert!((found[0].omega - 3f64.sqrt()).abs() < 1e-13 && found[0].direction == 2);
    Ok(())
}

#[test]
fn ranges_end_at_the_nearest_crossing() -> Result<(), Error> {
    let task = Task::new();
    // s + p e^(−0.36 s): from 0 to π/0.72.
    let gain = family(&[(1.0, 0, 1, 0.0, 0.0), (1.0, 1, 0, 0.36, 0.0)]);
    let (low, high) = gain_range(&gain, 2.0, (f64::NEG_INFINITY, f64::INFINITY), &task)?;
    assert_eq!(low, 0.0);
    assert!((high - PI / 0.72).abs() < 1e-13);
    // p s + 1 + 2 e^(−0.1 s), a time constant: far above its end, and found nevertheless.
    let slow = family(&[
        (1.0, 1, 1, 0.0, 0.0),
        (1.0, 0, 0, 0.0, 0.0),
        (2.0, 0, 0, 0.1, 0.0),
    ]);
    let (low, high) = gain_range(&slow, 1.5, (0.0, f64::INFINITY), &task)?;
    let omega = 10.0 * (-0.5f64).acos();
    assert!((low - 3f64.sqrt() / omega).abs() < 1e-13 && high == f64::INFINITY);
    // A parameter that stands nowhere is free.
    assert_eq!(
        gain_range(&family(&[(1.0, 0, 1, 0.0, 0.0)]), 1.0, (0.0, 9.0), &task)?,
        (0.0, 9.0)
    );
    Ok(())
}

#[test]
fn ratios_at_extremes_and_limits_at_zero() -> Result<(), Error> {
    let (n, d) = (make(&[&[2.0]], &[0.36]), QuasiPolynomial::variable());
    let points = [1e-308, 1e200].map(|omega| Complex64::new(0.0, omega));
    let found = ratio(&n, &d, &points, &Task::new())?;
    assert_eq!(found[0].im, f64::NEG_INFINITY);
    assert!((found[0].re + 0.72).abs() < 1e-12, "{}", found[0]);
    assert!((found[1].norm() / 2e-200 - 1.0).abs() < 1e-9);
    assert!(
        ratio(&n, &d, &[Complex64::ZERO], &Task::new())?[0]
            .re
            .is_infinite()
    );
    // 1 − e^(−s/2) = s/2 − …
    assert_eq!(first_term(&make(&[&[1.0], &[-1.0]], &[0.0, 0.5])), (0.5, 1));
    assert_eq!(first_term(&QuasiPolynomial::zero()), (0.0, 0));
    Ok(())
}

#[test]
fn one_number_varies_at_a_time() {
    let two = Family::new(vec!["a".to_owned(), "b".to_owned()], Vec::new()).unwrap();
    assert!(crossings(&two, (0.0, 1.0), &Task::new()).is_err());
    let both = family(&[(1.0, 0, 1, 0.0, 0.0), (1.0, 1, 0, 0.0, 1.0)]);
    assert!(crossings(&both, (0.0, 1.0), &Task::new()).is_err());
}
