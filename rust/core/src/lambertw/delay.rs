//! Characteristic roots of the scalar equation with one delay.
//!
//! The roots of s = a0 + a1 e^(-s T), belonging to x'(t) = a0 x(t) + a1 x(t - T), are s_k = W_k(T
//! a1 e^(-a0 T))/T + a0 for every integer k: Armah & Yi, eq. (3), after Asl & Ulsoy (2003) and Yi,
//! Nelson & Ulsoy (2010). Taken literally the formula overflows or cancels for large |a0 T|. Here
//! sigma = s T solves (sigma - alpha) e^sigma = beta, alpha = a0 T, beta = a1 T: the starting value
//! comes from W, or from sigma = log beta + 2 pi i k - log W where W is large, and the steps that
//! follow act on sigma itself with the residual beta e^-sigma - (sigma - alpha) in double-double
//! arithmetic. A sigma near zero (stability boundary) is solved for from alpha + beta, so that its
//! sign is right. Error: a few 2^-53 |s|, more only where two roots meet (1 + W small), where the
//! inputs do not determine the root better either.

use num_complex::Complex64;

use crate::simd::{Complex, Mask, Real, Simd};

use super::branch_point::{INVERSE_E, one_plus_w};
use super::elementary::{Reduced, cos_sin, exp, rough_log};
use super::guess::{
    BEHIND_RADIUS, PRINCIPAL_RADIUS, behind, logarithm, logarithmic_step, principal,
};
use super::huge_branch::{HUGE_BRANCH, fixed_point};
use super::refine::{Scaled, correction};
use super::special_values;
use crate::simd::double_double::{DoubleDouble, product};

/// Largest products a0 T and a1 T; beyond, the result is NaN.
const LARGEST: f64 = 1e300;
/// log |z| below which W_0 equals its Taylor polynomial of low order.
const SMALL: f64 = -20.0;
/// log |z| from which on two roots cannot be close to each other.
const APART: f64 = 3.0;
/// |log z| above which w is real up to rounding errors, and its powers might overflow.
const LARGE: f64 = 1e40;
/// |1 + e z| below which two roots (nearly) meet and the series is the result.
const MEETING: f64 = 1.0 / 8_192.0;
/// |1 + e z| below which the series is the starting value.
const NEARLY_MEETING: f64 = 0.125;
/// |sigma| below which the difference of 1 and e^-sigma is summed by its series.
const NEAR_ZERO: f64 = 1.0 / 256.0;
/// -1/7!, 1/6!, …, 1/2!: what follows 1/8! in (e^-s - 1 + s)/s^2, highest power first.
const EXP_TAIL: [f64; 6] = [
    -1.0 / 5_040.0,
    1.0 / 720.0,
    -1.0 / 120.0,
    1.0 / 24.0,
    -1.0 / 6.0,
    0.5,
];

/// Arguments that the kernel does not handle: not finite, no delayed term, or large branches.
#[inline(always)]
pub(super) fn out_of_reach<S: Simd>([a0, a1, delay, k]: [Real<S>; 4]) -> Mask<S> {
    let sound = a0.abs().lt(f64::INFINITY)
        & a1.abs().lt(f64::INFINITY)
        & delay.lt(f64::INFINITY)
        & delay.gt(0.0);
    let moderate = (a0 * delay).abs().le(LARGEST) & (a1 * delay).abs().le(LARGEST);
    !(sound & moderate) | a1.eq(0.0) | k.abs().ge(HUGE_BRANCH as f64)
}

/// The root for arguments that the vectorised code does not handle.
pub(super) fn far_root(a0: f64, a1: f64, delay: f64, k: i64) -> Complex64 {
    let (alpha, beta) = (a0 * delay, a1 * delay);
    let sound = a0.is_finite() && a1.is_finite() && delay.is_finite() && delay >= 0.0;
    if !sound || alpha.abs() > LARGEST || beta.abs() > LARGEST {
        return Complex64::new(f64::NAN, f64::NAN);
    }
    if a1 == 0.0 || delay == 0.0 {
        return without_delay(a0, a1, k);
    }
    let angle = libm::atan2(0.0, beta);
    let log = Complex64::new(
        libm::log(a1.abs()) + libm::log(delay),
        if k < 0 { -angle } else { angle },
    );
    let sigma = fixed_point(log, alpha, k.unsigned_abs());
    let im = sigma.im.abs() / delay;
    Complex64::new(sigma.re / delay, if k < 0 { -im } else { im })
}

