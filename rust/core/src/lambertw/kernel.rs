//! The vectorised code for one element: choice of the starting value and of the last step.

use crate::simd::{Complex, Mask, Real, Simd};

use super::branch_point::{
    INVERSE_E, INVERSE_E_LOW, branch_root, deep_branch_root, offset,
    one_plus_w as near_branch_point,
};
use super::elementary::{rough_angle, rough_log};
use super::guess::{BEHIND_RADIUS, PRINCIPAL_RADIUS, behind, logarithmic_step, principal};
use super::huge_branch::HUGE_BRANCH;
use super::refine::{Scaled, correction, product_with_exp};
use crate::simd::double_double::{ordered_sum, sum};

/// Distance from -1/e below which the series is the result. A larger one would need more terms.
pub(super) const SERIES_ANSWERS: f64 = 1.0 / 16_384.0;
/// Distance from -1/e below which the series gives 1 + W more accurately than a step does.
const SERIES_TRUSTED: f64 = 1.0 / 2_048.0;
/// Distance from -1/e below which the series is the starting value.
pub(super) const SERIES_STARTS: f64 = 0.046;
/// Angle between z and the real axis up to which the derivative dw/dz corrects the starting value.
const NARROW: f64 = 1e-9;
/// Modulus below which W_0(z) = z - z^2 to working precision.
pub(super) const SMALL: f64 = 1e-9;

/// W, and 1 + W to its own relative accuracy.
pub(super) struct Answer<S: Simd> {
    pub(super) w: Complex<S>,
    pub(super) one_plus_w: Complex<S>,
}

/// Arguments that the kernel does not handle: zero, infinities, NaN, and large branches.
#[inline(always)]
pub(super) fn out_of_reach<S: Simd>(z: Complex<S>, k: Real<S>) -> Mask<S> {
    // Every comparison with NaN is false.
    let finite = z.re.abs().lt(f64::INFINITY) & z.im.abs().lt(f64::INFINITY);
    let zero = z.re.eq(0.0) & z.im.eq(0.0);
    !finite | zero | k.abs().ge(HUGE_BRANCH as f64)
}

/// An argument, and what belongs to it.
pub(super) struct Point<S: Simd> {
    z: Complex<S>,
    /// The low word of Re z, where there is one.
    low: Option<Real<S>>,
    /// z + 1/e.
    offset: Complex<S>,
}

impl<S: Simd> Point<S> {
    #[inline(always)]
    pub(super) fn new(z: Complex<S>) -> Self {
        Self {
            z,
            low: None,
            offset: offset(z),
        }
    }

    /// The point at `offset` from -1/e.
    #[inline(always)]
    pub(super) fn from_offset(offset: Complex<S>) -> Self {
        let near = sum(offset.re, offset.re.constant(-INVERSE_E));
        let re = ordered_sum(near.hi, near.lo - INVERSE_E_LOW);
        Self {
            z: Complex::new(re.hi, offset.im),
            low: Some(re.lo),
            offset,
        }
    }
}

/// W_k for arguments that the kernel handles; `k` holds whole numbers.
#[inline(always)]
pub(super) fn lambertw<S: Simd>(point: Point<S>, k: Real<S>) -> Answer<S> {
    // W_k(conj z) = conj W_-k(z) brings every case to k >= 0 and, for k = 0, to Im z >= 0;
    // there Im w >= 0.
    let side = k.eq(0.0).select(point.z.im.sign(), k.sign());
    let answer = upper(
        Point {
            z: reflected(point.z, side),
            offset: reflected(point.offset, side),
            ..point
        },
        k.abs(),
    );
    Answer {
        w: reflected(answer.w, side),
        one_plus_w: reflected(answer.one_plus_w, side),
    }
}

/// Conjugated where `side`, which is +0 or -0, has its bit set.
#[inline(always)]
pub(super) fn reflected<S: Simd>(w: Complex<S>, side: Real<S>) -> Complex<S> {
    Complex::new(w.re, w.im.flipped(side))
}

