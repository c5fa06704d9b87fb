//! Response of a sampled loop: sample by sample, exact, with output at any time.

use std::borrow::Cow;
use std::cell::OnceCell;

use crate::dde::control_loop::linear_loop::{Equations, LinearLoop, Start, Update, saturate};
use crate::dde::control_loop::reference::{Cursor, Reference};
use crate::dde::control_loop::requested_output::{RequestedOutput, Trajectory};
use crate::dde::limits::{RESPONSE, check_growth, slack};
use crate::dde::propagator::Propagator;
use crate::dde::scalar::Scalar;
use crate::memory::push;
use crate::{Error, Task};

use super::timing::Timing;
use super::window::{INPUTS, Window};

/// Samples between two checks for cancellation.
const CHECK_EVERY: u64 = 1024;

/// Upper limit on the number of samples (bounds the time).
const MOST_SAMPLES: u64 = 100_000_000;

pub(crate) fn run<S: Scalar>(
    plant: &LinearLoop<S>,
    sample_time: S,
    start: &Start<S>,
    reference: &Reference,
    mut requested: RequestedOutput<'_, S>,
    task: &Task,
) -> Result<Trajectory<S>, Error> {
    requested.reserve()?;
    let equations = plant.equations();
    let timing = Timing::new(plant.delay(), sample_time);
    let stopped = plant.stops().filter(|_| plant.is_watched());
    let mut walk = Walk {
        plant,
        timing,
        fields: [
            Some(Field::new(Cow::Borrowed(equations), timing)),
            stopped.map(|state| Field::new(Cow::Owned(equations.stopped(state)), timing)),
        ],
        is_stopped: false,
        commands: Commands::new(start),
        cursor: reference.cursor(&start.kicks),
        x: start.state.clone(),
        scratch: start.state.clone(),
        held: S::default(),
        excess: S::default(),
        requested,
    };
    let phase = start.sample_phase;
    if phase > 0.0 {
        // The run begins inside the interval after sample −1.
        walk.held = S::from(walk.cursor.value());
        walk.interval(-1, sample_time - S::from(phase), S::default())?;
    }
    let mut k = 0_u64;
    while !walk.requested.is_done() {
        if k.is_multiple_of(CHECK_EVERY) {
            task.check()?;
        }
        if k == MOST_SAMPLES {
            return Err(Error::TooMuch {
                what: "the sampled response",
                limit: MOST_SAMPLES,
                unit: "samples",
                advice: "shorten the time or lengthen the sample time".to_owned(),
            });
        }
        let now = S::from(k as f64).mul_add(sample_time, S::from(phase));
        walk.sample(k as i64, now, sample_time)?;
        walk.interval(k as i64, S::default(), now)?;
        k += 1;
    }
    Ok(walk.requested.trajectory)
}

/// How the states move over the parts of a sample.
struct Field<'a, S: Scalar> {
    equations: Cow<'a, Equations<S>>,
    early: Span<S>,
    late: Span<S>,
}

impl<'a, S: Scalar> Field<'a, S> {
    fn new(equations: Cow<'a, Equations<S>>, timing: Timing<S>) -> Self {
        Self {
            early: Span::new(&equations, timing.early),
            late: Span::new(&equations, timing.late),
            equations,
        }
    }
}

/// A part of a sample under constant inputs.
struct Span<S: Scalar> {
    over: Propagator<S>,
    /// The output as polynomials, once it is asked for between samples, or measured.
    window: OnceCell<Window<S>>,
}

impl<S: Scalar> Span<S> {
    fn new(equations: &Equations<S>, length: S) -> Self {
        Self {
            over: equations.over(length),
            window: OnceCell::new(),
        }
    }
}

/// The commands issued, by sample number; negative numbers are those before the start.
struct Commands<'a, S> {
    start: &'a Start<S>,
    issued: Vec<S>,
}

impl<'a, S: Scalar> Commands<'a, S> {
    fn new(start: &'a Start<S>) -> Self {
        Self {
            start,
            issued: Vec::new(),
        }
    }

    fn issue(&mut self, u: S) -> Result<(), Error> {
        push(RESPONSE, &mut self.issued, u)
    }

    fn at(&self, k: i64) -> S {
        let history = &self.start.command_history;
        let found = match usize::try_from(k) {
            Ok(k) => self.issued.get(k).copied(),
            Err(_) => usize::try_from(-k)
                .ok()
                .and_then(|back| history.len().checked_sub(back))
                .and_then(|place| history.get(place))
                .map(|&u| S::from(u)),
        };
        found.unwrap_or(self.start.command)
    }
}

/// The parts of a sample, between the arrivals of commands.
#[derive(Clone, Copy)]
enum Part {
    Early,
    Late,
    /// Of any other length.
    Other,
}

struct Walk<'a, 'r, S: Scalar> {
    plant: &'a LinearLoop<S>,
    timing: Timing<S>,
    /// While the integral runs, and while it is stopped.
    fields: [Option<Field<'a, S>>; 2],
    is_stopped: bool,
    commands: Commands<'a, S>,
    cursor: Cursor<'a>,
    x: Vec<S>,
    scratch: Vec<S>,
    /// The reference as held since the last sample.
    held: S,
    /// What the bounds add to the command of the last sample.
    excess: S,
    requested: RequestedOutput<'r, S>,
}

impl<S: Scalar> Walk<'_, '_, S> {
    /// m as a signed number.
    fn lag(&self) -> i64 {
        self.timing.samples as i64
    }

    /// The command computed at sample `k`, and those that reach the plant before and after the
    /// arrival within the interval that follows.
    fn commands_of(&self, k: i64) -> [S; 3] {
        let lag = self.lag();
        [k, k - lag - 1, k - lag].map(|number| self.commands.at(number))
    }

