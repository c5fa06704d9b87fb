//! Is h(iw; p) ≠ 0 for all p in a box and all w in a stretch?
//!
//! With centre c, w_0 and p = c + δ, w = w_0 + η, |δ_i| ≤ r_i, |η| ≤ ρ, Taylor's theorem gives
//!     h = h_0 + Σ δ_i ∂_i h + η ∂_w h + E,  |E| ≤ ½ Σ_ab x_a x_b max |∂_a ∂_b h|,  x = (r, ρ),
//! the first part of which fills a zonotope. It lies clear of 0 by more than |E| if, for some n,
//!     |Re n̄ h_0| − Σ_a |Re n̄ ∂_a h| x_a > |n| max |E|.
//! Tried are the normals of the edges, one of which separates 0 from a polygon if any line does, and
//! h_0 itself (for the disc around it). With f = P e^(−iwd), P = P(iw; p), dashes for ∂/∂s:
//!     ∂_i f = (P_i − iw d_i P) e^(…),  ∂_w f = i (P′ − d P) e^(…),
//!     |∂_w² f| ≤ |P″| + 2|d P′| + d²|P|,  |∂_w ∂_i f| ≤ |P_i′| + |d P_i| + |d_i| (|P| + w|P′| + w|d P|),
//!     |∂_i ∂_l f| ≤ |P_il| + w (|d_i P_l| + |d_l P_i|) + w² |d_i d_l P|,
//! bounded by majorants at the upper end of the stretch. Or, whatever the delays are, one row outweighs
//! the others: |P_j| stays within max |P_j′| ρ + Σ max |P_i| r_i of its value at w_0. Rounding: as in `quasipoly::probe`, a value
//! or slope of degree n is wrong by at most u (16 (n + 1) + 4 m + 16 wS) of its majorant for m rows, S
//! the sum of the moduli that make up d, plus `digits` of the coefficients; directions and products with them
//! lose 32 u more. The same again is left for a member being formed in double precision.

use num_complex::Complex64;

use super::local::{Local, LocalRow};
use crate::elementary::sin_cos;

/// Half an ulp of 1, with room for what the bounds lose in being computed.
const ROUNDING: f64 = 1.02 * 0.5 * f64::EPSILON;

/// Far above all that underflow can do; the square is a normal number.
const FLOOR: f64 = 1e-150;

/// Below this nothing is claimed.
const SMALLEST: f64 = 1e-140;

/// What a look at one stretch of the axis says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Look<const D: usize> {
    /// No member has a root there.
    Clear,
    /// The stretch is too long to tell.
    Long,
    /// The box is too large to tell; the part of each parameter in that.
    Wide([f64; D]),
}

/// First and second order of h around the middle of a stretch.
struct Expansion<const D: usize> {
    value: Complex64,
    slopes: [Complex64; D],
    turn: Complex64,
    /// |∂_w² h|, |∂_w ∂_i h| and |∂_i ∂_l h|.
    bend: f64,
    mixed: [f64; D],
    bends: [[f64; D]; D],
    /// What the largest row exceeds the others by, all over box and stretch.
    excess: f64,
    /// Bound on what rounding does to the zonotope.
    rounding: f64,
}

/// Majorants of a polynomial over the box at one frequency: P, P′, P″.
#[inline(always)]
fn majorants<const D: usize>(row: &LocalRow<D>, w: f64) -> (f64, f64, f64) {
    let (mut p, mut dp, mut ddp) = (0.0, 0.0, 0.0);
    for c in row.coefficients.iter().rev() {
        ddp = ddp * w + dp;
        dp = dp * w + p;
        p = p * w + c.most;
    }
    (p, dp, 2.0 * ddp)
}

