//! One element: nodes, delayed values, first guess, sweeps.
//!
//! A sweep evaluates the right-hand side at all nodes of the iterate and improves it by a step of
//! Picard's or Newton's iteration. The sweeps end when the remaining error, |δ| θ / (1 − θ) with
//! the ratio θ of the last two steps, is a small share of the tolerance. Where the Jacobian was
//! used before, its last ratio replaces the second step, with a margin.

use super::chebyshev;
use super::delayed::{Delayed, Place};
use super::history::History;
use super::newton::Newton;
use super::nodes::Nodes;
use super::problem::{Columns, Equation, Problem};
use super::products::{Rows, multiply};
use super::sizes::{all_finite, largest};
use crate::{Error, Task};

/// Largest remaining error of the iteration, in tolerances.
const LEFT: f64 = 0.02;
/// Factor on a bound of the residual, to which the step that it asks for is compared.
const BOUND: f64 = 4.0;
/// Upper limit on the sweeps of one element.
const MOST: u32 = 40;
/// Factor on a ratio that was observed at an earlier element.
const MARGIN: f64 = 10.0;

/// Largest step, in tolerances, for which a ratio observed at an earlier element is used.
const BELIEVED: f64 = 300.0;
/// Lower limit on a ratio from two steps, because the first of them may have any size.
const SLOWEST: f64 = 1e-3;
/// Growth of the iterate from one sweep to the next that counts as divergence.
const WILD: f64 = 30.0;
/// Furthest coordinate on the last piece, which ends at 1, to which it is extrapolated.
const FARTHEST: f64 = 5.0;
/// Terms of an extrapolation larger than this many times the smallest one are dropped.
const GROWN: f64 = 4.0;

/// Outcome of the sweeps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Sweeps {
    /// Converged after this number of sweeps.
    Converged(u32),
    /// Not converging.
    Stalled,
    /// The right-hand side is not finite at this node.
    NotFinite(usize),
}

/// Memory for the elements of a run.
#[derive(Debug, Default)]
pub(super) struct Element {
    pub(super) start: f64,
    pub(super) end: f64,
    pub(super) t: Vec<f64>,
    /// Values, component by component, at the N + 1 points.
    pub(super) y: Vec<f64>,
    /// Delayed values and slopes at the nodes, as in [`Columns`].
    pub(super) z: Vec<f64>,
    pub(super) dz: Vec<f64>,
    /// The right-hand side at the nodes, from the last evaluation.
    pub(super) f: Vec<f64>,
    pub(super) coefficients: Vec<f64>,
    /// Tolerance of each component.
    pub(super) scale: Vec<f64>,
    residual: Vec<f64>,
    /// Slopes at the nodes before a step, and their change with it.
    before: Vec<f64>,
    table: Vec<f64>,
    delayed: Delayed,
    pub(super) newton: Newton,
    /// Is the guess the constant from the start?
    is_flat: bool,
    /// Ratio of the steps and first step, as last observed with Newton's iteration.
    seen: Option<(f64, f64)>,
    pub(super) calls: u64,
    pub(super) evaluated: u64,
}

/// The starting point of an element.
#[derive(Debug, Clone, Copy)]
pub(super) struct Begin<'a> {
    pub(super) initial: &'a [f64],
    pub(super) history: &'a History,
    /// Does the last piece continue smoothly enough to be extrapolated?
    pub(super) smooth: bool,
    /// Does the right-hand side jump at the start and at the end?
    pub(super) jumps: (bool, bool),
}

impl Element {
    /// Memory for a run, with what is known of the Jacobian.
    pub(super) fn new(newton: Newton) -> Self {
        Self {
            newton,
            ..Self::default()
        }
    }

    /// Set the place of the element and read its past.
    pub(super) fn set(
        &mut self,
        problem: &Problem,
        nodes: &'static Nodes,
        (start, end): (f64, f64),
        begin: Begin<'_>,
    ) -> Result<(), Error> {
        let (n, dim) = (nodes.order + 1, problem.dim());
        (self.start, self.end) = (start, end);
        let half = 0.5 * (end - start);
        self.t.clear();
        self.t
            .extend(nodes.points.iter().map(|x| start + half * (1.0 + x)));
        self.t[n - 1] = end;
        let size = problem.delays.len() * dim * n;
        self.z.resize(size, 0.0);
        self.dz.resize(if problem.neutral { size } else { 0 }, 0.0);
        self.f.resize(dim * n, 0.0);
        self.coefficients.resize(dim * n, 0.0);
        self.residual.resize(dim * nodes.order, 0.0);
        let place = Place {
            start,
            end,
            t: &self.t,
            nodes,
        };
        let (z, dz) = (&mut self.z, &mut self.dz);
        let overlapped = self.delayed.overlaps();
        self.delayed
            .gather(begin.history, &problem.delays, place, dim, z, dz)?;
        if self.delayed.overlaps() != overlapped {
            // The point at which the Jacobian was evaluated has changed.
            self.newton.forget();
            self.seen = None;
        }
        self.guess(n, begin);
        // The time of a jump that the caller receives must lie on the side of the element.
        if begin.jumps.0 {
            self.t[0] = start.next_up();
        }
        if begin.jumps.1 {
            self.t[n - 1] = end.next_down();
        }
        Ok(())
    }

