//! The problem, the interface to the caller's functions, and the solution.

use std::ops::Range;

use super::breaks::BreakingPoint;
use super::history::History;
use super::sparsity::Sparsity;
use crate::{Error, Task};

/// Least delay relative to the times of a run.
const RESOLUTION: f64 = 1e-13;

/// Relative rounding error by which a history may be too short.
const HISTORY_ROUNDING: f64 = 1e-12;

/// Least relative tolerance.
const LEAST_RTOL: f64 = 1e-14;

/// Arguments of the right-hand side at many nodes; the node runs fastest.
#[derive(Debug, Clone, Copy)]
pub struct Columns<'a> {
    /// Times, one for each node.
    pub t: &'a [f64],
    /// y: component, node.
    pub y: &'a [f64],
    /// Delayed y: delay, component, node.
    pub z: &'a [f64],
    /// Delayed y′ likewise; empty unless the equation is neutral.
    pub dz: &'a [f64],
}

/// The caller's functions: the equation, its events, its jumps.
pub trait Equation {
    /// The right-hand side at all nodes, component by component like y.
    fn slope(&mut self, at: Columns<'_>, out: &mut [f64], task: &Task) -> Result<(), Error>;

    /// Does a call cost much more than its work for a node? Sweeps are then worth saving.
    fn is_costly(&self) -> bool {
        false
    }

    /// Some of the event functions at one time.
    fn events(
        &mut self,
        _t: f64,
        _y: &[f64],
        _which: Range<usize>,
        _out: &mut [f64],
    ) -> Result<(), Error> {
        Ok(())
    }

    /// Change y at the jump with this index.
    fn change(&mut self, _jump: usize, _t: f64, _y: &mut [f64]) -> Result<(), Error> {
        Ok(())
    }
}

/// Which zeros of an event function count, and whether they end the run.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Event {
    /// 1 for upward crossings only, −1 for downward ones, 0 for both.
    pub direction: i8,
    /// End the run at the crossing with this number, counted from 1; 0 for never.
    pub terminal: u32,
}

/// A time at which the right-hand side jumps, and perhaps y.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Jump {
    /// The time.
    pub time: f64,
    /// Is [`Equation::change`] called?
    pub changes: bool,
}

/// The problem and the required accuracy.
#[derive(Debug, Clone, Default)]
pub struct Problem {
    /// Start of the solution.
    pub start: f64,
    /// End of the solution.
    pub end: f64,
    /// y at the start.
    pub y0: Vec<f64>,
    /// The constant delays.
    pub delays: Vec<f64>,
    /// Does the right-hand side take delayed derivatives?
    pub neutral: bool,
    /// The past, at least as long as the largest delay.
    pub history: History,
    /// Breaking points of the past and of the start.
    pub breaks: Vec<BreakingPoint>,
    /// Jumps of the right-hand side, in the order of time.
    pub jumps: Vec<Jump>,
    /// Events, as many as [`Equation::events`] writes.
    pub events: Vec<Event>,
    /// Relative tolerance.
    pub rtol: f64,
    /// Absolute tolerance: one, or one for each component.
    pub atol: Vec<f64>,
    /// Largest length of an element.
    pub max_step: f64,
    /// Times at which y is requested, ascending; without them y is returned at every node.
    pub t_eval: Option<Vec<f64>>,
    /// Keep every piece instead of those that a delay still reaches.
    pub dense_output: bool,
    /// The components on which the right-hand side depends; determined by differences where it is
    /// not given.
    pub jac_sparsity: Option<Sparsity>,
    /// Upper limit on the elements tried, accepted or not.
    pub max_steps: Option<u64>,
}

/// Outcome of a run.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Outcome {
    /// At the end of the interval.
    #[default]
    Finished,
    /// At a terminal event.
    Event,
    /// Elements became as short as rounding errors allow, at this time.
    Shrunk(f64),
    /// The right-hand side is not finite from this time on.
    NotFinite(f64),
    /// The upper limit on elements was reached at this time.
    TooMany(f64),
}

