//! Loops of one structure, one in each row of an array.

use crate::Error;
use crate::dde::control_loop::row::{Row, width};

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

/// Loops of one structure, each at rest at zero when its reference steps to `amplitude`.
#[derive(Debug, Clone, Copy)]
pub struct Sets<'a> {
    /// Number of states.
    pub states: usize,
    /// One row for each set: A, B, E, K, C, L, M, D, impulse, delay, sample time (0 for none),
    /// limit (∞ for none).
    pub rows: &'a [f64],
    /// Height of the step.
    pub amplitude: f64,
    /// Is the delay in the measurement, so that the output is read ahead by it?
    pub is_ahead: bool,
}

impl<'a> Sets<'a> {
    /// Number of sets.
    pub(super) fn len(&self) -> usize {
        self.rows.len() / width(self.states)
    }

    pub(super) fn row(&self, set: usize) -> Result<Row<'a>, Error> {
        let width = width(self.states);
        let row = self.rows.get(set * width..(set + 1) * width);
        Row::new(self.states, row.unwrap_or_default())
    }

    /// Time by which the output is read ahead of the simulation.
    pub(super) fn ahead(&self, row: &Row<'_>) -> f64 {
        if self.is_ahead { row.delay } else { 0.0 }
    }
}
