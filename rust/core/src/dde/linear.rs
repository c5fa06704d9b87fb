//! The linear loop with one delay, an optional limit and an optional hold.
//!
//!   x′ = A x + B w + E r,   u = K x + L w + M r,   y = C x + D w,   w(t) = sat(u(t − Td)).
//!
//! x holds the states of plant and controller, u is the command, w the command that reaches the
//! plant, r the reference, y the output. L = 0 is the retarded loop; L ≠ 0 (an ideal derivative
//! of y, or direct feedthrough) the neutral one, whose jumps travel on for ever. With a sample
//! time Ts the command is u_k = sat(K x(t_k) + L w(t_k−) + M r(t_k)) and w = u_k on
//! [t_k + Td, t_{k+1} + Td); controller states see the reference held in the same way.
//! An ideal derivative of r is zero but for an impulse at each jump of r, which arrives at the
//! plant like the rest of the command and, where L ≠ 0, comes back with weight L.
//! Time counts from the start of the run; every signal is scalar, x has any length.

use crate::{Error, Task};

use super::{continuous, sampled};

/// Largest magnitude of a state before a run is given up as diverging.
pub const DIVERGED: f64 = 1e150;

/// The matrices of the loop, row-major; n is the length of `b`.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Equations {
    /// State matrix A, n × n.
    pub a: Vec<f64>,
    /// Input column B, n.
    pub b: Vec<f64>,
    /// Reference column E, n.
    pub e: Vec<f64>,
    /// Feedback row K, n.
    pub k: Vec<f64>,
    /// Feedback L of the delayed command.
    pub l: f64,
    /// Gain M of the reference.
    pub m: f64,
    /// Output row C, n.
    pub c: Vec<f64>,
    /// Feedthrough D.
    pub d: f64,
    /// Weight of the impulse in u per unit jump of the reference: the gain of an ideal derivative
    /// of r. A limited or sampled command does not see it.
    pub impulse: f64,
}

impl Equations {
    /// Number of states.
    pub fn states(&self) -> usize {
        self.b.len()
    }

    /// u before the limit.
    pub(crate) fn command(&self, x: &[f64], w: f64, r: f64) -> f64 {
        dot(&self.k, x) + self.l * w + self.m * r
    }

    /// y.
    pub(crate) fn output(&self, x: &[f64], w: f64) -> f64 {
        dot(&self.c, x) + self.d * w
    }
}

/// A validated loop.
#[derive(Debug, Clone, PartialEq)]
pub struct LinearLoop {
    equations: Equations,
    delay: f64,
    sample_time: Option<f64>,
    limit: Option<f64>,
}

/// State of affairs when a run begins, at time 0.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Start {
    /// x(0), n.
    pub state: Vec<f64>,
    /// The command before time 0, constant.
    pub command: f64,
    /// Sampled loops: commands issued at the samples before time 0, latest last; `command`
    /// stands for all earlier ones.
    pub command_history: Vec<f64>,
    /// Sampled loops: time of the first sample, in [0, Ts).
    pub sample_phase: f64,
}

/// A piecewise constant reference, each value holding from its time on.
#[derive(Debug, Clone, PartialEq)]
pub struct Reference {
    before: f64,
    times: Vec<f64>,
    values: Vec<f64>,
}

impl Reference {
    /// `values[i]` holds from `times[i]` (increasing) on, `before` until the first of them.
    pub fn new(before: f64, times: Vec<f64>, values: Vec<f64>) -> Result<Self, Error> {
        if times.len() != values.len() {
            return Err(Error::argument(format!(
                "{} reference values for {} reference times: give one value a time",
                values.len(),
                times.len()
            )));
        }
        finite("reference before the start", &[before])?;
        finite("reference", &values)?;
        finite("reference time", &times)?;
        if let Some(pair) = times.windows(2).find(|pair| pair[1] <= pair[0]) {
            return Err(Error::argument(format!(
                "reference time {} follows {}: sort the times and drop repeated ones",
                pair[1], pair[0]
            )));
        }
        // Only true jumps are kept: each one ends an element of time.
        let mut last = before;
        let (times, values) = times
            .into_iter()
            .zip(values)
            .filter(|&(_, value)| value != std::mem::replace(&mut last, value))
            .unzip();
        Ok(Self {
            before,
            times,
            values,
        })
    }

    /// A step from `before` to `value` at time 0.
    pub fn step(before: f64, value: f64) -> Result<Self, Error> {
        Self::new(before, vec![0.0], vec![value])
    }

    /// The value that holds at `time`.
    pub(crate) fn at(&self, time: f64) -> f64 {
        match self.times.partition_point(|&jump| jump <= time) {
            0 => self.before,
            place => self.values[place - 1],
        }
    }

