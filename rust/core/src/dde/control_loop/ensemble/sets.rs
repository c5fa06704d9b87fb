//! Loops of one structure, one in each row of an array.

use crate::Error;
use crate::dde::control_loop::row::{Row, width};

/// What became of one set.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Outcome {
    /// Simulated, and settled where metrics were asked for.
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

    pub(super) fn row(&self, set: usize) -> Result<Row<'a>, Error> {
        let width = width(self.states);
        let row = self.rows.get(set * width..(set + 1) * width);
        Row::new(self.states, row.unwrap_or_default())
    }

    /// Time by which the output runs ahead of the stepper's.
    pub(super) fn ahead(&self, row: &Row<'_>) -> f64 {
        if self.is_ahead { row.delay } else { 0.0 }
    }
}
