//! A run from start to end, element by element.

use super::breaks::{BreakingPoint, Breaks};
use super::control::Verdict;
use super::element::{Begin, Element, Sweeps};
use super::events::Watch;
use super::history::Piece;
use super::newton::Newton;
use super::nodes::{COUPLED, Nodes, nodes};
use super::output::Output;
use super::problem::{Equation, Outcome, Problem, Solution};
use super::unread::{Reading, Unread};
use super::{chebyshev, control};
use crate::{Error, Task};

/// Shortest element relative to its time; a shorter one consists of rounding errors.
const SHORTEST: f64 = 64.0 * f64::EPSILON;
/// Share of its length by which an element may end earlier to coincide with the ends of earlier
/// elements.
const IN_STEP: f64 = 0.45;
/// Number of elements between two breaking points up to which they are made equal.
const EQUAL: f64 = 4.0;
/// Sweeps of Picard's iteration from which on a Jacobian pays even where calls are cheap.
const MANY_SWEEPS: u32 = 12;
/// Sweeps from which on a new Jacobian is evaluated.
const STALE_SWEEPS: u32 = 4;
/// Sweeps of Picard's iteration from which on elements are not lengthened.
const SLOW_SWEEPS: u32 = 16;
/// A solution that needs at most one in this many of the coefficients is smooth.
const FEW_TERMS: usize = 4;
/// Factor on the length where sweeps fail or the right-hand side is not finite.
const RETREAT: f64 = 0.3;
/// An element that contains its own delayed values needs many sweeps: it must be at least this many
/// delays long.
const OVERLAP: f64 = 12.0;
/// Terms of an element from which on one so much longer does not succeed.
const OVERLAP_TERMS: usize = 8;
/// Upper limit on the elements before one of that kind is tried again.
const LONGEST_WAIT: u32 = 4096;
/// Orders of a jump that matter in addition to one for each digit of the tolerance.
const UNSEEN: u32 = 2;
/// A jump of a neutral slope below this share of the tolerance is negligible.
const FAINT: f64 = 0.02;

/// Length of an element, in shortest ones, at which a right-hand side that is not finite ends the
/// run.
const NEAR_START: f64 = 1e3;

/// Relative rounding error in dividing an interval into elements.
const WHOLE_PARTS: f64 = 1e-10;

/// Largest factor on the length after an element was rejected.
const SHORTENED: f64 = 0.8;

/// Solve to the end of the interval or a terminal event.
pub fn solve<E: Equation + ?Sized>(
    problem: &Problem,
    equation: &mut E,
    task: &Task,
) -> Result<Solution, Error> {
    problem.check()?;
    let mut run = Run::new(problem, equation)?;
    while run.solution.end < problem.end {
        task.check()?;
        if let Some(outcome) = run.advance(equation, task)? {
            run.solution.outcome = outcome;
            break;
        }
        task.advance(1);
    }
    Ok(run.finished())
}

struct Run<'a> {
    problem: &'a Problem,
    solution: Solution,
    breaks: Breaks,
    /// Index of the next jump.
    jump: usize,
    watch: Watch,
    element: Element,
    reading: Reading,
    state: Vec<f64>,
    /// The start of the next element, if it is a breaking point that has not been followed.
    fresh: Option<BreakingPoint>,
    length: f64,
    order: usize,
    preferred: usize,
    /// Orders to prefer for coupled and for uncoupled components.
    orders: [usize; 2],
    shortest_delay: f64,
    /// Length of the longest element on which sweeps without a Jacobian failed since the last one
    /// that succeeded.
    stalled: f64,
    /// Elements until one longer than a delay is tried, and the number last time.
    wait: (u32, u32),
    output: Output<'a>,
}