    /// A reader that walks forward in time.
    pub(crate) fn cursor(&self) -> Cursor<'_> {
        Cursor {
            reference: self,
            next: 0,
            value: self.before,
        }
    }
}

/// Reads a reference at times that do not decrease.
#[derive(Debug)]
pub(crate) struct Cursor<'a> {
    reference: &'a Reference,
    next: usize,
    value: f64,
}

impl Cursor<'_> {
    /// Move to time `t` (a jump closer than `slack` after it counts as reached); the value there.
    pub(crate) fn advance(&mut self, t: f64, slack: f64) -> f64 {
        while let (Some(&time), Some(&value)) = (
            self.reference.times.get(self.next),
            self.reference.values.get(self.next),
        ) {
            if time > t + slack {
                break;
            }
            self.value = value;
            self.next += 1;
        }
        self.value
    }

    /// The value at the time reached, `before` until the first move.
    pub(crate) fn value(&self) -> f64 {
        self.value
    }

    /// Time of the next jump, infinite if there is none.
    pub(crate) fn next_jump(&self) -> f64 {
        self.reference
            .times
            .get(self.next)
            .copied()
            .unwrap_or(f64::INFINITY)
    }
}

/// What a run returns.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Trajectory {
    /// y at the output times.
    pub outputs: Vec<f64>,
    /// The command after the limit at the input times.
    pub inputs: Vec<f64>,
    /// Times at which y or a low derivative of it jumps.
    pub output_breaks: Vec<f64>,
    /// Times at which the command or a low derivative of it jumps.
    pub input_breaks: Vec<f64>,
}

impl LinearLoop {
    /// Check and keep.
    pub fn new(
        equations: Equations,
        delay: f64,
        sample_time: Option<f64>,
        limit: Option<f64>,
    ) -> Result<Self, Error> {
        let n = equations.states();
        let lengths = [
            ("A", equations.a.len(), n * n),
            ("E", equations.e.len(), n),
            ("K", equations.k.len(), n),
            ("C", equations.c.len(), n),
        ];
        for (name, found, wanted) in lengths {
            if found != wanted {
                return Err(Error::argument(format!(
                    "{name} has {found} elements, {wanted} are needed for {n} states"
                )));
            }
        }
        finite("A", &equations.a)?;
        finite("B", &equations.b)?;
        finite("E", &equations.e)?;
        finite("K", &equations.k)?;
        finite("C", &equations.c)?;
        finite(
            "L, M, D, impulse",
            &[equations.l, equations.m, equations.d, equations.impulse],
        )?;
        if !(delay.is_finite() && delay >= 0.0) {
            return Err(Error::argument(format!(
                "delay={delay}: give a finite number of seconds, zero or more"
            )));
        }
        if let Some(ts) = sample_time
            && !(ts.is_finite() && ts > 0.0)
        {
            return Err(Error::argument(format!(
                "sample_time={ts}: give a positive number of seconds, or none for continuous time"
            )));
        }
        if let Some(limit) = limit
            && (limit.is_nan() || limit <= 0.0)
        {
            return Err(Error::argument(format!(
                "limit={limit}: give a positive bound of the command, or none for no limit"
            )));
        }
        Ok(Self {
            equations,
            delay,
            sample_time,
            limit: limit.filter(|limit| limit.is_finite()),
        })
    }

    /// The matrices.
    pub fn equations(&self) -> &Equations {
        &self.equations
    }

    /// Td, s.
    pub fn delay(&self) -> f64 {
        self.delay
    }

    /// Ts, s; none in continuous time.
    pub fn sample_time(&self) -> Option<f64> {
        self.sample_time
    }

    /// Bound of |u|; none where there is no bound.
    pub fn limit(&self) -> Option<f64> {
        self.limit
    }

    /// y at `output_times` and the limited command at `input_times` (both increasing, ≥ 0, s).
    pub fn simulate(
        &self,
        start: &Start,
        reference: &Reference,
        output_times: &[f64],
        input_times: &[f64],
        task: &Task,
    ) -> Result<Trajectory, Error> {
        self.check_start(start)?;
        for times in [output_times, input_times] {
            finite("time", times)?;
            if let Some(&first) = times.first()
                && first < 0.0
            {
                return Err(Error::argument(format!(
                    "time {first} lies before the start of the run: leave it out"
                )));
            }
            if let Some(pair) = times.windows(2).find(|pair| pair[1] < pair[0]) {
                return Err(Error::argument(format!(
                    "time {} follows {}: sort the times",
                    pair[1], pair[0]
                )));
            }
        }
        let wanted = Wanted::new(output_times, input_times);
        match self.sample_time {
            Some(ts) => sampled::run(self, ts, start, reference, wanted, task),
            None => continuous::run(self, start, reference, wanted, task),
        }
    }

