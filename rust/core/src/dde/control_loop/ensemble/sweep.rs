//! Metrics and responses of all sets.

use super::block::{Column, Members};
use super::each;
use super::metrics::MetricsJob;
use super::responses::ResponsesJob;
use super::sets::{Found, Measures, Outcome, SETS, Sets, of};
use super::shape::{Shapes, plant_states};
use super::through::{Job, through};
use crate::dde::control_loop::metrics::Criteria;
use crate::memory::{filled, push, reserved, room};
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

/// What receives the results of a sweep.
trait Kept<J: Job> {
    /// The result of a set that runs alone.
    type Single: Send;

    /// Keep the results of the first of `members`, and append to `left` those that have to run
    /// alone. Returns how many they are.
    fn lanes(
        &mut self,
        members: &[usize],
        found: J::Found,
        left: &mut Vec<usize>,
    ) -> Result<usize, Error>;

    fn single(&mut self, set: usize, found: Self::Single);
}

impl Sets<'_> {
    /// Process all sets, blocks with `job` and single sets with `alone`; at most `at_once` results
    /// are held before they are kept.
    fn each<J: Job, K: Kept<J>>(
        &self,
        (span, at_once): (f64, usize),
        task: &Task,
        job: &J,
        alone: impl Fn(usize) -> Result<K::Single, Error> + Sync,
        kept: &mut K,
    ) -> Result<(), Error> {
        let (alike, mut left) = Shapes::new(self)?.sorted(span)?;
        let plant = plant_states(self);
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
                room::<Column>(SWEEP, columns.unwrap_or(0))?;
                through(self, plant, blocks, (span, job), found);
                task.advance(found.iter().map(|found| J::done(found) as u64).sum());
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
                    let count = kept.lanes(members, found, &mut left)?;
                    members = members.get(count..).unwrap_or_default();
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
                kept.single(*set, found);
            }
        }
        Ok(())
    }
}

/// A function that receives metrics.
struct Receiver<F>(F);

impl<F: FnMut(&[usize], &Measures)> Kept<MetricsJob<'_>> for Receiver<F> {
    type Single = (Found, Outcome);

    fn lanes(
        &mut self,
        members: &[usize],
        found: Measures,
        left: &mut Vec<usize>,
    ) -> Result<usize, Error> {
        let count = found.count.min(members.len());
        for (&set, outcome) in members.iter().zip(&found.outcomes).take(count) {
            if outcome.is_none() {
                push(SWEEP, left, set)?;
            }
        }
        (self.0)(members.get(..count).unwrap_or_default(), &found);
        Ok(count)
    }

    fn single(&mut self, set: usize, (found, outcome): Self::Single) {
        let mut measures = Measures::new();
        measures.push(&found, Some(outcome));
        (self.0)(&[set], &measures);
    }
}

/// Outputs of all sets, a row a set.
struct Rows {
    outputs: Vec<f64>,
    outcomes: Vec<Outcome>,
    length: usize,
}

impl Kept<ResponsesJob<'_>> for Rows {
    type Single = (Vec<f64>, Outcome);

    fn lanes(
        &mut self,
        members: &[usize],
        found: Vec<Option<Self::Single>>,
        left: &mut Vec<usize>,
    ) -> Result<usize, Error> {
        let count = found.len();
        for (&set, found) in members.iter().zip(found) {
            match found {
                Some(found) => self.single(set, found),
                None => push(SWEEP, left, set)?,
            }
        }
        Ok(count)
    }

    fn single(&mut self, set: usize, (values, outcome): Self::Single) {
        let places = set * self.length..(set + 1) * self.length;
        if let Some(row) = self.outputs.get_mut(places)
            && values.len() == self.length
        {
            row.copy_from_slice(&values);
        }
        if let Some(place) = self.outcomes.get_mut(set) {
            *place = outcome;
        }
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
            each::metrics(sets, set, numbers, span, criteria, task)
        },
        &mut Receiver(keep),
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
    let mut rows = Rows {
        outputs: filled(SWEEP, f64::NAN, sets.len().saturating_mul(length))?,
        outcomes: filled(SWEEP, Outcome::Refused, sets.len())?,
        length,
    };
    let span = times.last().copied().unwrap_or(0.0);
    sets.each(
        (
            span,
            (VALUES_AT_ONCE / length.max(1)).clamp(1, AT_ONCE * rayon::current_num_threads()),
        ),
        task,
        &ResponsesJob { times },
        |set| each::response(sets, set, times, task),
        &mut rows,
    )?;
    Ok((rows.outputs, rows.outcomes))
}
