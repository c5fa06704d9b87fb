//! Metrics and responses of all sets.

use rayon::prelude::*;

use super::block::Block;
use super::sets::{Outcome, Sets};
use super::{block, corners, each, measured};
use crate::dde::control_loop::metrics::{Criteria, Metrics};
use crate::memory::{filled, push, reserved, room};
use crate::{Error, Task};

/// What memory is requested for, in errors.
const SWEEP: &str = "the sweep";

/// Results held before they are written to their places: enough to keep all threads busy.
const AT_ONCE: usize = 1 << 14;

/// Upper limit on the values of responses held at a time (bounds memory to a share of the result).
const VALUES_AT_ONCE: usize = 1 << 22;

/// The number of whole samples in the delay of a set, and the index of the set.
type Alike = (usize, usize);

impl Sets<'_> {
    /// The sets for the vectorised code, ordered by the number of whole samples in their delay, and
    /// the remaining sets, for responses of `span` seconds.
    fn sorted(&self, span: f64) -> Result<(Vec<Alike>, Vec<usize>), Error> {
        let mut fit = Vec::new();
        let mut left = Vec::new();
        for set in 0..self.len() {
            match block::samples_in_delay(&self.row(set)?, span) {
                Some(samples) => push(SWEEP, &mut fit, (samples, set))?,
                None => push(SWEEP, &mut left, set)?,
            }
        }
        fit.sort_unstable();
        Ok((fit, left))
    }

    /// Process all sets, blocks with `side_by_side` and single sets with `alone`. `keep` receives
    /// every set with its result; at most `at_once` results are held before.
    fn each<T: Send>(
        &self,
        (span, at_once): (f64, usize),
        task: &Task,
        side_by_side: impl Fn(&Block, &[usize]) -> Result<Vec<T>, Error> + Sync,
        alone: impl Fn(usize) -> Result<T, Error> + Sync,
        mut keep: impl FnMut(usize, T),
    ) -> Result<(), Error> {
        let (fit, left) = self.sorted(span)?;
        let alike = fit.chunk_by(|one, other| one.0 == other.0);
        let mut blocks = reserved(SWEEP, fit.len())?;
        blocks.extend(alike.flat_map(|group| group.chunks(block::SETS)));
        for group in blocks.chunks(at_once.div_ceil(block::SETS)) {
            let work = |members: &&[Alike]| {
                task.check()?;
                let sets: Vec<usize> = members.iter().map(|&(_, set)| set).collect();
                let found = side_by_side(&Block::new(self, &sets)?, &sets)?;
                task.advance(sets.len() as u64);
                Ok(found)
            };
            let found: Result<Vec<_>, Error> = group.par_iter().map(work).collect();
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
/// `steady` holds the steady state of each set, NaN where its last output is to count as that.
pub fn metrics(
    sets: &Sets<'_>,
    steady: &[f64],
    span: f64,
    criteria: &Criteria,
    task: &Task,
) -> Result<Vec<(Metrics, Outcome)>, Error> {
    let goal = |set: usize| steady.get(set).copied().unwrap_or(f64::NAN);
    let mut found = filled(SWEEP, (Metrics::UNKNOWN, Outcome::Refused), sets.len())?;
    sets.each(
        (span, AT_ONCE),
        task,
        |block, members| {
            let goals: Vec<f64> = members.iter().map(|&set| goal(set)).collect();
            room::<block::Column>(SWEEP, block.samples)?;
            Ok(measured::metrics(block, &goals, span, criteria))
        },
        |set| each::metrics(sets, set, goal(set), span, criteria, task),
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
        |block, members| corners::responses(block, members.len(), times),
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
