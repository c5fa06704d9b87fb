//! The requested output of a run: outputs and inputs at given times, breaking points, metrics.

use super::series::{BLOCK, Series};
use crate::Error;
use crate::dde::limits::RESPONSE;
use crate::dde::scalar::Scalar;
use crate::memory::{push, require, reserved};

/// Result of a run.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Trajectory<S = f64> {
    /// y at the output times.
    pub outputs: Vec<S>,
    /// The command after the limit at the input times.
    pub inputs: Vec<S>,
    /// Times at which y or a low derivative of it jumps.
    pub output_breaks: Vec<f64>,
    /// Times at which the command or a low derivative of it jumps.
    pub input_breaks: Vec<f64>,
}

/// What measures a response during its run.
pub(crate) trait Measure: std::fmt::Debug {
    /// The response is `y` of (t − `start`)/`length`, from 0 to `end`.
    fn segment(&mut self, start: f64, length: f64, end: f64, y: &Series);

    /// The command is at its limit from `start` to `end`.
    fn limited(&mut self, start: f64, end: f64);

    /// Is enough of the response known?
    fn is_enough(&self) -> bool {
        false
    }
}

/// Output and input times of a run, and the values so far.
#[derive(Debug)]
pub(crate) struct RequestedOutput<'a, S = f64> {
    output_times: &'a [f64],
    input_times: &'a [f64],
    /// Derivative of the output times with respect to the parameter.
    ahead: S,
    pub(crate) trajectory: Trajectory<S>,
    /// Measures the output during the run, if metrics are requested.
    metrics: Option<&'a mut dyn Measure>,
}

impl<'a, S: Scalar> RequestedOutput<'a, S> {
    /// The times at which values are requested; the output times have the slope of `ahead`.
    pub(crate) fn new(
        output_times: &'a [f64],
        input_times: &'a [f64],
        ahead: S,
    ) -> Result<Self, Error> {
        require::<S>(RESPONSE, output_times.len() + input_times.len())?;
        Ok(Self {
            output_times,
            input_times,
            ahead,
            trajectory: Trajectory::default(),
            metrics: None,
        })
    }

    /// Take memory for all values.
    pub(crate) fn reserve(&mut self) -> Result<(), Error> {
        self.trajectory.outputs = reserved(RESPONSE, self.output_times.len())?;
        self.trajectory.inputs = reserved(RESPONSE, self.input_times.len())?;
        Ok(())
    }

    /// Measure the output as well, at least up to the last of the times.
    pub(crate) fn measured_by(mut self, metrics: &'a mut dyn Measure) -> Self {
        self.metrics = Some(metrics);
        self
    }

    /// Is the output measured?
    pub(crate) fn is_measured(&self) -> bool {
        self.metrics.is_some()
    }

    /// The output is `y` of (t − `start`)/`length`, from 0 to `end`.
    pub(crate) fn measure(&mut self, start: f64, length: f64, end: f64, y: &Series<S>) {
        if let Some(metrics) = &mut self.metrics {
            metrics.segment(start, length, end, &y.values());
        }
    }

    /// The command is at its limit from `start` to `end`.
    pub(crate) fn limited(&mut self, start: S, end: S) {
        if let Some(metrics) = &mut self.metrics {
            metrics.limited(start.value(), end.value());
        }
    }

    /// Output and input times.
    pub(crate) fn times(&self) -> [&'a [f64]; 2] {
        [self.output_times, self.input_times]
    }

    /// Time of the next output, infinite if all are stored.
    pub(crate) fn next_output(&self) -> f64 {
        let next = self.output_times.get(self.trajectory.outputs.len());
        next.copied().unwrap_or(f64::INFINITY)
    }

    /// The last requested time, 0 if there is none.
    pub(crate) fn last(&self) -> f64 {
        let last = |times: &[f64]| times.last().copied().unwrap_or(0.0);
        last(self.output_times).max(last(self.input_times))
    }

    /// Store one value as the outputs at all times before `end`.
    pub(crate) fn outputs_before(&mut self, end: f64, value: S) {
        let outputs = &mut self.trajectory.outputs;
        blocks_before(end, self.output_times, outputs, S::from, |_| [value; BLOCK]);
    }

    /// Store one value as the inputs at all times before `end`.
    pub(crate) fn inputs_before(&mut self, end: f64, value: S) {
        self.input_blocks(end, |_| [value; BLOCK]);
    }

    /// Store the outputs at all times before `end`, several at once.
    pub(crate) fn output_blocks(&mut self, end: f64, values: impl FnMut([S; BLOCK]) -> [S; BLOCK]) {
        let place = |time| self.ahead.pinned(time);
        let outputs = &mut self.trajectory.outputs;
        blocks_before(end, self.output_times, outputs, place, values);
    }

    /// Store the inputs at all times before `end`, several at once.
    pub(crate) fn input_blocks(&mut self, end: f64, values: impl FnMut([S; BLOCK]) -> [S; BLOCK]) {
        let inputs = &mut self.trajectory.inputs;
        blocks_before(end, self.input_times, inputs, S::from, values);
    }

    /// Store a break of y at `t` unless it lies after the last output time.
    pub(crate) fn output_break(&mut self, t: S) -> Result<(), Error> {
        let t = t.value();
        if self.output_times.last().is_some_and(|&last| t <= last) {
            push(RESPONSE, &mut self.trajectory.output_breaks, t)?;
        }
        Ok(())
    }

    /// Store a break of the command at `t` unless it lies after the last input time.
    pub(crate) fn input_break(&mut self, t: S) -> Result<(), Error> {
        let t = t.value();
        if self.input_times.last().is_some_and(|&last| t <= last) {
            push(RESPONSE, &mut self.trajectory.input_breaks, t)?;
        }
        Ok(())
    }

    /// Store all values and breaks.
    pub(crate) fn store(&mut self, found: Trajectory) {
        let moved = |values: Vec<f64>| values.into_iter().map(S::from).collect();
        self.trajectory = Trajectory {
            outputs: moved(found.outputs),
            inputs: moved(found.inputs),
            output_breaks: found.output_breaks,
            input_breaks: found.input_breaks,
        };
    }

    /// Are all values stored, or is enough measured?
    pub(crate) fn is_done(&self) -> bool {
        let is_stored = self.trajectory.outputs.len() == self.output_times.len()
            && self.trajectory.inputs.len() == self.input_times.len();
        is_stored
            || self
                .metrics
                .as_ref()
                .is_some_and(|metrics| metrics.is_enough())
    }
}

/// Append the values at those of the remaining `times` that are before `end`.
fn blocks_before<S: Scalar>(
    end: f64,
    times: &[f64],
    found: &mut Vec<S>,
    place: impl Fn(f64) -> S,
    mut values: impl FnMut([S; BLOCK]) -> [S; BLOCK],
) {
    let left = times.get(found.len()..).unwrap_or_default();
    let count = left.iter().take_while(|time| **time < end).count();
    for block in left[..count].chunks(BLOCK) {
        // The last time stands in for those that a short block lacks.
        let last = block.len() - 1;
        let here = values(std::array::from_fn(|i| place(block[i.min(last)])));
        found.extend_from_slice(&here[..block.len()]);
    }
}
