//! The output on one part of a sample of each loop, as a polynomial in local time.
//!
//! Under constant w and r, y(σ h) = Σ c_j σ^j with c_0 = C x + D w, c_j = C v_j, v_1 = (A x + B w +
//! E r) h and v_{j+1} = A v_j h/(j + 1). A derivative whose partial sums of coefficients all have
//! one sign has no zero in (0, 1), because Σ a_j σ^j = Σ s_j (σ^j − σ^{j+1}) + s_n σ^{n+1} with the
//! partial sums s_j. Where neither y′ nor y″ is shown to keep its sign in this way, the polynomial
//! is examined by sign changes in the Bernstein basis instead.

use crate::dde::control_loop::series::{DEGREE, Series};
use crate::simd::{Mask, Real, Simd};

use super::trace::of;

/// Largest degree of a series.
pub(super) const LONG: usize = 20;

/// Degrees of the series for the rate of the plant times the length of a part: reach^n/n! of the
/// next power is below 1e-17.
const DEGREES: [(f64, usize); 6] = [
    (0.05, 8),
    (0.12, 10),
    (0.25, 12),
    (0.35, 13),
    (0.5, 15),
    (0.7, 16),
];

/// The degree for the rate of the plant times the length of a part, at most 1.
pub(super) fn degree_for(reach: f64) -> usize {
    let degree = DEGREES.iter().find(|(most, _)| reach <= *most);
    degree.map_or(LONG, |(_, degree)| *degree)
}

/// Limit on the steps towards a zero: bisection alone takes no more.
const MOST_STEPS: u32 = 64;

/// After a step of Newton's method this short, the error is below rounding.
const ARRIVED: f64 = 1e-10;

/// A bracket this short ends the search.
const NARROWEST: f64 = 2.0 * f64::EPSILON;

/// Coefficients of σ^j.
pub(super) struct Piece<S: Simd> {
    pub(super) terms: [Real<S>; LONG + 1],
    pub(super) degree: usize,
}

/// What is wanted of the pieces.
pub(super) struct Asked<S: Simd> {
    /// The pieces that count, and those of them of which a crossing is wanted, not an extremum.
    pub(super) is_open: Mask<S>,
    pub(super) crosses: Mask<S>,
    /// Where the output crosses this level before `high`.
    pub(super) level: Real<S>,
    pub(super) high: Real<S>,
}

/// What the pieces show.
pub(super) struct Shown<S: Simd> {
    /// The pieces that have one extremum in (0, 1).
    pub(super) has_one: Mask<S>,
    /// Where it is, and the output there.
    pub(super) at: Real<S>,
    pub(super) output: Real<S>,
    /// The pieces of which the extrema are not known.
    pub(super) is_unknown: Mask<S>,
    /// Where the output crosses the level; NaN where it may turn before.
    pub(super) crossing: Real<S>,
}

impl<S: Simd> Shown<S> {
    /// The outputs at the extrema, before `until`, of the pieces in `wanted` that have one; NaN of
    /// the others.
    #[inline(always)]
    pub(super) fn extremum(&self, wanted: Mask<S>, until: Real<S>) -> Real<S> {
        let here = wanted & self.has_one & self.at.le(until);
        here.select(self.output, until.constant(f64::NAN))
    }
}

impl<S: Simd> Piece<S> {
    pub(super) fn new(zero: Real<S>) -> Self {
        Self {
            terms: [zero; LONG + 1],
            degree: 0,
        }
    }

    #[inline(always)]
    pub(super) fn at(&self, sigma: Real<S>) -> Real<S> {
        let mut sum = sigma.constant(0.0);
        for c in self.terms.iter().take(self.degree + 1).rev() {
            sum = sum.mul_add(sigma, *c);
        }
        sum
    }