    /// The last piece extrapolated, with as many of its terms as still decrease at the far end.
    fn guess(&mut self, n: usize, begin: Begin<'_>) {
        self.y.clear();
        for initial in begin.initial {
            self.y.extend(std::iter::repeat_n(*initial, n));
        }
        self.is_flat = true;
        let Some(piece) = begin.history.latest().filter(|_| begin.smooth) else {
            return;
        };
        let far = piece.place(self.end);
        if far > FARTHEST {
            return;
        }
        // Where the right-hand side is linear in its one component, a step from any guess is as good,
        // so that an extrapolation pays only if it saves a sweep.
        if self.newton.is_exact()
            && let &[scale] = &self.scale[..]
            && falling(&piece.coefficients, far).1 > BELIEVED * scale
        {
            return;
        }
        self.is_flat = false;
        let places: Vec<f64> = self.t.iter().map(|t| piece.place(*t)).collect();
        chebyshev::basis(&places, piece.terms, &mut self.table);
        let rows = piece.coefficients.chunks_exact(piece.terms);
        for ((y, initial), c) in self.y.chunks_exact_mut(n).zip(begin.initial).zip(rows) {
            let (terms, _) = falling(c, far);
            let all = Rows::of(n);
            multiply((&c[..terms], Rows::of(terms)), &self.table, n, (y, all));
            let shift = initial - y[0];
            y.iter_mut().for_each(|y| *y += shift);
            y[0] = *initial;
        }
    }

    /// Sweep until converged.
    pub(super) fn sweep<E: Equation + ?Sized>(
        &mut self,
        problem: &Problem,
        nodes: &'static Nodes,
        equation: &mut E,
        task: &Task,
    ) -> Result<Sweeps, Error> {
        let n = nodes.order + 1;
        let half = 0.5 * (self.end - self.start);
        let mut last = f64::INFINITY;
        let mut first = 0.0;
        let mut growing = 0;
        for count in 1..=MOST {
            task.check()?;
            if self.delayed.overlaps() {
                nodes.coefficients(&self.y, &mut self.coefficients);
                self.delayed.renew(&self.coefficients, n, &mut self.z);
            }
            let at = Columns {
                t: &self.t,
                y: &self.y,
                z: &self.z,
                dz: &self.dz,
            };
            equation.slope(at, &mut self.f, task)?;
            self.calls += 1;
            self.evaluated += n as u64;
            if !all_finite(&self.f)
                && let Some(bad) = self.f.iter().position(|f| !f.is_finite())
            {
                return Ok(Sweeps::NotFinite(bad % n));
            }
            let costly = equation.is_costly();
            if count == 1
                && let Some(most) = self.newton.comes_first(problem.dim(), costly)
            {
                self.linearise_at(self.t.len() / 2, most, equation, task)?;
                self.newton.wait_if_full();
                if !costly && !self.newton.is_uncoupled() {
                    self.newton.turn_off();
                }
            }
            if count == 2 && self.is_explained(problem.dim(), nodes, half) {
                // The residual removes the rounding errors of the first step.
                self.residual(nodes, half);
                self.step(problem, n);
                self.seen = Some((self.size(n - 1) / last, first));
                self.newton.age += 1;
                return Ok(Sweeps::Converged(count));
            }
            if count == 1 && problem.dim() == 1 {
                self.before.clone_from(&self.f);
            }
            if !self.find_step(count, nodes, half) {
                return Ok(Sweeps::Stalled);
            }
            let grown = self.step(problem, n);
            let size = self.size(n - 1);
            if count == 1 {
                first = size;
            } else if grown > WILD {
                return Ok(Sweeps::Stalled);
            }
            let ratio = size / last;
            if self.settled(count, size, ratio) {
                if count > 1 && self.newton.is_on() {
                    self.seen = Some((ratio, first));
                }
                self.newton.age += 1;
                return Ok(Sweeps::Converged(count));
            }
            growing = if ratio > 1.0 { growing + 1 } else { 0 };
            if !size.is_finite() || growing > 2 || (count > 8 && ratio > 0.8) {
                return Ok(Sweeps::Stalled);
            }
            last = size;
        }
        Ok(Sweeps::Stalled)
    }

    /// Are the slopes after the first step, of one component, so close to those that the Jacobian
    /// predicts that no further step is needed but for rounding errors?
    ///
    /// The residual after a step δ is (h/2) B (F(Y + δ) − F(Y) − J δ).
    fn is_explained(&mut self, dim: usize, nodes: &Nodes, half: f64) -> bool {
        if dim != 1 || !self.newton.is_on() || self.delayed.overlaps() {
            return false;
        }
        for (before, f) in self.before.iter_mut().zip(&self.f) {
            *before = f - *before;
        }
        let left = self
            .newton
            .unexplained(&self.y, &self.residual, &self.before[1..]);
        let scale = self.scale.first().copied().unwrap_or_default();
        left.is_some_and(|left| BOUND * half * nodes.norm * left <= LEFT * scale)
    }

