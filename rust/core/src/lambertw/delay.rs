//! Characteristic roots of the scalar equation with one delay.
//!
//! The roots of s = a0 + a1 e^(-s T), belonging to x'(t) = a0 x(t) + a1 x(t - T), are
//! s_k = W_k(T a1 e^(-a0 T))/T + a0 for every integer k: Armah & Yi, eq. (3), after Asl & Ulsoy
//! (2003) and Yi, Nelson & Ulsoy (2010). Taken literally the formula overflows or cancels for
//! large |a0 T|. Here sigma = s T solves (sigma - alpha) e^sigma = beta, alpha = a0 T,
//! beta = a1 T: the starting value comes from W, or from sigma = log beta + 2 pi i k - log W
//! where W is large, and the steps that follow act on sigma itself with the residual
//! beta e^-sigma - (sigma - alpha) in two words. A sigma near zero (stability boundary) is solved
//! for from alpha + beta, so that its sign is right. Error: a few 2^-53 |s|, more only where
//! two roots meet (1 + W small), where the inputs do not determine the root better either.

use num_complex::Complex64;

use super::branch_point::one_plus_w;
use super::elementary::{cos_sin, exp, power_of_two};
use super::guess::{
    BEHIND_RADIUS, PRINCIPAL_RADIUS, behind, from_logarithm, logarithm, principal, quotient,
};
use super::huge_branch::{HUGE_BRANCH, fixed_point};
use super::refine::{Scaled, correction};
use super::special_values;
use super::two_word::{TwoWord, product};

/// Products a0 T and a1 T up to here are treated; beyond, the answer is NaN.
const LARGEST: f64 = 1e300;
/// log |z| below which W_0 is its own Taylor polynomial.
const SMALL: f64 = -20.0;
/// |w| above which w + 1 = w and the powers of w in the usual step might overflow.
const LARGE: f64 = 1e40;
/// |1 + e z| below which two roots (nearly) meet and the series is the answer.
const MEETING: f64 = 1.0 / 8_192.0;
/// |1 + e z| below which the series is the starting value.
const NEARLY_MEETING: f64 = 0.125;
/// |sigma| below which the difference of 1 and e^-sigma is summed as such.
const NEAR_ZERO: f64 = 1.0 / 256.0;

