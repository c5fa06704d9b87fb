//! Complex numbers in lanes. The squares of their moduli must be in range.

use std::ops::{Add, Mul, Neg, Sub};

use pulp::Simd;

use super::real::{Mask, Operand, Real};

/// One complex number in each lane.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Complex<S: Simd> {
    pub(crate) re: Real<S>,
    pub(crate) im: Real<S>,
}

impl<S: Simd> Complex<S> {
    #[inline(always)]
    pub(crate) fn new(re: Real<S>, im: Real<S>) -> Self {
        Self { re, im }
    }

    /// The squared modulus.
    #[inline(always)]
    pub(crate) fn square_modulus(self) -> Real<S> {
        self.re.mul_add(self.re, self.im * self.im)
    }

    /// Multiplied by a real number.
    #[inline(always)]
    pub(crate) fn scaled(self, factor: impl Operand<S>) -> Self {
        Self::new(self.re * factor, self.im * factor)
    }

    /// `self * factor + summand` with real factor and summand.
    #[inline(always)]
    pub(crate) fn affine(self, factor: f64, summand: f64) -> Self {
        Self::new(self.re.mul_add(factor, summand), self.im * factor)
    }

    /// With a real number added.
    #[inline(always)]
    pub(crate) fn shifted(self, summand: impl Operand<S>) -> Self {
        Self::new(self.re + summand, self.im)
    }

    /// `1 / self`.
    #[inline(always)]
    pub(crate) fn inverse(self) -> Self {
        let inverse = self.re.constant(1.0) / self.square_modulus();
        Self::new(self.re * inverse, -(self.im * inverse))
    }

    /// `self * factor + summand` with a real summand.
    #[inline(always)]
    pub(crate) fn mul_add(self, factor: Self, summand: impl Operand<S>) -> Self {
        let re = self.im.negated_mul_add(factor.im, summand);
        Self::new(
            self.re.mul_add(factor.re, re),
            self.re.mul_add(factor.im, self.im * factor.re),
        )
    }

    /// `self / divisor`.
    #[inline(always)]
    pub(crate) fn over(self, divisor: Self) -> Self {
        let inverse = divisor.re.constant(1.0) / divisor.square_modulus();
        Self::new(
            self.re.mul_add(divisor.re, self.im * divisor.im) * inverse,
            self.im.mul_sub(divisor.re, self.re * divisor.im) * inverse,
        )
    }

    /// The square root with a real part that is not negative.
    #[inline(always)]
    pub(crate) fn sqrt(self) -> Self {
        // The larger component first, without cancellation; the other by division.
        let modulus = self.square_modulus().sqrt();
        let larger = ((modulus + self.re.abs()) * 0.5).sqrt();
        let smaller = self.im.abs() / (larger + larger);
        // At zero 0/0 would be NaN.
        let smaller = larger.eq(0.0).select(0.0, smaller);
        let right = self.re.ge(0.0);
        let im = right.select(smaller, larger);
        Self::new(right.select(larger, smaller), im.signed(self.im.sign()))
    }

    /// With the imaginary part not negative.
    #[inline(always)]
    pub(crate) fn folded(self) -> Self {
        Self::new(self.re, self.im.abs())
    }
}

impl<S: Simd> Add for Complex<S> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self::new(self.re + other.re, self.im + other.im)
    }
}

impl<S: Simd> Sub for Complex<S> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self::new(self.re - other.re, self.im - other.im)
    }
}

impl<S: Simd> Mul for Complex<S> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self::new(
            self.re.mul_sub(other.re, self.im * other.im),
            self.re.mul_add(other.im, self.im * other.re),
        )
    }
}

impl<S: Simd> Neg for Complex<S> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self::new(-self.re, -self.im)
    }
}

impl<S: Simd> Mask<S> {
    /// In each lane `yes` where the mask is true, `no` elsewhere.
    #[inline(always)]
    pub(crate) fn choose(self, yes: Complex<S>, no: Complex<S>) -> Complex<S> {
        Complex::new(self.select(yes.re, no.re), self.select(yes.im, no.im))
    }
}
