//! Values of a quasi-polynomial at single points.

use num_complex::Complex64;

use super::jet::modulus;
use super::overflow;
use super::probe::Probe;
use super::quasi_polynomial::QuasiPolynomial;
use crate::elementary::{exp, sin_cos};
use crate::memory::filled;
use crate::parallel;
use crate::{Error, Task};

/// Points in one task of a thread.
const CHUNK: usize = 1024;

/// A value less than this many times its error bound is computed again in double-double arithmetic.
const DROWNED: f64 = 1e6;

/// A value of h without its largest exponential: h(s) = `value` · e^(−s `delay`).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scaled {
    /// g(s) = h(s) e^(s `delay`).
    pub value: Complex64,
    /// The error of `value` is at most this.
    pub error: f64,
    /// Delay of the term that dominates at s, in seconds.
    pub delay: f64,
}

impl QuasiPolynomial {
    /// h(s) without the exponential of its dominating term, with a bound on the error.
    ///
    /// Finite wherever the powers of s are; the bound is NaN or infinite where they are not.
    pub fn scaled_value(&self, s: Complex64) -> Scaled {
        let mut probe = Probe::new(self);
        probe.refer_to_dominant(s);
        let jet = probe.jet(s);
        Scaled {
            value: jet.value,
            error: jet.value_error,
            delay: probe.delay(),
        }
    }

    /// h(s); infinite where it exceeds the range of double precision.
    ///
    /// ```
    /// # use deadtime::quasipoly::QuasiPolynomial;
    /// # use num_complex::Complex64;
    /// let h = QuasiPolynomial::new(vec![vec![0.0, 1.0], vec![1.0]], vec![0.0, 1.0])?;
    /// assert_eq!(h.value(Complex64::new(0.0, 0.0)), Complex64::new(1.0, 0.0));
    /// # Ok::<(), deadtime::Error>(())
    /// ```
    pub fn value(&self, s: Complex64) -> Complex64 {
        let Scaled { value, delay, .. } = self.scaled_value(s);
        if !value.is_finite() && s.is_finite() {
            return overflow::value(self, s);
        }
        if delay == 0.0 {
            return value;
        }
        let (sine, cosine) = sin_cos(delay * s.im);
        let turned = value * Complex64::new(cosine, -sine);
        // In two halves, so that the result overflows only where h itself does.
        let half = exp(-0.5 * delay * s.re);
        let grow = |part: f64| {
            if part == 0.0 {
                part
            } else {
                part * half * half
            }
        };
        Complex64::new(grow(turned.re), grow(turned.im))
    }

    /// h′(s)/h(s), the exponential of the dominating term cancelled: g′/g − τ. Where double
    /// precision does not separate h from zero, it is computed in double-double arithmetic.
    ///
    /// ```
    /// # use deadtime::quasipoly::QuasiPolynomial;
    /// # use num_complex::Complex64;
    /// // (s² + 1)′/(s² + 1) = 2s/(s² + 1)
    /// let h = QuasiPolynomial::new(vec![vec![1.0, 0.0, 1.0]], vec![0.0])?;
    /// assert_eq!(h.logarithmic_derivative(Complex64::ONE), Complex64::ONE);
    /// # Ok::<(), deadtime::Error>(())
    /// ```
    pub fn logarithmic_derivative(&self, s: Complex64) -> Complex64 {
        let mut probe = Probe::new(self);
        probe.refer_to_dominant(s);
        let mut jet = probe.jet(s);
        let drowned = |value, error| modulus(value) < DROWNED * error;
        if drowned(jet.value, jet.value_error) || drowned(jet.slope, jet.slope_error) {
            jet = probe.double_double_jet(s);
        }
        let size = modulus(jet.value);
        (jet.slope / size) * (jet.value.conj() / size) - probe.delay()
    }

    /// h at every point.
    ///
    /// # Errors
    /// [`Error::Interrupted`].
    pub fn values(&self, points: &[Complex64], task: &Task) -> Result<Vec<Complex64>, Error> {
        at_all(points, task, |s| self.value(s))
    }

    /// h′/h at every point.
    ///
    /// # Errors
    /// [`Error::Interrupted`].
    pub fn logarithmic_derivatives(
        &self,
        points: &[Complex64],
        task: &Task,
    ) -> Result<Vec<Complex64>, Error> {
        at_all(points, task, |s| self.logarithmic_derivative(s))
    }
}

fn at_all(
    points: &[Complex64],
    task: &Task,
    value: impl Fn(Complex64) -> Complex64 + Sync,
) -> Result<Vec<Complex64>, Error> {
    const WHAT: &str = "the array of values";
    let mut values = filled(WHAT, Complex64::ZERO, points.len())?;
    let chunks = values.chunks_mut(CHUNK).zip(points.chunks(CHUNK));
    parallel::each(WHAT, chunks, |_, (places, points)| {
        task.check()?;
        for (place, point) in places.iter_mut().zip(points) {
            *place = value(*point);
        }
        task.advance(points.len() as u64);
        Ok(())
    })?;
    Ok(values)
}
