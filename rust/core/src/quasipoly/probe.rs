//! Evaluation of g(s) = h(s) e^(s τ_c) along a path: value, slope, and bounds on their errors.
//!
//! With d_j = τ_j − τ_c, g = Σ p_j(s) e^(−s d_j). Let P_j be p_j with the moduli of its
//! coefficients and u = 2⁻⁵³. A complex product has the relative error √5 u (Brent, Percival and
//! Zimmermann 2007), a sum u: Horner's rule for degree n has the error 3.3 n u P_j, its derivative
//! 7 n u P_j′. The rounding of d and of d x, d y changes the exponent by 2.1 u |d| (|x| + |y|),
//! hence the exponential by less than 4 u |d| (|x| + |y|): its phase since |e^(ia) − e^(ib)| ≤ |a −
//! b|, its modulus since |d x| < 746 where that is neither 0 nor infinite; never by more than 2.5
//! of it. The errors are 1.25 u of exp, √2 u of cos and sin together, u of their products with it,
//! 2.3 u of the product with p_j, 2 u of the factor d and the difference in g′, and (m − 1) u of
//! the sum of m terms. Hence
//!     |error of g| ≤ u Σ (4n + m + 8 + 4|d| (|x| + |y|)) P_j(|s|) e^(−x d_j),
//! with 8n and P_j′ + |d| P_j for g′. Underflow: each product has an error of at most 2⁻¹⁰⁷⁴. TINY,
//! added to every |coefficient| and weight, exceeds its effect in Horner's rule, and FLOOR the
//! rest. `curvature` bounds |g″| ≤ Σ (P_j″ + 2|d| P_j′ + d² P_j)(|s| + r) max e^(−x d_j) nearby.

use std::ops::{Add, AddAssign, Mul, Sub};

use num_complex::Complex64;

use super::double_double;
use super::jet::{FLOOR, Jet, TINY, modulus};
use super::quasi_polynomial::QuasiPolynomial;
use crate::elementary::{exp, log, sin_cos};

/// Half an ulp of 1, enlarged by the rounding errors of computing the bounds.
pub(super) const ROUNDING: f64 = 1.02 * 0.5 * f64::EPSILON;

/// Largest relative error of an exponential, in units of u: its phase is wrong by at most half a
/// turn.
pub(super) const OPPOSITE: f64 = 5.0 / f64::EPSILON;

/// Factor on a computed bound: larger than the rounding errors of its sums and powers with
/// millions of operations, and too small to weaken the bound.
pub(super) const ENLARGED: f64 = 1.0 + 1e-9;

/// Number of evaluations that one in double-double arithmetic counts for.
const DOUBLE_DOUBLE_COST: u64 = 20;

/// Evaluates one quasi-polynomial at many points, relative to a reference term c.
#[derive(Debug, Clone)]
pub struct Probe<'a> {
    h: &'a QuasiPolynomial,
    reference: usize,
    delay: f64,
    /// d_j = τ_j − τ_c.
    gaps: Vec<f64>,
    /// e^(−x d_j) at the last x.
    weights: Vec<f64>,
    x: f64,
    /// The terms at the point of the last jet, if they are known there.
    parts: Vec<Part>,
    parts_at: Option<Complex64>,
    evaluations: u64,
}

/// One term of g at a point.
#[derive(Debug, Clone, Copy, Default)]
struct Part {
    /// Its derivative.
    slope: Complex64,
    /// Bound on its modulus.
    size: f64,
}

/// How fast g can change from a point on, where terms that are small and fast are bounded by their
/// size.
#[derive(Debug, Clone, Copy)]
pub(crate) struct DominatedTerms {
    /// Slope of the other terms.
    pub(crate) slope: Complex64,
    /// Bound on their second derivative nearby.
    pub(crate) bend: f64,
    /// Largest change of g by the small terms.
    pub(crate) perturbation: f64,
}

impl<'a> Probe<'a> {
    /// A probe that refers to the first term.
    pub fn new(h: &'a QuasiPolynomial) -> Self {
        let count = h.delays().len();
        let mut probe = Self {
            h,
            reference: 0,
            delay: 0.0,
            gaps: vec![0.0; count],
            weights: vec![1.0; count],
            x: f64::NAN,
            parts: vec![Part::default(); count],
            parts_at: None,
            evaluations: 0,
        };
        probe.refer_to(0);
        probe
    }

