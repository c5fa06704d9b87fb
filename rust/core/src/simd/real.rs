//! Real numbers in lanes, and the masks that comparisons give.

use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

use pulp::Simd;
use pulp::bytemuck::{cast_slice, cast_slice_mut};

/// One double in each lane of two vectors.
///
/// A kernel is one long chain of dependent operations; while one vector waits for a result, the
/// other one proceeds. It begins with a line of the cache: the widest vectors, as long as a line, would
/// else be read from two.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub(crate) struct Real<S: Simd> {
    pub(super) simd: S,
    pub(super) lanes: [S::f64s; 2],
}

/// Two vectors.
pub(crate) type Lanes<S> = [<S as Simd>::f64s; 2];

/// The numbers of vectors one after the other.
#[inline(always)]
pub(crate) fn flat<S: Simd>(lanes: &[Lanes<S>]) -> &[f64] {
    cast_slice(lanes.as_flattened())
}

/// The same for writing.
#[inline(always)]
pub(crate) fn flat_mut<S: Simd>(lanes: &mut [Lanes<S>]) -> &mut [f64] {
    cast_slice_mut(lanes.as_flattened_mut())
}

/// A truth value for each lane.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Mask<S: Simd> {
    simd: S,
    lanes: [S::m64s; 2],
}

/// A method that compares lane by lane.
macro_rules! comparison {
    ($name:ident, $lanes:ident) => {
        #[inline(always)]
        pub(crate) fn $name(self, other: impl Operand<S>) -> Mask<S> {
            let ([a, b], [c, d]) = (self.lanes, other.spread(self).lanes);
            let simd = self.simd;
            Mask::new(simd, [simd.$lanes(a, c), simd.$lanes(b, d)])
        }
    };
}

impl<S: Simd> Real<S> {
    #[inline(always)]
    pub(crate) fn new(simd: S, lanes: [S::f64s; 2]) -> Self {
        Self { simd, lanes }
    }

    /// The same number in every lane.
    #[inline(always)]
    pub(crate) fn splat(simd: S, value: f64) -> Self {
        Self::new(simd, [simd.splat_f64s(value); 2])
    }

    /// The instructions that compute with it.
    #[inline(always)]
    pub(crate) fn simd(self) -> S {
        self.simd
    }

    #[inline(always)]
    pub(crate) fn lanes(self) -> [S::f64s; 2] {
        self.lanes
    }

    /// The lanes one after the other.
    #[inline(always)]
    pub(crate) fn numbers(&self) -> &[f64] {
        cast_slice(&self.lanes)
    }

    /// The same for writing.
    #[inline(always)]
    pub(crate) fn numbers_mut(&mut self) -> &mut [f64] {
        cast_slice_mut(&mut self.lanes)
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
        let ([a, b], [c, d], [e, f]) = (self.lanes, factor.lanes, summand.lanes);
        let simd = self.simd;
        Self::new(
            simd,
            [simd.mul_add_f64s(a, c, e), simd.mul_add_f64s(b, d, f)],
        )
    }

    /// `summand - self * factor`, rounded once.
    #[inline(always)]
    pub(crate) fn negated_mul_add(self, factor: impl Operand<S>, summand: impl Operand<S>) -> Self {
        let (factor, summand) = (factor.spread(self), summand.spread(self));
        let ([a, b], [c, d], [e, f]) = (self.lanes, factor.lanes, summand.lanes);
        let simd = self.simd;
        let first = simd.negate_mul_add_f64s(a, c, e);
        Self::new(simd, [first, simd.negate_mul_add_f64s(b, d, f)])
    }

    /// `self * factor - subtrahend`, rounded once.
    #[inline(always)]
    pub(crate) fn mul_sub(self, factor: impl Operand<S>, subtrahend: impl Operand<S>) -> Self {
        let subtrahend = subtrahend.spread(self);
        self.mul_add(factor, -subtrahend)
    }

    #[inline(always)]
    pub(crate) fn sqrt(self) -> Self {
        let [a, b] = self.lanes;
        Self::new(self.simd, [self.simd.sqrt_f64s(a), self.simd.sqrt_f64s(b)])
    }

    comparison!(lt, less_than_f64s);
    comparison!(le, less_than_or_equal_f64s);
    comparison!(eq, equal_f64s);

    #[inline(always)]
    pub(crate) fn gt(self, other: impl Operand<S>) -> Mask<S> {
        other.spread(self).lt(self)
    }

    #[inline(always)]
    pub(crate) fn ge(self, other: impl Operand<S>) -> Mask<S> {
        other.spread(self).le(self)
    }

