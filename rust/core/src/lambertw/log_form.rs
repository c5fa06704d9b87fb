//! W of an argument given by its logarithm: w + log w = log z + 2 pi i k.
//!
//! No z is too large or too small then, and Im log z may have any value: with Im log z beyond ±pi
//! the equation goes on analytically, which makes the Wright omega function of it (Corless &
//! Jeffrey 2002) for k = 0. In the last step t = z e^-w = exp(log z - w) needs no z either; the
//! difference is formed in double-double arithmetic, and so is the angle theta = Im log z + 2 pi k.
//! Beside the branch point, at log z = -1 ± i pi, 1 + e z = -expm1(log z + 1 ∓ i pi) keeps its
//! digits. Error: as for W itself, 0.51 * 2^-52 of |w|.

use std::f64::consts::{PI, TAU};

use num_complex::Complex64;

use crate::simd::{Complex, Kernel, Mask, Real, SHORT, Simd, sweep};

use super::branch_point::one_plus_w as near_branch_point;
use super::guess::{behind, logarithmic_step, principal};
use super::huge_branch::{HUGE_BRANCH, turns};
use super::kernel::{SERIES_ANSWERS, SERIES_STARTS, reflected};
use super::refine::{Scaled, correction, product_with_exp};
use crate::simd::double_double::{DoubleDouble, ordered_sum, product, sum};

/// Low words of 2 pi and pi.
const TURN_LOW: f64 = 2.449_293_598_294_706_4e-16;
const HALF_TURN_LOW: f64 = 1.224_646_799_147_353_2e-16;
/// |Im log z| from which on elements are handled one at a time.
const FAR_ANGLE: f64 = 4_194_304.0;
/// |Re log z| from which on w is found by fixed-point iteration on its logarithm.
const FAR_MODULUS: f64 = 1e7;
/// log 1024, up to which the rational starting value is used.
const PRINCIPAL_LOG: f64 = 6.931_471_805_599_453;
/// log |z| below which W_0(z) = z - z^2 to working precision.
const SMALL: f64 = -20.8;
/// Distance of log z from -1 ± i pi up to which the rational function for the sheet behind is used.
const BEHIND: f64 = 0.5;
/// 1/11!, …, 1/2!, 1: expm1(x)/x, highest power first.
const EXPM1: [f64; 11] = [
    1.0 / 39_916_800.0,
    1.0 / 3_628_800.0,
    1.0 / 362_880.0,
    1.0 / 40_320.0,
    1.0 / 5_040.0,
    1.0 / 720.0,
    1.0 / 120.0,
    1.0 / 24.0,
    1.0 / 6.0,
    0.5,
    1.0,
];

/// Arguments that the vectorised code does not handle.
#[inline(always)]
pub(super) fn out_of_reach<S: Simd>(log: Complex<S>, k: Real<S>) -> Mask<S> {
    let reached =
        log.re.abs().lt(FAR_MODULUS) & log.im.abs().lt(FAR_ANGLE) & k.abs().lt(HUGE_BRANCH as f64);
    !reached
}

/// W for arguments that the vectorised code handles.
#[inline(always)]
pub(super) fn lambertw<S: Simd>(log: Complex<S>, k: Real<S>) -> Complex<S> {
    let turn = product(k, k.constant(TAU));
    let angle = sum(log.im, turn.hi);
    let angle = ordered_sum(angle.hi, angle.lo + k.mul_add(TURN_LOW, turn.lo));
    // The lower half plane is the mirror image of the upper one.
    let side = k.eq(0.0).select(log.im.sign(), angle.hi.sign());
    reflected(upper(log.re, angle.flipped(side)), side)
}

