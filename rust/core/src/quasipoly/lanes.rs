//! Values and slopes at many points at once, one point in each lane.
//!
//! The operations of `probe` with fused multiply-adds, under its error bounds: a complex product
//! has the relative error 2 u then (Jeannerod, Kornerup, Louvet and Muller 2017), a step of
//! Horner's rule 2 u of the sum of its moduli, which is less than `probe` allows for.

use super::jet::{FLOOR, TINY};
use super::probe::{ENLARGED, OPPOSITE, ROUNDING};
use super::quasi_polynomial::QuasiPolynomial;
use crate::elementary::simd::{exp, sin_cos};
use crate::simd::{Complex, Real, Simd};

/// The radius of the discs in which g″ is bounded, as a share of the modulus of their centres.
const NEARBY: f64 = 1e-9;

/// g(s) = h(s) e^(s τ_c) for one reference term c.
pub(crate) struct Lanes<'a> {
    h: &'a QuasiPolynomial,
    /// τ_j − τ_c.
    gaps: Vec<f64>,
}

/// Bounds on g around a point.
pub(crate) struct Enclosure<S: Simd> {
    /// Above |g|.
    pub(crate) value: Real<S>,
    /// Above the error of the computed value.
    pub(crate) error: Real<S>,
    /// Below |g′|.
    pub(crate) slope: Real<S>,
    /// Above |g″| within `reach`.
    pub(crate) bend: Real<S>,
    /// A radius about the point; zero where nothing is known about `bend`.
    pub(crate) reach: Real<S>,
}

impl<'a> Lanes<'a> {
    pub(crate) fn new(h: &'a QuasiPolynomial, reference: usize) -> Self {
        let own = h.delays().get(reference).copied().unwrap_or(0.0);
        Self {
            h,
            gaps: h.delays().iter().map(|delay| delay - own).collect(),
        }
    }

    /// One term of g and of g′, and |e^(−s gap)|.
    #[inline(always)]
    fn term<S: Simd>(row: &[f64], gap: f64, s: Complex<S>) -> (Complex<S>, Complex<S>, Real<S>) {
        let (p, dp) = polynomial(row, s);
        if gap == 0.0 {
            return (p, dp, s.re.constant(1.0));
        }
        let weight = exp(s.re * -gap);
        let (sine, cosine) = sin_cos(s.im * gap);
        let turn = Complex::new(weight * cosine, -(weight * sine));
        let value = p * turn;
        (value, dp * turn - value.scaled(gap), weight)
    }

    /// g and g′, their errors not known.
    #[inline(always)]
    pub(crate) fn jet<S: Simd>(&self, s: Complex<S>) -> (Complex<S>, Complex<S>) {
        let zero = s.re.constant(0.0);
        let mut sums = (Complex::new(zero, zero), Complex::new(zero, zero));
        for (row, &gap) in self.h.coefficients().iter().zip(&self.gaps) {
            let (value, slope, _) = Self::term(row, gap, s);
            sums = (sums.0 + value, sums.1 + slope);
        }
        sums
    }

    /// Bounds on g with all rounding errors.
    #[inline(always)]
    pub(crate) fn enclosure<S: Simd>(&self, s: Complex<S>) -> Enclosure<S> {
        let zero = s.re.constant(0.0);
        let size = s.square_modulus().sqrt();
        let reach = size * NEARBY;
        // The bounds of the terms grow with the modulus: those at the edge of the disc hold within.
        let size = size * (1.0 + 2.0 * NEARBY);
        let spread = s.re.abs() + s.im.abs();
        let count = self.gaps.len() as f64;
        let (mut value, mut slope) = (Complex::new(zero, zero), Complex::new(zero, zero));
        let (mut value_error, mut slope_error) = (zero, zero);
        let (mut bend, mut gaps, mut longest) = (zero, 0.0, 0.0_f64);
        for (row, &gap) in self.h.coefficients().iter().zip(&self.gaps) {
            let (own, own_slope, weight) = Self::term(row, gap, s);
            value = value + own;
            slope = slope + own_slope;
            let (mut p, mut dp, mut ddp) = (zero, zero, zero);
            for &c in row.iter().rev() {
                ddp = ddp.mul_add(size, dp);
                dp = dp.mul_add(size, p);
                p = p.mul_add(size, c.abs() + TINY);
            }
            let gap = gap.abs();
            gaps += gap;
            longest = longest.max(gap);
            let length = row.len() as f64;
            let weight = weight + TINY;
            let shared = (spread * (4.0 * gap)).smaller(OPPOSITE) + (count + 8.0);
            value_error = (shared + 4.0 * length).mul_add(p * weight, value_error);
            let sizes = p.mul_add(gap, dp) * weight;
            slope_error = (shared + 8.0 * length).mul_add(sizes, slope_error);
            // e^t ≤ 1 + 2 t for 0 ≤ t ≤ 1.
            let heaviest = (reach * (2.0 * gap)).mul_add(weight, weight);
            let curved = (p * gap + dp * 2.0).mul_add(gap, ddp * 2.0);
            bend = curved.mul_add(heaviest, bend);
        }
        let modulus = |z: Complex<S>| z.square_modulus().sqrt();
        let value_error = value_error * ROUNDING + FLOOR;
        let slope_error = slope_error * ROUNDING + FLOOR * (1.0 + gaps);
        Enclosure {
            value: (modulus(value) + value_error) * ENLARGED,
            error: value_error,
            slope: (modulus(slope) * (2.0 - ENLARGED)) - slope_error,
            bend: (bend + FLOOR) * ENLARGED,
            reach: (reach * longest).le(1.0).select(reach, zero),
        }
    }
}

/// A row and its derivative.
#[inline(always)]
fn polynomial<S: Simd>(row: &[f64], s: Complex<S>) -> (Complex<S>, Complex<S>) {
    let real = |value: f64| Complex::new(s.re.constant(value), s.re.constant(0.0));
    match row {
        [lower @ .., before, top] => {
            let (mut p, mut dp) = (s.affine(*top, *before), real(*top));
            for &c in lower.iter().rev() {
                dp = dp * s + p;
                p = p.mul_add(s, c);
            }
            (p, dp)
        }
        [only] => (real(*only), real(0.0)),
        [] => (real(0.0), real(0.0)),
    }
}