    fn check_start(&self, start: &Start) -> Result<(), Error> {
        let n = self.equations.states();
        if start.state.len() != n {
            return Err(Error::argument(format!(
                "the initial state has {} elements, the loop has {n} states",
                start.state.len()
            )));
        }
        finite("initial state", &start.state)?;
        finite("command before the start", &[start.command])?;
        finite("command_history", &start.command_history)?;
        match self.sample_time {
            Some(ts) if !(0.0..ts).contains(&start.sample_phase) => Err(Error::argument(format!(
                "sample_phase={}: the first sample lies in [0, {ts}) s after the start",
                start.sample_phase
            ))),
            None if !start.command_history.is_empty() || start.sample_phase != 0.0 => {
                Err(Error::argument(
                    "command_history and sample_phase belong to sampled loops: give the loop a \
                     sample_time or leave them out",
                ))
            }
            _ => Ok(()),
        }
    }
}

/// Output and input times of a run, and how many of each are served.
#[derive(Debug)]
pub(crate) struct Wanted<'a> {
    output_times: &'a [f64],
    input_times: &'a [f64],
    pub(crate) trajectory: Trajectory,
}

impl<'a> Wanted<'a> {
    fn new(output_times: &'a [f64], input_times: &'a [f64]) -> Self {
        Self {
            output_times,
            input_times,
            trajectory: Trajectory {
                outputs: Vec::with_capacity(output_times.len()),
                inputs: Vec::with_capacity(input_times.len()),
                ..Trajectory::default()
            },
        }
    }

    /// The last time asked for, 0 if none is.
    pub(crate) fn last(&self) -> f64 {
        let last = |times: &[f64]| times.last().copied().unwrap_or(0.0);
        last(self.output_times).max(last(self.input_times))
    }

    /// Serve the output times before `end`.
    pub(crate) fn outputs_before(&mut self, end: f64, mut value: impl FnMut(f64) -> f64) {
        while let Some(&t) = self.output_times.get(self.trajectory.outputs.len()) {
            if t >= end {
                break;
            }
            self.trajectory.outputs.push(value(t));
        }
    }

    /// Serve the input times before `end`.
    pub(crate) fn inputs_before(&mut self, end: f64, mut value: impl FnMut(f64) -> f64) {
        while let Some(&t) = self.input_times.get(self.trajectory.inputs.len()) {
            if t >= end {
                break;
            }
            self.trajectory.inputs.push(value(t));
        }
    }

    /// Note a break of y at `t` unless it lies after the last output time.
    pub(crate) fn output_break(&mut self, t: f64) {
        if self.output_times.last().is_some_and(|&last| t <= last) {
            self.trajectory.output_breaks.push(t);
        }
    }

    /// Note a break of the command at `t` unless it lies after the last input time.
    pub(crate) fn input_break(&mut self, t: f64) {
        if self.input_times.last().is_some_and(|&last| t <= last) {
            self.trajectory.input_breaks.push(t);
        }
    }

    /// Is every time served?
    pub(crate) fn is_done(&self) -> bool {
        self.trajectory.outputs.len() == self.output_times.len()
            && self.trajectory.inputs.len() == self.input_times.len()
    }
}

/// Clip to [−limit, limit].
pub(crate) fn saturate(u: f64, limit: Option<f64>) -> f64 {
    limit.map_or(u, |limit| u.clamp(-limit, limit))
}

/// Two times closer than this are one: rounding of sums of delays and samples.
pub(crate) fn slack(t: f64, delay: f64) -> f64 {
    16.0 * f64::EPSILON * (t.abs() + delay)
}

/// The error of a response that has grown out of bounds.
pub(crate) fn check_growth(x: &[f64], u: f64, t: f64) -> Result<(), Error> {
    let sound = |v: &f64| v.abs() <= DIVERGED;
    if x.iter().all(sound) && sound(&u) {
        Ok(())
    } else {
        Err(Error::argument(format!(
            "the response exceeds {DIVERGED:e} at t = {t} s after the start: the loop is unstable, \
             end the simulation earlier, lower the gain or give it a limit"
        )))
    }
}

/// Σ a_i b_i.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn finite(name: &str, values: &[f64]) -> Result<(), Error> {
    match values.iter().find(|value| !value.is_finite()) {
        Some(value) => Err(Error::argument(format!(
            "{name} holds {value}: give finite numbers"
        ))),
        None => Ok(()),
    }
}
