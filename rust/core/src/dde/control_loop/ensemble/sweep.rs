//! Metrics and responses of all sets.

use rayon::prelude::*;

use super::block::{Column, Members, SETS};
use super::each;
use super::metrics::MetricsJob;
use super::responses::ResponsesJob;
use super::sets::{Outcome, Sets, of};
use super::shape::{Shapes, plant_states};
use super::through::{Job, through};
use crate::dde::control_loop::metrics::{Criteria, Metrics};
use crate::memory::{filled, push, reserved, room};
use crate::{Error, Task};

/// What memory is requested for, in errors.
const SWEEP: &str = "the sweep";

/// Results held for each thread before they are written to their places: enough to keep it busy,
/// and few enough for its cache.
const AT_ONCE: usize = 1 << 11;

/// Tasks for each thread, so that all threads end at about the same time.
const TASKS: usize = 4;

/// Most blocks in one task: more make the trace of a task less often, and take longer to cancel.
const BLOCKS: usize = 32;

/// Upper limit on the values of responses held at a time (bounds memory to a share of the result).
const VALUES_AT_ONCE: usize = 1 << 22;

impl Sets<'_> {
    /// Process all sets, blocks with `job` and single sets with `alone`. `keep` receives every set
    /// with its result; at most `at_once` results are held before.
    fn each<J: Job>(
        &self,
        (span, at_once): (f64, usize),
        task: &Task,
        job: &J,
        alone: impl Fn(usize) -> Result<J::Found, Error> + Sync,
        mut keep: impl FnMut(usize, J::Found),
    ) -> Result<(), Error> {
        let (alike, mut left) = Shapes::new(self)?.sorted(span)?;
        let plant = plant_states(self);
        let count = alike.iter().map(|(_, sets)| sets.len().div_ceil(SETS));
        let mut blocks: Vec<Members<'_>> = reserved(SWEEP, count.sum())?;
        for (shape, sets) in &alike {
            blocks.extend(sets.chunks(SETS).map(|members| (*shape, members)));
        }
        for group in blocks.chunks(at_once.div_ceil(SETS)) {
            let work = |blocks: &[Members<'_>]| {
                task.check()?;
                let columns = blocks.iter().map(|(shape, _)| shape.columns()).max();
                room::<Column>(SWEEP, columns.unwrap_or(0))?;
                let found = through(self, plant, blocks, span, job);
                task.advance(found.iter().flatten().count() as u64);
                Ok(found)
            };
            let tasks = TASKS * rayon::current_num_threads();
            let share = group.len().div_ceil(tasks).clamp(1, BLOCKS);
            let found: Result<Vec<_>, Error> = group.par_chunks(share).map(work).collect();
            let members = group.iter().flat_map(|(_, sets)| sets.iter());
            let found = found?.into_iter().flatten();
            for (set, found) in members.zip(found) {
                match found {
                    Some(found) => keep(*set, found),
                    None => push(SWEEP, &mut left, *set)?,
                }
            }
        }
        for group in left.chunks(at_once) {
            let work = |set: &usize| {
                task.check()?;
                let found = alone(*set)?;
                task.advance(1);
                Ok(found)
            };
            let found: Result<Vec<_>, Error> = group.par_iter().map(work).collect();
            group
                .iter()
                .zip(found?)
                .for_each(|(set, found)| keep(*set, found));
        }
        Ok(())
    }
}

/// Measure every response from its start to `span` seconds after it; `keep` receives the metrics of
/// each set, in any order.
///
/// `steady` holds the steady state of each set, or one for all, NaN where its last output is to
/// count as that; `slowest` the slowest time constant of its plant and controller.
pub fn metrics(
    sets: &Sets<'_>,
    (steady, slowest): (&[f64], &[f64]),
    span: f64,
    criteria: &Criteria,
    task: &Task,
    mut keep: impl FnMut(usize, &Metrics, Outcome),
) -> Result<(), Error> {
    let job = MetricsJob {
        steady,
        slowest,
        span,
        criteria: *criteria,
    };
    sets.each(
        (span, AT_ONCE * rayon::current_num_threads()),
        task,
        &job,
        |set| {
            let numbers = (of(steady, set), of(slowest, set));
            each::metrics(sets, set, numbers, span, criteria, task)
        },
        |set, (metrics, outcome)| keep(set, &metrics, outcome),
    )
}

/// Outputs of every response at `times` after its start (increasing, ≥ 0, s), one row for each set.
/// Rows of sets that diverge or are refused are NaN.
pub fn responses(
    sets: &Sets<'_>,
    times: &[f64],
    task: &Task,
) -> Result<(Vec<f64>, Vec<Outcome>), Error> {
    let length = times.len();
    let mut outputs = filled(SWEEP, f64::NAN, sets.len().saturating_mul(length))?;
    let mut outcomes = filled(SWEEP, Outcome::Refused, sets.len())?;
    let span = times.last().copied().unwrap_or(0.0);
    sets.each(
        (
            span,
            (VALUES_AT_ONCE / length.max(1)).clamp(1, AT_ONCE * rayon::current_num_threads()),
        ),
        task,
        &ResponsesJob { times },
        |set| each::response(sets, set, times, task),
        |set, (values, outcome)| {
            if let Some(row) = outputs.get_mut(set * length..(set + 1) * length)
                && values.len() == length
            {
                row.copy_from_slice(&values);
            }
            if let Some(place) = outcomes.get_mut(set) {
                *place = outcome;
            }
        },
    )?;
    Ok((outputs, outcomes))
}
