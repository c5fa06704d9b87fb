//! The frequencies at which the gain of a loop with a hold is one.
//!
//! Its loop gain is L = −b(σ) z^(−m−1)/a(σ) on the circle z = e^(jω Ts) (`stability::held`). There
//! x = |σ|² = (2 sin(ω Ts/2)/Ts)² and σ + σ* = −Ts x, so that |a|² − |b|² is a polynomial of degree n
//! in x, whatever the delay is: its zeros are the gain crossovers.

use std::f64::consts::{PI, TAU};

use num_complex::Complex64;

use super::zeros::{ORDER, RealFunction, Taylor, zeros_between};
use crate::elementary::{DoubleDouble, angle};
use crate::quasipoly::modulus;
use crate::stability::{Crossing, HeldNumbers, ROUNDINGS};
use crate::{Error, Task};

/// The largest factor on a loop gain that is looked for.
pub(super) const FAR: f64 = 1e12;

/// Size, beside the usual one, of a factor that may be zero.
const NEGLIGIBLE: f64 = 1e-9;

/// |a|² − |b|² as a polynomial in x, with bounds on the errors of its coefficients.
struct Difference {
    coefficients: Vec<f64>,
    sizes: Vec<f64>,
}

impl Difference {
    fn new(a: &[f64], b: &[f64], sample_time: f64) -> Self {
        let (own, other) = (square(a, sample_time), square(b, sample_time));
        let length = own.len().max(other.len());
        let at = |list: &[(DoubleDouble, f64)], k: usize| {
            list.get(k)
                .copied()
                .unwrap_or((DoubleDouble::default(), 0.0))
        };
        let (mut coefficients, mut sizes) = (Vec::new(), Vec::new());
        for k in 0..length {
            let ((p, of_p), (q, of_q)) = (at(&own, k), at(&other, k));
            let value = (p - q).high;
            coefficients.push(value);
            // A few roundings of the value; those of the sum are in double-double arithmetic.
            sizes.push(value.abs() + 1e-12 * (of_p + of_q));
        }
        Self {
            coefficients,
            sizes,
        }
    }

    /// The derivatives of order 0 to `ORDER` of a polynomial.
    fn derivatives(row: &[f64], x: f64) -> [f64; ORDER + 1] {
        let mut found = [0.0; ORDER + 1];
        for c in row.iter().rev() {
            for k in (1..=ORDER).rev() {
                found[k] = found[k] * x + found[k - 1];
            }
            found[0] = found[0] * x + c;
        }
        let mut factorial = 1.0;
        for (k, value) in found.iter_mut().enumerate().skip(1) {
            factorial *= k as f64;
            *value *= factorial;
        }
        found
    }
}

impl RealFunction for Difference {
    fn value(&mut self, x: f64) -> f64 {
        self.coefficients
            .iter()
            .rev()
            .fold(0.0, |sum, c| sum * x + c)
    }

    fn taylor(&mut self, x: f64) -> Taylor {
        let values = Self::derivatives(&self.coefficients, x);
        let sizes = Self::derivatives(&self.sizes, x);
        let roundings = (4 * self.sizes.len()) as f64 * f64::EPSILON;
        let mut found = Taylor::default();
        for k in 0..ORDER {
            found.values[k] = values[k];
            found.errors[k] = roundings * sizes[k];
        }
        found
    }

    fn bound(&self, x: f64) -> f64 {
        let absolute: Vec<f64> = self.coefficients.iter().map(|c| c.abs()).collect();
        Self::derivatives(&absolute, x)[ORDER]
    }
}