impl<const D: usize> Expansion<D> {
    fn new(local: &Local<D>, w: f64, rho: f64, top: f64) -> Self {
        let half = &local.half;
        let mut own = Self {
            value: Complex64::ZERO,
            slopes: [Complex64::ZERO; D],
            turn: Complex64::ZERO,
            bend: 0.0,
            mixed: [0.0; D],
            bends: [[0.0; D]; D],
            excess: 0.0,
            rounding: FLOOR,
        };
        let (mut largest, mut all) = (0.0f64, 0.0);
        for row in &local.rows {
            let (mut p, mut dp) = (Complex64::ZERO, Complex64::ZERO);
            let times_iw = |z: Complex64| Complex64::new(-w * z.im, w * z.re);
            for c in row.coefficients.iter().rev() {
                dp = times_iw(dp) + p;
                p = times_iw(p) + c.value;
            }
            let turned = if row.delay == 0.0 {
                Complex64::ONE
            } else {
                let (sine, cosine) = sin_cos(row.delay * w);
                Complex64::new(cosine, -sine)
            };
            let value = p * turned;
            let slope = dp * turned - value * row.delay;
            own.value += value;
            own.turn += Complex64::new(-slope.im, slope.re);
            let (most, most_slope, most_bend) = majorants(row, top);
            let d = row.longest;
            let pace = most_slope + d * most;
            own.bend += most_bend + d * (most_slope + pace);
            let mut sizes = most + pace * rho;
            let size = p.norm_sqr().sqrt();
            largest = largest.max(size);
            all += size + most_slope * rho;
            if row.moves {
                for (i, r) in half.iter().enumerate() {
                    let mut p_i = Complex64::ZERO;
                    let (mut most_i, mut most_slope_i) = (0.0, 0.0);
                    for c in row.coefficients.iter().rev() {
                        p_i = times_iw(p_i) + c.slopes[i];
                        most_slope_i = most_slope_i * top + most_i;
                        most_i = most_i * top + c.most_slopes[i];
                    }
                    let rate = row.rates[i];
                    own.slopes[i] += p_i * turned;
                    if rate != 0.0 {
                        own.slopes[i] -= times_iw(value) * row.slopes[i];
                    }
                    sizes += (most_i + top * rate * most) * r;
                    all += most_i * r;
                    own.mixed[i] += most_slope_i + d * most_i + rate * (most + top * pace);
                    for l in 0..D {
                        let (mut bend, mut most_l) = (0.0, 0.0);
                        for c in row.coefficients.iter().rev() {
                            bend = bend * top + c.bends[i][l];
                            most_l = most_l * top + c.most_slopes[l];
                        }
                        let other = row.rates[l];
                        own.bends[i][l] +=
                            bend + top * (rate * most_l + other * (most_i + top * rate * most));
                    }
                }
            }
            own.rounding += 2.0 * ROUNDING * (local.roundings + 16.0 * top * row.size) * sizes;
        }
        own.excess = 2.0 * largest - all * (1.0 + 1e-9);
        own
    }

    /// Second order in the parameters alone, each with its part in it.
    fn remainder(&self, half: &[f64; D]) -> [f64; D] {
        std::array::from_fn(|i| {
            let sum: f64 = self.bends[i].iter().zip(half).map(|(b, r)| b * r).sum();
            0.5 * half[i] * sum
        })
    }

    /// Does a line separate 0 from all values, the frequency being within `rho`?
    fn is_clear(&self, half: &[f64; D], rho: f64, rest: f64) -> bool {
        let mixed: f64 = self.mixed.iter().zip(half).map(|(m, r)| m * r).sum();
        let rest = rest + rho * (mixed + 0.5 * rho * self.bend);
        let rest = rest * (1.0 + 1e-9) + self.rounding;
        let separates = |n: Complex64| {
            let along = |z: Complex64| (n.re * z.re + n.im * z.im).abs();
            let mut reach = along(self.turn) * rho;
            for (slope, r) in self.slopes.iter().zip(half) {
                reach += along(*slope) * r;
            }
            let excess = along(self.value) - reach;
            // Where squares lose no digits.
            let size = n.norm_sqr();
            excess > SMALLEST
                && size > SMALLEST * SMALLEST
                && excess * excess > size * rest * rest * (1.0 + 1e-9)
        };
        let normal = |z: Complex64| Complex64::new(-z.im, z.re);
        separates(normal(self.turn))
            || separates(self.value)
            || self.slopes.iter().any(|slope| separates(normal(*slope)))
    }
}

/// Look at the stretch from `from` to `to`.
pub(super) fn look<const D: usize>(local: &Local<D>, from: f64, to: f64) -> Look<D> {
    let w = from + 0.5 * (to - from);
    let rho = (w - from).max(to - w) * (1.0 + 2.0 * f64::EPSILON);
    let own = Expansion::new(local, w, rho, to);
    let half = &local.half;
    let remainder = own.remainder(half);
    let rest: f64 = remainder.iter().sum();
    if own.is_clear(half, rho, rest) || own.excess > own.rounding {
        return Look::Clear;
    }
    // Seen along the way on which h moves with w, only the parameters can lead away from 0.
    let along = |z: &Complex64| {
        let size = own.turn.norm_sqr().sqrt();
        if size > 0.0 {
            (own.turn.re * z.im - own.turn.im * z.re).abs() / size
        } else {
            z.norm_sqr().sqrt()
        }
    };
    let mixed = |i: usize| own.mixed[i] * rho;
    let shares: [f64; D] =
        std::array::from_fn(|i| (along(&own.slopes[i]) + mixed(i)) * half[i] + remainder[i]);
    let spread: f64 = shares.iter().sum();
    let pace = own.turn.norm_sqr().sqrt() * rho;
    let finest = rho <= 1e-13 * to || pace <= own.rounding;
    if finest || (pace < COARSE * spread && !own.is_clear(half, 0.0, rest)) {
        return Look::Wide(shares);
    }
    if pace + own.bend * rho * rho < FINE * spread {
        return Look::Wide(shares);
    }
    Look::Long
}

/// A stretch on which h moves less than this many times what the box does is not divided if a
/// member may well have a root in its middle.
const COARSE: f64 = 0.3;

/// As COARSE, wherever the members' roots are.
const FINE: f64 = 0.1;
