//! The two real branches, on real arguments.
//!
//! The same starting values and the same last step as for complex arguments, with half the
//! operations and no angle. W_0 is defined on [-1/e, inf), W_-1 on [-1/e, 0). The double next to
//! -1/e lies 1.2e-17 below it; it counts as -1/e, where both are -1; the results are NaN from the
//! next double on. Error: 0.54 ulp.

use crate::simd::{Real, Simd};

use super::branch_point::{INVERSE_E, INVERSE_E_LOW, SERIES};
use super::coefficients::{
    LOWER_DENOMINATOR, LOWER_NUMERATOR, PRINCIPAL_DENOMINATOR, PRINCIPAL_NUMERATOR,
};
use super::elementary::{exp, rough_log};
use super::guess::PRINCIPAL_RADIUS;
use super::kernel::{SERIES_ANSWERS, SERIES_STARTS, SMALL};
use super::refine::SCALE_LIFT;
use crate::simd::double_double::DoubleDouble;

/// Largest argument for which W_-1 has a rational starting value.
const LOWER_END: f64 = -1.0 / 256.0;

/// W_0(x), NaN outside its domain.
#[inline(always)]
pub(super) fn lambertw0<S: Simd>(x: Real<S>) -> Real<S> {
    let offset = (x + INVERSE_E) + INVERSE_E_LOW;
    let small = x.abs().lt(SMALL);
    let by_series = offset.lt(SERIES_STARTS);
    let answered = offset.lt(SERIES_ANSWERS);
    let by_logarithm = x.ge(PRINCIPAL_RADIUS);

    let root = (offset.larger(0.0) * (2.0 * std::f64::consts::E)).sqrt();
    let quotient =
        polynomial(&PRINCIPAL_NUMERATOR, root) / polynomial(&PRINCIPAL_DENOMINATOR, root);
    let mut start = x * quotient;
    if by_series.any() {
        start = by_series.select(near_branch_point(root) - 1.0, start);
    }
    if by_logarithm.any() {
        let scaled = Scaled::new(x);
        start = by_logarithm.select(by_log(scaled.log()), start);
    }
    let done = small | answered;
    let mut w = start;
    if (!done).any() {
        // Down to 2^-1013, where w is 702, the low word keeps eleven bits, which is sufficient.
        let (modulus, exponent) = exp(-start, start.constant(0.0));
        let t = modulus.scaled(exponent.power_of_two()).times_word(x);
        w = done.select(start, stepped(start, t));
    }
    w = small.select(x.negated_mul_add(x, x), w);
    let w = x.eq(f64::INFINITY).select(x, w);
    x.ge(-INVERSE_E).select(w, x.constant(f64::NAN))
}

/// W_-1(x), NaN outside its domain, -inf at zero.
#[inline(always)]
pub(super) fn lambertwm1<S: Simd>(x: Real<S>) -> Real<S> {
    let offset = (x + INVERSE_E) + INVERSE_E_LOW;
    let by_series = offset.lt(SERIES_STARTS);
    let answered = offset.lt(SERIES_ANSWERS);
    let by_rational = x.le(LOWER_END);

    let root = (offset.larger(0.0) * (2.0 * std::f64::consts::E)).sqrt();
    let mut start = root;
    if by_rational.any() {
        start = polynomial(&LOWER_NUMERATOR, root) / polynomial(&LOWER_DENOMINATOR, root);
    }
    if by_series.any() {
        start = by_series.select(near_branch_point(-root) - 1.0, start);
    }
    let scaled = Scaled::new(x);
    if (!by_rational).any() {
        start = by_rational.select(start, by_log(scaled.log()));
    }
    let mut w = start;
    if (!answered).any() {
        let (modulus, exponent) = exp(-start, start.constant(0.0));
        let power = (exponent + scaled.exponent).power_of_two();
        let t = modulus.scaled(power).times_word(scaled.mantissa);
        w = answered.select(start, stepped(start, t));
    }
    let w = x.eq(0.0).select(f64::NEG_INFINITY, w);
    let inside = x.ge(-INVERSE_E) & x.le(0.0);
    inside.select(w, x.constant(f64::NAN))
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

/// `1 + w` from `p`, as in `branch_point`.
#[inline(always)]
fn near_branch_point<S: Simd>(p: Real<S>) -> Real<S> {
    (polynomial(&SERIES, p) * p).mul_add(p, p)
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

/// The last step, as in `refine`, with t = x e^-w.
#[inline(always)]
fn stepped<S: Simd>(w: Real<S>, t: DoubleDouble<S>) -> Real<S> {
    // One division for 1/w and 1/(1 + w). This and everything that follows from it is computed
    // before d is known.
    let u = w + 1.0;
    let both = w.constant(1.0) / (w * u);
    let (inverse, v) = (both * u, both * w);
    let square = v * v;
    let first = square.mul_add(0.5, -0.5);
    let second = v
        .mul_add(0.5, -1.0 / 3.0)
        .mul_add(v, -0.5)
        .mul_add(square, 1.0 / 3.0);
    let third = v
        .mul_add(0.625, -5.0 / 6.0)
        .mul_add(v, -0.5)
        .mul_add(v, 0.5)
        .mul_add(v, 11.0 / 24.0)
        .mul_add(square, -0.25);
    let d = (t.hi - w) + t.lo;
    let eta = d * inverse;
    let third = eta.mul_add(0.2, third);
    let series = third.mul_add(eta, second).mul_add(eta, first);
    (d * v).mul_add(series.mul_add(eta, 1.0), w)
}