fn without_delay(a0: f64, a1: f64, k: i64) -> Complex64 {
    if k == 0 {
        return Complex64::new(a0 + a1, 0.0);
    }
    let w = special_values::lambertw(Complex64::new(0.0_f64.copysign(a1), 0.0), k);
    let im = if w.im == 0.0 {
        w.im
    } else {
        f64::INFINITY.copysign(w.im)
    };
    Complex64::new(f64::NEG_INFINITY, im)
}

/// (sigma - alpha) e^sigma = beta on branch k >= 0, below the cut where `mirrored`.
struct Problem<S: Simd> {
    alpha: DoubleDouble<S>,
    /// beta = factor 2^exponent.
    factor: DoubleDouble<S>,
    exponent: Real<S>,
}

/// The root for arguments that the kernel handles.
#[inline(always)]
pub(super) fn root<S: Simd>([a0, a1, delay, k]: [Real<S>; 4]) -> Complex<S> {
    let zero = k.constant(0.0);
    let scaled = Scaled::new(Complex::new(a1, zero));
    let lag = Scaled::new(Complex::new(delay, zero));
    let problem = Problem {
        alpha: product(a0, delay),
        factor: product(scaled.value.re, lag.value.re),
        exponent: scaled.exponent + lag.exponent,
    };
    let sigma = problem.solve(k.abs(), k.lt(0.0));
    // The half plane Im W >= 0 belongs to k >= 0.
    Complex::new(
        sigma.re / delay,
        (sigma.im / delay).signed(k.lt(0.0).select(-0.0, zero)),
    )
}

