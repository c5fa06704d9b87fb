use num_complex::Complex64;
use proptest::prelude::*;

use super::{Kind, Probe, QuasiPolynomial};
use crate::Error;

pub(crate) fn make(rows: &[&[f64]], delays: &[f64]) -> QuasiPolynomial {
    let rows = rows.iter().map(|row| row.to_vec()).collect();
    QuasiPolynomial::new(rows, delays.to_vec()).unwrap()
}

fn any() -> impl Strategy<Value = QuasiPolynomial> {
    let row = prop::collection::vec(-3.0..3.0f64, 1..4);
    prop::collection::vec((row, 0.0..2.0f64), 1..4).prop_map(|terms| {
        let (rows, delays) = terms.into_iter().unzip();
        QuasiPolynomial::new(rows, delays).unwrap_or_else(|_| QuasiPolynomial::zero())
    })
}

fn point() -> impl Strategy<Value = Complex64> {
    (-2.0..2.0f64, -5.0..5.0f64).prop_map(|(x, y)| Complex64::new(x, y))
}

/// Sum of the moduli of all terms, to which rounding errors are relative.
fn size(h: &QuasiPolynomial, s: Complex64) -> f64 {
    h.terms()
        .map(|(row, delay)| {
            let p: f64 = row
                .iter()
                .rev()
                .fold(0.0, |sum, c| sum * s.norm() + c.abs());
            p * (-delay * s.re).exp()
        })
        .sum()
}

#[test]
fn rows_are_sorted_merged_and_trimmed() {
    let h = make(
        &[&[1.0, 0.0], &[2.0, -1.0], &[0.0], &[0.0, 1.0]],
        &[2.0, 0.5, 0.1, 0.5],
    );
    assert_eq!(h.delays(), [0.5, 2.0]);
    assert_eq!(h.coefficients(), [vec![2.0], vec![1.0]]);
    assert_eq!(
        make(&[&[1.0], &[-1.0]], &[1.0, 1.0]),
        QuasiPolynomial::zero()
    );
    assert!(QuasiPolynomial::zero().is_zero());
}

#[test]
fn bad_arguments_are_refused() {
    for (rows, delays) in [
        (vec![], vec![]),
        (vec![vec![1.0]], vec![]),
        (vec![vec![1.0]], vec![-0.1]),
        (vec![vec![1.0]], vec![f64::NAN]),
        (vec![vec![f64::INFINITY]], vec![0.0]),
        (vec![vec![1e308], vec![1e308]], vec![1.0, 1.0]),
    ] {
        assert!(matches!(
            QuasiPolynomial::new(rows, delays),
            Err(Error::Argument(_))
        ));
    }
    let huge = make(&[&[1e200]], &[1e308]);
    assert!(huge.mul(&huge).is_err());
    assert!(make(&[&[1.0, 1.0]], &[0.0]).pow(4_000_000).is_err());
    assert!(make(&[&[1.0]], &[1.0]).derivative(u32::MAX).is_err());
    assert_eq!(
        make(&[&[1.0, 1.0]], &[0.0]).derivative(u32::MAX),
        Ok(QuasiPolynomial::zero())
    );
}

#[test]
fn the_kind_is_told_after_the_smallest_delay_is_factored_out() {
    let kind = |rows: &[&[f64]], delays: &[f64]| make(rows, delays).kind();
    assert_eq!(kind(&[&[1.0, 2.0]], &[3.0]), Kind::Polynomial);
    assert_eq!(kind(&[&[0.0]], &[0.0]), Kind::Polynomial);
    assert_eq!(kind(&[&[0.0, 1.0], &[2.0]], &[1.0, 2.0]), Kind::Retarded);
    assert_eq!(
        kind(&[&[0.0, 1.0], &[2.0, 0.1]], &[0.0, 2.0]),
        Kind::Neutral
    );
    assert_eq!(kind(&[&[1.0], &[2.0]], &[0.0, 2.0]), Kind::Difference);
    assert_eq!(kind(&[&[1.0], &[2.0, 1.0]], &[0.0, 2.0]), Kind::Advanced);
}

#[test]
fn nothing_overflows_far_to_the_left() {
    let h = make(&[&[0.0, 1.0], &[1.0]], &[0.0, 10.0]);
    let s = Complex64::new(-1e3, 3.0);
    let scaled = h.scaled_value(s);
    assert_eq!(scaled.delay, 10.0);
    assert!((scaled.value - 1.0).norm() < 1e-14);
    assert!(h.value(s).norm().is_infinite());
    assert_eq!(h.value(Complex64::new(1e3, 0.0)), Complex64::new(1e3, 0.0));
}

#[test]
fn sums_of_delays_in_another_order_are_the_same_delay() {
    let h = make(&[&[1.0], &[2.0], &[3.0]], &[0.0, 0.1, 0.25]);
    let left = h.mul(&h).and_then(|square| square.mul(&h));
    assert_eq!(left.map(|cube| cube.delays().len()), Ok(10));
}

proptest! {
    #[test]
    fn algebra_acts_pointwise(a in any(), b in any(), s in point()) {
        let margin = 1e-12 * (1.0 + size(&a, s)) * (1.0 + size(&b, s));
        let (x, y) = (a.value(s), b.value(s));
        let close = |h: Result<QuasiPolynomial, Error>, wanted: Complex64| {
            h.is_ok_and(|h| (h.value(s) - wanted).norm() <= margin)
        };
        prop_assert!(close(a.add(&b), x + y));
        prop_assert!(close(a.sub(&b), x - y));
        prop_assert!(close(a.mul(&b), x * y));
        prop_assert!(close(a.scale(-2.5), x * -2.5));
    }

    #[test]
    fn slope_and_derivative_agree(h in any(), s in point()) {
        let mut probe = Probe::new(&h);
        probe.refer_to_dominant(s);
        let jet = probe.jet(s);
        let back = (-s * probe.delay()).exp();
        // h = g e^(−sτ), so h′ = (g′ − τ g) e^(−sτ).
        let slope = (jet.slope - jet.value * probe.delay()) * back;
        let wanted = h.derivative(1).map(|d| d.value(s));
        prop_assert!(wanted.is_ok_and(|w| (w - slope).norm() <= 1e-11 * (1.0 + 30.0 * size(&h, s))));
    }

    #[test]
    fn the_curvature_bound_holds_on_the_disc(h in any(), s in point(), r in 0.0..1.0f64, a in 0.0..6.3f64) {
        let mut probe = Probe::new(&h);
        probe.refer_to_dominant(s);
        probe.jet(s);
        let bound = probe.curvature_around(s.norm() + r, r);
        let at = s + Complex64::from_polar(r, a);
        let second = QuasiPolynomial::new(
            h.coefficients().to_vec(),
            h.delays().iter().map(|d| d - probe.delay()).map(f64::abs).collect(),
        );
        // Where all gaps are positive, g is itself a quasi-polynomial and can be differentiated.
        prop_assume!(probe.reference() == 0);
        let second = second.and_then(|g| g.derivative(2)).map(|g| g.value(at).norm());
        prop_assert!(second.is_ok_and(|size| size <= bound * (1.0 + 1e-9) + 1e-12));
    }
}
