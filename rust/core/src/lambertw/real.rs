//! The two real branches, on real arguments.
//!
//! W_0 is defined on [-1/e, inf), W_-1 on [-1/e, 0). The double next to -1/e lies 1.2e-17 below
//! it; it counts as -1/e, where both are -1; the results are NaN from the next double on.
//!
//! *W_0 below zero.* W_0(x)/x is analytic in p = sqrt(2 (1 + e x)) as far as p = -sqrt 2. It is
//! computed as c - p, which two words hold exactly, and a polynomial for the rest. That rest is at
//! most a seventh of it, and so are its rounding errors; x (c - p) is added last.
//! *Elsewhere* a rational starting value in x or p, or two steps on w + log w = log x where that
//! does not reach, and one step of third order on w = X e^-a: X = x and a = w for W_0, X = e x and
//! a = 1 + w for W_-1, which keeps the digits of 1 + w next to -1/e. The residual is formed in two
//! words with the error of a small part of e^-a only.
//!
//! Error: below an ulp; at most 0.91 of it at five million points.

use crate::simd::{Real, Simd};

use super::branch_point::INVERSE_E;
use super::elementary::rough_log;
use super::kernel::SMALL;
use super::real_coefficients::{
    ABOVE_DENOMINATOR, ABOVE_NUMERATOR, EXP_REST, LOWER_DENOMINATOR, LOWER_NUMERATOR, RATIO_CENTRE,
    RATIO_REST, RATIO_SLOPE, RATIO_TOP,
};
use super::refine::SCALE_LIFT;
use crate::simd::double_double::{DoubleDouble, ordered_sum, product};

/// Largest argument for which W_0 has a rational starting value.
const ABOVE_END: f64 = 1_024.0;
/// Largest argument for which W_-1 has one.
const LOWER_END: f64 = -1.0 / 256.0;
/// e to 106 bits.
const E: f64 = std::f64::consts::E;
const E_LOW: f64 = 1.445_646_891_729_250_2e-16;
/// Derivative of W_0(x)/x by p where p is zero; it falls to half of it at p = 1/2.
const STEEP: f64 = -E;
/// Derivative of the polynomial of [`below_zero`] by t^2, where it is large.
const BY_SQUARE: f64 = 0.87;
/// Share of log 2 by which the range of r lies lower: where a is small, r is a for longer.
const AHEAD: f64 = 0.078_125;
const LOG2_E: f64 = std::f64::consts::LOG2_E;
/// ln 2 in pieces of 40 and 53 bits.
const LN_2: [f64; 2] = [0.693_147_180_559_208_2, 7.371_002_565_167_799e-13];

/// W_0(x), NaN outside its domain.
#[inline(always)]
pub(super) fn lambertw0<S: Simd>(x: Real<S>) -> Real<S> {
    let below = x.lt(-SMALL);
    let above = x.ge(SMALL);
    let mut w = x.negated_mul_add(x, x);
    if below.any() {
        w = below.select(below_zero(x), w);
    }
    if above.any() {
        // Elsewhere the square of x may be subnormal, which is slow.
        let x = above.select(x, x.constant(1.0));
        w = above.select(above_zero(x), w);
    }
    w
}

/// W_0 below zero.
#[inline(always)]
fn below_zero<S: Simd>(x: Real<S>) -> Real<S> {
    let twice = times_e(x, 2.0);
    let square = ordered_sum(x.constant(2.0), twice.hi);
    let square = DoubleDouble::new(square.hi, square.lo + twice.lo);
    // NaN where x lies below -1/e.
    let p = square.rounded().sqrt();
    let t = ordered_sum(x.constant(-RATIO_CENTRE), p);
    let first = ordered_sum(x.constant(RATIO_TOP), -t.hi);
    let rest = polynomial(&RATIO_REST, t.hi);
    // What is lost in p - 1, in its square within the polynomial, and in p^2 and its root.
    let low = t.lo.mul_add(p.mul_add(-STEEP, STEEP), first.lo);
    let low = product(t.hi, t.hi).lo.mul_add(BY_SQUARE, low);
    let off = p.negated_mul_add(p, square.hi) + square.lo;
    let low = polynomial(&RATIO_SLOPE, p).mul_add(off, low);
    let w = x.mul_add(first.hi, x * (rest + low));
    x.eq(-INVERSE_E).select(-1.0, w)
}

/// W_0 from [`SMALL`] on.
#[inline(always)]
fn above_zero<S: Simd>(x: Real<S>) -> Real<S> {
    let by_logarithm = x.gt(ABOVE_END);
    let mut w = x;
    let mut v = x;
    if (!by_logarithm).any() {
        let numerator = x * polynomial(&ABOVE_NUMERATOR, x);
        let denominator = polynomial(&ABOVE_DENOMINATOR, x);
        let sum = denominator + numerator;
        // w = N/D and 1/(1 + w) = D/(D + N) with one division.
        let inverse = x.constant(1.0) / (denominator * sum);
        w = numerator * sum * inverse;
        v = denominator * denominator * inverse;
    }
    if by_logarithm.any() {
        let other = by_log(Scaled::new(x).log());
        w = by_logarithm.select(other, w);
        v = by_logarithm.select(other.constant(1.0) / (other + 1.0), v);
    }
    let equation = Equation {
        a: w,
        factor: DoubleDouble::from_word(x),
        exponent: None,
    };
    let w = stepped(w, v, equation);
    x.eq(f64::INFINITY).select(x, w)
}

