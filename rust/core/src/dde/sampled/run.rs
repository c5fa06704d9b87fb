//! Response of a sampled loop: sample by sample, exact, with output at any time.

use crate::dde::linear::{
    LinearLoop, Reference, Start, Trajectory, Wanted, check_growth, saturate, slack,
};
use crate::dde::propagator::Propagator;
use crate::{Error, Task};

use super::Timing;

/// Samples between two looks at the task.
const CHECK_EVERY: u64 = 1024;

/// More samples than anyone waits for.
const MOST_SAMPLES: u64 = 100_000_000;

pub(crate) fn run(
    plant: &LinearLoop,
    sample_time: f64,
    start: &Start,
    reference: &Reference,
    wanted: Wanted<'_>,
    task: &Task,
) -> Result<Trajectory, Error> {
    let equations = plant.equations();
    let timing = Timing::new(plant.delay(), sample_time);
    let columns = [equations.b.as_slice(), equations.e.as_slice()];
    let hold = |h: f64| Propagator::new(&equations.a, &columns, h);
    let mut walk = Walk {
        plant,
        timing,
        early: hold(timing.early),
        late: hold(timing.late),
        commands: Commands::new(start),
        x: start.state.clone(),
        scratch: start.state.clone(),
        held: 0.0,
        wanted,
    };
    let phase = start.sample_phase;
    let mut cursor = reference.cursor();
    if phase > 0.0 {
        // The run begins inside the interval that follows sample −1.
        walk.held = cursor.value();
        walk.partial(-1, sample_time - phase, 0.0);
    }
    let mut k = 0_u64;
    while !walk.wanted.is_done() {
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
        let now = (k as f64).mul_add(sample_time, phase);
        walk.held = cursor.advance(now, slack(now, sample_time));
        let index = k as i64;
        let arrived = walk.commands.at(index - walk.lag() - 1);
        let u = equations.command(&walk.x, arrived, walk.held);
        check_growth(&walk.x, u, now)?;
        walk.commands.issue(saturate(u, plant.limit()));
        walk.wanted.input_break(now);
        walk.interval(index, now);
        k += 1;
    }
    Ok(walk.wanted.trajectory)
}

/// The commands issued, by sample number; negative numbers are those before the start.
struct Commands<'a> {
    start: &'a Start,
    issued: Vec<f64>,
}

impl<'a> Commands<'a> {
    fn new(start: &'a Start) -> Self {
        Self {
            start,
            issued: Vec::new(),
        }
    }

    fn issue(&mut self, u: f64) {
        self.issued.push(u);
    }

    fn at(&self, k: i64) -> f64 {
        let history = &self.start.command_history;
        let found = match usize::try_from(k) {
            Ok(k) => self.issued.get(k),
            Err(_) => usize::try_from(-k)
                .ok()
                .and_then(|back| history.len().checked_sub(back))
                .and_then(|place| history.get(place)),
        };
        found.copied().unwrap_or(self.start.command)
    }
}

struct Walk<'a> {
    plant: &'a LinearLoop,
    timing: Timing,
    early: Propagator,
    late: Propagator,
    commands: Commands<'a>,
    x: Vec<f64>,
    scratch: Vec<f64>,
    /// The reference as held since the last sample.
    held: f64,
    wanted: Wanted<'a>,
}

impl Walk<'_> {
    /// m as a sample number.
    fn lag(&self) -> i64 {
        self.timing.samples as i64
    }

    /// From sample `k` at time `now` to the next one.
    fn interval(&mut self, k: i64, now: f64) {
        let Timing { early, late, .. } = self.timing;
        let tolerance = slack(now, early + late);
        let (before, after) = (
            self.commands.at(k - self.lag() - 1),
            self.commands.at(k - self.lag()),
        );
        let u = self.commands.at(k);
        self.wanted
            .inputs_before(now + early + late - tolerance, |_| u);
        if early > 0.0 {
            self.serve(before, now, now + early - tolerance);
            self.early
                .apply(&self.x, &[before, self.held], &mut self.scratch);
            std::mem::swap(&mut self.x, &mut self.scratch);
        }
        if before != after {
            self.wanted.output_break(now + early);
        }
        self.serve(after, now + early, now + early + late - tolerance);
        self.late
            .apply(&self.x, &[after, self.held], &mut self.scratch);
        std::mem::swap(&mut self.x, &mut self.scratch);
    }

    /// From `into` seconds after sample `k` (at time `now`) to the next one.
    fn partial(&mut self, k: i64, into: f64, now: f64) {
        let Timing { early, late, .. } = self.timing;
        let tolerance = slack(now, early + late);
        let (before, after) = (
            self.commands.at(k - self.lag() - 1),
            self.commands.at(k - self.lag()),
        );
        let u = self.commands.at(k);
        let end = now + (early + late - into);
        self.wanted.inputs_before(end - tolerance, |_| u);
        let mut at = now;
        if into < early - tolerance {
            let switch = now + (early - into);
            self.serve(before, at, switch - tolerance);
            self.jump(switch - at, before);
            self.wanted.output_break(switch);
            at = switch;
        }
        self.serve(after, at, end - tolerance);
        self.jump(end - at, after);
    }

    /// x over a step of any length under constant w.
    fn jump(&mut self, h: f64, w: f64) {
        let equations = self.plant.equations();
        Propagator::new(&equations.a, &[&equations.b, &equations.e], h).apply(
            &self.x,
            &[w, self.held],
            &mut self.scratch,
        );
        std::mem::swap(&mut self.x, &mut self.scratch);
    }

    /// Outputs from `from`, where the state is x, to `end` under constant w.
    fn serve(&mut self, w: f64, from: f64, end: f64) {
        let equations = self.plant.equations();
        let (x, scratch, held) = (&self.x, &mut self.scratch, self.held);
        self.wanted.outputs_before(end, |t| {
            if t <= from {
                return equations.output(x, w);
            }
            Propagator::new(&equations.a, &[&equations.b, &equations.e], t - from).apply(
                x,
                &[w, held],
                scratch,
            );
            equations.output(scratch, w)
        });
    }
}
