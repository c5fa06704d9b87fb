//! Double-double arithmetic in lanes: a value as `hi + lo`, with `lo` at most a few ulps of `hi`.
//!
//! Sums and products of doubles leave an error that is itself a double (Møller 1965, Knuth 1969,
//! Dekker 1971); a fused multiply-add gives the error of a product directly. Low words are summed
//! without normalisation and brought below half an ulp of the high word only by
//! [`DoubleDouble::normalised`]: the relative error of an operation is a few 2^-104 then, and some
//! 2^-100 in a short chain. This holds if nothing underflows or overflows.

use pulp::Simd;

use super::real::Real;

/// An unevaluated sum `hi + lo` in each lane.
#[derive(Debug, Clone, Copy)]
pub(crate) struct DoubleDouble<S: Simd> {
    pub(crate) hi: Real<S>,
    pub(crate) lo: Real<S>,
}

/// A constant as a double-double.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Constant(pub(crate) f64, pub(crate) f64);

/// `a + b` without loss.
#[inline(always)]
pub(crate) fn sum<S: Simd>(a: Real<S>, b: Real<S>) -> DoubleDouble<S> {
    let hi = a + b;
    let from_b = hi - a;
    let from_a = hi - from_b;
    DoubleDouble::new(hi, (a - from_a) + (b - from_b))
}

/// `a + b` without loss when `|a| >= |b|` or `a == 0`.
#[inline(always)]
pub(crate) fn ordered_sum<S: Simd>(a: Real<S>, b: Real<S>) -> DoubleDouble<S> {
    let hi = a + b;
    DoubleDouble::new(hi, b - (hi - a))
}

/// `a * b` without loss.
#[inline(always)]
pub(crate) fn product<S: Simd>(a: Real<S>, b: Real<S>) -> DoubleDouble<S> {
    let hi = a * b;
    DoubleDouble::new(hi, a.mul_sub(b, hi))
}

impl<S: Simd> DoubleDouble<S> {
    #[inline(always)]
    pub(crate) fn new(hi: Real<S>, lo: Real<S>) -> Self {
        Self { hi, lo }
    }

    /// A double as a double-double.
    #[inline(always)]
    pub(crate) fn from_word(hi: Real<S>) -> Self {
        Self::new(hi, hi.constant(0.0))
    }

    #[inline(always)]
    pub(crate) fn negated(self) -> Self {
        Self::new(-self.hi, -self.lo)
    }

    /// The same value with a low word of at most half an ulp of the high word.
    #[inline(always)]
    pub(crate) fn normalised(self) -> Self {
        ordered_sum(self.hi, self.lo)
    }

    #[inline(always)]
    pub(crate) fn plus(self, other: Self) -> Self {
        let high = sum(self.hi, other.hi);
        Self::new(high.hi, high.lo + (self.lo + other.lo))
    }

    /// `constant + self` for a `self` that is not larger.
    #[inline(always)]
    pub(crate) fn added_to(self, constant: Constant) -> Self {
        let high = ordered_sum(self.hi.constant(constant.0), self.hi);
        Self::new(high.hi, high.lo + (self.lo + constant.1))
    }

    #[inline(always)]
    pub(crate) fn times(self, other: Self) -> Self {
        let high = product(self.hi, other.hi);
        let low = self.hi.mul_add(other.lo, high.lo);
        Self::new(high.hi, self.lo.mul_add(other.hi, low))
    }

    #[inline(always)]
    pub(crate) fn times_word(self, b: Real<S>) -> Self {
        let high = product(self.hi, b);
        Self::new(high.hi, self.lo.mul_add(b, high.lo))
    }

    /// Negated where `sign`, which is +0 or -0, has its bit set.
    #[inline(always)]
    pub(crate) fn flipped(self, sign: Real<S>) -> Self {
        Self::new(self.hi.flipped(sign), self.lo.flipped(sign))
    }

    /// Multiplied by a power of two.
    #[inline(always)]
    pub(crate) fn scaled(self, power: Real<S>) -> Self {
        Self::new(self.hi * power, self.lo * power)
    }

    /// The value rounded to a double.
    #[inline(always)]
    pub(crate) fn rounded(self) -> Real<S> {
        self.hi + self.lo
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use pulp::Scalar;

    fn words(value: DoubleDouble<Scalar>) -> (f64, f64) {
        (value.hi.first(), value.lo.first())
    }

    proptest! {
        #[test]
        fn a_sum_loses_nothing(a in -1e9..1e9_f64, b in -1.0..1.0_f64) {
            // Whole multiples of 2^-60 below 2^30 fit the 128-bit integers used as truth.
            let whole = |x: f64| (x * 2.0_f64.powi(60)) as i128;
            let (a, b) = ((a * 1024.0).round() / 1024.0, (b * 2.0_f64.powi(50)).round() / 2.0_f64.powi(50));
            let (hi, lo) = words(sum(Real::lane(a), Real::lane(b)));
            prop_assert_eq!(whole(hi) + whole(lo), whole(a) + whole(b));
            prop_assert_eq!(hi, a + b);
        }

        #[test]
        fn a_product_loses_nothing(a in 1_u64 << 52..1_u64 << 53, b in 1_u64 << 52..1_u64 << 53) {
            let (hi, lo) = words(product(Real::lane(a as f64), Real::lane(b as f64)));
            prop_assert_eq!(hi as i128 + lo as i128, i128::from(a) * i128::from(b));
            prop_assert!(lo.abs() <= hi * f64::EPSILON / 2.0);
        }
    }

    #[test]
    fn two_words_multiply_to_more_than_a_hundred_bits() {
        let third = DoubleDouble::new(
            Real::lane(1.0 / 3.0),
            Real::lane(1.0 / 3.0 * 2.0_f64.powi(-54)),
        );
        let (hi, lo) = words(third.times_word(Real::lane(3.0)));
        assert!(((hi - 1.0) + lo).abs() < 2.0_f64.powi(-103));
        let (hi, lo) = words(third.times(third).times_word(Real::lane(9.0)));
        assert!(((hi - 1.0) + lo).abs() < 2.0_f64.powi(-102));
    }
}
