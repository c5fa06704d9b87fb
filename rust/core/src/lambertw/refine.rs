//! The last step: a residual in two words and one step of fourth order.
//!
//! With t = z e^-w the residual d = t - w is formed from t in two words, so its error is 2^-64 |w|
//! rather than 2^-53 |w|, and the step of Fritsch, Shafer & Crowley (1973, CACM 16, eq. 5) on
//! r = log(t/w) = log(1 + d/w) carries it to w. The step leaves the relative error
//! |2 w^2 - 8 w - 1| / (72 |1 + w|^6) r^4, below 1e-17 for the starting values of `guess`; what remains
//! is the rounding of the result and 2^-64 / |1 + w|.

use num_complex::Complex64;

use super::elementary::{cos_sin, exp, power_of_two};
use super::guess::quotient;
use super::two_word::{TwoWord, sum};

/// A complex number as (re + i im) 2^exponent, its larger component in [1, 2).
#[derive(Debug, Clone, Copy)]
pub(super) struct Scaled {
    pub(super) re: f64,
    pub(super) im: f64,
    pub(super) exponent: i32,
}

impl Scaled {
    /// Split off the exponent of a finite number that is not zero.
    #[inline(always)]
    pub(super) fn new(z: Complex64) -> Self {
        let largest = z.re.abs().max(z.im.abs());
        // A subnormal number has no exponent of its own: bring it among the normal ones first.
        let (lift, lifted) = if largest < f64::MIN_POSITIVE {
            (64, power_of_two(64))
        } else {
            (0, 1.0)
        };
        let exponent = (((largest * lifted).to_bits() >> 52) as i32 - 1023).min(1022);
        let factor = power_of_two(-exponent);
        Self {
            re: z.re * lifted * factor,
            im: z.im * lifted * factor,
            exponent: exponent - lift,
        }
    }

    /// `log |z|`.
    #[inline(always)]
    pub(super) fn log_modulus(self) -> f64 {
        f64::from(self.exponent) * std::f64::consts::LN_2
            + 0.5 * libm::log(self.re * self.re + self.im * self.im)
    }
}

/// `z e^-w - w`.
#[inline(always)]
pub(super) fn residual(z: Scaled, w: Complex64) -> Complex64 {
    let (modulus, exponent) = exp(-w.re, 0.0);
    let (cosine, sine) = cos_sin(w.im);
    let (cosine, sine) = (modulus.times(cosine), modulus.times(sine));
    let power = power_of_two(exponent + z.exponent);
    let less = |a: TwoWord, b: TwoWord, w: f64| {
        let high = sum(a.hi, b.hi);
        (high.hi * power - w) + (high.lo + (a.lo + b.lo)) * power
    };
    Complex64::new(
        less(cosine.times_word(z.re), sine.times_word(z.im), w.re),
        less(cosine.times_word(z.im), sine.times_word(-z.re), w.im),
    )
}

/// The step from `w` with `r = log(z/w) - w`.
#[inline(always)]
pub(super) fn fritsch_step(w: Complex64, r: Complex64) -> Complex64 {
    let one_plus_w = w + 1.0;
    let q = (one_plus_w * 2.0) * (one_plus_w + r * (2.0 / 3.0));
    w + quotient((w * r) * (q - r), one_plus_w * (q - r * 2.0))
}

/// What to add to `w`, which may be small, given `d = z e^-w - w`.
#[inline(always)]
pub(super) fn correction(w: Complex64, d: Complex64) -> Complex64 {
    let eta = quotient(d, w);
    // log(1 + eta)/eta; the next term is below 1e-18 for |eta| < 5e-4.
    let series = eta * (eta * (eta * (eta * 0.2 - 0.25) + 1.0 / 3.0) - 0.5) + 1.0;
    let r = eta * series;
    let one_plus_w = w + 1.0;
    let q = (one_plus_w * 2.0) * (one_plus_w + r * (2.0 / 3.0));
    quotient((d * series) * (q - r), one_plus_w * (q - r * 2.0))
}