/// Root `k` of `s = a0 + a1 e^(-s delay)`, in 1/s when `delay` is in s.
///
/// Root 0 has the largest real part; roots `k` and `-k` are conjugate unless `a1 < 0`, where
/// `0` and `-1` are the rightmost pair (conjugate, or both real). `delay = 0` leaves one root,
/// `a0 + a1`, and so does `a1 = 0`; the others have real part `-inf` then.
/// NaN for arguments that are not finite, a negative delay, or products beyond 1e300.
///
/// ```
/// use deadtime::lambertw::dde_root;
///
/// // x'(t) = -x(t - pi/2) is marginally stable: s = i.
/// let s = dde_root(0.0, -1.0, std::f64::consts::FRAC_PI_2, 0);
/// assert!(s.re.abs() < 1e-16 && (s.im - 1.0).abs() < 1e-15);
///
/// // e^(-a0 T) would overflow; the root does not care.
/// let s = dde_root(-1000.0, 500.0, 1.0, 0);
/// assert!((s - (-1000.0 + 500.0 * (-s).exp()) + 0.0).norm() < 1e-9);
/// assert_eq!(dde_root(-1.0, 0.5, 0.0, 0).re, -0.5);
/// ```
pub fn dde_root(a0: f64, a1: f64, delay: f64, k: i64) -> Complex64 {
    let (alpha, beta) = (a0 * delay, a1 * delay);
    let sound = a0.is_finite() && a1.is_finite() && delay.is_finite() && delay >= 0.0;
    if !sound || alpha.abs() > LARGEST || beta.abs() > LARGEST {
        return Complex64::new(f64::NAN, f64::NAN);
    }
    if a1 == 0.0 || delay == 0.0 {
        return without_delay(a0, a1, k);
    }
    let problem = Problem {
        alpha: exact_product(a0, delay, alpha),
        beta: exact_product(a1, delay, beta),
        mirrored: k < 0,
        k: k.unsigned_abs(),
    };
    let sigma = problem.solve();
    // The half plane Im W >= 0 belongs to k >= 0.
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

fn exact_product(a: f64, b: f64, rounded: f64) -> TwoWord {
    let limit = 2.0_f64.powi(990);
    if a.abs() < limit && b.abs() < limit && rounded.abs() < limit {
        product(a, b)
    } else {
        TwoWord::new(rounded, 0.0)
    }
}

/// (sigma - alpha) e^sigma = beta on branch k >= 0, below the cut if mirrored.
struct Problem {
    alpha: TwoWord,
    beta: TwoWord,
    mirrored: bool,
    k: u64,
}

impl Problem {
    fn solve(&self) -> Complex64 {
        let (alpha, beta) = (self.alpha.hi, self.beta.hi);
        let angle = libm::atan2(0.0, beta);
        let log_beta = Complex64::new(
            libm::log(beta.abs()),
            if self.mirrored { -angle } else { angle },
        );
        let log_modulus = log_beta.re - alpha;
        let joined = self.k == 0 || (self.k == 1 && self.mirrored && beta < 0.0);

        if self.k >= HUGE_BRANCH {
            return fixed_point(log_beta, alpha, self.k);
        }
        if self.k == 0 && log_modulus < SMALL {
            let z = self.argument();
            let sigma = Complex64::new(alpha + z * (1.0 - z * (1.0 - 1.5 * z)), 0.0);
            return self.near_zero(sigma);
        }
        // z and 1 + e z where the sheets that meet at -1/e can be near.
        let close = joined && log_modulus > SMALL && log_modulus < 3.0;
        let h = if close { self.one_plus_ez() } else { 0.0 };
        let real = if close {
            h >= 0.0
        } else {
            joined && (beta > 0.0 || log_modulus < 0.0)
        };
        if close && h.abs() < MEETING {
            let u = self.series(h);
            return Complex64::new((alpha - 1.0) + (u.re + self.alpha.lo), u.im.abs());
        }
        let start = if close && h.abs() < NEARLY_MEETING {
            alpha + (self.series(h) - 1.0)
        } else if close && self.k == 0 && self.argument().abs() < PRINCIPAL_RADIUS {
            let offset = Complex64::new(h / std::f64::consts::E, 0.0);
            alpha + principal(Complex64::new(self.argument(), 0.0), offset)
        } else if close && self.k == 1 && h.abs() < BEHIND_RADIUS * std::f64::consts::E {
            alpha + behind(Complex64::new(h / std::f64::consts::E, -0.0))
        } else {
            let turned = log_beta.im + std::f64::consts::TAU * self.k as f64;
            let log = Complex64::new(log_modulus, turned);
            if log_modulus.abs() > LARGE {
                fixed_point(log_beta, alpha, self.k)
            } else {
                let taken = logarithm(from_logarithm(log, if self.k == 1 { 2 } else { 1 }));
                Complex64::new(log_beta.re - taken.re, turned - taken.im)
            }
        };
        let sigma = (0..2).fold(folded(start, real), |sigma, _| {
            folded(sigma + self.step(sigma), real)
        });
        self.near_zero(sigma)
    }

    /// z = beta e^-alpha, zero where it underflows.
    fn argument(&self) -> f64 {
        if self.alpha.hi > 4_000.0 {
            return 0.0;
        }
        let (factor, exponent) = exp(-self.alpha.hi, -self.alpha.lo);
        let scaled = Scaled::new(Complex64::new(self.beta.hi, 0.0));
        scaled.re * factor.hi * power_of_two(exponent + scaled.exponent)
    }

    /// 1 + e z to 2^-64.
    fn one_plus_ez(&self) -> f64 {
        let exponent = TwoWord::new(1.0, 0.0).plus(self.alpha.negated());
        let (factor, power) = exp(exponent.hi, exponent.lo);
        let (beta, exponent) = self.scaled_beta();
        let ez = factor.times(beta).scaled(power_of_two(power + exponent));
        let h = TwoWord::new(1.0, 0.0).plus(ez);
        h.hi + h.lo
    }

    fn scaled_beta(&self) -> (TwoWord, i32) {
        let exponent = Scaled::new(Complex64::new(self.beta.hi, 0.0)).exponent;
        // In two halves: the exponent of a tiny beta is out of the range of one factor.
        let half = exponent / 2;
        let beta = self
            .beta
            .scaled(power_of_two(-half))
            .scaled(power_of_two(half - exponent));
        (beta, exponent)
    }

    /// 1 + w from 1 + e z.
    fn series(&self, h: f64) -> Complex64 {
        let modulus = (2.0 * h.abs()).sqrt();
        let p = if h < 0.0 {
            Complex64::new(0.0, modulus)
        } else {
            Complex64::new(modulus, 0.0)
        };
        // Below the axis the root of 1 + e z is conjugate and the sheet behind takes minus.
        one_plus_w(match (self.k, h < 0.0) {
            (0, _) | (_, true) => p,
            _ => -p,
        })
    }

    fn step(&self, sigma: Complex64) -> Complex64 {
        let (modulus, power) = exp(-sigma.re, 0.0);
        let (cosine, sine) = cos_sin(sigma.im);
        let (beta, exponent) = self.scaled_beta();
        let modulus = modulus.times(beta);
        let power = power_of_two(power + exponent);
        let w_re = TwoWord::new(sigma.re, 0.0).plus(self.alpha.negated());
        let t_re = modulus.times(cosine).scaled(power);
        let t_im = modulus.times(sine).negated().scaled(power);
        let d_re = t_re.plus(w_re.negated());
        let d = Complex64::new(d_re.hi, (t_im.hi - sigma.im) + t_im.lo);
        let w = Complex64::new(w_re.hi, sigma.im);
        if w_re.hi.abs() > LARGE {
            let unit = power_of_two(-Scaled::new(w).exponent);
            quotient(d * unit, w * unit)
        } else {
            correction(w, d)
        }
    }

    /// Newton's method on sigma - (alpha + beta) - beta (e^-sigma - 1) where its terms are small.
    fn near_zero(&self, sigma: Complex64) -> Complex64 {
        let sum = self.alpha.plus(self.beta).hi;
        let one_plus_beta = TwoWord::new(1.0, 0.0).plus(self.beta).hi;
        let beta = self.beta.hi;
        (0..3).fold(sigma, |s, _| {
            // e^-s - 1 + s = s^2 times this.
            let series = s
                * (s * (s
                    * (s * (s * (s / 40_320.0 - 1.0 / 5_040.0) + 1.0 / 720.0) - 1.0 / 120.0)
                    + 1.0 / 24.0)
                    - 1.0 / 6.0)
                + 0.5;
            let tail = s * s * series;
            let value = s * one_plus_beta - sum - tail * beta;
            let slope = (tail - s) * beta + one_plus_beta;
            if s.norm() < NEAR_ZERO && slope.norm() > 0.0 {
                s - value / slope
            } else {
                s
            }
        })
    }
}

fn folded(sigma: Complex64, real: bool) -> Complex64 {
    Complex64::new(sigma.re, if real { 0.0 } else { sigma.im.abs() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn relative_residual(a0: f64, a1: f64, delay: f64, s: Complex64) -> f64 {
        let feedback = a1 * (-s * delay).exp();
        // The rounding of e^(-s T) is proportional to |s T|.
        let scale = s.norm() + a0.abs() + feedback.norm() * (1.0 + (s * delay).norm());
        (s - a0 - feedback).norm() / scale
    }

    proptest! {
        #[test]
        fn every_root_solves_the_characteristic_equation(
            a0 in -50.0..50.0_f64, a1 in -50.0..50.0_f64, delay in 0.001..5.0_f64, k in -40_i64..40,
        ) {
            let s = dde_root(a0, a1, delay, k);
            prop_assert!(relative_residual(a0, a1, delay, s) < 1e-14, "{s}");
        }

        #[test]
        fn the_root_of_branch_zero_is_rightmost(
            a0 in -5.0..5.0_f64, a1 in -5.0..5.0_f64, delay in 0.01..5.0_f64,
        ) {
            let rightmost = dde_root(a0, a1, delay, 0).re;
            for k in -4..4 {
                prop_assert!(dde_root(a0, a1, delay, k).re <= rightmost + 1e-12 * rightmost.abs());
            }
        }

        #[test]
        fn the_sum_of_the_coefficients_is_kept(a in 0.001..0.9_f64, gap in 1e-18..1e-9_f64) {
            // Next to a0 + a1 = 0 the root is (a0 + a1)/(1 + a1 T) to first order.
            let s = dde_root(-a, a + gap, 1.0, 0);
            let sum = -a + (a + gap);
            prop_assert!((s.re - sum / (1.0 + a)).abs() <= 1e-8 * sum.abs());
        }
    }

    #[test]
    fn a_double_root_is_met_exactly() {
        assert_eq!(dde_root(1.0, -1.0, 1.0, 0), Complex64::new(0.0, 0.0));
        assert_eq!(dde_root(1.0, -1.0, 1.0, -1).re, 0.0);
    }

    #[test]
    fn without_a_delayed_term_one_root_is_left() {
        assert_eq!(dde_root(-2.0, 0.0, 1.0, 0).re, -2.0);
        assert_eq!(dde_root(-2.0, 0.0, 1.0, 3).re, f64::NEG_INFINITY);
        assert!(dde_root(f64::NAN, 1.0, 1.0, 0).re.is_nan());
        assert!(dde_root(1.0, 1.0, -1.0, 0).re.is_nan());
    }
}
