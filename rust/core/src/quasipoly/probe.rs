//! Evaluation of g(s) = h(s) e^(s τ_c) along a path: value, slope, and bounds on what is unknown.
//!
//! With d_j = τ_j − τ_c, g = Σ p_j(s) e^(−s d_j). Let P_j be p_j with the moduli of its
//! coefficients and u = 2⁻⁵³. Horner's rule in complex arithmetic loses at most (4n + 2) u P_j(|s|)
//! (n the degree); the exponent is wrong by at most 2u |d| (|x| + |y|), exp, sin and cos by 2 ulp
//! each, the products by 4u, the sum of m terms by m u. `Jet` adds these up with room to spare:
//!     |error of g| ≤ u Σ (4n + m + 24 + 4|d| (|x| + |y|)) P_j(|s|) e^(−x d_j).
//! `curvature` bounds |g″| ≤ Σ (P_j″ + 2|d| P_j′ + d² P_j)(|s| + r) max e^(−x d_j) nearby.
//! Not covered: underflow. The walks that prove something scale h to coefficients near 1 and
//! accept no value below 1e-250.

use num_complex::Complex64;

use super::QuasiPolynomial;

/// Half an ulp of 1, enlarged by what the bounds themselves lose in being computed.
const ROUNDING: f64 = 1.02 * 0.5 * f64::EPSILON;

/// |s|, never less than its parts: the squares of small ones underflow.
pub(crate) fn modulus(s: Complex64) -> f64 {
    s.norm_sqr().sqrt().max(s.re.abs()).max(s.im.abs())
}

/// Value and slope of g at a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Jet {
    /// g(s).
    pub value: Complex64,
    /// g′(s).
    pub slope: Complex64,
    /// Bound on the error of `value`.
    pub value_error: f64,
    /// Bound on the error of `slope`.
    pub slope_error: f64,
    /// Index of the largest term, where it exceeds the reference term fourfold.
    pub overtaken_by: Option<usize>,
}

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
    evaluations: u64,
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
    }

    /// Make the term that is largest at `s` the reference.
    pub fn refer_to_dominant(&mut self, s: Complex64) {
        let mut best = (f64::NEG_INFINITY, 0);
        for (index, (row, delay)) in self.h.terms().enumerate() {
            let value = row.iter().rev().fold(Complex64::ZERO, |sum, c| sum * s + c);
            let size = libm::log(modulus(value)) - s.re * delay;
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
                *weight = if *gap == 0.0 {
                    1.0
                } else {
                    libm::exp(-gap * x)
                };
            }
        }
    }

    /// g and g′ at `s`, with their error bounds.
    pub fn jet(&mut self, s: Complex64) -> Jet {
        self.evaluations += 1;
        self.weigh(s.re);
        let modulus = modulus(s);
        let reach = s.re.abs() + s.im.abs();
        let count = self.gaps.len() as f64;
        let (mut value, mut slope) = (Complex64::ZERO, Complex64::ZERO);
        let (mut value_error, mut slope_error) = (0.0, 0.0);
        let mut own_size = 0.0;
        let mut largest = (0.0, self.reference);
        let terms = self
            .h
            .coefficients()
            .iter()
            .zip(&self.gaps)
            .zip(&self.weights);
        for (index, ((row, &gap), &weight)) in terms.enumerate() {
            let (mut p, mut dp) = (Complex64::ZERO, Complex64::ZERO);
            let (mut bound, mut slope_bound) = (0.0, 0.0);
            for c in row.iter().rev() {
                dp = dp * s + p;
                p = p * s + c;
                slope_bound = slope_bound * modulus + bound;
                bound = bound * modulus + c.abs();
            }
            let turn = if gap == 0.0 {
                Complex64::new(weight, 0.0)
            } else {
                let (sine, cosine) = libm::sincos(gap * s.im);
                Complex64::new(weight * cosine, -weight * sine)
            };
            let term = p * turn;
            value += term;
            slope += dp * turn - term * gap;
            let length = row.len() as f64;
            let shared = count + 24.0 + 4.0 * gap.abs() * reach;
            value_error += (4.0 * length + shared) * bound * weight;
            slope_error += (8.0 * length + shared) * (slope_bound + gap.abs() * bound) * weight;
            let size = term.norm_sqr();
            if index == self.reference {
                own_size = size;
            }
            if size > largest.0 {
                largest = (size, index);
            }
        }
        Jet {
            value,
            slope,
            value_error: ROUNDING * value_error,
            slope_error: ROUNDING * slope_error,
            overtaken_by: (largest.0 > 16.0 * own_size).then_some(largest.1),
        }
    }

    /// Bound on |g″| at every s with |s| ≤ `modulus` whose real part lies between x and
    /// x + `shift`, x being the real part of the last point.
    pub fn curvature(&self, modulus: f64, shift: f64) -> f64 {
        self.bound(modulus, |gap| (-gap * shift).max(0.0))
    }

    /// Bound on |g″| at every s with |s| ≤ `modulus` whose real part is within `radius` of that
    /// of the last point.
    pub fn curvature_around(&self, modulus: f64, radius: f64) -> f64 {
        self.bound(modulus, |gap| gap.abs() * radius)
    }

    fn bound(&self, modulus: f64, growth: impl Fn(f64) -> f64) -> f64 {
        let mut total = 0.0;
        let terms = self
            .h
            .coefficients()
            .iter()
            .zip(&self.gaps)
            .zip(&self.weights);
        for ((row, &gap), &weight) in terms {
            let (mut p, mut dp, mut ddp) = (0.0, 0.0, 0.0);
            for c in row.iter().rev() {
                ddp = ddp * modulus + dp;
                dp = dp * modulus + p;
                p = p * modulus + c.abs();
            }
            let gap_size = gap.abs();
            let growth = growth(gap);
            let most = if growth == 0.0 {
                weight
            } else {
                // Not the product: a weight that has underflowed may be 0 here and 1 nearby.
                libm::exp(growth - gap * self.x)
            };
            total += (2.0 * ddp + gap_size * (2.0 * dp + gap_size * p)) * most;
        }
        // Covers the rounding of this sum, of the exponents and of `modulus` itself.
        total * (1.0 + 1e-9)
    }
}