/// A solution.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Solution {
    /// Times of the output.
    pub t: Vec<f64>,
    /// y at them, one time after the other.
    pub y: Vec<f64>,
    /// The stored pieces.
    pub history: History,
    /// End of the solution within the pieces.
    pub end: f64,
    /// Times of the crossings of each event.
    pub t_events: Vec<Vec<f64>>,
    /// y at them, one crossing after the other.
    pub y_events: Vec<Vec<f64>>,
    /// The breaking points on which elements end.
    pub breaks: Vec<BreakingPoint>,
    /// Calls of the right-hand side.
    pub nfev: u64,
    /// Nodes at which the right-hand side was evaluated.
    pub n_nodes: u64,
    /// Elements accepted.
    pub n_elements: u64,
    /// Elements tried and rejected.
    pub n_rejected: u64,
    /// Outcome of the run.
    pub outcome: Outcome,
}

impl Problem {
    /// Number of components.
    pub fn dim(&self) -> usize {
        self.y0.len()
    }

    /// The largest delay, 0 without any.
    pub fn memory(&self) -> f64 {
        self.delays.iter().copied().fold(0.0, f64::max)
    }

    /// Check the problem.
    pub fn check(&self) -> Result<(), Error> {
        let refuse = |message: String| Err(Error::argument(message));
        if !(self.start.is_finite() && self.end.is_finite() && self.end > self.start) {
            return refuse(format!(
                "t_span=({}, {}): give two finite times, the later one second. An equation with \
                 delays has no solution backwards in time",
                self.start, self.end
            ));
        }
        if let Some(delay) = self.delays.iter().find(|delay| **delay < 0.0) {
            return refuse(format!(
                "the delay {delay} is negative, so the equation is advanced, and its future would \
                 determine its present. Give delays above zero"
            ));
        }
        if let Some(delay) = self
            .delays
            .iter()
            .find(|delay| **delay == 0.0 || delay.is_nan())
        {
            return refuse(format!(
                "the delay {delay} is not above zero: in fun, use y itself for a delay of 0"
            ));
        }
        let resolution = RESOLUTION * self.start.abs().max(self.end.abs());
        if let Some(delay) = self.delays.iter().find(|delay| **delay <= resolution) {
            return refuse(format!(
                "the delay {delay} is smaller than the rounding errors of times in t_span: leave \
                 it out, or shift and scale time"
            ));
        }
        if self.delays.iter().any(|delay| !delay.is_finite()) {
            return refuse("a delay is infinite: leave it out".to_owned());
        }
        let first = self.history.pieces().next().map(|piece| piece.start);
        let needed = self.start - self.memory() * (1.0 - HISTORY_ROUNDING);
        if let Some(first) = first.filter(|first| *first > needed) {
            return refuse(format!(
                "the history begins at {first}: give the history from {} on, which is the start of \
                 the solution minus the largest delay",
                self.start - self.memory()
            ));
        }
        if let Some(value) = self.y0.iter().find(|value| !value.is_finite()) {
            return refuse(format!("y at the start is {value:?}: give finite numbers"));
        }
        if !(self.rtol >= LEAST_RTOL && self.rtol < 1.0) {
            return refuse(format!("rtol={}: give a number from 1e-14 to 1", self.rtol));
        }
        if let Some(atol) = self
            .atol
            .iter()
            .find(|atol| !(**atol >= 0.0 && atol.is_finite()))
        {
            return refuse(format!(
                "atol={atol}: give finite numbers that are not negative"
            ));
        }
        if self.atol.len() != 1 && self.atol.len() != self.dim() {
            return refuse(format!(
                "atol has {} entries for {} components: give one number, or one for each component",
                self.atol.len(),
                self.dim()
            ));
        }
        if self.max_step.is_nan() || self.max_step <= 0.0 {
            return refuse(format!(
                "max_step={}: give a number above zero",
                self.max_step
            ));
        }
        let within = |time: f64| time >= self.start && time <= self.end;
        if let Some(times) = &self.t_eval
            && !(times.is_sorted() && times.iter().all(|time| within(*time)))
        {
            return refuse(format!(
                "t_eval must contain increasing times within t_span=({}, {})",
                self.start, self.end
            ));
        }
        Ok(())
    }
}
