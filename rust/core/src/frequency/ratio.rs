//! Values of ratios of quasi-polynomials, without overflow where the ratio has none.
//!
//! Both are taken as h(s) = m e^x, x the real exponent of the largest exponential and of the highest
//! power of s; the exponents are subtracted before anything is raised to them. Values carry
//! rounding, which is not bounded here.

use num_complex::Complex64;

use crate::elementary::{exp, log, sin_cos};
use crate::quasipoly::{QuasiPolynomial, modulus};
use crate::{Error, Task};

/// Numerators and denominators of such moduli are divided as they are, with less rounding.
const MODERATE: std::ops::Range<f64> = 1e-140..1e140;

/// A Taylor coefficient of less than this part of its summands is zero but for rounding.
const ZERO: f64 = 16.0 * f64::EPSILON;

/// n/d at every point: infinite where only d is zero, NaN where both are.
///
/// # Errors
/// [`Error::Interrupted`].
pub fn ratio(
    n: &QuasiPolynomial,
    d: &QuasiPolynomial,
    points: &[Complex64],
    task: &Task,
) -> Result<Vec<Complex64>, Error> {
    let mut values = Vec::with_capacity(points.len());
    for chunk in points.chunks(256) {
        task.check()?;
        values.extend(chunk.iter().map(|s| ratio_at(n, d, *s)));
    }
    Ok(values)
}

pub(super) fn ratio_at(n: &QuasiPolynomial, d: &QuasiPolynomial, s: Complex64) -> Complex64 {
    let (above, below) = (n.value(s), d.value(s));
    let moderate = |value| MODERATE.contains(&modulus(value));
    if moderate(above) && moderate(below) {
        return above / below;
    }
    let ((above, up), (below, down)) = (scaled(n, s), scaled(d, s));
    let (size, other) = (modulus(above), modulus(below));
    if other == 0.0 {
        let part = if size == 0.0 { f64::NAN } else { f64::INFINITY };
        return Complex64::new(part, if size == 0.0 { part } else { 0.0 });
    }
    let direction = (above / size) * (below / other).conj();
    let exponent = up - down + log(size) - log(other);
    // A part may be finite where the modulus is not.
    let grown = |part: f64| {
        if part == 0.0 || size == 0.0 {
            0.0
        } else {
            part.signum() * exp(exponent + log(part.abs()))
        }
    };
    Complex64::new(grown(direction.re), grown(direction.im))
}

/// m and x with h(s) = m e^x, x real.
fn scaled(h: &QuasiPolynomial, s: Complex64) -> (Complex64, f64) {
    let size = modulus(s);
    let far = size > 1.0;
    let degree = h.degree();
    let largest = h.delays().iter().map(|tau| -tau * s.re);
    let largest = largest.fold(f64::NEG_INFINITY, f64::max);
    let near = if far { s.conj() / size / size } else { s };
    let mut total = Complex64::ZERO;
    for (row, tau) in h.coefficients().iter().zip(h.delays()) {
        let coefficient = |k: usize| row.get(k).copied().unwrap_or(0.0);
        let horner = |sum: Complex64, k: usize| sum * near + coefficient(k);
        let value = if far {
            (0..=degree).fold(Complex64::ZERO, horner)
        } else {
            (0..=degree).rev().fold(Complex64::ZERO, horner)
        };
        let (sine, cosine) = sin_cos(tau * s.im);
        total += value * Complex64::new(cosine, -sine) * exp(-tau * s.re - largest);
    }
    if !far {
        return (total, largest);
    }
    let unit = s / size;
    let direction = (0..degree).fold(Complex64::ONE, |power, _| power * unit);
    (total * direction, largest + degree as f64 * log(size))
}

/// The first term a s^p of the Taylor series at zero that is not zero to rounding: a and p.
pub fn first_term(h: &QuasiPolynomial) -> (f64, u32) {
    // No sum of exponentials with polynomials has a zero of a higher order.
    let most: usize = h.coefficients().iter().map(Vec::len).sum();
    let series = h.expansion(Complex64::ZERO, most);
    for (k, value) in series.coefficients.iter().enumerate() {
        let mut size = 0.0;
        for (row, delay) in h.coefficients().iter().zip(h.delays()) {
            // |c_i| τ^(k−i)/(k−i)!, from i = k down.
            let mut power = 1.0;
            for i in (0..=k).rev() {
                size += row.get(i).map_or(0.0, |c| c.abs()) * power;
                power *= (delay + series.delay) / (k - i + 1) as f64;
            }
        }
        if value.re.abs() > ZERO * size {
            return (value.re, k as u32);
        }
    }
    (0.0, 0)
}