impl<'a> Run<'a> {
    fn new<E: Equation + ?Sized>(problem: &'a Problem, equation: &mut E) -> Result<Self, Error> {
        let digits = -problem.rtol.log10();
        let sight = UNSEEN + digits.ceil() as u32;
        let mut breaks = Breaks::new(problem.start, &problem.delays, problem.neutral, sight);
        for jump in &problem.jumps {
            let order = u32::from(!jump.changes);
            let time = jump.time;
            breaks.add(BreakingPoint { time, order });
        }
        for point in &problem.breaks {
            breaks.follow(*point);
        }
        let first = problem
            .jumps
            .iter()
            .position(|jump| jump.time > problem.start);
        let costly = equation.is_costly();
        let preferred = control::preferred(problem.rtol, costly);
        let uncoupled = control::preferred_uncoupled(problem.rtol, costly, problem.dim());
        let delays = problem.delays.iter().copied();
        let mut run = Self {
            problem,
            solution: Solution {
                history: problem.history.clone(),
                end: problem.start,
                ..Solution::default()
            },
            breaks,
            jump: first.unwrap_or(problem.jumps.len()),
            watch: Watch::new(&problem.events, equation, problem.start, &problem.y0)?,
            element: Element::new(Newton::new(problem.jac_sparsity.as_ref())),
            reading: Reading::default(),
            state: problem.y0.clone(),
            fresh: None,
            length: (problem.end - problem.start).min(problem.max_step),
            order: preferred,
            preferred,
            orders: [preferred, uncoupled],
            shortest_delay: delays.fold(f64::INFINITY, f64::min),
            stalled: 0.0,
            wait: (0, 1),
            output: Output::new(problem.t_eval.as_deref()),
        };
        run.output.start(problem.start, &run.state)?;
        Ok(run)
    }

    /// Try elements until one is accepted; an outcome ends the run.
    fn advance<E: Equation + ?Sized>(
        &mut self,
        equation: &mut E,
        task: &Task,
    ) -> Result<Option<Outcome>, Error> {
        let start = self.solution.end;
        let mut retried = false;
        loop {
            let end = self.next_end();
            if end - start <= SHORTEST * start.abs().max(end.abs()) {
                return Ok(Some(Outcome::Shrunk(start)));
            }
            let tried = self.solution.n_elements + self.solution.n_rejected;
            if self.problem.max_steps.is_some_and(|most| tried >= most) {
                return Ok(Some(Outcome::TooMany(start)));
            }
            if !self.element.newton.is_uncoupled() {
                self.order = self.order.min(COUPLED);
            }
            let nodes = nodes(self.order);
            let begin = Begin {
                initial: &self.state,
                history: &self.solution.history,
                smooth: self.fresh.is_none_or(|point| point.order > 1),
                jumps: (self.jumps_at(start), self.jumps_at(end)),
            };
            self.element.set(self.problem, nodes, (start, end), begin)?;
            let ended = self.element.sweep(self.problem, nodes, equation, task)?;
            let before = self.solution.n_rejected;
            match ended {
                Sweeps::Converged(count) => {
                    nodes.coefficients(&self.element.y, &mut self.element.coefficients);
                    let verdict = control::judge(&self.element, nodes);
                    if verdict.error > 1.0 {
                        self.refuse(verdict);
                    } else if let Some(unread) = self.unread(nodes) {
                        self.read(unread, verdict);
                    } else {
                        let stiff = self.renew_jacobian(count, verdict, equation, task)?;
                        let held = (!self.element.newton.is_on() && count > SLOW_SWEEPS)
                            .then_some(end - start);
                        let outcome = self.accept(verdict, nodes, equation)?;
                        self.length = self.length.min(held.unwrap_or(f64::INFINITY)).max(stiff);
                        return Ok(outcome);
                    }
                }
                Sweeps::Stalled => {
                    // Try again with a Jacobian of this point, then with a shorter element.
                    let newton = &self.element.newton;
                    let known = newton.is_on() && newton.age == 0;
                    let waits = !newton.is_on() && !newton.is_cheap(self.problem.dim());
                    if waits
                        || retried
                        || known
                        || !self.element.linearise_at_start(equation, task)?
                    {
                        if waits {
                            self.stalled = self.stalled.max(end - start);
                        }
                        self.length = RETREAT * (end - start);
                        retried = false;
                    } else {
                        retried = true;
                    }
                    self.solution.n_rejected += 1;
                }
                Sweeps::NotFinite(0) if start == self.problem.start => {
                    return Err(self.no_start());
                }
                Sweeps::NotFinite(node) => {
                    if node == 0
                        || end - start <= NEAR_START * SHORTEST * start.abs().max(end.abs())
                    {
                        return Ok(Some(Outcome::NotFinite(self.element.t[node])));
                    }
                    self.length = RETREAT * (end - start);
                    self.solution.n_rejected += 1;
                }
            }
            if self.solution.n_rejected > before && end - start > self.shortest_delay {
                let wait = (2 * self.wait.1).min(LONGEST_WAIT);
                self.wait = (wait, wait);
            }
        }
    }

    fn no_start(&self) -> Error {
        let slopes: Vec<f64> = self
            .element
            .f
            .chunks_exact(self.element.t.len())
            .map(|row| row[0])
            .collect();
        Error::argument(format!(
            "the right-hand side is not finite at t={:?}, y={:?}: it is {slopes:?}",
            self.problem.start, self.problem.y0
        ))
    }

