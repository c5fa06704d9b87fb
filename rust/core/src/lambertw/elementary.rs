//! Exponential, sine and cosine to 2^-61 as double-doubles; logarithms of low accuracy.
//!
//! Reduction by multiples of ln 2 and pi/2 in pieces short enough that each product is exact (Cody
//! & Waite 1980), then the Taylor series: its first terms in double-double arithmetic, the tail, at
//! most 2^-10 of the sum, in double precision. The error is the rounding error of that tail. Valid
//! for |a| < 5000 (exponential) and |b| < 2^23 (sine and cosine). Errors are absolute: a sine next
//! to a multiple of pi (other than 0) has the error 2^-61, not the relative error 2^-61.

use crate::simd::{Complex, Real, Simd};

use crate::simd::double_double::{Constant, DoubleDouble, ordered_sum, product, sum};

const LOG2_E: f64 = std::f64::consts::LOG2_E;
/// ln 2 in pieces of 40 and 53 bits.
const LN_2: [f64; 2] = [0.693_147_180_559_208_2, 7.371_002_565_167_799e-13];
const TWO_OVER_PI: f64 = std::f64::consts::FRAC_2_PI;
/// pi/2 in pieces of 30, 30 and 53 bits.
const HALF_PI: [f64; 3] = [
    1.570_796_325_802_803,
    9.920_935_791_635_221e-10,
    5.170_182_981_794_105e-19,
];

const SIXTH: Constant = Constant(0.166_666_666_666_666_66, 9.251_858_538_542_97e-18);
const TWENTY_FOURTH: Constant = Constant(0.041_666_666_666_666_664, 2.312_964_634_635_742_7e-18);
const ONE_OVER_120: Constant = Constant(0.008_333_333_333_333_333, 1.156_482_317_317_871_4e-19);
const HALF: Constant = Constant(0.5, 0.0);
const ONE: Constant = Constant(1.0, 0.0);

/// 1/5!, 1/6!, …, 1/16!
const EXP_TAIL: [[f64; 2]; 6] = [
    [1.0 / 120.0, 1.0 / 720.0],
    [1.0 / 5_040.0, 1.0 / 40_320.0],
    [1.0 / 362_880.0, 1.0 / 3_628_800.0],
    [1.0 / 39_916_800.0, 1.0 / 479_001_600.0],
    [1.0 / 6_227_020_800.0, 1.0 / 87_178_291_200.0],
    [1.0 / 1_307_674_368_000.0, 1.0 / 20_922_789_888_000.0],
];
/// -1/7!, 1/9!, …, -1/19!
const SIN_TAIL: [[f64; 2]; 4] = [
    [-1.0 / 5_040.0, 1.0 / 362_880.0],
    [-1.0 / 39_916_800.0, 1.0 / 6_227_020_800.0],
    [-1.0 / 1_307_674_368_000.0, 1.0 / 355_687_428_096_000.0],
    [-1.0 / 121_645_100_408_832_000.0, 0.0],
];
/// -1/6!, 1/8!, …, -1/18!
const COS_TAIL: [[f64; 2]; 4] = [
    [-1.0 / 720.0, 1.0 / 40_320.0],
    [-1.0 / 3_628_800.0, 1.0 / 479_001_600.0],
    [-1.0 / 87_178_291_200.0, 1.0 / 20_922_789_888_000.0],
    [-1.0 / 6_402_373_705_728_000.0, 0.0],
];
/// log(1 + t) on |t| <= 1/3 within 2.5e-7 (Remez), ascending from the constant term, which also
/// holds log 1.5.
const LOG: [[f64; 2]; 4] = [
    [0.405_465_287_205_811_9, 0.999_999_840_133_113_6],
    [-0.500_051_435_737_354_1, 0.333_379_243_346_772_66],
    [-0.247_720_356_423_782_18, 0.197_965_928_377_114_88],
    [-0.198_254_094_714_704_55, 0.171_018_096_829_704_79],
];
/// atan(t)/t on [0, 1] within 4.9e-6 (Remez), ascending in t^2.
const ATAN: [[f64; 2]; 3] = [
    [0.999_994_834_633_887_9, -0.332_957_110_322_477_16],
    [0.195_346_590_027_987_38, -0.120_448_585_213_199_32],
    [0.056_589_985_199_829_76, -0.013_130_382_075_265_306],
];