/// W_-1(x), NaN outside its domain, -inf at zero.
#[inline(always)]
pub(super) fn lambertwm1<S: Simd>(x: Real<S>) -> Real<S> {
    let by_logarithm = x.gt(LOWER_END);
    let mut factor = times_e(x, 1.0);
    // NaN where x lies below -1/e.
    let p = ((factor.hi + 1.0) + factor.lo).sqrt();
    // 1 + w = -p N/D and its inverse with one division.
    let numerator = p * polynomial(&LOWER_NUMERATOR, p);
    let denominator = polynomial(&LOWER_DENOMINATOR, p);
    let inverse = x.constant(-1.0) / (numerator * denominator);
    let mut w = (numerator * numerator).mul_add(inverse, -1.0);
    let mut v = denominator * denominator * inverse;
    let mut exponent = x.constant(0.0);
    if by_logarithm.any() {
        let scaled = Scaled::new(x);
        let other = by_log(scaled.log());
        // Zero has the scale of a normal number here, and a result above it.
        w = by_logarithm.select(x.le(0.0).select(other, x.constant(f64::NAN)), w);
        v = by_logarithm.select(other.constant(1.0) / (other + 1.0), v);
        let mantissa = times_e(scaled.mantissa, 1.0);
        factor.hi = by_logarithm.select(mantissa.hi, factor.hi);
        factor.lo = by_logarithm.select(mantissa.lo, factor.lo);
        exponent = by_logarithm.select(scaled.exponent, exponent);
    }
    let equation = Equation {
        a: w + 1.0,
        factor,
        exponent: Some(exponent),
    };
    let w = stepped(w, v, equation);
    let w = x.eq(-INVERSE_E).select(-1.0, w);
    x.eq(0.0).select(f64::NEG_INFINITY, w)
}

/// `factor` e x in two words; the factor is a power of two.
#[inline(always)]
fn times_e<S: Simd>(x: Real<S>, factor: f64) -> DoubleDouble<S> {
    let high = product(x, x.constant(factor * E));
    DoubleDouble::new(high.hi, x.mul_add(factor * E_LOW, high.lo))
}

/// Even and odd powers by Horner's rule each (half the latency), ascending coefficients.
#[inline(always)]
fn polynomial<S: Simd, const N: usize>(coefficients: &[f64; N], x: Real<S>) -> Real<S> {
    let square = x * x;
    let mut even = x.constant(0.0);
    let mut odd = even;
    for (power, &coefficient) in coefficients.iter().enumerate().rev() {
        if power % 2 == 0 {
            even = even.mul_add(square, coefficient);
        } else {
            odd = odd.mul_add(square, coefficient);
        }
    }
    odd.mul_add(x, even)
}

/// A real number as mantissa times 2^exponent.
#[derive(Clone, Copy)]
struct Scaled<S: Simd> {
    mantissa: Real<S>,
    exponent: Real<S>,
}

impl<S: Simd> Scaled<S> {
    #[inline(always)]
    fn new(x: Real<S>) -> Self {
        let subnormal = x.abs().lt(f64::MIN_POSITIVE);
        let one = x.constant(1.0);
        let lifted = x * subnormal.select(SCALE_LIFT, one);
        Self {
            mantissa: lifted.mantissa().signed(x.sign()),
            exponent: lifted.binade().exponent() - subnormal.select(64.0, one.constant(0.0)),
        }
    }

    /// `log |x|` with low accuracy.
    #[inline(always)]
    fn log(self) -> Real<S> {
        self.exponent
            .mul_add(std::f64::consts::LN_2, rough_log(self.mantissa))
    }
}

/// The starting value where |w| is large: w = log |x| - log |w|, and a step of Fritsch, Shafer &
/// Crowley (1973) on it.
#[inline(always)]
fn by_log<S: Simd>(log: Real<S>) -> Real<S> {
    let w = log - rough_log(log.abs());
    let r = (log - w) - rough_log(w.abs());
    let u = w + 1.0;
    let q = (u + u) * r.mul_add(2.0 / 3.0, u);
    (w * r * (q - r)) / (u * (q - (r + r))) + w
}

/// The equation w = X e^-a.
struct Equation<S: Simd> {
    a: Real<S>,
    /// X over 2^exponent.
    factor: DoubleDouble<S>,
    exponent: Option<Real<S>>,
}

/// `w` after the step of third order on an equation, `v` being 1/(1 + w) to the accuracy of `w`.
///
/// With d = X e^-a - w, the solution moves by d v - (1 + v) (d v)^2/2 + ….
#[inline(always)]
fn stepped<S: Simd>(w: Real<S>, v: Real<S>, equation: Equation<S>) -> Real<S> {
    let Equation {
        a,
        factor,
        exponent,
    } = equation;
    // -a = n log 2 - r; the first difference is exact.
    let n = a.mul_add(-LOG2_E, -AHEAD).nearest();
    let r = ordered_sum(n.mul_add(LN_2[0], a), n * LN_2[1]);
    let first = ordered_sum(a.constant(1.0), -r.hi);
    let rest = polynomial(&EXP_REST, r.hi);
    let low = (r.hi * r.hi).mul_add(rest, r.lo.negated_mul_add(first.hi, first.lo));
    let power = exponent.map_or(n, |exponent| n + exponent);
    let factor = factor.scaled(power.power_of_two());
    let whole = product(factor.hi, first.hi);
    let tail = factor
        .lo
        .mul_add(first.hi, factor.hi.mul_add(low, whole.lo));
    let d = (whole.hi - w) + tail;
    let change = d * v;
    let bend = v.mul_add(-0.5, -0.5) * change;
    w + change.mul_add(bend, change)
}
