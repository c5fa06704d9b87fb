//! A loop with a hold over an interval of one of its numbers: is a pole on the circle anywhere?
//!
//! With w = z − 1, M = m + 1 and t in [−1, 1] across the interval, the poles are the zeros of
//!
//! ```text
//! h = z^M P − Q,   P = det(wI − Φ + I),   Q = K adj(wI − Φ + I) (Γ₀ + Γ₁ + Γ₀ w) + L P
//! ```
//!
//! (`model` with the sample time as the unit of time), whose coefficients are enclosed for all t (`elementary::Enclosed`). P has the leading coefficient
//! one, so that as many poles are outside the circle at all t, or another one is on it. On an arc
//! |θ − θ₀| ≤ δ, z = e^(jθ), h is not zero where |P| and |Q| have no size in common, or where
//!
//! ```text
//! |⟨v, h₀⟩| > δ |⟨v, h_θ⟩| + |⟨v, h_t⟩| + μ |⟨v, h_M⟩| + |v| R,   ⟨v, x⟩ = Re(v* x),
//! ```
//!
//! for some direction v: that of h₀, or one across an edge of the parallelogram that h covers to first
//! order. μ is half the range of M, and R bounds the terms of higher order and all rounding. An arc is
//! halved while its middle alone has no pole.

use std::f64::consts::PI;

use num_complex::Complex64;

use super::model::LoopPolynomials;
use crate::dde::{Equations, Update};
use crate::elementary::{Enclosed, sin_cos};
use crate::quasipoly::modulus;

/// Upper limit on the arcs that are looked at: a larger one passes closer to a pole and takes longer.
const ARCS: u32 = 20_000;

/// Covers the rounding of bounds.
const ROOM: f64 = 1.0 + 1e-12;

/// Roundings of a value for each degree, and of a product or an exponential.
const DEGREE: f64 = 16.0 * f64::EPSILON;
const FEW: f64 = 16.0 * f64::EPSILON;

/// P and Q over an interval.
#[derive(Debug, Clone)]
pub struct HeldInterval {
    p: Row,
    q: Row,
}

/// A polynomial in w: what it is in the middle, its terms in t and t², and a bound on the rest.
#[derive(Debug, Clone)]
struct Row(Vec<Coefficient>);

/// Of one power of w.
#[derive(Debug, Clone, Copy)]
struct Coefficient {
    center: f64,
    by_t: f64,
    by_tt: f64,
    rest: f64,
}

/// A polynomial on an arc.
struct Part {
    value: Complex64,
    by_w: Complex64,
    by_t: Complex64,
    by_tt: Complex64,
    /// Of all other terms and rounding.
    rest: f64,
    /// Of all that moves.
    reach: f64,
}

impl HeldInterval {
    /// Of the equations over the interval, what a sample does to the states, and the parts of a sample
    /// before and after a command arrives.
    pub fn new(
        equations: &Equations<Enclosed>,
        update: Option<&Update<Enclosed>>,
        times: [Enclosed; 2],
    ) -> Self {
        let states = (&equations.a[..], &equations.b[..]);
        let model = LoopPolynomials::built(states, update, times, Enclosed::from(1.0), 0.0);
        let b = model.fed(&equations.k, equations.l);
        Self {
            p: Row::new(model.a_exact.into_iter()),
            q: Row::new(b.into_iter().map(|(c, _)| c)),
        }
    }

    /// Is proved that no pole is on the circle, with any number M between these? The larger may be
    /// infinite.
    pub fn avoids_circle(&self, samples: (f64, f64)) -> bool {
        let mut open = vec![(0.0, PI * ROOM)];
        for _ in 0..ARCS {
            let Some((from, to)) = open.pop() else {
                return true;
            };
            let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
            if self.is_free(middle, half + f64::EPSILON * to, samples) {
                continue;
            }
            if !self.is_free(middle, 0.0, samples) {
                return false;
            }
            open.push((middle, to));
            open.push((from, middle));
        }
        false
    }

    /// Is |P| > |Q| at z = −1 over the interval? Then the argument of P − z^(−M) Q returns there where M grows
    /// by one, and without a pole on the circle for all real M between, as many are outside before and after.
    pub fn leads_at_minus_one(&self) -> bool {
        let [p, q] = [&self.p, &self.q].map(|row| row.around(Complex64::new(-2.0, 0.0), 0.0));
        modulus(p.value) - p.reach > (modulus(q.value) + q.reach) * ROOM
    }

