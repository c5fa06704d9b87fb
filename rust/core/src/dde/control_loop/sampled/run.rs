//! Response of a sampled loop: sample by sample, exact, with output at any time.

use crate::dde::control_loop::linear_loop::{LinearLoop, Start, Update, saturate};
use crate::dde::control_loop::reference::Reference;
use crate::dde::control_loop::requested_output::{RequestedOutput, Trajectory};
use crate::dde::limits::{RESPONSE, check_growth, slack};
use crate::dde::propagator::Propagator;
use crate::dde::scalar::Scalar;
use crate::memory::push;
use crate::{Error, Task};

use super::timing::Timing;
use super::window::{Window, Windows};

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
    let mut walk = Walk {
        plant,
        timing,
        early: equations.over(timing.early),
        late: equations.over(timing.late),
        commands: Commands::new(start),
        x: start.state.clone(),
        scratch: start.state.clone(),
        held: S::default(),
        windows: requested
            .is_measured()
            .then(|| Windows::new(equations, timing.early, timing.late)),
        requested,
    };
    let phase = start.sample_phase;
    let mut cursor = reference.cursor();
    if phase > 0.0 {
        // The run begins inside the interval after sample −1.
        walk.held = S::from(cursor.value());
        walk.partial(-1, sample_time - S::from(phase), S::default())?;
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
        walk.held = S::from(cursor.advance(now.value(), slack(now, sample_time)));
        let index = k as i64;
        let arrived = walk.commands.at(index - walk.lag() - 1);
        let u = equations.command(&walk.x, arrived, walk.held.value());
        check_growth(&walk.x, u, now)?;
        let issued = saturate(u, plant.limit());
        if issued.value() != u.value() {
            walk.requested.limited(now, now + sample_time);
        }
        walk.commands.issue(issued)?;
        if let Some(update) = plant.update() {
            walk.update(update, arrived);
        }
        walk.requested.input_break(now)?;
        walk.interval(index, now)?;
        k += 1;
    }
    Ok(walk.requested.trajectory)
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

struct Walk<'a, S> {
    plant: &'a LinearLoop<S>,
    timing: Timing<S>,
    early: Propagator<S>,
    late: Propagator<S>,
    commands: Commands<'a, S>,
    x: Vec<S>,
    scratch: Vec<S>,
    /// The reference as held since the last sample.
    held: S,
    /// For metrics, which begin at the first sample.
    windows: Option<Windows>,
    requested: RequestedOutput<'a, S>,
}

impl<S: Scalar> Walk<'_, S> {
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

    /// Advance from sample `k` at time `now` to the next one.
    fn interval(&mut self, k: i64, now: S) -> Result<(), Error> {
        let Timing { early, late, .. } = self.timing;
        let tolerance = slack(now, early + late);
        let [u, before, after] = self.commands_of(k);
        self.requested
            .inputs_before((now + early + late).value() - tolerance, |_| u);
        // A length that is zero but has a slope counts as well.
        if !early.is_nothing() {
            self.measure(before, now, |windows| &windows.early);
            self.serve(before, now, (now + early).value() - tolerance);
            self.early
                .apply(&self.x, &[before, self.held], &mut self.scratch);
            std::mem::swap(&mut self.x, &mut self.scratch);
        }
        if before != after {
            self.requested.output_break(now + early)?;
        }
        self.measure(after, now + early, |windows| &windows.late);
        self.serve(after, now + early, (now + early + late).value() - tolerance);
        self.late
            .apply(&self.x, &[after, self.held], &mut self.scratch);
        std::mem::swap(&mut self.x, &mut self.scratch);
        Ok(())
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

    /// Advance from `into` seconds after sample `k` (at time `now`) to the next sample.
    fn partial(&mut self, k: i64, into: S, now: S) -> Result<(), Error> {
        let Timing { early, late, .. } = self.timing;
        let tolerance = slack(now, early + late);
        let [u, before, after] = self.commands_of(k);
        let end = now + (early + late - into);
        self.requested.inputs_before(end.value() - tolerance, |_| u);
        let mut at = now;
        if into.value() < early.value() - tolerance {
            let switch = now + (early - into);
            self.serve(before, at, switch.value() - tolerance);
            self.jump(switch - at, before);
            self.requested.output_break(switch)?;
            at = switch;
        }
        self.serve(after, at, end.value() - tolerance);
        self.jump(end - at, after);
        Ok(())
    }

    /// Advance x by a step of any length under constant w.
    fn jump(&mut self, h: S, w: S) {
        let equations = self.plant.equations();
        let over = equations.over(h);
        over.apply(&self.x, &[w, self.held], &mut self.scratch);
        std::mem::swap(&mut self.x, &mut self.scratch);
    }

    /// Measure the output over one part of a sample, under constant w.
    fn measure(&mut self, w: S, from: S, part: impl Fn(&Windows) -> &Window) {
        if let Some(windows) = &self.windows {
            let inputs = [w.value(), self.held.value()];
            let equations = windows.equations();
            part(windows).measure(
                equations,
                &self.x,
                inputs,
                from.value(),
                &mut self.requested,
            );
        }
    }

    /// Store the outputs from `from`, where the state is x, to `end` under constant w.
    fn serve(&mut self, w: S, from: S, end: f64) {
        let equations = self.plant.equations();
        let (x, scratch, held) = (&self.x, &mut self.scratch, self.held);
        self.requested.outputs_before(end, |t| {
            let h = t - from;
            let h = h.pinned(h.value().max(0.0));
            if h.is_nothing() {
                return equations.output(x, w);
            }
            equations.over(h).apply(x, &[w, held], scratch);
            equations.output(scratch, w)
        });
    }
}