impl<S: Simd> Problem<S> {
    #[inline(always)]
    fn solve(&self, k: Real<S>, mirrored: Mask<S>) -> Complex<S> {
        let zero = k.constant(0.0);
        let alpha = self.alpha.hi;
        let negative = self.factor.hi.lt(0.0);
        let angle = negative.select(std::f64::consts::PI, zero);
        let turned = k.mul_add(std::f64::consts::TAU, mirrored.select(-angle, angle));
        let log_beta = self
            .exponent
            .mul_add(std::f64::consts::LN_2, rough_log(self.factor.hi.abs()));
        let log_modulus = log_beta - alpha;

        let principal_branch = k.eq(0.0);
        let joined = principal_branch | (k.eq(1.0) & mirrored & negative);
        let small = principal_branch & log_modulus.lt(SMALL);
        // Arguments for which the sheets that meet at -1/e can be close.
        let close = joined & log_modulus.gt(SMALL) & log_modulus.lt(APART);
        let large = log_modulus.abs().gt(LARGE);

        let mut start = Complex::new(zero, zero);
        let mut met = start;
        let mut real = joined & (!negative | log_modulus.lt(0.0));
        let mut meeting = k.lt(0.0);
        let mut started = small;
        if small.any() {
            let z = self.small_argument(small);
            let w = z * (((z * -1.5 + 1.0) * -z) + 1.0);
            start = Complex::new(alpha + w, zero);
        }
        if close.any() {
            let h = self.one_plus_ez(close);
            real = (close & h.ge(0.0)) | (real & !close);
            meeting = close & h.abs().lt(MEETING);
            let one = zero.constant(1.0);
            let magnitude = (h.abs() * 2.0).sqrt();
            let complex = h.lt(0.0);
            let root = Complex::new(
                complex.select(0.0, magnitude),
                complex.select(magnitude, zero),
            );
            // Below the axis the root of 1 + e z is conjugate and the sheet behind takes minus.
            let back = !(principal_branch | complex);
            let near = one_plus_w(back.choose(-root, root));
            met = Complex::new((alpha - 1.0) + (near.re + self.alpha.lo), near.im);
            let z = (h - 1.0) * INVERSE_E;
            let within = close & h.abs().lt(NEARLY_MEETING);
            let front = principal_branch & z.abs().lt(PRINCIPAL_RADIUS);
            let behind_it = !principal_branch & h.abs().lt(BEHIND_RADIUS * std::f64::consts::E);
            let by_root = close & (within | front | behind_it);
            let root = by_root.choose(root, Complex::new(one, zero));
            let flat = Complex::new(by_root.select(z, one), zero);
            let below = Complex::new(root.re, -root.im);
            let rational = principal_branch.choose(principal(flat, root), behind(below));
            let w = within.choose(near.shifted(-1.0), rational);
            start = by_root.choose(w.shifted(alpha), start);
            started = started | by_root;
        }
        if (!started).any() {
            let log = Complex::new(large.select(1.0, log_modulus), turned);
            let mut w = logarithmic_step(log, log);
            let first = k.eq(1.0);
            if first.any() {
                w = first.choose(logarithmic_step(w, log), w);
            }
            let mut taken = logarithm(w);
            if large.any() {
                let along = log_modulus.is_negative().select(std::f64::consts::PI, zero);
                let huge = Complex::new(rough_log(log_modulus.abs().larger(1.0)), along);
                taken = large.choose(huge, taken);
            }
            let sigma = Complex::new(log_beta - taken.re, turned - taken.im);
            start = started.choose(start, sigma);
        }

        let kept = small | meeting;
        let mut sigma = folded(start, real);
        for _ in 0..2 {
            let stepped = folded(sigma + self.step(sigma), real);
            sigma = kept.choose(sigma, stepped);
        }
        let near = sigma.re.abs().lt(NEAR_ZERO) & sigma.im.abs().lt(NEAR_ZERO);
        if near.any() {
            sigma = near.choose(self.near_zero(sigma), sigma);
        }
        sigma = meeting.choose(met, sigma);
        // With beta = -alpha one root is zero, and W = -alpha: on the upper sheet up to alpha = 1,
        // on the lower one from there on. The steps leave an error of about 1e-87.
        let balanced = self.alpha.hi.eq(-self.factor.hi * self.beta_power())
            & self.alpha.lo.eq(-self.factor.lo * self.beta_power());
        let upper_sheet = principal_branch & alpha.le(1.0);
        let lower_sheet = joined & !principal_branch & alpha.ge(1.0);
        let at_zero = balanced & (upper_sheet | lower_sheet);
        at_zero.choose(Complex::new(zero, zero), sigma).folded()
    }

    /// 2^exponent, within the range in which beta and alpha can balance or a sigma be near zero:
    /// beta is of the size of alpha there, or so small that it does not matter.
    #[inline(always)]
    fn beta_power(&self) -> Real<S> {
        self.exponent
            .larger(-1_000.0)
            .smaller(1_000.0)
            .power_of_two()
    }

    /// z = beta e^-alpha where `wanted`, zero where it underflows.
    #[inline(always)]
    fn small_argument(&self, wanted: Mask<S>) -> Real<S> {
        let zero = self.alpha.hi.constant(0.0);
        let reached = wanted & self.alpha.hi.lt(1_500.0);
        let alpha = reached.select(self.alpha.hi, zero);
        let (factor, exponent) = exp(-alpha, reached.select(-self.alpha.lo, zero));
        let exponent = exponent + self.exponent;
        // Beyond the normal numbers the term is negligible beside alpha.
        let seen = reached & exponent.gt(-1_000.0);
        let power = seen.select(exponent, zero).power_of_two();
        seen.select(self.factor.hi * factor.hi * power, zero)
    }

    /// 1 + e z to 2^-61 where `wanted`.
    #[inline(always)]
    fn one_plus_ez(&self, wanted: Mask<S>) -> Real<S> {
        let zero = self.alpha.hi.constant(0.0);
        let one = zero.constant(1.0);
        let alpha = DoubleDouble::new(
            wanted.select(self.alpha.hi, zero),
            wanted.select(self.alpha.lo, zero),
        );
        let argument = DoubleDouble::from_word(one)
            .plus(alpha.negated())
            .normalised();
        let (factor, power) = exp(argument.hi, argument.lo);
        let power = wanted.select(power + self.exponent, zero).power_of_two();
        let ez = factor.times(self.factor).scaled(power);
        DoubleDouble::from_word(one).plus(ez).rounded()
    }

