use proptest::prelude::*;

use super::{DoubleDouble, angle, exp, exp_above, log, precise, sin_cos};

/// Half an ulp of 1.
const U: f64 = 0.5 * f64::EPSILON;

/// Values at 1500 bits as sums of two doubles, hard cases among them; made by
/// `tests/reference/make_elementary.py`.
const REFERENCE: &str = include_str!("../../../../tests/reference/elementary.txt");

struct Row {
    name: &'static str,
    numbers: Vec<f64>,
}

fn rows() -> impl Iterator<Item = Row> {
    REFERENCE.lines().map(|line| {
        let mut words = line.split(' ');
        Row {
            name: words.next().unwrap_or(""),
            numbers: words
                .map(|word| f64::from_bits(u64::from_str_radix(word, 16).unwrap_or(u64::MAX)))
                .collect(),
        }
    })
}

#[test]
fn errors_stay_within_the_proved_bounds() {
    let mut worst = [0.0f64; 4];
    let mut count = 0;
    for Row { name, numbers } in rows() {
        let [.., high, low] = numbers[..] else {
            continue;
        };
        let x = numbers[0];
        let (slot, ours, bound) = match name {
            "sin" => (0, sin_cos(x).0, U),
            "cos" => (0, sin_cos(x).1, U),
            "exp" => (1, exp(x), 1.25 * U * high + f64::from_bits(1)),
            "log" => (2, log(x), 4.0 * U * (1.0 + high.abs())),
            "angle" => (3, angle(x, numbers[1]), 8.0 * U),
            _ => continue,
        };
        let error = ((ours - high) - low).abs();
        assert!(
            error <= bound,
            "{name} of {x:e}: {ours:e} instead of {high:e}"
        );
        if name == "exp" {
            assert!(exp_above(x) > high && exp_above(x) <= high * (1.0 + 1e-15) + 1e-323);
        }
        worst[slot] = worst[slot].max(error / bound);
        count += 1;
    }
    assert!(count > 1400, "{count} rows");
    // A bound far above the errors found would indicate a mistake in its derivation.
    assert!(worst.iter().all(|share| *share > 0.2), "{worst:?}");
}

#[test]
fn what_is_not_finite() {
    assert_eq!(
        (exp(f64::INFINITY), exp(f64::NEG_INFINITY)),
        (f64::INFINITY, 0.0)
    );
    assert_eq!(
        (exp(-745.3), exp(711.0), exp(-1e9)),
        (0.0, f64::INFINITY, 0.0)
    );
    for y in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert!(sin_cos(y).0.is_nan() && sin_cos(y).1.is_nan());
    }
    assert!(exp(f64::NAN).is_nan() && log(f64::NAN).is_nan() && log(-1.0).is_nan());
    assert_eq!(
        (log(0.0), log(f64::INFINITY)),
        (f64::NEG_INFINITY, f64::INFINITY)
    );
    assert!(angle(f64::NAN, 1.0).is_nan());
}

proptest! {
    #[test]
    fn exponentials_of_opposite_arguments_multiply_to_one(x in -700.0..700.0f64) {
        prop_assert!((exp(x) * exp(-x) - 1.0).abs() <= 4.0 * U);
    }

    #[test]
    fn squares_add_to_one(m in 1.0..2.0f64, e in -60..1023i32) {
        let (sine, cosine) = sin_cos(m * 2f64.powi(e));
        prop_assert!((sine * sine + cosine * cosine - 1.0).abs() <= 6.0 * U);
    }

    #[test]
    fn both_reductions_agree_where_they_meet(y in 1_048_000.0..1_049_000.0f64) {
        // The double angle is reduced in another way.
        let (s, c) = sin_cos(y);
        let (far_s, far_c) = sin_cos(y * 2.0);
        prop_assert!((far_s - 2.0 * s * c).abs() <= 8.0 * U);
        prop_assert!((far_c - (c - s) * (c + s)).abs() <= 8.0 * U);
    }

    #[test]
    fn parity(y in -1e9..1e9f64) {
        let ((s, c), (minus_s, same_c)) = (sin_cos(y), sin_cos(-y));
        prop_assert_eq!((s, c), (-minus_s, same_c));
    }

    #[test]
    fn logarithm_undoes_the_exponential(x in -700.0..700.0f64) {
        prop_assert!((log(exp(x)) - x).abs() <= U * (8.0 + 5.0 * x.abs()));
    }

    #[test]
    fn angles_are_those_of_their_direction(t in -3.1..3.1f64, size in 1e-5..1e5f64) {
        let (sine, cosine) = sin_cos(t);
        prop_assert!((angle(size * sine, size * cosine) - t).abs() <= 14.0 * U);
    }
}

#[test]
fn double_doubles_stay_within_the_proved_bounds() {
    let bound = 8.0 * U * U;
    let mut worst = 0.0f64;
    let mut count = 0;
    for Row { name, numbers } in rows() {
        let [x, high, low] = numbers[..] else {
            continue;
        };
        let (ours, scale) = match name {
            "sin" if x.abs() <= 1e12 => (precise::sin_cos(x.into()).0, 1.0),
            "cos" if x.abs() <= 1e12 => (precise::sin_cos(x.into()).1, 1.0),
            "exp" if x.abs() <= 600.0 => (precise::exp(x.into()), high),
            _ => continue,
        };
        let reference = DoubleDouble::new(high, low);
        // The reference is itself within u² of the value.
        let error = (ours - reference).high.abs() / scale;
        assert!(error <= bound + U * U, "{name} of {x:e}: {error:e}");
        worst = worst.max(error / bound);
        count += 1;
    }
    assert!(count > 700, "{count} rows");
    assert!(worst > 0.1, "{worst}");
}

proptest! {
    #[test]
    fn double_double_arguments_obey_the_addition_theorems(
        x in -300.0f64..300.0, y in -1e6f64..1e6, small in -1.0f64..1.0,
    ) {
        // e^(x + t) = e^x e^t, where the small part is the low word of the sum.
        let tiny = small * 1e-17 * x.abs().max(1e-3);
        let both = DoubleDouble::difference(x, -tiny);
        let product = precise::exp(x.into()) * precise::exp(tiny.into());
        let difference = precise::exp(both) - product;
        prop_assert!(difference.high.abs() <= 64.0 * U * U * product.high);
        let (s, c) = precise::sin_cos(y.into());
        let one = s * s + c * c;
        prop_assert!((one - DoubleDouble::ONE).high.abs() <= 64.0 * U * U);
        let double = precise::sin_cos(DoubleDouble::from(y) * 2.0).0;
        prop_assert!((double - s * c * 2.0).high.abs() <= 96.0 * U * U);
    }

    #[test]
    fn double_double_arithmetic_stays_within_its_bounds(
        a in -1e3f64..1e3, b in -1e3f64..1e3, c in 1e-3f64..1e3,
    ) {
        // (a + b)² c = a² c + 2 a b c + b² c: every operation has its part.
        let sum = DoubleDouble::difference(a, -b);
        let left = sum * sum * c;
        let right = DoubleDouble::product(a, a) * c
            + DoubleDouble::product(a, b) * 2.0 * c
            + DoubleDouble::product(b, b) * c;
        let size = (a.abs() + b.abs()).powi(2) * c;
        prop_assert!((left - right).high.abs() <= 40.0 * U * U * size);
    }
}
