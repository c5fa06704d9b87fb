//! Piecewise constant references.

use crate::Error;
use crate::dde::limits::finite;

/// A piecewise constant reference, each value holding from its time on.
#[derive(Debug, Clone, PartialEq)]
pub struct Reference {
    before: f64,
    times: Vec<f64>,
    values: Vec<f64>,
}

impl Reference {
    /// `values[i]` holds from `times[i]` (increasing) on, `before` until the first of them.
    pub fn new(before: f64, mut times: Vec<f64>, mut values: Vec<f64>) -> Result<Self, Error> {
        refuse_if!(
            times.len() != values.len(),
            "{} reference values for {} reference times: give one value for each time",
            values.len(),
            times.len()
        );
        finite("reference before the start", &[before])?;
        finite("reference", &values)?;
        finite("reference time", &times)?;
        if let Some(pair) = times.windows(2).find(|pair| pair[1] <= pair[0]) {
            refuse!(
                "reference time {} follows {}: sort the times and drop repeated ones",
                pair[1],
                pair[0]
            );
        }
        // Only true jumps are kept, because each one ends an element of time.
        let (mut kept, mut last) = (0, before);
        for at in 0..times.len() {
            if values[at] != std::mem::replace(&mut last, values[at]) {
                (times[kept], values[kept]) = (times[at], values[at]);
                kept += 1;
            }
        }
        times.truncate(kept);
        values.truncate(kept);
        Ok(Self {
            before,
            times,
            values,
        })
    }

    /// A step from `before` to `value` at time 0.
    pub fn step(before: f64, value: f64) -> Result<Self, Error> {
        Self::new(before, vec![0.0], vec![value])
    }

    /// The value that holds at `time`.
    pub(crate) fn at(&self, time: f64) -> f64 {
        match self.times.partition_point(|&jump| jump <= time) {
            0 => self.before,
            place => self.values[place - 1],
        }
    }

    /// A reader for times that do not decrease.
    pub(crate) fn cursor(&self) -> Cursor<'_> {
        Cursor {
            reference: self,
            next: 0,
            value: self.before,
        }
    }
}

/// Reads a reference at times that do not decrease.
#[derive(Debug)]
pub(crate) struct Cursor<'a> {
    reference: &'a Reference,
    next: usize,
    value: f64,
}

impl Cursor<'_> {
    /// Advance to time `t`, where a jump up to `slack` later counts as reached. Returns the value
    /// there.
    pub(crate) fn advance(&mut self, t: f64, slack: f64) -> f64 {
        while let (Some(&time), Some(&value)) = (
            self.reference.times.get(self.next),
            self.reference.values.get(self.next),
        ) {
            if time > t + slack {
                break;
            }
            self.value = value;
            self.next += 1;
        }
        self.value
    }

    /// The value at the time reached; `before` until the first call of `advance`.
    pub(crate) fn value(&self) -> f64 {
        self.value
    }

    /// Time of the next jump, infinite if there is none.
    pub(crate) fn next_jump(&self) -> f64 {
        self.reference
            .times
            .get(self.next)
            .copied()
            .unwrap_or(f64::INFINITY)
    }
}
