//! One element of time: forcing, solution, and test of the resolution.
//!
//! The rounding error of row i of x′ = A x + g is relative to F_i = Σ |a_ij| R_j + G_i, where G_i
//! sums the moduli of all that makes up g_i and R_j is the size of x_j, but at least a share
//! [`NOISE`] of the size to which F_j drives it: a state that vanishes by cancellation consists of
//! rounding errors, and must not be resolved like a signal. Delayed rounding errors cause further
//! ones; this is followed a few times, by several kinds of sizes that each piece stores, the first
//! being that of x itself. Followed without end, the bound would grow where x does not. The element
//! is resolved once the last coefficients of x′ are below [`RESOLVED`] F_i; those of x are smaller
//! by another h/(4k). Rounding errors of longer descent are told by halving: it leaves them as they
//! are, and at least halves what is a signal.

use super::legendre::{DEGREE, TERMS};
use super::solver::Solver;
use super::terms::Feed;
use super::track::{KINDS, NEGLIGIBLE, Sizes, Track};
use crate::linear_algebra::balance::balanced_above;

/// Coefficients of x′ below this share of F count as rounding errors: ten units, because each sums
/// 25 values.
const RESOLVED: f64 = 10.0 * f64::EPSILON;

/// Above this multiple of [`RESOLVED`] F the last coefficients are a signal.
const MOST_NOISE: f64 = 64.0;

/// Halving an element leaves less than this of the last coefficients of a signal: one half where its
/// derivative jumps, and far less where it is smooth.
const LEFT: f64 = 0.7;

/// Coefficients of x′ below this share of F are dropped.
const NOTHING: f64 = 0.25 * f64::EPSILON;

/// Index of the last coefficient that matters up to which an element twice as long may suffice.
const ROOMY: usize = 12;

/// Least size of a state as a share of what drives it: its last coefficients have errors of one
/// hundredth of a unit of that, and [`RESOLVED`] is ten.
const NOISE: f64 = 1.0 / 32.0;

/// Rounds of F and R: each follows rounding errors through one more integration.
const ROUNDS: usize = 3;

/// The equation and the current element.
#[derive(Debug)]
pub(super) struct Element {
    a: Vec<(usize, usize, f64)>,
    /// Feeds of the state, its derivative and the input.
    feeds: [Vec<Feed>; 3],
    solver: Solver,
    g: Vec<f64>,
    x: Vec<f64>,
    f: Vec<f64>,
    state_size: Vec<f64>,
    slope_size: Vec<f64>,
    forcing_size: Vec<Sizes>,
    /// The rate at which A lets each state follow, see [`rates`].
    rates: Vec<f64>,
    /// Sizes that the pieces of state and slope store.
    state_sizes: Vec<Sizes>,
    slope_sizes: Vec<Sizes>,
    /// Last coefficient of x′ above [`RESOLVED`], and above [`NOTHING`].
    needed: usize,
    kept: usize,
}

impl Element {
    pub(super) fn new(a: &[f64], n: usize, feeds: [Vec<Feed>; 3]) -> Self {
        let entries = a.iter().enumerate().filter(|(_, a)| **a != 0.0);
        Self {
            a: entries
                .map(|(place, a)| (place / n, place % n, *a))
                .collect(),
            feeds,
            solver: Solver::new(a, n),
            g: vec![0.0; n * TERMS],
            x: vec![0.0; n * TERMS],
            f: vec![0.0; n * TERMS],
            state_size: vec![0.0; n],
            slope_size: vec![0.0; n],
            forcing_size: vec![[0.0; KINDS]; n],
            rates: rates(a, n),
            state_sizes: vec![[0.0; KINDS]; n],
            slope_sizes: vec![[0.0; KINDS]; n],
            needed: 0,
            kept: 0,
        }
    }

    /// Size to which the rounding error of x is relative on the latest element.
    pub(super) fn state_size(&self) -> &[f64] {
        &self.state_size
    }

    /// The same for x′.
    pub(super) fn slope_size(&self) -> &[f64] {
        &self.slope_size
    }

    /// Solve over [t, t + h] from `start`; `tracks` are in the order of the feeds. Where the series
    /// of a delayed signal represents it only on a part of h, nothing is solved, and that part is
    /// returned.
    pub(super) fn solve(
        &mut self,
        start: &[f64],
        t: f64,
        h: f64,
        slack: f64,
        tracks: [&Track; 3],
    ) -> Option<f64> {
        self.g.fill(0.0);
        self.forcing_size.fill([0.0; KINDS]);
        let (mut degree, mut until) = (0, h);
        for (feeds, track) in self.feeds.iter_mut().zip(tracks) {
            for feed in feeds {
                let (added, read) =
                    feed.add_series(track, t, h, slack, &mut self.g, &mut self.forcing_size);
                degree = degree.max(added);
                until = until.min(read);
            }
        }
        if until < h {
            return Some(until);
        }
        self.solver
            .solve(h, slack, start, (&self.g, degree), &mut self.x, &mut self.f);
        self.judge(h);
        None
    }