    /// The largest length that is allowed now.
    fn longest(&self) -> f64 {
        let longest = self.problem.max_step;
        let overlaps = !self.problem.neutral
            && self.wait.0 == 0
            && self.length.min(longest) >= OVERLAP * self.shortest_delay;
        if overlaps {
            longest
        } else {
            longest.min(self.shortest_delay)
        }
    }

    /// End of the next element: a breaking point, the end of the run, or the end of an earlier
    /// element one delay before.
    fn next_end(&self) -> f64 {
        let start = self.solution.end;
        let length = self.length.min(self.longest());
        let ahead = self.breaks.next().map_or(f64::INFINITY, |point| point.time);
        // A point within rounding errors of the end is the end.
        let end = self.problem.end;
        let last = ahead >= end - 2.0 * SHORTEST * end.abs().max(start.abs());
        let stop = if last { end } else { ahead };
        let margin = stop - start;
        if margin <= length * (1.0 + WHOLE_PARTS) {
            return stop;
        }
        let parts = (margin / length * (1.0 - WHOLE_PARTS)).ceil();
        if parts <= EQUAL {
            return start + margin / parts;
        }
        let latest = start + length;
        let joints = self.problem.delays.iter().filter_map(|delay| {
            let history = &self.solution.history;
            let index = history.locate(latest - delay)?;
            let joint = history.piece(index)?.start + delay;
            (joint > start + IN_STEP * length && joint <= latest).then_some(joint)
        });
        let joint = joints.fold(f64::NEG_INFINITY, f64::max);
        if joint.is_finite() { joint } else { latest }
    }

    fn jumps_at(&self, time: f64) -> bool {
        let near = self.jump.saturating_sub(1)..(self.jump + 1).min(self.problem.jumps.len());
        self.problem.jumps[near]
            .iter()
            .any(|jump| jump.time == time)
    }

    /// Choose a larger order or a shorter element.
    fn refuse(&mut self, verdict: Verdict) {
        let length = self.element.end - self.element.start;
        self.solution.n_rejected += 1;
        if self.order < self.preferred {
            self.order = control::order_for(self.order + 3, self.preferred);
            self.length = length;
        } else {
            self.length = length * control::factor(verdict.error, self.order).min(SHORTENED);
        }
    }

    fn unread(&mut self, nodes: &Nodes) -> Option<Unread> {
        let history = &self.solution.history;
        self.reading
            .unread(self.problem, &self.element, nodes, history)
    }

    /// Make the next element read what this one did not resolve.
    fn read(&mut self, unread: Unread, verdict: Verdict) {
        let Some(time) = unread.end else {
            let error = unread.error;
            return self.refuse(Verdict { error, ..verdict });
        };
        self.solution.n_rejected += 1;
        // It ends only this element: the points that follow from it are left to the same
        // comparison.
        let order = self.breaks.smooth() - 1;
        self.breaks.add(BreakingPoint { time, order });
    }

    /// Have a Jacobian where sweeps were many, a new one where it is stale; the length that the
    /// next element may have because of it.
    ///
    /// A costly one is not used until sweeps failed on elements much longer than the solution
    /// needs, which is what makes an equation stiff.
    fn renew_jacobian<E: Equation + ?Sized>(
        &mut self,
        sweeps: u32,
        verdict: Verdict,
        equation: &mut E,
        task: &Task,
    ) -> Result<f64, Error> {
        let newton = &self.element.newton;
        let stalled = std::mem::take(&mut self.stalled);
        if newton.is_on() {
            if sweeps > STALE_SWEEPS && newton.age > 1 {
                self.element.linearise(equation, task)?;
            }
        } else if newton.is_cheap(self.problem.dim()) {
            if sweeps > MANY_SWEEPS {
                self.element.linearise(equation, task)?;
            }
        } else if stalled > 0.0
            && FEW_TERMS * verdict.terms <= self.preferred
            && self.element.linearise(equation, task)?
        {
            return Ok(stalled);
        }
        Ok(0.0)
    }

