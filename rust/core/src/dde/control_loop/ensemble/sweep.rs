//! Metrics and responses of all sets.

use super::block::{Column, Members};
use super::each::Alone;
use super::metrics::MetricsJob;
use super::responses::ResponsesJob;
use super::sets::{Measures, Outcome, SETS, Sets, of};
use super::shape::sorted;
use super::through::{Job, through};
use crate::dde::control_loop::metrics::Criteria;
use crate::memory::{filled, push, require, reserved};
use crate::parallel;
use crate::{Error, Task};

/// What memory is requested for, in errors.
const SWEEP: &str = "the sweep";

/// Results held for each thread before they are written to their places: enough to keep it busy,
/// and few enough for its cache.
const AT_ONCE: usize = 1 << 10;

/// Tasks for each thread, so that all threads end at about the same time.
const TASKS: usize = 4;

/// Most blocks in one task: more make the trace of a task less often, and take longer to cancel.
const BLOCKS: usize = 32;

/// Upper limit on the values of responses held at a time (bounds memory to a share of the result).
const VALUES_AT_ONCE: usize = 1 << 22;

impl Sets<'_> {
    /// Process all sets, blocks with `job` and single sets with `alone`; at most `at_once` results
    /// are held before they are kept.
    fn each<J: Job>(
        &self,
        (span, at_once): (f64, usize),
        task: &Task,
        job: &J,
        alone: impl Fn(usize) -> Result<J::Found, Error> + Sync,
        mut keep: impl FnMut(&[usize], &J::Found),
    ) -> Result<(), Error> {
        let (alike, mut left) = sorted(self, span)?;
        let count = alike.iter().map(|(_, sets)| sets.len().div_ceil(SETS));
        let mut blocks: Vec<Members<'_>> = reserved(SWEEP, count.sum())?;
        for (shape, sets) in &alike {
            blocks.extend(sets.chunks(SETS).map(|members| (*shape, members)));
        }
        // Results of each task, in the same memory for all groups.
        let tasks = match rayon::current_num_threads() {
            1 => 1,
            threads => TASKS * threads,
        };
        let mut results: Vec<Vec<J::Found>> = Vec::new();
        for group in blocks.chunks(at_once.div_ceil(SETS)) {
            let work = |_, (blocks, found): (&[Members<'_>], &mut Vec<J::Found>)| {
                task.check()?;
                let columns = blocks.iter().map(|(shape, _)| shape.columns()).max();
                require::<Column>(SWEEP, columns.unwrap_or(0))?;
                through(self, blocks, (span, job), found);
                let done = found.iter().flat_map(J::done).filter(|is_done| *is_done);
                task.advance(done.count() as u64);
                Ok(())
            };
            let share = group.len().div_ceil(tasks).clamp(1, BLOCKS);
            results.resize_with(group.len().div_ceil(share), Vec::new);
            parallel::each(SWEEP, group.chunks(share).zip(&mut results), work)?;
            let mut found = results.iter_mut().flat_map(|found| found.drain(..));
            for (_, members) in group {
                let mut members = *members;
                while !members.is_empty() {
                    let Some(found) = found.next() else {
                        break;
                    };
                    let mut count = 0;
                    for (is_done, &set) in J::done(&found).zip(members) {
                        count += 1;
                        if !is_done {
                            push(SWEEP, &mut left, set)?;
                        }
                    }
                    let (own, others) = members.split_at(count);
                    keep(own, &found);
                    members = others;
                }
            }
        }
        for group in left.chunks(at_once) {
            let work = |(): &mut (), index: usize| {
                task.check()?;
                let found = group.get(index).map(|set| alone(*set)).transpose()?;
                task.advance(1);
                Ok(found)
            };
            let found = parallel::results(SWEEP, group.len(), || (), work)?;
            for (set, found) in group.iter().zip(found.into_iter().flatten()) {
                keep(&[*set], &found);
            }
        }
        Ok(())
    }
}

/// Measure every response from its start to `span` seconds after it; `keep` receives sets, which
/// increase, with their metrics. It receives each set once with its outcome; those that it receives
/// as refused before were found not to fit into a block.
///
/// `steady` holds the steady state of each set, or one for all, NaN where its last output is to
/// count as that; `slowest` the slowest time constant of its plant and controller.
pub fn metrics(
    sets: &Sets<'_>,
    (steady, slowest): (&[f64], &[f64]),
    span: f64,
    criteria: &Criteria,
    task: &Task,
    keep: impl FnMut(&[usize], &Measures),
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
            let one = Alone::of(sets, set)?;
            let found = one.map(|one| one.metrics(numbers, span, criteria, task));
            Ok(Measures::of_one(found.transpose()?))
        },
        keep,
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
    let at_once = (VALUES_AT_ONCE / length.max(1)).clamp(1, AT_ONCE * rayon::current_num_threads());
    sets.each(
        (times.last().copied().unwrap_or(0.0), at_once),
        task,
        &ResponsesJob { times },
        |set| {
            let one = Alone::of(sets, set)?;
            Ok(vec![one.map(|one| one.response(times, task)).transpose()?])
        },
        |members, found| {
            for (&set, found) in members.iter().zip(found) {
                let places = set * length..(set + 1) * length;
                if let (Some((values, outcome)), Some(place)) = (found, outcomes.get_mut(set)) {
                    *place = *outcome;
                    let row = outputs.get_mut(places).filter(|_| values.len() == length);
                    row.into_iter().for_each(|row| row.copy_from_slice(values));
                }
            }
        },
    )?;
    Ok((outputs, outcomes))
}
