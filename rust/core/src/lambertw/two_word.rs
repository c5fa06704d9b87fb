//! Sums of two words: a value as `hi + lo` with `|lo|` at most half an ulp of `hi`.
//!
//! Sums and products of doubles leave an error that is itself a double (Møller 1965, Knuth 1969,
//! Dekker 1971). The product is split after Dekker and needs no fused multiply-add; where one is
//! used instead, the bits are the same, because both give the exact error. Relative error of
//! every operation here: a few 2^-104, provided nothing underflows and no factor exceeds 2^996.

/// An unevaluated sum `hi + lo`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct TwoWord {
    pub(super) hi: f64,
    pub(super) lo: f64,
}

/// `a + b` without loss.
#[inline(always)]
pub(super) fn sum(a: f64, b: f64) -> TwoWord {
    let hi = a + b;
    let from_b = hi - a;
    let from_a = hi - from_b;
    TwoWord {
        hi,
        lo: (a - from_a) + (b - from_b),
    }
}

/// `a + b` without loss when `|a| >= |b|` or `a == 0`.
#[inline(always)]
pub(super) fn ordered_sum(a: f64, b: f64) -> TwoWord {
    let hi = a + b;
    TwoWord {
        hi,
        lo: b - (hi - a),
    }
}

/// Two halves of at most 26 bits each.
#[inline(always)]
fn halves(a: f64) -> (f64, f64) {
    const SPLITTER: f64 = 134_217_729.0; // 2^27 + 1
    let wide = SPLITTER * a;
    let upper = wide - (wide - a);
    (upper, a - upper)
}

/// `a * b` without loss.
#[inline(always)]
pub(super) fn product(a: f64, b: f64) -> TwoWord {
    let hi = a * b;
    let (a_upper, a_lower) = halves(a);
    let (b_upper, b_lower) = halves(b);
    let lo =
        a_lower * b_lower - (((hi - a_upper * b_upper) - a_lower * b_upper) - a_upper * b_lower);
    TwoWord { hi, lo }
}

impl TwoWord {
    #[inline(always)]
    pub(super) const fn new(hi: f64, lo: f64) -> Self {
        Self { hi, lo }
    }

    #[inline(always)]
    pub(super) fn negated(self) -> Self {
        Self::new(-self.hi, -self.lo)
    }

    #[inline(always)]
    pub(super) fn plus(self, other: Self) -> Self {
        let high = sum(self.hi, other.hi);
        let low = sum(self.lo, other.lo);
        let joined = ordered_sum(high.hi, high.lo + low.hi);
        ordered_sum(joined.hi, joined.lo + low.lo)
    }

    /// `self + other` for an `other` that is not larger than `self`.
    #[inline(always)]
    pub(super) fn plus_smaller(self, other: Self) -> Self {
        let high = ordered_sum(self.hi, other.hi);
        ordered_sum(high.hi, high.lo + (self.lo + other.lo))
    }

    #[inline(always)]
    pub(super) fn times(self, other: Self) -> Self {
        let high = product(self.hi, other.hi);
        ordered_sum(high.hi, high.lo + (self.hi * other.lo + self.lo * other.hi))
    }

    #[inline(always)]
    pub(super) fn times_word(self, b: f64) -> Self {
        let high = product(self.hi, b);
        ordered_sum(high.hi, high.lo + self.lo * b)
    }

    /// Multiplied by a power of two.
    #[inline(always)]
    pub(super) fn scaled(self, power: f64) -> Self {
        Self::new(self.hi * power, self.lo * power)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_sum_loses_nothing(a in -1e9..1e9_f64, b in -1.0..1.0_f64) {
            // Whole multiples of 2^-60 below 2^30 fit the 128-bit integers used as truth.
            let whole = |x: f64| (x * 2.0_f64.powi(60)) as i128;
            let (a, b) = ((a * 1024.0).round() / 1024.0, (b * 2.0_f64.powi(50)).round() / 2.0_f64.powi(50));
            let s = sum(a, b);
            prop_assert_eq!(whole(s.hi) + whole(s.lo), whole(a) + whole(b));
            prop_assert_eq!(s.hi, a + b);
        }

        #[test]
        fn a_product_loses_nothing(a in 1_u64 << 52..1_u64 << 53, b in 1_u64 << 52..1_u64 << 53) {
            let p = product(a as f64, b as f64);
            prop_assert_eq!(p.hi as i128 + p.lo as i128, i128::from(a) * i128::from(b));
            prop_assert!(p.lo.abs() <= p.hi * f64::EPSILON / 2.0);
        }
    }

    #[test]
    fn two_words_multiply_to_more_than_a_hundred_bits() {
        let third = TwoWord::new(1.0 / 3.0, 1.0 / 3.0 * 2.0_f64.powi(-54));
        let one = third.times_word(3.0);
        assert!(((one.hi - 1.0) + one.lo).abs() < 2.0_f64.powi(-103));
        let ninth = third.times(third).times_word(9.0);
        assert!(((ninth.hi - 1.0) + ninth.lo).abs() < 2.0_f64.powi(-102));
    }
}