/// `angle` is not negative.
#[inline(always)]
fn upper<S: Simd>(modulus: Real<S>, angle: DoubleDouble<S>) -> Complex<S> {
    let zero = modulus.constant(0.0);
    let one = modulus.constant(1.0);
    let unit = Complex::new(one, one);
    let beyond = (angle.hi - PI) + (angle.lo - HALF_TURN_LOW);
    let front = beyond.le(0.0);
    let zeta = Complex::new(modulus + 1.0, beyond);
    let square = zeta.square_modulus();
    let scale = std::f64::consts::E;
    let by_series = square.lt((SERIES_STARTS * scale) * (SERIES_STARTS * scale));
    let answered = square.lt((SERIES_ANSWERS * scale) * (SERIES_ANSWERS * scale));
    let small = front & modulus.lt(SMALL);
    let by_principal = front & modulus.lt(PRINCIPAL_LOG);
    let by_behind = !front & square.lt(BEHIND * BEHIND);
    let by_logarithm = !(by_principal | by_behind);

    let mut start = unit;
    let mut w = unit;
    let near = by_principal | by_behind;
    if near.any() {
        // Below 2^-1022 z is scaled by 2^600; at e^-800 it is zero.
        let deep = small & modulus.lt(-200.0);
        let lift = deep.select(600.0, zero);
        let exponent = Complex::new(
            near.select(-modulus.larger(-800.0), zero),
            near.select(-angle.hi, zero),
        );
        let low = Complex::new(zero, near.select(-angle.lo, zero));
        let t = product_with_exp(Scaled::power(lift), exponent, Some(low));
        let z = Complex::new(t.re.rounded(), t.im.rounded());
        let mut h = z.affine(std::f64::consts::E, 1.0);
        if by_series.any() {
            let mut series = Complex::new(zero, zero);
            for coefficient in EXPM1 {
                series = series.mul_add(zeta, coefficient);
            }
            h = by_series.choose(-(series * zeta), h);
        }
        let root = h.scaled(2.0).sqrt();
        if by_series.any() {
            w = near_branch_point(by_behind.choose(-root, root)).shifted(-1.0);
        }
        if small.any() {
            let square = Complex::new((z.re - z.im) * (z.re + z.im), z.re * z.im * 2.0);
            let square = deep.choose(Complex::new(zero, zero), square);
            let unlift = (-lift).power_of_two();
            let tiny = Complex::new(
                t.re.hi + (t.re.lo - square.re),
                t.im.hi + (t.im.lo - square.im),
            );
            w = small.choose(tiny.scaled(unlift), w);
        }
        start = by_series.choose(w, principal(z, root));
        if by_behind.any() {
            start = (by_behind & !by_series).choose(behind(root), start);
        }
    }
    let done = small | answered;
    if (!done).any() {
        if by_logarithm.any() {
            let log = Complex::new(modulus, angle.hi);
            let mut far = logarithmic_step(log, log);
            let first = angle.hi.lt(3.0 * PI);
            if first.any() {
                far = first.choose(logarithmic_step(far, log), far);
            }
            start = by_logarithm.choose(far, start);
        }
        let start = start.folded();
        let re = sum(start.re, -modulus);
        let im = sum(start.im, -angle.hi);
        let exponent = Complex::new(re.hi, im.hi);
        let low = Complex::new(re.lo, im.lo - angle.lo);
        let t = product_with_exp(Scaled::power(zero), exponent, Some(low));
        let change = correction(start, t.less(start));
        w = done.choose(w, start + change);
    }
    w.folded()
}

/// W at an angle given as a double-double.
struct AtAngle;

impl Kernel<3, 2> for AtAngle {
    // Of few numbers.
    const IS_WIDE: bool = false;

    #[inline(always)]
    fn lanes<S: Simd>(&self, [modulus, angle, low]: [Real<S>; 3]) -> [Real<S>; 2] {
        let side = angle.sign();
        let w = upper(modulus, DoubleDouble::new(angle, low).flipped(side));
        let w = reflected(w, side);
        [w.re, w.im]
    }
}

/// W of an argument that the kernel handles, as a single element.
fn at_angle(modulus: f64, angle: f64, low: f64) -> Complex64 {
    let arguments = [modulus, angle, low].map(|argument| [argument; SHORT]);
    let mut values = [[0.0; SHORT]; 2];
    sweep(&AtAngle, &arguments, &mut values, 1);
    let [[re, ..], [im, ..]] = values;
    Complex64::new(re, im)
}

/// W for arguments that the vectorised code does not handle.
pub(super) fn far(log: Complex64, k: i64) -> Complex64 {
    // The angle as a double-double.
    let [turn, turn_low] = turns(k.unsigned_abs());
    let (turn, turn_low) = if k < 0 {
        (-turn, -turn_low)
    } else {
        (turn, turn_low)
    };
    let rounded = log.im + turn;
    let from_turn = rounded - log.im;
    let rest = (log.im - (rounded - from_turn)) + (turn - from_turn) + turn_low;
    // Where turns cancel, the low words may be as large as the difference.
    let angle = rounded + rest;
    let low = rest - (angle - rounded);
    if log.re.is_nan() || !angle.is_finite() {
        return Complex64::new(f64::NAN, f64::NAN);
    }
    if log.re < -FAR_MODULUS && angle.abs() <= PI {
        // e^-10000000 is zero.
        return Complex64::new(0.0_f64.copysign(libm::cos(angle)), 0.0_f64.copysign(angle));
    }
    if log.re.is_infinite() {
        let side = if log.re < 0.0 {
            PI.copysign(angle)
        } else {
            0.0
        };
        return Complex64::new(log.re, angle - side);
    }
    if log.re.abs() < FAR_MODULUS && angle.abs() < FAR_ANGLE {
        // Turns that cancel: the difference is in the range of the kernel.
        return at_angle(log.re, angle, low);
    }
    (0..4).fold(Complex64::new(log.re, angle), |w, _| {
        // A common factor keeps the hypotenuse in range.
        let modulus = libm::log(libm::hypot(w.re * 0.5, w.im * 0.5)) + std::f64::consts::LN_2;
        let turned = libm::atan2(w.im, w.re);
        Complex64::new(log.re - modulus, angle + (low - turned))
    })
}
