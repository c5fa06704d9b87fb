//! Many loops at once: step responses from rest, or their figures, one loop a set of numbers.
//!
//! Sampled loops whose output is a line between events (an integrator under any controller) run
//! in lanes, one set in each (`walk`); sets whose delays hold the same number of whole samples
//! share a block, so that its lanes read their delayed commands from the same place. All other
//! sets run one by one by the engines of a single loop (`each`). A set's result has the same
//! bits whatever its neighbours, the number of threads and the instruction set.

mod block;
mod corners;
mod each;
mod measured;
mod through;
mod walk;

#[cfg(test)]
mod tests;

use rayon::prelude::*;

use super::figures::{Criteria, Figures};
use super::row::{Row, width};
use crate::{Error, Task};

use block::Block;

/// What became of one set.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Outcome {
    /// Simulated, and settled where figures were asked for.
    Ok = 0,
    /// Outside its settling band at the end of the time simulated.
    Unsettled = 1,
    /// Grown beyond all bounds before the end.
    Diverged = 2,
    /// Not simulated: numbers outside what a loop can have, or more work than is sensible.
    Refused = 3,
    /// Inside its settling band at the end, but not so long or so close that the response itself
    /// shows that it stays there.
    Doubtful = 4,
}

/// Loops of one structure, each at rest at zero when its reference steps to `amplitude`.
#[derive(Debug, Clone, Copy)]
pub struct Sets<'a> {
    /// Number of states.
    pub states: usize,
    /// A row a set: A, B, E, K, C, L, M, D, impulse, delay, sample time (0 for none), limit
    /// (∞ for none).
    pub rows: &'a [f64],
    /// Height of the step.
    pub amplitude: f64,
    /// Is the delay in the measurement, so that the output runs ahead by it?
    pub is_ahead: bool,
}

impl<'a> Sets<'a> {
    /// How many.
    pub fn len(&self) -> usize {
        self.rows.len() / width(self.states)
    }

    /// None at all?
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    fn row(&self, set: usize) -> Result<Row<'a>, Error> {
        let width = width(self.states);
        let row = self.rows.get(set * width..(set + 1) * width);
        Row::new(self.states, row.unwrap_or_default())
    }

    /// Time by which the output runs ahead of the stepper's.
    fn ahead(&self, row: &Row<'_>) -> f64 {
        if self.is_ahead { row.delay } else { 0.0 }
    }

    /// Blocks of sets for the lanes, and the sets that are left, for responses of `span` seconds.
    fn sorted(&self, span: f64) -> Result<(Vec<Vec<usize>>, Vec<usize>), Error> {
        let mut fit = Vec::new();
        let mut left = Vec::new();
        for set in 0..self.len() {
            match block::samples_in_delay(&self.row(set)?, span) {
                Some(samples) => fit.push((samples, set)),
                None => left.push(set),
            }
        }
        fit.sort_unstable();
        let alike = fit.chunk_by(|one, other| one.0 == other.0);
        let blocks = alike
            .flat_map(|group| group.chunks(block::SETS))
            .map(|block| block.iter().map(|&(_, set)| set).collect())
            .collect();
        Ok((blocks, left))
    }

    /// Work on all sets, `in_lanes` on blocks and `alone` on single ones; `keep` is given every
    /// set with its result.
    fn each<T: Send>(
        &self,
        span: f64,
        task: &Task,
        in_lanes: impl Fn(&Block, &[usize]) -> Vec<T> + Sync,
        alone: impl Fn(usize) -> Result<T, Error> + Sync,
        mut keep: impl FnMut(usize, T),
    ) -> Result<(), Error> {
        let (blocks, left) = self.sorted(span)?;
        let from_blocks: Vec<_> = blocks
            .par_iter()
            .map(|members| {
                task.check()?;
                let found = in_lanes(&Block::new(self, members)?, members);
                task.advance(members.len() as u64);
                Ok(found)
            })
            .collect::<Result<_, Error>>()?;
        let from_rest: Vec<_> = left
            .par_iter()
            .map(|&set| {
                task.check()?;
                let found = alone(set)?;
                task.advance(1);
                Ok(found)
            })
            .collect::<Result<_, Error>>()?;
        let members = blocks.iter().flatten().chain(&left);
        let found = from_blocks.into_iter().flatten().chain(from_rest);
        members
            .zip(found)
            .for_each(|(&set, found)| keep(set, found));
        Ok(())
    }
}

/// Figures of every response from its start to `span` seconds after it.
///
/// `steady` holds the steady state of each set, NaN where its last output is to count as that.
pub fn figures(
    sets: &Sets<'_>,
    steady: &[f64],
    span: f64,
    criteria: &Criteria,
    task: &Task,
) -> Result<Vec<(Figures, Outcome)>, Error> {
    let goal = |set: usize| steady.get(set).copied().unwrap_or(f64::NAN);
    let mut found = vec![(Figures::UNKNOWN, Outcome::Refused); sets.len()];
    sets.each(
        span,
        task,
        |block, members| {
            let goals: Vec<f64> = members.iter().map(|&set| goal(set)).collect();
            measured::figures(block, &goals, span, criteria)
        },
        |set| each::figures(sets, set, goal(set), span, criteria, task),
        |set, result| {
            if let Some(place) = found.get_mut(set) {
                *place = result;
            }
        },
    )?;
    Ok(found)
}

/// Outputs of every response at `times` after its start (increasing, ≥ 0, s), a row a set; rows of
/// sets that diverge or are refused are NaN.
pub fn responses(
    sets: &Sets<'_>,
    times: &[f64],
    task: &Task,
) -> Result<(Vec<f64>, Vec<Outcome>), Error> {
    let length = times.len();
    let mut outputs = vec![f64::NAN; sets.len() * length];
    let mut outcomes = vec![Outcome::Refused; sets.len()];
    sets.each(
        times.last().copied().unwrap_or(0.0),
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