#[inline(always)]
fn upper<S: Simd>(point: Point<S>, k: Real<S>) -> Answer<S> {
    let Point { z, low, offset } = point;
    let one = z.re.constant(1.0);
    let unit = Complex::new(one, one);
    let principal_branch = k.eq(0.0);
    let first = k.eq(1.0);
    let largest = z.re.abs().larger(z.im.abs());
    let small = principal_branch & largest.lt(SMALL);

    // Only these two sheets meet at -1/e.
    let joined = principal_branch | (first & z.im.is_negative());
    // An overflow here stands for a large distance.
    let square = offset.square_modulus();
    let by_series = joined & square.lt(SERIES_STARTS * SERIES_STARTS);
    let answered = joined & square.lt(SERIES_ANSWERS * SERIES_ANSWERS);
    let by_principal = principal_branch & largest.lt(PRINCIPAL_RADIUS);
    let by_behind = first & joined & square.lt(BEHIND_RADIUS * BEHIND_RADIUS);
    let by_logarithm = !(by_principal | by_behind);

    let mut w = unit;
    let mut one_plus_w = unit;
    let mut root = unit;
    if (by_series | by_behind | (by_principal & !small)).any() {
        root = match low {
            None => branch_root(offset),
            Some(_) => deep_branch_root(offset),
        };
    }
    if by_series.any() {
        one_plus_w = near_branch_point(by_behind.choose(-root, root));
        w = one_plus_w.shifted(-1.0);
    }
    if small.any() {
        // As a product of sums, so that an underflow keeps the sign.
        let square = Complex::new((z.re - z.im) * (z.re + z.im), z.re * z.im * 2.0);
        let square = match low {
            None => square,
            Some(low) => square.shifted(-low),
        };
        w = small.choose(z - square, w);
        one_plus_w = small.choose((z - square).shifted(1.0), one_plus_w);
    }
    let done = small | answered;
    if (!done).any() {
        let mut start = w;
        if by_principal.any() {
            start = (by_principal & !by_series).choose(principal(z, root), start);
        }
        if by_behind.any() {
            start = (by_behind & !by_series).choose(behind(root), start);
        }
        let scaled = Scaled::new(z).with_low(low);
        if by_logarithm.any() {
            start = by_logarithm.choose(by_log(z, scaled, k, joined), start);
        }
        let start = start.folded();
        let change = correction(start, product_with_exp(scaled, start, None).less(start));
        w = done.choose(w, start + change);
        let trusted = small | (joined & square.lt(SERIES_TRUSTED * SERIES_TRUSTED));
        one_plus_w = trusted.choose(one_plus_w, start.shifted(1.0) + change);
    }
    Answer {
        w: w.folded(),
        one_plus_w: one_plus_w.folded(),
    }
}

/// The starting value from log z + 2 pi i k.
#[inline(always)]
fn by_log<S: Simd>(z: Complex<S>, scaled: Scaled<S>, k: Real<S>, joined: Mask<S>) -> Complex<S> {
    let first = k.eq(1.0);
    let modulus = scaled.exponent.mul_add(
        std::f64::consts::LN_2,
        rough_log(scaled.value.square_modulus()) * 0.5,
    );
    let angle = k.mul_add(std::f64::consts::TAU, rough_angle(z));
    let log = Complex::new(modulus, angle);
    let mut w = logarithmic_step(log, log);
    if first.any() {
        w = first.choose(logarithmic_step(w, log), w);
    }
    // On the segment on which W_1 is real from below, log z + 2 pi i - log w has an imaginary part
    // of rounding errors. The true one is Im z dw/dz, which is zero where Im z is.
    let flat = z.im.abs().le(z.re.abs() * NARROW);
    let narrow = joined & flat & z.re.lt(0.0) & z.re.gt(-INVERSE_E);
    if narrow.any() {
        let slope = (z.im * w.re) / (z.re * (w.re + 1.0));
        w.im = narrow.select(slope, w.im);
    }
    w
}

/// dW/dz = W/(z (1 + W)) for arguments that the kernel handles.
#[inline(always)]
pub(super) fn derivative<S: Simd>(z: Complex<S>, k: Real<S>) -> Complex<S> {
    let Answer { w, one_plus_w } = lambertw(Point::new(z), k);
    let (z, w) = (Scaled::new(z), Scaled::new(w));
    let exponent = w.exponent - z.exponent;
    // In two factors, because the quotient of extreme numbers exceeds the range of one.
    let half = (exponent * 0.5).nearest();
    w.value
        .over(z.value)
        .scaled(half.power_of_two())
        .over(one_plus_w)
        .scaled((exponent - half).power_of_two())
}
