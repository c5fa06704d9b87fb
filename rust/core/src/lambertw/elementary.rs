//! Exponential, sine and cosine to about 2^-64, as sums of two words.
//!
//! Reduction by multiples of ln 2 and pi/2 in pieces short enough that each product is exact
//! (Cody & Waite 1980), then the Taylor series: its first terms in two words, the tail, at most
//! 2^-11 of the sum, in one. What is lost is the rounding of that tail.
//! Valid for |a| < 5000 (exponential) and |b| < 2^23 (sine and cosine); no libm, so the bits are
//! the same on every machine.

use super::two_word::{TwoWord, ordered_sum, product, sum};

const LOG2_E: f64 = std::f64::consts::LOG2_E;
/// ln 2 in pieces of 40, 40 and 53 bits.
const LN_2: [f64; 3] = [
    0.693_147_180_560_117_7,
    -1.723_944_452_561_082_6e-13,
    -4.008_656_105_520_17e-26,
];
const TWO_OVER_PI: f64 = std::f64::consts::FRAC_2_PI;
/// pi/2 in pieces of 30, 30, 30 and 53 bits.
const HALF_PI: [f64; 4] = [
    1.570_796_327_665_448_2,
    -8.705_515_692_000_731e-10,
    -3.503_434_396_954_818e-19,
    -1.135_111_860_752_220_2e-28,
];
/// Adding and subtracting 1.5 * 2^52 rounds to the nearest integer.
const ROUNDER: f64 = 6_755_399_441_055_744.0;

const SIXTH: TwoWord = TwoWord::new(0.166_666_666_666_666_66, 9.251_858_538_542_97e-18);
const TWENTY_FOURTH: TwoWord = TwoWord::new(0.041_666_666_666_666_664, 2.312_964_634_635_742_7e-18);
const ONE_OVER_120: TwoWord = TwoWord::new(0.008_333_333_333_333_333, 1.156_482_317_317_871_4e-19);
const ONE_OVER_720: TwoWord = TwoWord::new(0.001_388_888_888_888_889, -5.300_543_954_373_577e-20);

/// 1/5!, 1/6!, …, 1/16!
const EXP_TAIL: [[f64; 2]; 6] = [
    [1.0 / 120.0, 1.0 / 720.0],
    [1.0 / 5_040.0, 1.0 / 40_320.0],
    [1.0 / 362_880.0, 1.0 / 3_628_800.0],
    [1.0 / 39_916_800.0, 1.0 / 479_001_600.0],
    [1.0 / 6_227_020_800.0, 1.0 / 87_178_291_200.0],
    [1.0 / 1_307_674_368_000.0, 1.0 / 20_922_789_888_000.0],
];
/// -1/7!, 1/9!, …, 1/21!
const SIN_TAIL: [[f64; 2]; 4] = [
    [-1.0 / 5_040.0, 1.0 / 362_880.0],
    [-1.0 / 39_916_800.0, 1.0 / 6_227_020_800.0],
    [-1.0 / 1_307_674_368_000.0, 1.0 / 355_687_428_096_000.0],
    [
        -1.0 / 121_645_100_408_832_000.0,
        1.0 / 51_090_942_171_709_440_000.0,
    ],
];
/// 1/8!, -1/10!, …, -1/22!
const COS_TAIL: [[f64; 2]; 4] = [
    [1.0 / 40_320.0, -1.0 / 3_628_800.0],
    [1.0 / 479_001_600.0, -1.0 / 87_178_291_200.0],
    [1.0 / 20_922_789_888_000.0, -1.0 / 6_402_373_705_728_000.0],
    [
        1.0 / 2_432_902_008_176_640_000.0,
        -1.0 / 1_124_000_727_777_607_680_000.0,
    ],
];

/// Horner's rule in pairs (half the latency), ascending coefficients.
#[inline(always)]
fn polynomial<const PAIRS: usize>(coefficients: &[[f64; 2]; PAIRS], x: f64) -> f64 {
    let square = x * x;
    coefficients
        .iter()
        .rev()
        .fold(0.0, |sum, [even, odd]| sum * square + (odd * x + even))
}

#[inline(always)]
fn nearest(x: f64) -> f64 {
    (x + ROUNDER) - ROUNDER
}