    fn judge(&mut self, h: f64) {
        for (sizes, x) in self.state_sizes.iter_mut().zip(self.x.chunks_exact(TERMS)) {
            sizes[0] = x.iter().fold(0.0, |m, c| f64::max(m, c.abs()));
        }
        for (sizes, f) in self.slope_sizes.iter_mut().zip(self.f.chunks_exact(TERMS)) {
            sizes[0] = f.iter().fold(0.0, |m, c| f64::max(m, c.abs()));
        }
        for kind in 0..KINDS {
            self.measure(kind, h);
            if kind + 1 < KINDS {
                for i in 0..self.state_size.len() {
                    self.state_sizes[i][kind + 1] = self.state_size[i];
                    self.slope_sizes[i][kind + 1] = self.slope_size[i];
                }
            }
        }
        (self.needed, self.kept) = (0, 0);
        for (f, size) in self.f.chunks_exact(TERMS).zip(&self.slope_size) {
            let beyond = |part: f64| {
                let least = (part * size).max(NEGLIGIBLE);
                f.iter().rposition(|c| c.abs() > least).unwrap_or(0)
            };
            self.kept = self.kept.max(beyond(NOTHING));
            if self.kept > self.needed {
                self.needed = self.needed.max(beyond(RESOLVED));
            }
        }
    }

    /// F and R, from forcing sizes of one kind.
    fn measure(&mut self, kind: usize, h: f64) {
        for (size, own) in self.state_size.iter_mut().zip(&self.state_sizes) {
            *size = own[0];
        }
        for _ in 0..ROUNDS {
            for (slope, forcing) in self.slope_size.iter_mut().zip(&self.forcing_size) {
                *slope = forcing[kind];
            }
            for &(row, column, a) in &self.a {
                self.slope_size[row] += a.abs() * self.state_size[column];
            }
            let mut changed = false;
            for (i, state) in self.state_size.iter_mut().enumerate() {
                let driven = NOISE * h * self.slope_size[i] / (1.0 + h * self.rates[i]);
                changed |= *state < driven;
                *state = state.max(driven);
            }
            if !changed {
                break;
            }
        }
    }

    /// Is the truncated series exact up to rounding errors?
    pub(super) fn is_resolved(&self) -> bool {
        self.needed < DEGREE - 1
    }

    /// The last coefficients as a multiple of [`RESOLVED`] F.
    pub(super) fn tail(&self) -> f64 {
        let parts = self.f.chunks_exact(TERMS).zip(&self.slope_size);
        parts
            .map(|(f, size)| {
                f[DEGREE - 1].abs().max(f[DEGREE].abs()) / (RESOLVED * size).max(NEGLIGIBLE)
            })
            .fold(0.0, f64::max)
    }

    /// May the next element be longer?
    pub(super) fn has_room(&self) -> bool {
        self.needed <= ROOMY
    }

    /// Append the element [t, next] to the tracks; `end`, its first x, becomes its last one.
    pub(super) fn store(
        &self,
        t: f64,
        next: f64,
        states: &mut Track,
        slopes: Option<&mut Track>,
        end: &mut [f64],
    ) {
        let degree = (self.kept + 1).min(DEGREE);
        states.push(t, next, degree, &self.x, &self.state_sizes);
        states.begin(end);
        if let Some(slopes) = slopes {
            slopes.push(t, next, self.kept, &self.f, &self.slope_sizes);
        }
        for (end, x) in end.iter_mut().zip(self.x.chunks_exact(TERMS)) {
            *end = x.iter().rev().sum();
        }
    }

    /// x′ just after `t`, where the state is `x`.
    pub(super) fn slope_at(
        &mut self,
        t: f64,
        longest: f64,
        x: &[f64],
        tracks: [&Track; 3],
        f: &mut [f64],
    ) {
        for (feeds, track) in self.feeds.iter_mut().zip(tracks) {
            for feed in feeds {
                feed.add_value(track, t, longest, f);
            }
        }
        for &(row, column, a) in &self.a {
            f[row] += a * x[column];
        }
    }
}

/// Σ_j |a_ij| d_j/d_i in the units d of the states that balance A: the rate at which a state follows
/// its input, within a factor of two in any unit.
fn rates(a: &[f64], n: usize) -> Vec<f64> {
    let (balanced, _) = balanced_above(a, n, 0.0);
    let rows = balanced.chunks_exact(n.max(1));
    rows.map(|row| row.iter().map(|a| a.abs()).sum()).collect()
}

/// Do last coefficients of this [`Element::tail`] consist of rounding errors, given the tail of an
/// element twice as long?
pub(super) fn is_noise(tail: f64, before: f64) -> bool {
    tail < MOST_NOISE && tail > LEFT * before
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halving_tells_rounding_errors_from_signals() {
        assert!(is_noise(17.0, 20.0) && is_noise(29.0, 17.0));
        // A jump of the derivative, a smooth signal, what is too large, and a first attempt.
        for (tail, before) in [
            (10.0, 20.0),
            (1.5, 1e6),
            (100.0, 100.0),
            (17.0, f64::INFINITY),
        ] {
            assert!(!is_noise(tail, before));
        }
    }

    #[test]
    fn rates_do_not_know_units() {
        // Poles −1, −10 and −100, as a chain of derivatives and in a thousandth of its unit. Units are
        // powers of two: rows may differ by a factor of two, and the next power is one more.
        let a = [0.0, 1.0, 0.0, 0.0, 0.0, 1.0, -1000.0, -1110.0, -111.0];
        let found = rates(&a, 3);
        assert!(
            found.iter().all(|rate| (1.0..500.0).contains(rate)),
            "{found:?}"
        );
        let mut scaled = a;
        for i in 0..3 {
            scaled[3 * i + 2] *= 1e3;
            scaled[6 + i] *= 1e-3;
        }
        for (rate, other) in found.iter().zip(rates(&scaled, 3)) {
            assert!((0.25..=4.0).contains(&(rate / other)), "{rate} and {other}");
        }
    }
}
