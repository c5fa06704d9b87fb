//! Metrics and responses of all sets.

use rayon::prelude::*;

use super::block::{Column, SETS};
use super::each;
use super::metrics::MetricsJob;
use super::responses::ResponsesJob;
use super::sets::{Outcome, Sets, of};
use super::shape::{Shapes, plant_states};
use super::through::{Job, Member, through};
use super::trace::SAMPLES;
use crate::dde::control_loop::metrics::{Criteria, Metrics};
use crate::memory::{filled, reserved, room};
use crate::{Error, Task};

/// What memory is requested for, in errors.
const SWEEP: &str = "the sweep";

/// Results held before they are written to their places: enough to keep all threads busy.
const AT_ONCE: usize = 1 << 14;

/// Blocks in one task of a thread: few enough to share small sweeps, and enough to make the trace
/// of a task seldom.
const BLOCKS: usize = 8;

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
        let (alike, left) = Shapes::new(self)?.sorted(span)?;
        let plant = plant_states(self);
        let mut blocks: Vec<&[Member]> = reserved(SWEEP, alike.len())?;
        let groups = alike.chunk_by(|one, other| one.0 == other.0);
        blocks.extend(groups.flat_map(|group| group.chunks(SETS)));
        for group in blocks.chunks(at_once.div_ceil(SETS)) {
            let work = |blocks: &[&[Member]]| {
                task.check()?;
                let longest = blocks.iter().flat_map(|block| block.first());
                let samples = longest.map(|(shape, _)| shape.samples).max();
                room::<Column>(SWEEP, samples.unwrap_or(0) as usize + SAMPLES)?;
                let found = through(self, plant, blocks, span, job);
                task.advance(found.len() as u64);
                Ok(found)
            };
            let found: Result<Vec<_>, Error> = group.par_chunks(BLOCKS).map(work).collect();
            let members = group.iter().copied().flatten();
            let found = found?.into_iter().flatten();
            members
                .zip(found)
                .for_each(|((_, set), found)| keep(*set, found));
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

/// Metrics of every response from its start to `span` seconds after it.
///
/// `steady` holds the steady state of each set, or one for all, NaN where its last output is to
/// count as that; `slowest` the slowest time constant of its plant and controller.
pub fn metrics(
    sets: &Sets<'_>,
    (steady, slowest): (&[f64], &[f64]),
    span: f64,
    criteria: &Criteria,
    task: &Task,
) -> Result<Vec<(Metrics, Outcome)>, Error> {
    let mut found = filled(SWEEP, (Metrics::UNKNOWN, Outcome::Refused), sets.len())?;
    let job = MetricsJob {
        steady,
        slowest,
        span,
        criteria: *criteria,
    };
    sets.each(
        (span, AT_ONCE),
        task,
        &job,
        |set| {
            let numbers = (of(steady, set), of(slowest, set));
            each::metrics(sets, set, numbers, span, criteria, task)
        },
        |set, result| {
            if let Some(place) = found.get_mut(set) {
                *place = result;
            }
        },
    )?;
    Ok(found)
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
        (span, (VALUES_AT_ONCE / length.max(1)).clamp(1, AT_ONCE)),
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
