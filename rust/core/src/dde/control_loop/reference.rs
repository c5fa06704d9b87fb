//! Piecewise constant references.

use crate::Error;
use crate::dde::limits::finite;
use crate::dde::scalar::Scalar;

use super::linear_loop::{Equations, Kick};

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
                "reference time {} follows {}: give increasing times",
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

    /// A reader for times that do not decrease, of the reference and of the jumps of inputs.
    pub(crate) fn cursor<'a>(&'a self, kicks: &'a [Kick]) -> Cursor<'a> {
        Cursor {
            reference: self,
            next: 0,
            value: self.before,
            kicks,
        }
    }
}

/// Reads a reference at times that do not decrease.
#[derive(Debug)]
pub(crate) struct Cursor<'a> {
    reference: &'a Reference,
    next: usize,
    value: f64,
    /// Those that are still to come.
    kicks: &'a [Kick],
}

impl Cursor<'_> {
    /// Let the inputs jump that do up to `slack` after time `t`. Returns the weight of the
    /// impulse that they cause in the command; none where no input jumps.
    pub(crate) fn kick<S: Scalar>(
        &mut self,
        t: f64,
        slack: f64,
        equations: &Equations<S>,
        x: &mut [S],
    ) -> Option<S> {
        let mut weight = None;
        let first = x.len().saturating_sub(equations.impulses.len());
        while let Some((kick, later)) = self.kicks.split_first()
            && kick.time <= t + slack
        {
            self.kicks = later;
            let Some(state) = x.get_mut(first + kick.input) else {
                continue;
            };
            let to = S::from(kick.to);
            let by = to - std::mem::replace(state, to);
            let impulse = equations.impulses.get(kick.input).copied();
            let before = weight.unwrap_or_default();
            weight = Some(before + impulse.unwrap_or_default() * by);
        }
        weight
    }

    /// Time of the next jump of an input, infinite if there is none.
    pub(crate) fn next_kick(&self) -> f64 {
        self.kicks.first().map_or(f64::INFINITY, |kick| kick.time)
    }

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

    /// Time of the next jump of the reference or of an input, infinite if there is none.
    pub(crate) fn next_jump(&self) -> f64 {
        let times = &self.reference.times;
        let jump = times.get(self.next).copied().unwrap_or(f64::INFINITY);
        jump.min(self.next_kick())
    }
}
