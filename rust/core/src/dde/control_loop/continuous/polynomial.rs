//! Polynomials of one length in a local coordinate σ ∈ [0, 1], for registers of any width.
//!
//! All functions are inlined into code that is compiled for an instruction set.

use crate::dde::control_loop::series::{DEGREE, NEGLIGIBLE, TRIMMED};

/// Values that are computed together: an element has three or four output times as a rule.
pub(super) const LANES: usize = 4;

/// Coefficients that are processed together.
const WIDTH: usize = 8;

/// A state this small throughout its element counts as zero.
const NOTHING: f64 = 1e-280;

/// Two coefficients, of an even and an odd power.
const PAIRS: usize = DEGREE / 2;

/// Coefficients among which the largest one is looked for.
const LARGEST_OF: usize = 5;

/// Place of the constant in front of the other coefficients, which begin a block.
const FIRST: usize = WIDTH - 1;
const REST: usize = WIDTH;

/// c_0 + c_1 σ + …; c_j stands at `FIRST` + j, so that powers from 1 on fill whole blocks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Polynomial {
    terms: [f64; REST + DEGREE],
    /// Pairs of powers from 1 on that are not negligible.
    pairs: usize,
}

impl Polynomial {
    #[inline(always)]
    pub(super) fn constant(first: f64) -> Self {
        let mut terms = [0.0; REST + DEGREE];
        terms[FIRST] = first;
        Self { terms, pairs: 0 }
    }

    /// c_j.
    #[inline(always)]
    pub(super) fn coefficient(&self, j: usize) -> f64 {
        self.terms[FIRST + j]
    }

    /// Become c_j.
    #[inline(always)]
    pub(super) fn set(&mut self, j: usize, value: f64) {
        self.terms[FIRST + j] = value;
        self.pairs = PAIRS;
    }

    #[inline(always)]
    pub(super) fn is_constant(&self) -> bool {
        self.pairs == 0 && self.terms[REST..] == [0.0; DEGREE]
    }

    /// Become `first` + Σ_j g_j v_j σ^{j+1}.
    #[inline(always)]
    pub(super) fn integrate(&mut self, first: f64, gains: &[f64; DEGREE], slopes: &[f64; DEGREE]) {
        for ((term, gain), slope) in self.terms[REST..].iter_mut().zip(gains).zip(slopes) {
            *term = gain * slope;
        }
        self.terms[FIRST] = first;
        self.pairs = (self.pairs + 1).min(PAIRS);
    }

    /// Add `gain` times another one.
    #[inline(always)]
    pub(super) fn add(&mut self, gain: f64, other: &Self) {
        for (sum, term) in self.terms.iter_mut().zip(&other.terms) {
            *sum += gain * term;
        }
        self.pairs = self.pairs.max(other.pairs);
    }

    /// Leave out last terms that are far below rounding errors. Are the last of all negligible?
    #[inline(always)]
    pub(super) fn trim(&mut self) -> bool {
        // Of the first powers: a number that is too small leaves out less.
        let mut largest = 0.0;
        for term in &self.terms[FIRST..FIRST + LARGEST_OF] {
            let size = term.abs();
            largest = if size > largest { size } else { largest };
        }
        let least = TRIMMED * NEGLIGIBLE * largest;
        while self.pairs > 0 {
            let [even, odd] = self.pair(self.pairs - 1);
            if even.abs() > least || odd.abs() > least {
                break;
            }
            self.pairs -= 1;
        }
        let [even, odd] = self.pair(PAIRS - 1);
        let last = NEGLIGIBLE * largest;
        self.pairs < PAIRS || largest <= NOTHING || (even.abs() <= last && odd.abs() <= last)
    }

    #[inline(always)]
    fn pair(&self, at: usize) -> [f64; 2] {
        [self.terms[REST + 2 * at], self.terms[REST + 2 * at + 1]]
    }

    /// The same function on either half, each in its own coordinate from 0 to 1.
    pub(super) fn halves(&self) -> [Self; 2] {
        let mut low = *self;
        let mut power = 1.0;
        for term in &mut low.terms[FIRST..] {
            *term *= power;
            power *= 0.5;
        }
        let mut high = low;
        // Repeated synthetic division by σ − 1.
        for first in FIRST..FIRST + DEGREE {
            for j in (first..FIRST + DEGREE).rev() {
                high.terms[j] += high.terms[j + 1];
            }
        }
        high.pairs = PAIRS;
        [low, high]
    }

    /// The value at σ = 1.
    #[inline(always)]
    pub(super) fn end(&self) -> f64 {
        let blocks = self.terms[REST..].as_chunks::<WIDTH>().0;
        let mut sums = [0.0; WIDTH];
        for terms in blocks.iter().rev() {
            for (sum, term) in sums.iter_mut().zip(terms) {
                *sum += term;
            }
        }
        let [a, b, c, d, e, f, g, h] = sums;
        let [a, b, c, d] = [a + e, b + f, c + g, d + h];
        self.terms[FIRST] + ((a + c) + (b + d))
    }

    /// Values at several σ.
    #[inline(always)]
    pub(super) fn at(&self, sigmas: &[f64; LANES]) -> [f64; LANES] {
        let mut squares = [0.0; LANES];
        for (square, sigma) in squares.iter_mut().zip(sigmas) {
            *square = sigma * sigma;
        }
        // Even and odd powers apart: each step of one sum waits for the step before.
        let (mut evens, mut odds) = ([0.0; LANES], [0.0; LANES]);
        let pairs = self.terms[REST..].as_chunks::<2>().0;
        for [even, odd] in pairs[..self.pairs.min(PAIRS)].iter().rev() {
            for i in 0..LANES {
                evens[i] = evens[i] * squares[i] + even;
                odds[i] = odds[i] * squares[i] + odd;
            }
        }
        for i in 0..LANES {
            evens[i] = self.terms[FIRST] + sigmas[i] * (evens[i] + sigmas[i] * odds[i]);
        }
        evens
    }
}
