//! The last step: a residual in two words and one step of fourth order.
//!
//! With t = z e^-w the residual d = t - w is formed from t in two words, so its error is 2^-63 |w|
//! rather than 2^-53 |w|, and the step of Fritsch, Shafer & Crowley (1973, CACM 16, eq. 5) on
//! r = log(t/w) = log(1 + d/w) carries it to w. The step leaves the relative error
//! |2 w^2 - 8 w - 1| / (72 |1 + w|^6) r^4, below 1e-17 for the starting values of `guess`; what remains
//! is the rounding of the result and 2^-63 / |1 + w|.

use crate::lanes::{Complex, Real, Simd};

use super::elementary::{cos_sin, exp};
use super::two_word::TwoWord;

/// A complex number as (re + i im) 2^exponent, its larger component in [1, 2).
#[derive(Debug, Clone, Copy)]
pub(super) struct Scaled<S: Simd> {
    pub(super) value: Complex<S>,
    pub(super) exponent: Real<S>,
}

impl<S: Simd> Scaled<S> {
    /// Split off the exponent of finite numbers that are not zero.
    #[inline(always)]
    pub(super) fn new(z: Complex<S>) -> Self {
        let largest = z.re.abs().larger(z.im.abs());
        // A subnormal number has no exponent of its own: bring it among the normal ones first.
        let subnormal = largest.lt(f64::MIN_POSITIVE);
        let one = largest.constant(1.0);
        let lifted = subnormal.select(18_446_744_073_709_551_616.0, one);
        let lift = subnormal.select(64.0, one.constant(0.0));
        let exponent = (largest * lifted).binade().exponent();
        // 2^-1023 would be subnormal.
        let factor = (-exponent.smaller(1022.0)).power_of_two();
        Self {
            value: z.scaled(lifted).scaled(factor),
            exponent: exponent.smaller(1022.0) - lift,
        }
    }
}

/// A complex number whose components have two words.
#[derive(Debug, Clone, Copy)]
pub(super) struct TwoWordComplex<S: Simd> {
    pub(super) re: TwoWord<S>,
    pub(super) im: TwoWord<S>,
}

/// `z e^-w`, to 2^-63 of its modulus.
#[inline(always)]
pub(super) fn product_with_exp<S: Simd>(z: Scaled<S>, w: Complex<S>) -> TwoWordComplex<S> {
    let (modulus, exponent) = exp(-w.re, w.re.constant(0.0));
    let (cosine, sine) = cos_sin(w.im);
    let power = (exponent + z.exponent).power_of_two();
    let (z, negated) = (z.value, -z.value.re);
    let re = cosine.times_word(z.re).plus(sine.times_word(z.im));
    let im = cosine.times_word(z.im).plus(sine.times_word(negated));
    TwoWordComplex {
        re: re.times(modulus).scaled(power),
        im: im.times(modulus).scaled(power),
    }
}

impl<S: Simd> TwoWordComplex<S> {
    /// `self - w`, for a `w` that is near.
    #[inline(always)]
    pub(super) fn less(self, w: Complex<S>) -> Complex<S> {
        Complex::new(
            (self.re.hi - w.re) + self.re.lo,
            (self.im.hi - w.im) + self.im.lo,
        )
    }
}

/// The step from `w` with `r = log(z/w) - w`.
#[inline(always)]
pub(super) fn fritsch_step<S: Simd>(w: Complex<S>, r: Complex<S>) -> Complex<S> {
    let one_plus_w = w.shifted(1.0);
    let q = one_plus_w.scaled(2.0) * (one_plus_w + r.scaled(2.0 / 3.0));
    w + ((w * r) * (q - r)).over(one_plus_w * (q - r.scaled(2.0)))
}

/// What to add to `w`, which may be small, given `d = z e^-w - w`.
#[inline(always)]
pub(super) fn correction<S: Simd>(w: Complex<S>, d: Complex<S>) -> Complex<S> {
    let eta = d.over(w);
    // log(1 + eta)/eta; the next term is below 1e-18 for |eta| < 5e-4.
    let mut series = Complex::new(eta.re.constant(0.2), eta.re.constant(0.0));
    for coefficient in [-0.25, 1.0 / 3.0, -0.5, 1.0] {
        series = (series * eta).shifted(coefficient);
    }
    let r = eta * series;
    let one_plus_w = w.shifted(1.0);
    let q = one_plus_w.scaled(2.0) * (one_plus_w + r.scaled(2.0 / 3.0));
    ((d * series) * (q - r)).over(one_plus_w * (q - r.scaled(2.0)))
}
