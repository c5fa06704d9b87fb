//! Loops of one structure, one set of numbers for each.

use crate::Error;
use crate::dde::control_loop::linear_loop::LinearLoop;
use crate::dde::control_loop::metrics::{Metrics, Verdict};
use crate::dde::control_loop::row::{Row, width};

/// Number of loops in a block: two vectors of the widest instruction set.
pub(super) const SETS: usize = 16;

/// Outcome of one set.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Outcome {
    /// Simulated, and settled where metrics were requested.
    Ok = 0,
    /// Outside its settling band at the end of the time simulated.
    Unsettled = 1,
    /// The response exceeded all limits before the end.
    Diverged = 2,
    /// Not simulated: the numbers are not those of a loop, or the work exceeds a limit.
    Refused = 3,
    /// Inside its settling band at the end, but not long or close enough for the response itself to
    /// show that it stays there.
    Doubtful = 4,
}

/// What is found of a set: metrics, the last time at which the command was at its limit, and the outcome.
pub(super) type Found = ((Metrics, f64), Outcome);

/// What is found of a set without a response.
pub(super) const UNKNOWN: (Metrics, f64) = (Metrics::UNKNOWN, f64::NAN);

impl From<Verdict> for Outcome {
    fn from(verdict: Verdict) -> Self {
        match verdict {
            Verdict::Outside => Self::Unsettled,
            Verdict::Doubtful => Self::Doubtful,
            Verdict::Settled => Self::Ok,
        }
    }
}

/// Metrics and outcomes of some sets.
#[derive(Debug, Clone)]
pub struct Measures {
    /// The metrics in the order of their fields, one for each set.
    metrics: [[f64; SETS]; 9],
    /// The last time at which each command was at its limit.
    limited_until: [f64; SETS],
    /// Outcomes; none of sets that have to run one by one.
    pub(super) outcomes: [Option<Outcome>; SETS],
    /// How many sets.
    pub(super) count: usize,
}

impl Measures {
    /// Of no set yet.
    pub(super) const NONE: Self = Self {
        metrics: [[f64::NAN; SETS]; 9],
        limited_until: [f64::NAN; SETS],
        outcomes: [None; SETS],
        count: 0,
    };

    /// Of one set, refused where nothing is found.
    pub(super) fn of_one(found: Option<Found>) -> Self {
        let (found, outcome) = found.unwrap_or((UNKNOWN, Outcome::Refused));
        let mut out = Self::NONE;
        out.push(found, Some(outcome));
        out
    }

    /// Append metrics and the last time at the limit of a set, without an outcome if it has to run alone.
    #[inline]
    pub(super) fn push(&mut self, found: (Metrics, f64), outcome: Option<Outcome>) {
        let (metrics, limited_until) = found;
        if let Some(place) = self.limited_until.get_mut(self.count) {
            *place = limited_until;
        }
        for (column, metric) in self.metrics.iter_mut().zip(metrics.to_array()) {
            if let Some(place) = column.get_mut(self.count) {
                *place = metric;
            }
        }
        if let Some(place) = self.outcomes.get_mut(self.count) {
            *place = outcome;
        }
        self.count += 1;
    }

    /// The metrics of one of the sets.
    #[cfg(test)]
    pub(super) fn of(&self, place: usize) -> Metrics {
        Metrics::from_array(self.metrics.map(|column| column[place]))
    }

    /// The metrics in the order of their fields, and then the last times at which commands were at
    /// their limits.
    pub fn columns(&self) -> impl Iterator<Item = &[f64; SETS]> {
        self.metrics.iter().chain([&self.limited_until])
    }

    /// Outcomes, refused where there is none.
    pub fn outcomes(&self) -> impl Iterator<Item = Outcome> {
        let outcomes = self.outcomes.iter().take(self.count);
        outcomes.map(|outcome| outcome.unwrap_or(Outcome::Refused))
    }
}

/// Loops of one structure, each at rest at zero when its reference steps to `amplitude`.
#[derive(Debug, Clone, Copy)]
pub struct Sets<'a> {
    /// Number of states.
    states: usize,
    count: usize,
    entries: &'a [&'a [f64]],
    /// Height of the step.
    pub(super) amplitude: f64,
    /// Is the delay in the measurement, so that the output is read ahead by it?
    pub(super) is_ahead: bool,
}

impl<'a> Sets<'a> {
    /// `count` loops with `states` states. `entries` are their numbers in the order of a row: A, B,
    /// E, K, C, L, M, D, impulse, delay, sample time (0 for none), limit (∞ for none), each of them
    /// one number for all loops or one for each.
    ///
    /// # Errors
    /// [`Error::Argument`] if there are other numbers of entries, or entries of other lengths.
    pub fn new(
        states: usize,
        count: usize,
        entries: &'a [&'a [f64]],
        amplitude: f64,
        is_ahead: bool,
    ) -> Result<Self, Error> {
        refuse_if!(
            entries.len() != width(states),
            "{} entries: a loop with {states} states has {}",
            entries.len(),
            width(states)
        );
        for entry in entries {
            refuse_if!(
                entry.len() != 1 && entry.len() != count,
                "an entry has {} numbers: give one, or one for each of {count} loops",
                entry.len()
            );
        }
        Ok(Self {
            states,
            count,
            entries,
            amplitude,
            is_ahead,
        })
    }

    /// Number of sets.
    pub(crate) fn len(&self) -> usize {
        self.count
    }

    /// Number of states.
    pub(super) fn states(&self) -> usize {
        self.states
    }

    /// The entries in the order of a row.
    pub(super) fn entries(&self) -> &'a [&'a [f64]] {
        self.entries
    }

    /// The numbers of a set.
    pub(super) fn row(&self, set: usize) -> Vec<f64> {
        self.entries.iter().map(|entry| of(entry, set)).collect()
    }

    /// The loop of a set; none where its numbers are not those of one.
    pub(crate) fn loop_of(&self, set: usize) -> Result<Option<LinearLoop>, Error> {
        let row = self.row(set);
        Ok(Row::new(self.states, &row)?.checked().ok())
    }

    /// Time by which the output of a loop with `delay` is read ahead of the simulation.
    pub(super) fn ahead(&self, delay: f64) -> f64 {
        if self.is_ahead { delay } else { 0.0 }
    }
}

/// The number of `set` in an entry.
#[inline]
pub(super) fn of(entry: &[f64], set: usize) -> f64 {
    match entry {
        [shared] => *shared,
        each => each.get(set).copied().unwrap_or(f64::NAN),
    }
}