    /// Compute and issue the command of sample `k` at time `now`.
    fn sample(&mut self, k: i64, now: S, sample_time: S) -> Result<(), Error> {
        let (plant, equations) = (self.plant, self.plant.equations());
        let tolerance = slack(now, sample_time);
        self.held = S::from(self.cursor.advance(now.value(), tolerance));
        if self.cursor.next_kick() <= now.value() + tolerance {
            self.kick(now, tolerance)?;
        }
        let arrived = self.commands.at(k - self.lag() - 1);
        let u = equations.command(&self.x, arrived, self.held.value());
        check_growth(&self.x, u, now)?;
        let bounded = saturate(u, plant.bounds());
        let mut issued = bounded;
        if let Some(rate) = plant.rate() {
            let (last, reach) = (self.commands.at(k - 1), rate * sample_time);
            issued = saturate(bounded, Some((last - reach, last + reach)));
        }
        if issued.value() != u.value() {
            self.requested.limited(now, now + sample_time);
        }
        self.excess = issued - u;
        self.is_stopped = plant.stops().is_some_and(|state| {
            let gain = equations.k.get(state).copied().unwrap_or_default();
            let drive = gain * equations.slope(state, &self.x, arrived, self.held);
            (u - bounded).value() * drive.value() > 0.0
        });
        self.commands.issue(issued)?;
        if let Some(update) = plant.update() {
            self.update(update, arrived);
        }
        self.requested.input_break(now)
    }

    /// Add the jumps of inputs up to `now`.
    fn kick(&mut self, now: S, tolerance: f64) -> Result<(), Error> {
        let equations = self.plant.equations();
        self.cursor
            .kick(now.value(), tolerance, equations, &mut self.x);
        self.requested.output_break(now)
    }

    /// Advance to the next sample from `into` seconds after sample `k`, at time `now`.
    fn interval(&mut self, k: i64, into: S, now: S) -> Result<(), Error> {
        let Timing { early, late, .. } = self.timing;
        let tolerance = slack(now, early + late);
        let [u, before, after] = self.commands_of(k);
        let is_whole = into.is_nothing();
        let end = now + (early + late - into);
        self.requested.inputs_before(end.value() - tolerance, u);
        let mut at = now;
        // A length that is zero but has a slope counts as well.
        let is_early =
            (is_whole && !early.is_nothing()) || into.value() < early.value() - tolerance;
        if is_early {
            let (left, part) = if is_whole {
                (early, Part::Early)
            } else {
                (early - into, Part::Other)
            };
            self.go(before, at, left, part, tolerance)?;
            at = now + left;
        }
        if before != after && (is_whole || is_early) {
            self.requested.output_break(at)?;
        }
        let (left, part) = if is_whole {
            (late, Part::Late)
        } else {
            (end - at, Part::Other)
        };
        self.go(after, at, left, part, tolerance)
    }

    /// Change the states that change at samples.
    fn update(&mut self, update: &Update, arrived: S) {
        let rows = update.states.chunks_exact(self.x.len().max(1));
        let inputs = update.command.iter().zip(&update.reference);
        for ((new, row), (&g, &h)) in self.scratch.iter_mut().zip(rows).zip(inputs) {
            *new = S::from(g) * arrived + S::from(h) * self.held;
            for (&weight, &x) in row.iter().zip(&self.x) {
                *new += S::from(weight) * x;
            }
        }
        std::mem::swap(&mut self.x, &mut self.scratch);
    }

    /// Advance over `length` seconds under constant w, input by input that jumps within.
    fn go(&mut self, w: S, from: S, length: S, part: Part, tolerance: f64) -> Result<(), Error> {
        let end = from + length;
        let (mut from, mut part) = (from, part);
        while self.cursor.next_kick() < end.value() - tolerance {
            let next = S::from(self.cursor.next_kick().max(from.value()));
            self.over(w, from, next - from, Part::Other, tolerance);
            self.kick(next, tolerance)?;
            (from, part) = (next, Part::Other);
        }
        let length = if matches!(part, Part::Other) {
            end - from
        } else {
            length
        };
        self.over(w, from, length, part, tolerance);
        Ok(())
    }

    /// Measure, store and advance over one part of a sample under constant inputs.
    fn over(&mut self, w: S, from: S, length: S, part: Part, tolerance: f64) {
        let [running, stopped] = &self.fields;
        let Some(field) = stopped
            .as_ref()
            .filter(|_| self.is_stopped)
            .or(running.as_ref())
        else {
            return;
        };
        let inputs: [S; INPUTS] = [w, self.held, self.excess];
        let equations = &*field.equations;
        let columns: &[S] = inputs.get(..equations.inputs()).unwrap_or_default();
        let until = (from + length).value() - tolerance;
        let (x, scratch) = (&self.x, &mut self.scratch);
        let other;
        let span = match part {
            Part::Early => &field.early,
            Part::Late => &field.late,
            Part::Other => {
                other = Span::new(equations, length);
                &other
            }
        };
        // Most times of a record are those of samples, at which the output is known.
        let known = until.min(from.value().next_up());
        if !S::MOVES && self.requested.next_output() < known {
            self.requested.outputs_before(known, equations.output(x, w));
        }
        if self.requested.is_measured() || self.requested.next_output() < until {
            let window = span.window.get_or_init(|| Window::new(equations, length));
            window.serve(equations, x, inputs, (from, until), &mut self.requested);
        }
        span.over.apply(x, columns, scratch);
        std::mem::swap(&mut self.x, &mut self.scratch);
    }
}