    /// Evaluate the Jacobian at the middle node of the last evaluation.
    pub(super) fn linearise<E: Equation + ?Sized>(
        &mut self,
        equation: &mut E,
        task: &Task,
    ) -> Result<bool, Error> {
        let most = self.newton.worth_renewing();
        self.linearise_at(self.t.len() / 2, most, equation, task)
    }

    fn linearise_at<E: Equation + ?Sized>(
        &mut self,
        node: usize,
        most: usize,
        equation: &mut E,
        task: &Task,
    ) -> Result<bool, Error> {
        let at = Columns {
            t: &self.t,
            y: &self.y,
            z: &self.z,
            dz: &self.dz,
        };
        self.seen = None;
        self.newton
            .evaluate(equation, at, node, &self.delayed, most, task)
    }

    /// Evaluate the Jacobian at the start, where the iterate is exact for any outcome of the
    /// sweeps.
    pub(super) fn linearise_at_start<E: Equation + ?Sized>(
        &mut self,
        equation: &mut E,
        task: &Task,
    ) -> Result<bool, Error> {
        let most = self.newton.worth_renewing();
        self.linearise_at(0, most, equation, task)
    }

    /// The step of a sweep, in the place of the residual; `false` where its system is singular.
    fn find_step(&mut self, count: u32, nodes: &Nodes, half: f64) -> bool {
        if count == 1 && self.is_flat && self.newton.is_exact() {
            let slopes = &self.f[1..];
            return self
                .newton
                .step_from_rest(nodes, half, slopes, &mut self.residual);
        }
        self.residual(nodes, half);
        !self.newton.is_on() || self.newton.solve(nodes, half, &mut self.residual)
    }

    /// y_0 + (h/2) B F − Y.
    fn residual(&mut self, nodes: &Nodes, half: f64) {
        let order = nodes.order;
        let (slopes, rows) = (Rows::after_first(order + 1), Rows::of(order));
        let residual = &mut self.residual;
        multiply((&self.f, slopes), &nodes.integrals, order, (residual, rows));
        let values = self.y.chunks_exact(order + 1);
        for (residual, y) in self.residual.chunks_exact_mut(order).zip(values) {
            for (residual, value) in residual.iter_mut().zip(&y[1..]) {
                *residual = y[0] + half * *residual - value;
            }
        }
    }

    /// Add the step, and compute the size to which it is compared and the growth of y.
    fn step(&mut self, problem: &Problem, n: usize) -> f64 {
        self.scale.clear();
        let before = largest(&self.y);
        let mut after = 0.0_f64;
        let rows = self.y.chunks_exact_mut(n);
        for (d, (y, step)) in rows.zip(self.residual.chunks_exact(n - 1)).enumerate() {
            for (y, step) in y[1..].iter_mut().zip(step) {
                *y += step;
            }
            let size = largest(y);
            after = after.max(size);
            let atol = problem.atol.get(d).or(problem.atol.first());
            let scale = atol.copied().unwrap_or(0.0) + problem.rtol * size;
            self.scale.push(scale.max(f64::MIN_POSITIVE));
        }
        after / before
    }

    /// Largest entry of the step, in tolerances.
    fn size(&self, order: usize) -> f64 {
        if !all_finite(&self.residual) {
            return f64::INFINITY;
        }
        let rows = self.residual.chunks_exact(order).zip(&self.scale);
        rows.fold(0.0, |worst: f64, (row, scale)| {
            worst.max(largest(row) / scale)
        })
    }

    /// Is the remaining error after a step small enough?
    fn settled(&self, count: u32, size: f64, ratio: f64) -> bool {
        if size <= LEFT {
            return true;
        }
        if count == 1 {
            return self.newton.is_on()
                && !self.delayed.overlaps()
                && size <= BELIEVED
                && self.seen.is_some_and(|(ratio, first)| {
                    size * ratio * MARGIN * (size / first).max(1.0) <= LEFT
                });
        }
        let ratio = ratio.max(SLOWEST);
        ratio < 0.5 && size * ratio / (1.0 - ratio) <= LEFT
    }
}

/// Number of terms of a sum that decrease at `far`, which lies beyond its interval, and the size of
/// the last of them.
fn falling(coefficients: &[f64], far: f64) -> (usize, f64) {
    let (mut below, mut here) = (1.0, far);
    // In even and odd functions every other term is zero, so that pairs are compared.
    let (mut best, mut last) = ((f64::INFINITY, 1), 0.0);
    for (k, c) in coefficients.iter().enumerate().skip(1) {
        let term = (c * here).abs();
        let size = term.max(last);
        if size <= best.0 {
            best = (size, k + 1);
        } else if size > GROWN * best.0 {
            break;
        }
        last = term;
        (below, here) = (here, 2.0 * far * here - below);
    }
    (best.1, best.0)
}