/// Horner's rule in pairs (half the latency), ascending coefficients.
#[inline(always)]
fn polynomial<S: Simd, const PAIRS: usize>(
    coefficients: &[[f64; 2]; PAIRS],
    x: Real<S>,
) -> Real<S> {
    let square = x * x;
    let mut sum = x.constant(0.0);
    for &[even, odd] in coefficients.iter().rev() {
        sum = sum.mul_add(square, x.mul_add(odd, even));
    }
    sum
}

/// `e^(a + low)` as a factor in [0.7, 1.42] and a power of two; `low` is at most an ulp of `a`.
#[inline(always)]
pub(super) fn exp<S: Simd>(a: Real<S>, low: Real<S>) -> (DoubleDouble<S>, Real<S>) {
    let n = (a * LOG2_E).nearest();
    let [first, second] = LN_2;
    // The first difference is exact. If the second piece is the larger one, both are so small that
    // the rounding error of this sum is negligible.
    let piece = product(n, n.constant(second));
    let near = ordered_sum(n.negated_mul_add(first, a), -piece.hi);
    let r = DoubleDouble::new(near.hi, (near.lo - piece.lo) + low);

    let square = product(r.hi, r.hi);
    let square = DoubleDouble::new(square.hi, (r.hi + r.hi).mul_add(r.lo, square.lo));
    let cube = square.times(r);
    let third = product(cube.hi, r.hi.constant(SIXTH.0));
    let third_low = cube.lo.mul_add(SIXTH.0, cube.hi.mul_add(SIXTH.1, third.lo));
    let fourth = cube.hi * r.hi;
    let fifth = fourth * r.hi * polynomial(&EXP_TAIL, r.hi);
    let tail = fourth.mul_add(TWENTY_FOURTH.0, fifth);

    // 1 + (r + (r^2/2 + r^3/6)); the rest, which is the largest there, is added last to the low
    // words.
    let curved = ordered_sum(square.hi * 0.5, third.hi);
    let change = ordered_sum(r.hi, curved.hi);
    let whole = ordered_sum(change.hi.constant(1.0), change.hi);
    let low = square.lo.mul_add(0.5, curved.lo + third_low) + (change.lo + r.lo) + whole.lo;
    // r^4/24 was computed from the high word alone; the low word changes it by r^3/6 times itself.
    let low = r.lo.mul_add(third.hi, low);
    (ordered_sum(whole.hi, tail + low), n)
}

/// Cosine and sine of an angle reduced by whole quarter turns.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reduced<S: Simd> {
    pub(super) cosine: DoubleDouble<S>,
    pub(super) sine: DoubleDouble<S>,
    /// The quarter turns removed, modulo 4: -2 or 2, -1, 0 or 1.
    pub(super) quarters: Real<S>,
}

/// Cosine and sine of `b + low` reduced by quarter turns to at most pi/4; `low` is at most an ulp
/// of `b`.
#[inline(always)]
pub(super) fn cos_sin<S: Simd>(b: Real<S>, low: Real<S>) -> Reduced<S> {
    let n = (b * TWO_OVER_PI).nearest();
    let [first, second, third] = HALF_PI;
    // n < 2^23 and 30 bits: the products are exact; the first difference is exact as well.
    let near = sum(n.negated_mul_add(first, b), -(n * second));
    let r = ordered_sum(near.hi, n.negated_mul_add(third, near.lo + low));

    let square = product(r.hi, r.hi);
    let square = DoubleDouble::new(square.hi, (r.hi + r.hi).mul_add(r.lo, square.lo));

    let tail = polynomial(&SIN_TAIL, square.hi) * square.hi;
    let series = DoubleDouble::from_word(tail).added_to(ONE_OVER_120);
    let series = series.times(square).negated().added_to(SIXTH).negated();
    let bend = series.times(square).times(r);
    let sine = ordered_sum(r.hi, bend.hi);
    let sine = DoubleDouble::new(sine.hi, sine.lo + (bend.lo + r.lo));

    let tail = polynomial(&COS_TAIL, square.hi) * square.hi;
    let series = DoubleDouble::from_word(tail).added_to(TWENTY_FOURTH);
    let series = series.times(square).negated().added_to(HALF).negated();
    let cosine = series.times(square).added_to(ONE);

    Reduced {
        cosine,
        sine,
        quarters: (n * 0.25).nearest().negated_mul_add(4.0, n),
    }
}