    /// The larger of two numbers neither of which is NaN; of two zeros, either.
    #[inline(always)]
    pub(crate) fn max(self, other: Self) -> Self {
        let ([a, b], [c, d]) = (self.lanes, other.lanes);
        Self::new(
            self.simd,
            [self.simd.max_f64s(a, c), self.simd.max_f64s(b, d)],
        )
    }

    /// The smaller of two numbers neither of which is NaN; of two zeros, either.
    #[inline(always)]
    pub(crate) fn min(self, other: Self) -> Self {
        let ([a, b], [c, d]) = (self.lanes, other.lanes);
        Self::new(
            self.simd,
            [self.simd.min_f64s(a, c), self.simd.min_f64s(b, d)],
        )
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

/// The second operand of an operation with a [`Real`]: another one, or one number for every lane.
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

/// An operator that acts lane by lane.
macro_rules! operator {
    ($trait:ident, $name:ident, $lanes:ident) => {
        impl<S: Simd, T: Operand<S>> $trait<T> for Real<S> {
            type Output = Self;

            #[inline(always)]
            fn $name(self, other: T) -> Self {
                let ([a, b], [c, d]) = (self.lanes, other.spread(self).lanes);
                let simd = self.simd;
                Self::new(simd, [simd.$lanes(a, c), simd.$lanes(b, d)])
            }
        }
    };
}
operator!(Add, add, add_f64s);
operator!(Sub, sub, sub_f64s);
operator!(Mul, mul, mul_f64s);
operator!(Div, div, div_f64s);

impl<S: Simd> Neg for Real<S> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        let [a, b] = self.lanes;
        Self::new(self.simd, [self.simd.neg_f64s(a), self.simd.neg_f64s(b)])
    }
}

impl<S: Simd> Mask<S> {
    #[inline(always)]
    pub(super) fn new(simd: S, lanes: [S::m64s; 2]) -> Self {
        Self { simd, lanes }
    }

    /// In each lane `yes` where the mask is true, `no` elsewhere.
    #[inline(always)]
    pub(crate) fn select(self, yes: impl Operand<S>, no: Real<S>) -> Real<S> {
        let yes = yes.spread(no);
        let ([a, b], [c, d], [e, f]) = (self.lanes, yes.lanes, no.lanes);
        let simd = self.simd;
        Real::new(simd, [simd.select_f64s(a, c, e), simd.select_f64s(b, d, f)])
    }

    /// Is it true in any lane?
    #[inline(always)]
    pub(crate) fn any(self) -> bool {
        let [a, b] = self.lanes;
        let either = self.simd.or_m64s(a, b);
        if const { size_of::<S::m64s>() < size_of::<f64>() } {
            // One bit for each lane, in one small register.
            return self.simd.first_true_m64s(either) != S::F64_LANES;
        }
        // Combining words into one compiles to a single test; searching them does not.
        let (yes, no) = (self.simd.splat_u64s(1), self.simd.splat_u64s(0));
        let marks = [self.simd.select_u64s(either, yes, no)];
        let words: &[u64] = cast_slice(&marks);
        words.iter().fold(0, |any, word| any | word) != 0
    }
}

impl<S: Simd> Mask<S> {
    /// The lanes in which it is true.
    #[inline(always)]
    pub(crate) fn lanes(self) -> impl Iterator<Item = usize> {
        let marks = self.select(1.0, Real::splat(self.simd, 0.0));
        let is_true = move |&lane: &usize| marks.numbers().get(lane).is_some_and(|&m| m > 0.0);
        (0..2 * S::F64_LANES).filter(is_true)
    }
}

impl<S: Simd> BitAnd for Mask<S> {
    type Output = Self;

    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        let ([a, b], [c, d]) = (self.lanes, other.lanes);
        let simd = self.simd;
        Self::new(simd, [simd.and_m64s(a, c), simd.and_m64s(b, d)])
    }
}

impl<S: Simd> BitOr for Mask<S> {
    type Output = Self;

    #[inline(always)]
    fn bitor(self, other: Self) -> Self {
        let ([a, b], [c, d]) = (self.lanes, other.lanes);
        let simd = self.simd;
        Self::new(simd, [simd.or_m64s(a, c), simd.or_m64s(b, d)])
    }
}

impl<S: Simd> Not for Mask<S> {
    type Output = Self;

    #[inline(always)]
    fn not(self) -> Self {
        let [a, b] = self.lanes;
        Self::new(self.simd, [self.simd.not_m64s(a), self.simd.not_m64s(b)])
    }
}

#[cfg(test)]
impl Real<pulp::Scalar> {
    /// The same number in every lane.
    pub(crate) fn lane(value: f64) -> Self {
        Self::splat(pulp::Scalar, value)
    }

    /// The number in the first lane.
    pub(crate) fn first(self) -> f64 {
        self.numbers().first().copied().unwrap_or(f64::NAN)
    }
}