    /// The function.
    pub fn function(&self) -> &'a QuasiPolynomial {
        self.h
    }

    /// τ_c in seconds.
    pub fn delay(&self) -> f64 {
        self.delay
    }

    /// Number of jets computed so far.
    pub fn evaluations(&self) -> u64 {
        self.evaluations
    }

    /// The index c of the reference term.
    pub fn reference(&self) -> usize {
        self.reference
    }

    /// Make term `index` the reference.
    pub fn refer_to(&mut self, index: usize) {
        self.reference = index;
        self.delay = self.h.delays().get(index).copied().unwrap_or(0.0);
        for (gap, delay) in self.gaps.iter_mut().zip(self.h.delays()) {
            *gap = delay - self.delay;
        }
        self.x = f64::NAN;
        self.parts_at = None;
    }

    /// Make the term that is largest at `s` the reference.
    pub fn refer_to_dominant(&mut self, s: Complex64) {
        let mut best = (f64::NEG_INFINITY, 0);
        for (index, (row, delay)) in self.h.terms().enumerate() {
            let value = row.iter().rev().fold(Complex64::ZERO, |sum, c| sum * s + c);
            let size = log(modulus(value)) - s.re * delay;
            if size > best.0 {
                best = (size, index);
            }
        }
        self.refer_to(best.1);
    }

    fn weigh(&mut self, x: f64) {
        if self.x != x {
            self.x = x;
            for (weight, gap) in self.weights.iter_mut().zip(&self.gaps) {
                *weight = if *gap == 0.0 { 1.0 } else { exp(-gap * x) };
            }
        }
    }

    /// g and g′ at `s`, with their error bounds.
    pub fn jet(&mut self, s: Complex64) -> Jet {
        self.evaluations += 1;
        self.weigh(s.re);
        if s.im == 0.0 {
            return self.real_jet(s.re);
        }
        let reach = s.re.abs() + s.im.abs();
        let turn = |gap: f64, weight: f64| {
            if gap == 0.0 {
                return Complex64::new(weight, 0.0);
            }
            let (sine, cosine) = sin_cos(gap * s.im);
            Complex64::new(weight * cosine, -weight * sine)
        };
        let size = |term: Complex64| term.norm_sqr();
        self.jet_of(s, (modulus(s), reach), turn, size, 16.0)
    }

    /// [`jet`](Self::jet) on the real axis, where every operation has a smaller error, so that the
    /// bounds of the complex ones hold; `weights` are those at `x`.
    fn real_jet(&mut self, x: f64) -> Jet {
        self.jet_of(x, (x.abs(), x.abs()), |_, weight| weight, f64::abs, 4.0)
    }

    /// The jet at a real or complex `s`. `turn` is e^(−s gap), `size` a measure of a term, and a
    /// term this many times larger than that of the reference is told.
    #[inline(always)]
    fn jet_of<V>(
        &mut self,
        s: V,
        (modulus, reach): (f64, f64),
        turn: impl Fn(f64, f64) -> V,
        size: impl Fn(V) -> f64,
        excess: f64,
    ) -> Jet
    where
        V: Copy + Default + Into<Complex64> + AddAssign + Add<Output = V> + Sub<Output = V>,
        V: Mul<Output = V> + Mul<f64, Output = V> + Add<f64, Output = V>,
    {
        let count = self.gaps.len() as f64;
        let (mut value, mut slope) = (V::default(), V::default());
        let (mut value_error, mut slope_error) = (0.0, 0.0);
        let (mut own_size, mut gaps) = (0.0, 0.0);
        let mut largest = (0.0, self.reference);
        let rows = self.h.coefficients().iter();
        let terms = rows.zip(&self.gaps).zip(&self.weights).zip(&mut self.parts);
        for (index, (((row, &gap), &weight), part)) in terms.enumerate() {
            let (mut p, mut dp) = (V::default(), V::default());
            let (mut bound, mut slope_bound) = (0.0, 0.0);
            for &c in row.iter().rev() {
                dp = dp * s + p;
                p = p * s + c;
                slope_bound = slope_bound * modulus + bound;
                bound = bound * modulus + (c.abs() + TINY);
            }
            let turn = turn(gap, weight);
            let term = p * turn;
            let own_slope = dp * turn - term * gap;
            value += term;
            slope += own_slope;
            let length = row.len() as f64;
            let shared = count + 8.0 + (4.0 * gap.abs() * reach).min(OPPOSITE);
            let weight = weight + TINY;
            gaps += gap.abs();
            *part = Part {
                slope: own_slope.into(),
                size: bound * weight,
            };
            value_error += (4.0 * length + shared) * bound * weight;
            slope_error += (8.0 * length + shared) * (slope_bound + gap.abs() * bound) * weight;
            let size = size(term);
            if index == self.reference {
                own_size = size;
            }
            if size > largest.0 {
                largest = (size, index);
            }
        }
        self.parts_at = Some(s.into());
        Jet {
            value: value.into(),
            slope: slope.into(),
            value_error: ROUNDING * value_error + FLOOR,
            slope_error: ROUNDING * slope_error + FLOOR * (1.0 + gaps),
            overtaken_by: (largest.0 > excess * own_size).then_some(largest.1),
        }
    }

    /// The same as [`jet`](Self::jet) in double-double arithmetic, at some twenty times the cost,
    /// for points where rounding errors exceed the value.
    pub fn double_double_jet(&mut self, s: Complex64) -> Jet {
        self.evaluations += DOUBLE_DOUBLE_COST;
        self.weigh(s.re);
        self.parts_at = None;
        double_double::jet(self.h, self.reference, s)
    }

    /// Bound on |g″| at every s with |s| ≤ `modulus` whose real part lies between x and
    /// x + `shift`, x being the real part of the last point.
    pub fn curvature(&self, modulus: f64, shift: f64) -> f64 {
        let far = self.x + shift;
        self.bound(modulus, |gap, weight| heavier(gap, weight, far, shift))
    }

    /// Bound on |g″| at every s with |s| ≤ `modulus` whose real part is within `radius` of that
    /// of the last point.
    pub fn curvature_around(&self, modulus: f64, radius: f64) -> f64 {
        self.bound(modulus, |gap, weight| {
            let shift = if gap > 0.0 { -radius } else { radius };
            heavier(gap, weight, self.x + shift, shift)
        })
    }

    fn bound(&self, modulus: f64, heaviest: impl Fn(f64, f64) -> f64) -> f64 {
        let mut total = 0.0;
        for ((row, &gap), &weight) in self.terms() {
            let (p, dp, ddp) = sizes(row, modulus);
            let gap_size = gap.abs();
            total += (2.0 * ddp + gap_size * (2.0 * dp + gap_size * p)) * heaviest(gap, weight);
        }
        // Exponents are below 746 in modulus, or the weight is 0 or infinite; their error is at
        // most 2e-13. This, the rounding of the sums and of `modulus` together are far below 1e-9.
        (total + FLOOR) * ENLARGED
    }

    fn terms(&self) -> impl Iterator<Item = ((&Vec<f64>, &f64), &f64)> {
        let rows = self.h.coefficients().iter();
        rows.zip(&self.gaps).zip(&self.weights)
    }

    /// The largest bound on a term at the last jet.
    pub(crate) fn largest_term(&self) -> f64 {
        self.parts
            .iter()
            .fold(0.0, |most, part| part.size.max(most))
    }

    /// The bounds of [`curvature`](Self::curvature) without the terms that together change g by at
    /// most `most` on the way to Re s = x + `shift`. `None` where there are no such terms or no
    /// others, or the last jet was not at `s`.
    pub(crate) fn dominated_terms(
        &self,
        s: Complex64,
        (modulus, shift): (f64, f64),
        most: f64,
    ) -> Option<DominatedTerms> {
        if self.parts_at != Some(s) {
            return None;
        }
        let far = self.x + shift;
        let share = most / self.parts.len() as f64;
        let (mut slope, mut bend, mut perturbation) = (Complex64::ZERO, FLOOR, 0.0);
        let (mut small, mut other) = (false, false);
        for (((row, &gap), &weight), part) in self.terms().zip(&self.parts) {
            let (p, dp, ddp) = sizes(row, modulus);
            let heaviest = heavier(gap, weight, far, shift);
            let change = part.size + p * heaviest;
            if gap != 0.0 && change < share {
                small = true;
                perturbation += change;
            } else {
                other = true;
                let gap = gap.abs();
                slope += part.slope;
                bend += (2.0 * ddp + gap * (2.0 * dp + gap * p)) * heaviest;
            }
        }
        (small && other).then_some(DominatedTerms {
            slope,
            bend: bend * ENLARGED,
            perturbation: (perturbation + FLOOR) * ENLARGED,
        })
    }
}

/// P, P′ and P″/2 at `modulus`.
#[inline(always)]
fn sizes(row: &[f64], modulus: f64) -> (f64, f64, f64) {
    let (mut p, mut dp, mut ddp) = (0.0, 0.0, 0.0);
    for c in row.iter().rev() {
        ddp = ddp * modulus + dp;
        dp = dp * modulus + p;
        p = p * modulus + (c.abs() + TINY);
    }
    (p, dp, ddp)
}

/// The largest e^(−x′ `gap`) for x′ between x, where it is `weight`, and `far` = x + `shift`.
#[inline(always)]
fn heavier(gap: f64, weight: f64, far: f64, shift: f64) -> f64 {
    if gap * shift < 0.0 {
        // Not the product of the weight and its growth, because either may be out of range.
        exp(-gap * far).max(weight) + TINY
    } else {
        weight + TINY
    }
}
