//! The last step: a residual in double-double arithmetic and one step of fourth order.
//!
//! With t = z e^-w the residual d = t - w is formed from t as a double-double, so that its error is
//! 2^-61 |w| rather than 2^-53 |w|. The Taylor series of the solution in d gives the correction of
//! w. Truncated after the fourth power it has an error below 1e-17 |w| for the starting values of
//! `guess`; the remaining errors are the rounding of the result and 2^-61 / |1 + w|.

use crate::simd::{Complex, Real, Simd};

use super::elementary::{Reduced, cos_sin, exp, turned_back};
use crate::simd::double_double::DoubleDouble;

/// 2^64 makes a subnormal number normal.
pub(super) const SCALE_LIFT: f64 = 18_446_744_073_709_551_616.0;

/// A complex number as (re + i im) 2^exponent, its larger component in [1, 2).
#[derive(Debug, Clone, Copy)]
pub(super) struct Scaled<S: Simd> {
    pub(super) value: Complex<S>,
    pub(super) exponent: Real<S>,
    /// The low word of the real part, where there is one.
    pub(super) low: Option<Real<S>>,
}

impl<S: Simd> Scaled<S> {
    /// Split off the exponent of finite numbers that are not zero.
    #[inline(always)]
    pub(super) fn new(z: Complex<S>) -> Self {
        let largest = z.re.abs().larger(z.im.abs());
        // The exponent of a subnormal number is read after the number was scaled to a normal one.
        let subnormal = largest.lt(f64::MIN_POSITIVE);
        let one = largest.constant(1.0);
        let lifted = subnormal.select(SCALE_LIFT, one);
        let lift = subnormal.select(64.0, one.constant(0.0));
        let exponent = (largest * lifted).binade().exponent();
        // 2^-1023 would be subnormal.
        let factor = (-exponent.smaller(1022.0)).power_of_two();
        Self {
            value: z.scaled(lifted).scaled(factor),
            exponent: exponent.smaller(1022.0) - lift,
            low: None,
        }
    }

    /// A power of two.
    #[inline(always)]
    pub(super) fn power(exponent: Real<S>) -> Self {
        let (one, zero) = (exponent.constant(1.0), exponent.constant(0.0));
        Self {
            value: Complex::new(one, zero),
            exponent,
            low: None,
        }
    }

    /// The same with a low word of the real part, in units of the number itself (which is not
    /// subnormal).
    #[inline(always)]
    pub(super) fn with_low(self, low: Option<Real<S>>) -> Self {
        match low {
            None => self,
            Some(low) => Self {
                low: Some(low * (-self.exponent).power_of_two()),
                ..self
            },
        }
    }
}

/// A complex number whose components are double-doubles.
#[derive(Debug, Clone, Copy)]
pub(super) struct TwoWordComplex<S: Simd> {
    pub(super) re: DoubleDouble<S>,
    pub(super) im: DoubleDouble<S>,
}

/// `z e^-w`, to 2^-61 of its modulus; `low` holds low words of w, where there are any.
#[inline(always)]
pub(super) fn product_with_exp<S: Simd>(
    z: Scaled<S>,
    w: Complex<S>,
    low: Option<Complex<S>>,
) -> TwoWordComplex<S> {
    let zero = w.re.constant(0.0);
    let low = low.unwrap_or(Complex::new(zero, zero));
    let (modulus, exponent) = exp(-w.re, -low.re);
    let modulus = modulus.scaled((exponent + z.exponent).power_of_two());
    let Reduced {
        cosine,
        sine,
        quarters,
    } = cos_sin(w.im, low.im);
    let turned = turned_back(z.value, quarters);
    let mut re = cosine
        .times_word(turned.re)
        .plus(sine.times_word(turned.im));
    let mut im = cosine
        .times_word(turned.im)
        .plus(sine.times_word(-turned.re));
    if let Some(low) = z.low {
        let low = turned_back(Complex::new(low, low.constant(0.0)), quarters);
        re.lo = re.lo + low.re.mul_add(cosine.hi, low.im * sine.hi);
        im.lo = im.lo + low.im.mul_sub(cosine.hi, low.re * sine.hi);
    }
    TwoWordComplex {
        re: re.times(modulus),
        im: im.times(modulus),
    }
}

impl<S: Simd> TwoWordComplex<S> {
    /// `self - w`, for a `w` close to `self`.
    #[inline(always)]
    pub(super) fn less(self, w: Complex<S>) -> Complex<S> {
        Complex::new(
            (self.re.hi - w.re) + self.re.lo,
            (self.im.hi - w.im) + self.im.lo,
        )
    }
}

/// The step of Fritsch, Shafer & Crowley (1973, CACM 16, eq. 5) from `w` with
/// `r = log(z/w) - w`.
#[inline(always)]
pub(super) fn fritsch_step<S: Simd>(w: Complex<S>, r: Complex<S>) -> Complex<S> {
    let one_plus_w = w.shifted(1.0);
    let q = one_plus_w.scaled(2.0) * (one_plus_w + r.scaled(2.0 / 3.0));
    w + ((w * r) * (q - r)).over(one_plus_w * (q - r.scaled(2.0)))
}

/// What to add to `w`, which may be small, given `d = z e^-w - w`.
///
/// With eta = d/w, r = log(1 + eta) and u = 1 + w, the solution moves by
/// w (r/u + r^2/(2 u^3) + (1 - 2 w) r^3/(6 u^5) + (6 w^2 - 8 w + 1) r^4/(24 u^7) + …), the Taylor
/// series of dw/dr = w/u. In powers of eta this is d/u times a cubic whose coefficients are
/// polynomials in v = 1/u. All of them, and both divisions, are computed before d is known.
#[inline(always)]
pub(super) fn correction<S: Simd>(w: Complex<S>, d: Complex<S>) -> Complex<S> {
    let v = w.shifted(1.0).inverse();
    let square = v * v;
    let first = square.affine(0.5, -0.5);
    let second = v
        .affine(0.5, -1.0 / 3.0)
        .mul_add(v, -0.5)
        .mul_add(square, 1.0 / 3.0);
    let third = v
        .affine(0.625, -5.0 / 6.0)
        .mul_add(v, -0.5)
        .mul_add(v, 0.5)
        .mul_add(v, 11.0 / 24.0)
        .mul_add(square, -0.25);
    let eta = d * w.inverse();
    // Of the next coefficient the constant term is sufficient.
    let third = third + eta.scaled(0.2);
    let series = (third * eta + second) * eta + first;
    (d * v) * series.mul_add(eta, 1.0)
}
