//! The output on one part of a sample of each loop, as a polynomial in local time.
//!
//! Under constant w and r, y(σ h) = Σ c_j σ^j with c_0 = C x + D w, c_j = C v_j, v_1 = (A x + B w +
//! E r) h and v_{j+1} = A v_j h/(j + 1). A derivative whose partial sums of coefficients all have
//! one sign has no zero in (0, 1), because Σ a_j σ^j = Σ s_j (σ^j − σ^{j+1}) + s_n σ^{n+1} with the
//! partial sums s_j. Where neither y′ nor y″ is shown to keep its sign in this way, the polynomial
//! is examined by sign changes in the Bernstein basis instead.

use crate::dde::control_loop::level_crossings::crossings;
use crate::dde::control_loop::series::{DEGREE, Series};
use crate::simd::{Mask, Real, Simd};

use super::trace::of;

/// Degree of the shorter series: 0.25^13/13! is below 1e-17.
pub(super) const SHORT: usize = 12;

/// Degree of the longer series: 1/20! is below 1e-18.
pub(super) const LONG: usize = 20;

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

/// What is known of the extrema inside of the pieces.
pub(super) struct Extrema<S: Simd> {
    /// Pieces that have none.
    pub(super) has_none: Mask<S>,
    /// 1 for pieces that have one.
    pub(super) has_one: Real<S>,
    /// Where it is, and the output there.
    pub(super) at: Real<S>,
    pub(super) output: Real<S>,
    /// 1 for pieces of which this is not known.
    pub(super) is_unknown: Real<S>,
}

impl<S: Simd> Piece<S> {
    #[inline(always)]
    pub(super) fn at(&self, sigma: Real<S>) -> Real<S> {
        let mut sum = sigma.constant(0.0);
        for c in self.terms.iter().take(self.degree + 1).rev() {
            sum = sum.mul_add(sigma, *c);
        }
        sum
    }

    /// Extrema in (0, 1), where all pieces in `wanted` count.
    #[inline(always)]
    pub(super) fn extrema(&self, wanted: Mask<S>) -> Extrema<S> {
        let zero = self.terms[0].constant(0.0);
        let mut slope = self.terms;
        let (mut sum, mut least, mut most) = (zero, zero, zero);
        let (mut bend, mut lowest, mut highest) = (zero, zero, zero);
        for j in 1..=self.degree {
            slope[j - 1] = self.terms[j] * j as f64;
            sum = sum + slope[j - 1];
            (least, most) = (least.min(sum), most.max(sum));
            if j > 1 {
                bend = slope[j - 1].mul_add((j - 1) as f64, bend);
                (lowest, highest) = (lowest.min(bend), highest.max(bend));
            }
        }
        let turns = wanted & least.lt(0.0) & most.gt(0.0);
        let bends = lowest.lt(0.0) & highest.gt(0.0);
        let (first, last) = (slope[0], sum);
        let changes = (first.lt(0.0) & last.gt(0.0)) | (first.gt(0.0) & last.lt(0.0));
        let has_one = turns & !bends & changes;
        let mut at = zero;
        if has_one.any() {
            let slope = Self {
                terms: slope,
                degree: self.degree - 1,
            };
            at = slope.zero(zero, zero, zero.constant(1.0), has_one);
        }
        let is_unknown = turns & bends;
        Extrema {
            has_none: !(has_one | is_unknown),
            has_one: has_one.select(1.0, zero),
            at,
            output: self.at(at),
            is_unknown: is_unknown.select(1.0, zero),
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

/// Zeros of the derivative in (0, 1), in order.
pub(super) fn turns(y: &Series) -> Vec<f64> {
    let mut zeros = Vec::new();
    crossings(&y.derivative(), 0.0, &mut zeros);
    zeros.sort_by(f64::total_cmp);
    zeros
}