/// `e^(a + low)` as a factor in [0.7, 1.42] and a power of two; `low` is at most an ulp of `a`.
#[inline(always)]
pub(super) fn exp(a: f64, low: f64) -> (TwoWord, i32) {
    let n = nearest(a * LOG2_E);
    let [first, second, third] = LN_2;
    let near = sum(a - n * first, -(n * second));
    let r = ordered_sum(near.hi, near.lo + (low - n * third));

    let tail = polynomial(&EXP_TAIL, r.hi) * r.hi;
    let series = TWENTY_FOURTH.plus_smaller(TwoWord::new(tail, 0.0));
    let series = SIXTH.plus_smaller(series.times(r));
    let series = TwoWord::new(0.5, 0.0).plus_smaller(series.times(r));
    let series = TwoWord::new(1.0, 0.0).plus_smaller(series.times(r));
    let series = TwoWord::new(1.0, 0.0).plus_smaller(series.times(r));
    (series, n as i32)
}

/// `(cos b, sin b)`.
#[inline(always)]
pub(super) fn cos_sin(b: f64) -> (TwoWord, TwoWord) {
    let n = nearest(b * TWO_OVER_PI);
    let [first, second, third, fourth] = HALF_PI;
    // n < 2^23 and 30 bits: the products are exact; the first difference is exact as well.
    let near = sum(b - n * first, -(n * second));
    let near = near.plus(sum(-(n * third), -(n * fourth)));
    let r = ordered_sum(near.hi, near.lo);

    let square = product(r.hi, r.hi);
    let square = ordered_sum(square.hi, square.lo + 2.0 * r.hi * r.lo);

    let tail = polynomial(&SIN_TAIL, square.hi) * square.hi;
    let series = ONE_OVER_120.plus_smaller(TwoWord::new(tail, 0.0));
    let series = SIXTH.negated().plus_smaller(series.times(square));
    let sine = r.plus_smaller(series.times(square).times(r));

    let tail = polynomial(&COS_TAIL, square.hi) * square.hi;
    let series = ONE_OVER_720.negated().plus_smaller(TwoWord::new(tail, 0.0));
    let series = TWENTY_FOURTH.plus_smaller(series.times(square));
    let series = TwoWord::new(-0.5, 0.0).plus_smaller(series.times(square));
    let cosine = TwoWord::new(1.0, 0.0).plus_smaller(series.times(square));

    match (n as i32) & 3 {
        0 => (cosine, sine),
        1 => (sine.negated(), cosine),
        2 => (cosine.negated(), sine.negated()),
        _ => (sine, cosine.negated()),
    }
}

/// `2^n`, with `n` brought into the range of normal numbers.
#[inline(always)]
pub(super) fn power_of_two(n: i32) -> f64 {
    f64::from_bits(((n.clamp(-1022, 1023) + 1023) as u64) << 52)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const BOUND: f64 = 1.0 / (1_u64 << 63) as f64;

    proptest! {
        #[test]
        fn exponentials_of_opposite_arguments_multiply_to_one(a in -2000.0..2000.0_f64) {
            let ((p, up), (q, down)) = (exp(a, 0.0), exp(-a, 0.0));
            let one = p.times(q).scaled(power_of_two(up + down));
            prop_assert!(((one.hi - 1.0) + one.lo).abs() < BOUND);
            prop_assert!((0.7..1.42).contains(&p.hi));
        }

        #[test]
        fn the_second_word_of_the_argument_counts(a in -10.0..10.0_f64, low in -1e-17..1e-17_f64) {
            let ((p, n), (q, m)) = (exp(a, low), exp(a, 0.0));
            prop_assert_eq!(n, m);
            let change = ((p.hi - q.hi) + (p.lo - q.lo)) / q.hi;
            prop_assert!((change - low).abs() < BOUND);
        }

        #[test]
        fn the_squares_of_cosine_and_sine_add_to_one(b in -8e6..8e6_f64) {
            let (c, s) = cos_sin(b);
            let one = c.times(c).plus(s.times(s));
            prop_assert!(((one.hi - 1.0) + one.lo).abs() < BOUND);
        }

        #[test]
        fn first_words_agree_with_the_library(a in -700.0..700.0_f64, b in -1e3..1e3_f64) {
            let (factor, n) = exp(a, 0.0);
            let near = |x: f64, y: f64| (x - y).abs() <= 2.0 * f64::EPSILON * y.abs();
            prop_assert!(near(factor.hi * power_of_two(n), libm::exp(a)));
            let (c, s) = cos_sin(b);
            prop_assert!(near(c.hi, libm::cos(b)) && near(s.hi, libm::sin(b)));
        }
    }
}
