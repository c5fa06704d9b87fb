//! The variable of the polynomials of a loop with a hold.
//!
//! The characteristic function of a loop sampled every Ts seconds is a polynomial in z = e^(s Ts).
//! In powers of z its coefficients cancel next to z = 1: 7 to 9 digits are lost at 1 kHz. It is
//! therefore written in σ = (z − 1)/Ts (delta operator: Middleton and Goodwin 1990, Digital Control
//! and Estimation, chapter 4), which tends to s as Ts tends to 0:
//!     h(s) = Σ p_j(σ(s)) e^(−s d_j),   σ′ = z, σ″ = Ts z, σ‴ = Ts² z.
//! All roots are counted in the strip 0 ≤ Im s ≤ π/Ts, whose upper edge holds the negative z: there
//! h is real, as on the real axis.
//!
//! *Rounding.* With s Ts = x + iy, E = e^x − 1 and v = sin(y/2), σ Ts = E − 2 v² e^x + 2i v cos(y/2)
//! e^x and |σ Ts|² = E² + 4 v² e^x. E is within 5 u of itself. For e^x ≥ 1/4, 2 v² e^x ≤ |σ Ts|
//! e^(x/2) |v| and below |σ Ts| > 3/4; for e^x ≥ 4, e^x < 4/3 |σ Ts|: each part, and the effect of
//! the roundings of x and y with y ≤ π, is within (16 + 2|x|) u |σ Ts|. A polynomial of degree n in
//! σ is then within n (24 + 3|x|) u of its bound by moduli, which `ROUNDINGS` and the terms in |s|
//! of `Pencil` and `Plane` include.

use num_complex::Complex64;

use crate::elementary::{exp, simd, sin_cos};
use crate::simd::{Complex, Real, Simd};

/// Rounding errors of a polynomial for each degree in σ, in units of u, beyond those in |s|.
pub(crate) const ROUNDINGS: f64 = 48.0;

/// Largest |x| for which e^x − 1 is summed as a series.
const SERIES: f64 = 0.5;

/// Covers the rounding errors of bounds.
const ROOM: f64 = 1.0 + 1e-12;

/// 1/2!, 1/3!, …, 1/16!: the rest is below 0.5¹⁶/17! < u/2⁸.
const FACTORIALS: [f64; 15] = [
    1.0 / 2.0,
    1.0 / 6.0,
    1.0 / 24.0,
    1.0 / 120.0,
    1.0 / 720.0,
    1.0 / 5_040.0,
    1.0 / 40_320.0,
    1.0 / 362_880.0,
    1.0 / 3_628_800.0,
    1.0 / 39_916_800.0,
    1.0 / 479_001_600.0,
    1.0 / 6_227_020_800.0,
    1.0 / 87_178_291_200.0,
    1.0 / 1_307_674_368_000.0,
    1.0 / 20_922_789_888_000.0,
];

/// A hold over `sample_time`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Hold {
    /// Ts, s.
    pub(crate) sample_time: f64,
    /// Errors of the coefficients, relative to the bounds by their moduli.
    pub(crate) coefficients: f64,
}

impl Hold {
    /// π/Ts, the imaginary part of the negative z, 1/s.
    pub(crate) fn top(&self) -> f64 {
        std::f64::consts::PI / self.sample_time
    }

    /// σ and z.
    pub(crate) fn at(&self, s: Complex64) -> (Complex64, Complex64) {
        let (x, y) = (s.re * self.sample_time, s.im * self.sample_time);
        let growth = exp_minus_one(x);
        let size = exp(x);
        let (sine, cosine) = sin_cos(0.5 * y);
        let turned = 2.0 * sine * size;
        let change = Complex64::new(growth - turned * sine, turned * cosine);
        let z = Complex64::new(size - turned * sine, turned * cosine);
        (change / self.sample_time, z)
    }

