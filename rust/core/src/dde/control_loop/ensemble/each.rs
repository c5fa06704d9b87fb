//! One loop, run by the code for single loops.

use crate::dde::control_loop::linear_loop::{LinearLoop, Start};
use crate::dde::control_loop::metrics::{Criteria, Pace};
use crate::dde::control_loop::reference::Reference;
use crate::dde::control_loop::requested_output::{RequestedOutput, Trajectory};
use crate::dde::control_loop::step_metrics::StepMetrics;
use crate::memory::collected;
use crate::{Error, Task, parallel};

use super::sets::{Found, Measures, Outcome, Sets, UNKNOWN};

/// A loop, the time by which its output is read ahead, and the step of its reference.
#[derive(Debug, Clone)]
pub struct Alone {
    /// The loop.
    pub plant: LinearLoop,
    /// s.
    pub ahead: f64,
    /// Height of the step.
    pub amplitude: f64,
}

impl Alone {
    /// The loop of a set; none where its numbers are not those of one.
    pub(super) fn of(sets: &Sets<'_>, set: usize) -> Result<Option<Self>, Error> {
        let found = sets.loop_of(set)?;
        Ok(found.map(|plant| Self {
            ahead: sets.ahead(plant.delay()),
            plant,
            amplitude: sets.amplitude,
        }))
    }

    /// Metrics of a response of `span` seconds, with steady state and slowest time constant.
    pub(super) fn metrics(
        &self,
        (steady, slowest): (f64, f64),
        span: f64,
        criteria: &Criteria,
        task: &Task,
    ) -> Result<Found, Error> {
        let ahead = self.ahead;
        let end = [ahead + span];
        let mut steady = steady;
        if steady.is_nan() {
            match self.run(RequestedOutput::new(&end, &[], 0.0)?, task)? {
                Ok(found) => steady = found.outputs.last().copied().unwrap_or(f64::NAN),
                Err(outcome) => return Ok((UNKNOWN, outcome)),
            }
        }
        let pace = Pace {
            span,
            wait: self.plant.delay() + self.plant.sample_time().unwrap_or(0.0),
            slowest,
        };
        let mut metrics = StepMetrics::new(ahead, ahead + span, steady, *criteria);
        let requested = RequestedOutput::new(&end, &[], 0.0)?.measured_by(&mut metrics);
        Ok(match self.run(requested, task)? {
            Ok(_) => {
                let record = metrics.record();
                let found = (metrics.metrics(), record.limited_until);
                (found, record.verdict(&pace).into())
            }
            Err(outcome) => (UNKNOWN, outcome),
        })
    }

    /// Outputs at times after the start.
    ///
    /// # Errors
    /// [`Error::Interrupted`], [`Error::Memory`].
    pub fn response(&self, times: &[f64], task: &Task) -> Result<(Vec<f64>, Outcome), Error> {
        let times = collected("the sweep", times.iter().map(|t| t + self.ahead))?;
        Ok(
            match self.run(RequestedOutput::new(&times, &[], 0.0)?, task)? {
                Ok(found) => (found.outputs, Outcome::Ok),
                Err(outcome) => (Vec::new(), outcome),
            },
        )
    }

    fn run(
        &self,
        requested: RequestedOutput<'_>,
        task: &Task,
    ) -> Result<Result<Trajectory, Outcome>, Error> {
        let start = Start {
            state: vec![0.0; self.plant.equations().states()],
            ..Start::default()
        };
        let reference = Reference::step(0.0, self.amplitude)?;
        match self.plant.serve(&start, &reference, requested, task) {
            Ok(found) => Ok(Ok(found)),
            Err(error) if error.ends_all() => Err(error),
            Err(Error::Diverges { .. }) => Ok(Err(Outcome::Diverged)),
            Err(_) => Ok(Err(Outcome::Refused)),
        }
    }
}

/// Metrics of loops that run one by one, as those of sets; none where there is no loop.
///
/// # Errors
/// [`Error::Interrupted`], [`Error::Memory`].
pub fn metrics_alone(
    numbers: &[(f64, f64)],
    one: impl Fn(usize) -> Option<Alone> + Sync,
    (span, criteria): (f64, &Criteria),
    task: &Task,
    mut keep: impl FnMut(&[usize], &Measures),
) -> Result<(), Error> {
    let work = |(): &mut (), set: usize| {
        task.check()?;
        let found = match (one(set), numbers.get(set)) {
            (Some(one), Some(numbers)) => Some(one.metrics(*numbers, span, criteria, task)?),
            _ => None,
        };
        task.advance(1);
        Ok(found)
    };
    let found = parallel::results("the sweep", numbers.len(), || (), work)?;
    for (set, found) in found.into_iter().enumerate() {
        keep(&[set], &Measures::of_one(found));
    }
    Ok(())
}