    /// Extrema in (0, 1), and crossings of a level where there are none. `sought` is filled with
    /// the polynomials whose zeros these are.
    #[inline(always)]
    pub(super) fn shown(&self, sought: &mut Self, asked: &Asked<S>) -> Shown<S> {
        let zero = self.terms[0].constant(0.0);
        let (mut sum, mut least, mut most) = (zero, zero, zero);
        let (mut bend, mut lowest, mut highest) = (zero, zero, zero);
        for j in 1..=self.degree {
            let slope = self.terms[j] * j as f64;
            sum = sum + slope;
            (least, most) = (least.min(sum), most.max(sum));
            if j > 1 {
                bend = slope.mul_add((j - 1) as f64, bend);
                (lowest, highest) = (lowest.min(bend), highest.max(bend));
            }
        }
        let turns = asked.is_open & least.lt(0.0) & most.gt(0.0);
        let bends = lowest.lt(0.0) & highest.gt(0.0);
        let (first, last) = (self.terms[1], sum);
        let changes = (first.lt(0.0) & last.gt(0.0)) | (first.gt(0.0) & last.lt(0.0));
        let has_one = turns & !bends & changes;
        let is_unknown = turns & bends;
        let is_simple = asked.crosses & !(has_one | is_unknown);
        let turns_there = has_one & !asked.crosses;
        let wanted = turns_there | is_simple;
        let mut at = zero;
        if wanted.any() {
            sought.degree = self.degree;
            for j in 0..self.degree {
                let slope = self.terms[j + 1] * (j + 1) as f64;
                sought.terms[j] = is_simple.select(self.terms[j], slope);
            }
            sought.terms[self.degree] = is_simple.select(self.terms[self.degree], zero);
            let level = is_simple.select(asked.level, zero);
            let high = is_simple.select(asked.high, zero.constant(1.0));
            at = sought.zero(level, zero, high, wanted);
        }
        Shown {
            has_one,
            at,
            output: self.at(at),
            is_unknown,
            crossing: is_simple.select(at, zero.constant(f64::NAN)),
        }
    }

    /// Where the pieces in `wanted` pass through `level` between `low` and `high`, at which they are
    /// on different sides of it: by Newton's method, and by bisection where that leaves the bracket.
    #[inline(always)]
    pub(super) fn zero(
        &self,
        level: Real<S>,
        low: Real<S>,
        high: Real<S>,
        wanted: Mask<S>,
    ) -> Real<S> {
        let (begin, last) = (self.at(low) - level, self.at(high) - level);
        let rises = last.gt(begin);
        let (mut low, mut high) = (low, high);
        let part = begin / (begin - last);
        let mut sigma = wanted.select((high - low).mul_add(part, low), low);
        let mut open = wanted;
        for _ in 0..MOST_STEPS {
            let (mut value, mut slope) = (sigma.constant(0.0), sigma.constant(0.0));
            for c in self.terms.iter().take(self.degree + 1).rev() {
                slope = slope.mul_add(sigma, value);
                value = value.mul_add(sigma, *c);
            }
            let value = value - level;
            let is_right = (rises & value.ge(0.0)) | (!rises & value.le(0.0));
            high = (open & is_right).select(sigma, high);
            low = (open & !is_right).select(sigma, low);
            let newton = sigma - value / slope;
            let inside = newton.ge(low) & newton.le(high);
            let next = inside.select(newton, (low + high) * 0.5);
            let arrives = (inside & (next - sigma).abs().le(ARRIVED)) | (high - low).le(NARROWEST);
            sigma = open.select(next, sigma);
            open = open & !arrives;
            if !open.any() {
                break;
            }
        }
        sigma
    }

    /// The polynomial of one lane.
    pub(super) fn series(&self, lane: usize) -> Series {
        let mut series = Series::constant(0.0);
        series.degree = self.degree.min(DEGREE);
        for (c, term) in series.coefficients.iter_mut().zip(&self.terms) {
            *c = of(term, lane);
        }
        series
    }
}