    fn accept<E: Equation + ?Sized>(
        &mut self,
        verdict: Verdict,
        nodes: &Nodes,
        equation: &mut E,
    ) -> Result<Option<Outcome>, Error> {
        let n = nodes.order + 1;
        let (start, end) = (self.element.start, self.element.end);
        let mut piece = Piece::new(start, end, n, self.element.coefficients.clone());
        if self.problem.neutral {
            piece = piece.with_slopes();
        }
        self.follow(&piece);
        let (y, t) = (&self.element.y, &self.element.t);
        let stop = self.watch.scan(equation, &piece, nodes, y)?;
        let until = stop.unwrap_or(end);
        let last = stop.is_some() || end >= self.problem.end;
        self.output.give(&piece, (y, t), until, last)?;
        self.solution.history.push(piece)?;
        self.solution.n_elements += 1;
        self.solution.end = until;
        for (state, row) in self.state.iter_mut().zip(self.element.y.chunks_exact(n)) {
            *state = row[n - 1];
        }
        if stop.is_some() {
            return Ok(Some(Outcome::Event));
        }
        self.reach(end);
        if self.jump_at(end, equation)? {
            self.output.end(end, &self.state);
            return Ok(Some(Outcome::Event));
        }
        if !self.problem.dense_output {
            self.solution.history.forget(end - self.problem.memory());
        }
        self.plan(verdict, end - start);
        Ok(None)
    }

    /// Process the breaking point at the end of an element, if there is one.
    fn reach(&mut self, time: f64) {
        self.fresh = self.breaks.reach(time);
        let Some(point) = self.fresh else { return };
        if time < self.problem.end {
            self.solution.breaks.push(point);
        }
        // A neutral one is processed after the slope behind it is known.
        if !self.problem.neutral {
            self.breaks.follow(point);
        }
    }

    /// Follow a neutral breaking point at the start of the accepted element.
    fn follow(&mut self, piece: &Piece) {
        let Some(mut point) = self.fresh.filter(|_| self.problem.neutral) else {
            return;
        };
        if point.order == 1
            && let Some(before) = self.solution.history.latest()
        {
            let length = self.shortest_delay;
            let slope = |piece: &Piece, d: usize, x: f64| {
                let row = &piece.slopes[d * piece.terms..(d + 1) * piece.terms];
                chebyshev::value(row, x)
            };
            let scale = self.element.scale.iter().enumerate();
            let turn = scale.map(|(d, scale)| {
                length * (slope(piece, d, -1.0) - slope(before, d, 1.0)).abs() / scale
            });
            if turn.fold(0.0, f64::max) < FAINT {
                point.order = 2;
            }
        }
        self.breaks.follow(point);
    }

    /// Apply the jump at `time`; is it a terminal event?
    fn jump_at<E: Equation + ?Sized>(
        &mut self,
        time: f64,
        equation: &mut E,
    ) -> Result<bool, Error> {
        let mut changed = false;
        while let Some(jump) = self.problem.jumps.get(self.jump) {
            if jump.time > time {
                break;
            }
            if jump.changes {
                equation.change(self.jump, time, &mut self.state)?;
                changed = true;
            }
            self.jump += 1;
        }
        if changed {
            self.output.start(time, &self.state)?;
            return self.watch.change(equation, time, &self.state);
        }
        Ok(false)
    }

    /// Length and order of the next element.
    fn plan(&mut self, verdict: Verdict, length: f64) {
        let factor = control::factor(verdict.error, self.order);
        let mut wanted = length * factor;
        if self.order < self.preferred {
            // More nodes serve as well as a shorter element.
            wanted = wanted.max(length);
        }
        self.wait.0 = self.wait.0.saturating_sub(1);
        // If a delay limits the length, the factors by which it should grow accumulate.
        let overlaps = !self.problem.neutral && verdict.terms <= OVERLAP_TERMS;
        self.length = if wanted > self.shortest_delay && overlaps {
            wanted.max(self.length.min(OVERLAP * self.shortest_delay) * factor)
        } else {
            wanted
        };
        let ahead = self.breaks.next().map_or(f64::INFINITY, |point| point.time);
        let margin = (ahead - self.solution.end).min(self.longest());
        self.preferred = self.orders[usize::from(self.element.newton.is_uncoupled())];
        // Use fewer nodes where the next element is no longer than this one needed to be.
        let parts = (margin / wanted * (1.0 - WHOLE_PARTS)).ceil().max(1.0);
        let is_equal = parts <= EQUAL && margin / parts <= length * (1.0 + WHOLE_PARTS);
        self.order = if (wanted > 1.5 * margin.min(length) && wanted > margin) || is_equal {
            control::next_order(verdict.terms, self.order, self.preferred)
        } else {
            self.preferred
        };
    }

    fn finished(mut self) -> Solution {
        self.solution.t = self.output.times;
        self.solution.y = self.output.values;
        let (calls, columns) = self.element.newton.spent();
        self.solution.nfev = self.element.calls + calls;
        self.solution.n_nodes = self.element.evaluated + columns;
        self.solution.t_events = self.watch.times;
        self.solution.y_events = self.watch.values;
        self.solution
    }
}