/// `z (-i)^quarters`, for -2 to 2 quarter turns.
#[inline(always)]
pub(super) fn turned_back<S: Simd>(z: Complex<S>, quarters: Real<S>) -> Complex<S> {
    let half = quarters.abs().eq(2.0);
    let odd = quarters.abs().eq(1.0);
    let zero = quarters.constant(0.0);
    let flip_re = (half | quarters.eq(-1.0)).select(-0.0, zero);
    let flip_im = (half | quarters.eq(1.0)).select(-0.0, zero);
    Complex::new(
        odd.select(z.im, z.re).flipped(flip_re),
        odd.select(z.re, z.im).flipped(flip_im),
    )
}

/// `log x` within 3e-7 for a positive normal number.
#[inline(always)]
pub(crate) fn rough_log<S: Simd>(x: Real<S>) -> Real<S> {
    let t = x.mantissa().mul_add(2.0 / 3.0, -1.0);
    let exponent = x.binade().exponent();
    exponent.mul_add(std::f64::consts::LN_2, polynomial(&LOG, t))
}

/// The angle of a complex number that is not zero, within 5e-6; that of a real one is exact.
#[inline(always)]
pub(crate) fn rough_angle<S: Simd>(z: Complex<S>) -> Real<S> {
    let (along, across) = (z.re.abs(), z.im.abs());
    let steep = across.gt(along);
    let t = steep.select(along, across) / steep.select(across, along);
    let angle = t * polynomial(&ATAN, t * t);
    let angle = steep.select(-angle + std::f64::consts::FRAC_PI_2, angle);
    let angle =
        z.re.is_negative()
            .select(-angle + std::f64::consts::PI, angle);
    angle.signed(z.im.sign())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use pulp::Scalar;

    /// The errors of two factors.
    const BOUND: f64 = 1.0 / (1_u64 << 60) as f64;

    /// The difference between a double-double that should be 1 and 1.
    fn beside_one(value: DoubleDouble<Scalar>) -> f64 {
        ((Real::first(value.hi) - 1.0) + Real::first(value.lo)).abs()
    }

    proptest! {
        #[test]
        fn exponentials_of_opposite_arguments_multiply_to_one(a in -2000.0..2000.0_f64) {
            let zero = Real::lane(0.0);
            let ((p, up), (q, down)) = (exp(Real::lane(a), zero), exp(Real::lane(-a), zero));
            let power = (up + down).power_of_two();
            prop_assert!(beside_one(p.times(q).scaled(power)) < BOUND);
            prop_assert!((0.7..1.42).contains(&Real::first(p.hi)));
        }

        #[test]
        fn the_second_word_of_the_argument_counts(a in -10.0..10.0_f64, low in -1e-17..1e-17_f64) {
            let ((p, n), (q, m)) = (exp(Real::lane(a), Real::lane(low)), exp(Real::lane(a), Real::lane(0.0)));
            prop_assert_eq!(Real::first(n), Real::first(m));
            let change = (Real::first(p.hi - q.hi) + Real::first(p.lo - q.lo)) / Real::first(q.hi);
            prop_assert!((change - low).abs() < BOUND);
        }

        #[test]
        fn the_squares_of_cosine_and_sine_add_to_one(b in -8e6..8e6_f64) {
            let Reduced { cosine: c, sine: s, .. } = cos_sin(Real::lane(b), Real::lane(0.0));
            prop_assert!(beside_one(c.times(c).plus(s.times(s))) < BOUND);
        }

        #[test]
        fn first_words_agree_with_the_library(a in -700.0..700.0_f64, b in -1e3..1e3_f64) {
            let (factor, n) = exp(Real::lane(a), Real::lane(0.0));
            let near = |x: f64, y: f64| (x - y).abs() <= 2.0 * f64::EPSILON * y.abs();
            prop_assert!(near(Real::first(factor.hi * n.power_of_two()), libm::exp(a)));
            let reduced = cos_sin(Real::lane(b), Real::lane(0.0));
            let conjugate = Complex::new(reduced.cosine.hi, -reduced.sine.hi);
            let z = turned_back(conjugate, reduced.quarters);
            prop_assert!(near(Real::first(z.re), libm::cos(b)) && near(Real::first(-z.im), libm::sin(b)));
        }

        #[test]
        fn rough_ones_are_as_good_as_they_say(x in -700.0..700.0_f64, angle in -3.1..3.1_f64) {
            prop_assert!((Real::first(rough_log(Real::lane(x.exp()))) - x).abs() < 3e-7);
            let z = Complex::new(Real::lane(angle.cos() * 7.0), Real::lane(angle.sin() * 7.0));
            prop_assert!((Real::first(rough_angle(z)) - angle).abs() < 5e-6);
        }
    }
}