    /// Is no pole on this arc?
    fn is_free(&self, theta: f64, half: f64, (least, most): (f64, f64)) -> bool {
        let (sine, cosine) = sin_cos(0.5 * theta);
        let w = Complex64::new(-2.0 * sine * sine, 2.0 * sine * cosine);
        let (p, q) = (self.p.around(w, half), self.q.around(w, half));
        let (of_p, of_q) = (modulus(p.value), modulus(q.value));
        if (of_p - of_q).abs() > (p.reach + q.reach) * ROOM + FEW * (of_p + of_q) {
            return true;
        }
        if most.is_infinite() {
            return false;
        }
        let (samples, more) = (0.5 * (least + most), 0.5 * (most - least));
        let turn = samples * theta;
        let (sine, cosine) = sin_cos(turn);
        let late = Complex64::new(cosine, sine);
        let along = Complex64::I * (Complex64::ONE + w);
        let here = late * p.value - q.value;
        let edges = [
            (late * (Complex64::I * samples * p.value + along * p.by_w) - along * q.by_w) * half,
            late * p.by_t - q.by_t,
            late * p.value * Complex64::I * theta * more,
        ];
        let phase = samples * half + theta * more + half * more;
        let second = 0.5 * phase * phase;
        let rest = p.rest
            + q.rest
            + modulus(late * p.by_tt - q.by_tt)
            + of_p * (second + half * more)
            + (phase + second) * p.reach
            + FEW * (1.0 + turn) * (of_p + of_q + p.reach + q.reach);
        let across = edges.map(|edge| Complex64::I * edge);
        across.into_iter().chain([here]).any(|direction| {
            let along = |x: Complex64| (direction.conj() * x).re.abs();
            let moved: f64 = edges.into_iter().map(along).sum();
            along(here) > (moved + modulus(direction) * rest) * ROOM
        })
    }
}

impl Row {
    /// From the coefficients of powers of w, ascending.
    fn new(coefficients: impl Iterator<Item = Enclosed>) -> Self {
        let terms = coefficients.map(|c| {
            let higher: f64 = c.slopes.iter().skip(2).map(|slope| slope.abs()).sum();
            Coefficient {
                center: c.center.high,
                by_t: c.slopes[0],
                by_tt: c.slopes[1],
                rest: (higher + c.radius + c.center.low.abs()) * ROOM,
            }
        });
        Self(terms.collect())
    }

    /// Within `half` of w.
    fn around(&self, w: Complex64, half: f64) -> Part {
        let zero = Complex64::ZERO;
        let (mut p, mut by_t, mut by_tt) = ([zero; 3], [zero; 2], zero);
        // The same with moduli, up to the terms that are left out: Σ C(j, k) |c_j| |w|^(j−k).
        let (mut sizes, mut slopes, mut bends, mut rest) = ([0.0; 4], [0.0; 3], [0.0; 2], 0.0);
        let size = modulus(w) + half;
        for c in self.0.iter().rev() {
            p[2] = p[2] * w + p[1];
            p[1] = p[1] * w + p[0];
            p[0] = p[0] * w + c.center;
            by_t[1] = by_t[1] * w + by_t[0];
            by_t[0] = by_t[0] * w + c.by_t;
            by_tt = by_tt * w + c.by_tt;
            raise(&mut sizes, size, c.center.abs());
            raise(&mut slopes, size, c.by_t.abs());
            raise(&mut bends, size, c.by_tt.abs());
            rest = rest * size + c.rest;
        }
        let units = DEGREE * (self.0.len() + 1) as f64;
        let known = rest + units * (sizes[0] + slopes[0] + bends[0]);
        // |w(θ) − w₀ − jz (θ − θ₀)| ≤ δ²/2.
        let square = half * half;
        let bent = square * (modulus(p[2]) + half * sizes[3] + 0.5 * modulus(p[1]));
        let turned = half * (modulus(by_t[1]) + half * slopes[2] + bends[1]);
        let rest = (known + bent + turned) * ROOM;
        Part {
            value: p[0],
            by_w: p[1],
            by_t: by_t[0],
            by_tt,
            rest,
            reach: half * modulus(p[1]) + modulus(by_t[0]) + modulus(by_tt) + rest,
        }
    }
}

/// One more step of Horner's rule, for a polynomial and its derivatives over factorials.
fn raise<const N: usize>(sums: &mut [f64; N], x: f64, coefficient: f64) {
    for k in (1..N).rev() {
        sums[k] = sums[k] * x + sums[k - 1];
    }
    sums[0] = sums[0] * x + coefficient;
}
