//! What is known of one response while its trace is searched.

use crate::dde::control_loop::metrics::{Levels, Record};

/// What is known of one response.
#[derive(Debug, Clone, Copy)]
pub(super) struct Measured {
    pub(super) levels: Levels,
    pub(super) record: Record,
    /// Least output after the rise, times the sign of the step.
    pub(super) dip: f64,
    pub(super) stage: Stage,
    /// The part or place at which the stage continues.
    pub(super) at: usize,
}

impl Measured {
    /// Nothing yet, of a response that begins at `first`.
    pub(super) fn new(levels: Levels, first: f64) -> Self {
        let is_inside = (first - levels.steady).abs() <= levels.band;
        Self {
            levels,
            record: Record {
                top: (first, 0.0),
                bottom: (first, 0.0),
                risen: (f64::NAN, f64::NAN),
                after: (f64::NAN, f64::NAN),
                inside_since: if is_inside { 0.0 } else { f64::NAN },
                unsettled_until: 0.0,
            },
            dip: f64::NAN,
            stage: Stage::Top,
            at: 0,
        }
    }

    pub(super) fn dip(&self) -> f64 {
        self.dip
    }

    /// Levels of the rise, in the direction of the step.
    pub(super) fn level(&self, is_end: bool) -> f64 {
        if is_end {
            self.levels.rise.1
        } else {
            self.levels.rise.0
        }
    }

    pub(super) fn is_outside(&self, y: f64) -> bool {
        (y - self.levels.steady).abs() > self.levels.band
    }

    /// The record in the end.
    pub(super) fn finished(mut self) -> Self {
        let record = &mut self.record;
        record.after = if self.levels.sign > 0.0 {
            (self.dip, record.top.0)
        } else {
            (record.bottom.0, -self.dip)
        };
        self
    }
}

/// What is looked for, one after the other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Stage {
    Top,
    Bottom,
    Rise(bool),
    Dip,
    Band,
    Done,
}

/// What has to be known of a part to continue.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Wanted {
    Extremum,
    /// Where it passes through a level.
    Crossing(f64),
}