    #[inline(always)]
    fn step(&self, sigma: Complex<S>) -> Complex<S> {
        let (modulus, power) = exp(-sigma.re, sigma.re.constant(0.0));
        let Reduced {
            cosine,
            sine,
            quarters,
        } = cos_sin(sigma.im, sigma.im.constant(0.0));
        // The quarter turns exchange cosine and sine and determine their signs.
        let odd = quarters.abs().eq(1.0);
        let half = quarters.abs().eq(2.0);
        let zero = quarters.constant(0.0);
        let flip_re = (half | quarters.eq(1.0)).select(-0.0, zero);
        let flip_im = (half | quarters.eq(-1.0)).select(0.0, zero.constant(-0.0));
        let power = (power + self.exponent).power_of_two();
        let modulus = modulus.times(self.factor).scaled(power);
        let w_re = DoubleDouble::from_word(sigma.re)
            .plus(self.alpha.negated())
            .normalised();
        let t_re = modulus.times(chosen(odd, sine, cosine)).flipped(flip_re);
        let t_im = modulus.times(chosen(odd, cosine, sine)).flipped(flip_im);
        let d = Complex::new(
            t_re.plus(w_re.negated()).rounded(),
            (t_im.hi - sigma.im) + t_im.lo,
        );
        let w = Complex::new(w_re.hi, sigma.im);
        let large = w.re.abs().gt(LARGE);
        if large.any() {
            let one = w.re.constant(1.0);
            let moderate = Complex::new(large.select(one, w.re), w.im);
            let kept = Complex::new(large.select(0.0, d.re), large.select(0.0, d.im));
            let along = Complex::new(d.re / w.re, d.im / w.re);
            large.choose(along, correction(moderate, kept))
        } else {
            correction(w, d)
        }
    }

    /// Newton's method on sigma - (alpha + beta) - beta (e^-sigma - 1) where its terms are small.
    #[inline(always)]
    fn near_zero(&self, sigma: Complex<S>) -> Complex<S> {
        let zero = sigma.re.constant(0.0);
        let beta = self.factor.scaled(self.beta_power());
        let sum = self.alpha.plus(beta).rounded();
        let one = zero.constant(1.0);
        let one_plus_beta = DoubleDouble::from_word(one).plus(beta).rounded();
        // A common factor keeps the squares of the division in range.
        let unit = one / (beta.hi.abs() + 1.0);
        let mut s = sigma;
        for _ in 0..3 {
            // e^-s - 1 + s = s^2 times this.
            let mut series = Complex::new(zero.constant(1.0 / 40_320.0), zero);
            for coefficient in EXP_TAIL {
                series = (series * s).shifted(coefficient);
            }
            let tail = s * s * series;
            let value = s.scaled(one_plus_beta).shifted(-sum) - tail.scaled(beta.hi);
            let slope = (tail - s).scaled(beta.hi).shifted(one_plus_beta);
            let flat = slope.re.eq(0.0) & slope.im.eq(0.0);
            let divisor = flat.choose(Complex::new(one, zero), slope.scaled(unit));
            s = flat.choose(s, s - value.scaled(unit).over(divisor));
        }
        s
    }
}

/// In the upper half plane; on the real axis where `real`.
#[inline(always)]
fn folded<S: Simd>(sigma: Complex<S>, real: Mask<S>) -> Complex<S> {
    Complex::new(sigma.re, real.select(0.0, sigma.im.abs()))
}

/// In each lane `yes` where the mask is true, `no` elsewhere.
#[inline(always)]
fn chosen<S: Simd>(mask: Mask<S>, yes: DoubleDouble<S>, no: DoubleDouble<S>) -> DoubleDouble<S> {
    DoubleDouble::new(mask.select(yes.hi, no.hi), mask.select(yes.lo, no.lo))
}
