//! Real numbers in lanes, and the masks that comparisons give.

use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

use pulp::Simd;

/// One double in each lane.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Real<S: Simd> {
    pub(super) simd: S,
    pub(super) lanes: S::f64s,
}

/// A truth value for each lane.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Mask<S: Simd> {
    simd: S,
    lanes: S::m64s,
}

impl<S: Simd> Real<S> {
    #[inline(always)]
    pub(crate) fn new(simd: S, lanes: S::f64s) -> Self {
        Self { simd, lanes }
    }

    /// The same number in every lane.
    #[inline(always)]
    pub(crate) fn splat(simd: S, value: f64) -> Self {
        Self::new(simd, simd.splat_f64s(value))
    }

    #[inline(always)]
    pub(crate) fn lanes(self) -> S::f64s {
        self.lanes
    }

    /// `value` in every lane, for the instruction set of `self`.
    #[inline(always)]
    pub(crate) fn constant(self, value: f64) -> Self {
        Self::splat(self.simd, value)
    }

    /// `self * factor + summand`, rounded once.
    #[inline(always)]
    pub(crate) fn mul_add(self, factor: impl Operand<S>, summand: impl Operand<S>) -> Self {
        let (factor, summand) = (factor.spread(self), summand.spread(self));
        Self::new(
            self.simd,
            self.simd
                .mul_add_e_f64s(self.lanes, factor.lanes, summand.lanes),
        )
    }

    /// `summand - self * factor`, rounded once.
    #[inline(always)]
    pub(crate) fn negated_mul_add(self, factor: impl Operand<S>, summand: impl Operand<S>) -> Self {
        let (factor, summand) = (factor.spread(self), summand.spread(self));
        Self::new(
            self.simd,
            self.simd
                .negate_mul_add_e_f64s(self.lanes, factor.lanes, summand.lanes),
        )
    }

    /// `self * factor - subtrahend`, rounded once.
    #[inline(always)]
    pub(crate) fn mul_sub(self, factor: impl Operand<S>, subtrahend: impl Operand<S>) -> Self {
        let subtrahend = subtrahend.spread(self);
        self.mul_add(factor, -subtrahend)
    }

    #[inline(always)]
    pub(crate) fn sqrt(self) -> Self {
        Self::new(self.simd, self.simd.sqrt_f64s(self.lanes))
    }

    #[inline(always)]
    pub(crate) fn lt(self, other: impl Operand<S>) -> Mask<S> {
        let lanes = self
            .simd
            .less_than_f64s(self.lanes, other.spread(self).lanes);
        Mask::new(self.simd, lanes)
    }

    #[inline(always)]
    pub(crate) fn le(self, other: impl Operand<S>) -> Mask<S> {
        let lanes = self
            .simd
            .less_than_or_equal_f64s(self.lanes, other.spread(self).lanes);
        Mask::new(self.simd, lanes)
    }

    #[inline(always)]
    pub(crate) fn gt(self, other: impl Operand<S>) -> Mask<S> {
        other.spread(self).lt(self)
    }

    #[inline(always)]
    pub(crate) fn ge(self, other: impl Operand<S>) -> Mask<S> {
        other.spread(self).le(self)
    }

    #[inline(always)]
    pub(crate) fn eq(self, other: impl Operand<S>) -> Mask<S> {
        let lanes = self.simd.equal_f64s(self.lanes, other.spread(self).lanes);
        Mask::new(self.simd, lanes)
    }

    /// The larger of two numbers neither of which is NaN.
    #[inline(always)]
    pub(crate) fn larger(self, other: impl Operand<S>) -> Self {
        let other = other.spread(self);
        self.gt(other).select(self, other)
    }

    /// The smaller of two numbers neither of which is NaN.
    #[inline(always)]
    pub(crate) fn smaller(self, other: impl Operand<S>) -> Self {
        let other = other.spread(self);
        self.lt(other).select(self, other)
    }
}

/// What stands beside a [`Real`] in an operation: another one, or a number for every lane.
pub(crate) trait Operand<S: Simd>: Copy {
    fn spread(self, like: Real<S>) -> Real<S>;
}

impl<S: Simd> Operand<S> for Real<S> {
    #[inline(always)]
    fn spread(self, _: Real<S>) -> Real<S> {
        self
    }
}

impl<S: Simd> Operand<S> for f64 {
    #[inline(always)]
    fn spread(self, like: Real<S>) -> Real<S> {
        like.constant(self)
    }
}

impl<S: Simd, T: Operand<S>> Add<T> for Real<S> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: T) -> Self {
        let other = other.spread(self);
        Self::new(self.simd, self.simd.add_f64s(self.lanes, other.lanes))
    }
}

impl<S: Simd, T: Operand<S>> Sub<T> for Real<S> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: T) -> Self {
        let other = other.spread(self);
        Self::new(self.simd, self.simd.sub_f64s(self.lanes, other.lanes))
    }
}

impl<S: Simd, T: Operand<S>> Mul<T> for Real<S> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: T) -> Self {
        let other = other.spread(self);
        Self::new(self.simd, self.simd.mul_f64s(self.lanes, other.lanes))
    }
}

impl<S: Simd, T: Operand<S>> Div<T> for Real<S> {
    type Output = Self;

    #[inline(always)]
    fn div(self, other: T) -> Self {
        let other = other.spread(self);
        Self::new(self.simd, self.simd.div_f64s(self.lanes, other.lanes))
    }
}

impl<S: Simd> Neg for Real<S> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self::new(self.simd, self.simd.neg_f64s(self.lanes))
    }
}

impl<S: Simd> Mask<S> {
    #[inline(always)]
    pub(super) fn new(simd: S, lanes: S::m64s) -> Self {
        Self { simd, lanes }
    }

    /// Lane by lane: `yes` where true, `no` elsewhere.
    #[inline(always)]
    pub(crate) fn select(self, yes: impl Operand<S>, no: Real<S>) -> Real<S> {
        let yes = yes.spread(no);
        Real::new(
            self.simd,
            self.simd.select_f64s(self.lanes, yes.lanes, no.lanes),
        )
    }

    /// Is it true in any lane?
    #[inline(always)]
    pub(crate) fn any(self) -> bool {
        self.simd.first_true_m64s(self.lanes) != S::F64_LANES
    }
}

impl<S: Simd> BitAnd for Mask<S> {
    type Output = Self;

    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        Self::new(self.simd, self.simd.and_m64s(self.lanes, other.lanes))
    }
}

impl<S: Simd> BitOr for Mask<S> {
    type Output = Self;

    #[inline(always)]
    fn bitor(self, other: Self) -> Self {
        Self::new(self.simd, self.simd.or_m64s(self.lanes, other.lanes))
    }
}

impl<S: Simd> Not for Mask<S> {
    type Output = Self;

    #[inline(always)]
    fn not(self) -> Self {
        Self::new(self.simd, self.simd.not_m64s(self.lanes))
    }
}