/// |p(σ)|² on the circle as a polynomial in x, with sums of moduli.
fn square(p: &[f64], sample_time: f64) -> Vec<(DoubleDouble, f64)> {
    let zero = (DoubleDouble::default(), 0.0);
    let mut total = vec![zero; p.len()];
    // σᵏ + σ*ᵏ = −Ts x (σᵏ⁻¹ + σ*ᵏ⁻¹) − x (σᵏ⁻² + σ*ᵏ⁻²), ascending powers of x.
    let mut before = vec![(DoubleDouble::from(2.0), 2.0)];
    let mut now = vec![zero, (DoubleDouble::from(-sample_time), sample_time)];
    for k in 0..p.len() {
        let power = if k == 0 {
            vec![(DoubleDouble::ONE, 1.0)]
        } else {
            now.clone()
        };
        for (i, (low, high)) in p.iter().zip(&p[k..]).enumerate() {
            let product = DoubleDouble::product(*low, *high);
            for (j, (c, size)) in power.iter().enumerate() {
                if let Some(sum) = total.get_mut(i + j) {
                    sum.0 = sum.0 + product * *c;
                    sum.1 += product.high.abs() * size;
                }
            }
        }
        if k > 0 {
            let mut next = vec![zero; now.len() + 1];
            for (j, (c, size)) in now.iter().enumerate() {
                next[j + 1].0 = next[j + 1].0 + *c * -sample_time;
                next[j + 1].1 += size * sample_time;
            }
            for (j, (c, size)) in before.iter().enumerate() {
                next[j + 1].0 = next[j + 1].0 - *c;
                next[j + 1].1 += size;
            }
            before = std::mem::replace(&mut now, next);
        }
    }
    total
}

/// A frequency at which |L| = 1.
#[derive(Debug, Clone, Copy)]
pub(super) struct Crossover {
    pub(super) omega: f64,
    /// The turn in [0, 2π) that brings L to −1.
    pub(super) turn: f64,
    /// What rounding may change in it, to first order; infinite where |L| only touches 1.
    pub(super) error: f64,
}

impl Crossover {
    /// The least turn in either direction.
    pub(super) fn distance(&self) -> f64 {
        self.turn.min(TAU - self.turn)
    }

    /// The same, or where ω times `whole` seconds is less than one the delay for it, in units of that.
    pub(super) fn margin(&self, whole: f64) -> f64 {
        self.distance() * (1.0 / (self.omega * whole)).max(1.0)
    }
}

/// All gain crossovers above zero.
pub(super) fn crossovers(numbers: &HeldNumbers, task: &Task) -> Result<Vec<Crossover>, Error> {
    let (a, b) = numbers.polynomials();
    let sample_time = numbers.sample_time();
    let largest = 4.0 / (sample_time * sample_time);
    let mut difference = Difference::new(a, b, sample_time);
    let found = zeros_between(&mut difference, 0.0, largest, task)?;
    Ok(found
        .into_iter()
        .map(|x| {
            let sine = (0.5 * sample_time * x.sqrt()).min(1.0);
            let omega = 2.0 / sample_time * sine.asin();
            let (of_a, of_b) = numbers.parts(omega);
            let gain = -of_b * of_a.conj();
            // dx/dω = 2 √x cos(ω Ts/2).
            let here = difference.taylor(x);
            let off = 2.0 * here.errors[0] / here.values[1].abs();
            let late = off / (2.0 * x.sqrt() * (1.0 - sine * sine).sqrt());
            let pace = numbers.delay() + slope(a, numbers, omega) + slope(b, numbers, omega);
            Crossover {
                omega,
                turn: (PI + angle(gain.im, gain.re)).rem_euclid(TAU),
                error: pace * (late + f64::EPSILON * omega)
                    + rounding(a, numbers, omega)
                    + rounding(b, numbers, omega),
            }
        })
        .collect())
}

/// |p′/p| at a frequency.
fn slope(p: &[f64], numbers: &HeldNumbers, omega: f64) -> f64 {
    let sigma = numbers.variable(omega);
    let (mut value, mut slope) = (Complex64::ZERO, Complex64::ZERO);
    for c in p.iter().rev() {
        slope = slope * sigma + value;
        value = value * sigma + c;
    }
    modulus(slope) / modulus(value)
}

/// The error of p relative to it.
fn rounding(p: &[f64], numbers: &HeldNumbers, omega: f64) -> f64 {
    let sigma = numbers.variable(omega);
    let size = modulus(sigma);
    let sum = p.iter().rev().fold(0.0, |sum, c| sum * size + c.abs());
    let value = p
        .iter()
        .rev()
        .fold(Complex64::ZERO, |sum, c| sum * sigma + c);
    let units = ROUNDINGS * (p.len() + 1) as f64 * f64::EPSILON;
    (units + numbers.errors()) * sum / modulus(value)
}

/// Is a factor zero, but for rounding? The interval of another one may hold zero where polynomials of
/// high degree lose digits.
pub(super) fn is_zero(factor: &Crossing, usual: f64) -> bool {
    factor.low <= 0.0 && factor.high >= 0.0 && factor.gain.abs() <= NEGLIGIBLE * usual
}
