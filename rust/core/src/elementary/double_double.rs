//! Double-double arithmetic: sums of two doubles as one number of 106 bits.
//!
//! A number is `high + low`, high being the double nearest to the sum. With u = 2⁻⁵³ the bounds of
//! Joldes, Muller & Popescu (2017, ACM Trans. Math. Softw. 44) hold, relative to the exact result:
//! sum of two numbers 3.1 u² (their algorithm 6), with a double 2 u² (algorithm 4), product 7 u²
//! (algorithm 10), with a double 2 u² (algorithm 7). They assume that nothing overflows; where a
//! low word underflows, there is a further error of 2⁻¹⁰⁷⁴. Products are made exact by splitting
//! (Dekker 1971) and not by fused operations. The double-doubles of `simd`, for kernels, use fused
//! operations and normalise less often.

use std::ops::{Add, Mul, Neg, Sub};

/// 2²⁷ + 1 splits a double into halves of 26 bits.
const SPLITTER: f64 = 134_217_729.0;

/// A double-double.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct DoubleDouble {
    /// The double nearest to the number.
    pub high: f64,
    /// The remainder.
    pub low: f64,
}

/// a + b without error (Knuth 1969).
#[inline(always)]
fn two_sum(a: f64, b: f64) -> DoubleDouble {
    let high = a + b;
    let from_b = high - a;
    let low = (a - (high - from_b)) + (b - from_b);
    DoubleDouble { high, low }
}

/// a + b without error for |a| ≥ |b| (Dekker 1971).
#[inline(always)]
fn ordered_sum(a: f64, b: f64) -> DoubleDouble {
    let high = a + b;
    DoubleDouble::new(high, b - (high - a))
}

/// a b without error, up to 2⁹⁹⁵.
#[inline(always)]
fn two_product(a: f64, b: f64) -> DoubleDouble {
    let halves = |x: f64| {
        let large = SPLITTER * x;
        let upper = large - (large - x);
        (upper, x - upper)
    };
    let high = a * b;
    let ((a1, a2), (b1, b2)) = (halves(a), halves(b));
    let low = ((a1 * b1 - high) + a1 * b2 + a2 * b1) + a2 * b2;
    DoubleDouble { high, low }
}

impl DoubleDouble {
    /// One.
    pub const ONE: Self = Self::new(1.0, 0.0);

    /// `high + low`, |low| being at most half an ulp of `high`.
    pub const fn new(high: f64, low: f64) -> Self {
        Self { high, low }
    }

    /// a − b without error.
    ///
    /// ```
    /// use deadtime::elementary::DoubleDouble;
    /// let difference = DoubleDouble::difference(1.0, 1e-20);
    /// assert_eq!((difference.high, difference.low), (1.0, -1e-20));
    /// ```
    #[inline(always)]
    pub fn difference(a: f64, b: f64) -> Self {
        two_sum(a, -b)
    }

    /// a b without error, up to 2⁹⁹⁵.
    #[inline(always)]
    pub fn product(a: f64, b: f64) -> Self {
        two_product(a, b)
    }

    /// Divided by a double: 3 u² (algorithm 15).
    #[inline(always)]
    pub fn over(self, divisor: f64) -> Self {
        let high = self.high / divisor;
        let p = two_product(high, divisor);
        let rest = ((self.high - p.high) - p.low) + self.low;
        ordered_sum(high, rest / divisor)
    }

    /// Multiplied by a power of two, exactly unless it underflows.
    #[inline(always)]
    pub fn scaled(self, power: f64) -> Self {
        Self::new(self.high * power, self.low * power)
    }
}

impl From<f64> for DoubleDouble {
    fn from(high: f64) -> Self {
        Self::new(high, 0.0)
    }
}

impl Neg for DoubleDouble {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self::new(-self.high, -self.low)
    }
}

impl Add for DoubleDouble {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        let s = two_sum(self.high, other.high);
        let t = two_sum(self.low, other.low);
        let v = ordered_sum(s.high, s.low + t.high);
        ordered_sum(v.high, t.low + v.low)
    }
}

impl Sub for DoubleDouble {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Add<f64> for DoubleDouble {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: f64) -> Self {
        let s = two_sum(self.high, other);
        ordered_sum(s.high, self.low + s.low)
    }
}

impl Mul for DoubleDouble {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        let p = two_product(self.high, other.high);
        let cross = self.high * other.low + self.low * other.high;
        ordered_sum(p.high, p.low + cross)
    }
}

impl Mul<f64> for DoubleDouble {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: f64) -> Self {
        let p = two_product(self.high, other);
        let c = ordered_sum(p.high, self.low * other);
        ordered_sum(c.high, p.low + c.low)
    }
}