    /// σ and z in every lane.
    #[inline(always)]
    pub(crate) fn lanes<S: Simd>(&self, s: Complex<S>) -> (Complex<S>, Complex<S>) {
        let (x, y) = (s.re * self.sample_time, s.im * self.sample_time);
        let size = simd::exp(x);
        let mut sum = x.constant(0.0);
        for factorial in FACTORIALS.iter().rev() {
            sum = sum * x + *factorial;
        }
        let growth = x.abs().le(SERIES).select(x + x * x * sum, size - 1.0);
        let (sine, cosine) = simd::sin_cos(y * 0.5);
        let turned = sine * 2.0 * size;
        let inverse: Real<S> = x.constant(1.0) / self.sample_time;
        let change = Complex::new(growth - turned * sine, turned * cosine);
        let z = Complex::new(size - turned * sine, change.im);
        (change.scaled(inverse), z)
    }

    /// Bounds on |σ| and |z| on the straight line between two points.
    pub(crate) fn sizes(&self, ends: [Complex64; 2]) -> (f64, f64) {
        let [x0, x1] = ends.map(|s| s.re * self.sample_time);
        self.sizes_within(
            x0.min(x1),
            x0.max(x1),
            ends[0].im.abs().max(ends[1].im.abs()),
        )
    }

    /// Bounds on |σ| and |z| within `radius` of a point.
    pub(crate) fn sizes_around(&self, center: Complex64, radius: f64) -> (f64, f64) {
        let [low, high] = [-radius, radius].map(|shift| (center.re + shift) * self.sample_time);
        self.sizes_within(low, high, center.im.abs() + radius)
    }

    /// For x between `low` and `high`, and |Im s| at most `highest`.
    fn sizes_within(&self, low: f64, high: f64, highest: f64) -> (f64, f64) {
        let growth = exp_minus_one(low).abs().max(exp_minus_one(high).abs());
        let size = exp(high);
        let half = (0.5 * highest * self.sample_time).min(std::f64::consts::FRAC_PI_2);
        let (sine, _) = sin_cos(half);
        let square = growth * growth + 4.0 * size * sine * sine;
        (
            square.sqrt() / self.sample_time * ROOM + f64::MIN_POSITIVE,
            size * ROOM,
        )
    }

    /// Bounds on a function of σ and its derivatives by σ as bounds on its derivatives by s.
    pub(crate) fn chain(&self, [p, p1, p2, p3]: [f64; 4], z: f64) -> [f64; 4] {
        let ts = self.sample_time;
        [
            p,
            z * p1,
            z * (z * p2 + ts * p1),
            z * (z * (z * p3 + 3.0 * ts * p2) + ts * ts * p1),
        ]
    }
}

/// e^x − 1 within 5 · 2⁻⁵³ of itself.
fn exp_minus_one(x: f64) -> f64 {
    if x.abs() <= SERIES {
        let sum = FACTORIALS.iter().rev().fold(0.0, |sum, c| sum * x + c);
        x + x * x * sum
    } else {
        exp(x) - 1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_variable_tends_to_s_and_keeps_its_digits() {
        let s = Complex64::new(-0.3, 2.0);
        for sample_time in [1e-9, 1e-6, 1e-3] {
            let hold = Hold {
                sample_time,
                coefficients: 0.0,
            };
            let (sigma, z) = hold.at(s);
            // (e^w − 1)/w = 1 + w/2! + w²/3! + …
            let w = s * sample_time;
            let series = 1.0 + w * (0.5 + w * (1.0 / 6.0 + w * (1.0 / 24.0 + w / 120.0)));
            assert!((sigma / (s * series) - 1.0).norm() < 1e-15, "{sample_time}");
            assert!((z - w.exp()).norm() < 1e-15);
        }
    }

    #[test]
    fn bounds_hold_along_a_line() {
        let hold = Hold {
            sample_time: 0.065,
            coefficients: 0.0,
        };
        for (from, to) in [
            (Complex64::new(-2.0, 0.0), Complex64::new(-2.0, hold.top())),
            (Complex64::new(0.0, 1.0), Complex64::new(-30.0, 40.0)),
            (Complex64::new(3.0, hold.top()), Complex64::new(3.0, 10.0)),
        ] {
            let (sigma, z) = hold.sizes([from, to]);
            for share in 0..=100 {
                let s = from + (to - from) * (f64::from(share) / 100.0);
                let (at, turn) = hold.at(s);
                assert!(at.norm() <= sigma && turn.norm() <= z);
            }
        }
    }
}
