//! Places on the imaginary axis at which roots cross it.

use std::f64::consts::TAU;

/// A value of a parameter at which roots lie on the imaginary axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crossing {
    /// The value.
    pub value: f64,
    /// Imaginary part of the root, zero or positive, 1/s.
    pub omega: f64,
    /// Roots that go to the right as the parameter grows, less those that go to the left; zero where
    /// that is not known.
    pub direction: i32,
}

/// A frequency at which roots cross for T = `first` + n `period`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Passage {
    pub(super) omega: f64,
    pub(super) first: f64,
    pub(super) period: f64,
    pub(super) direction: i32,
}

impl Passage {
    /// From e^(−jωT·`unit`) = e^(j·`turn`).
    pub(super) fn new(omega: f64, turn: f64, unit: f64, direction: i32) -> Self {
        let scale = unit * omega;
        Self {
            omega,
            first: turn.rem_euclid(TAU) / scale,
            period: TAU / scale,
            direction,
        }
    }

    /// The last delay before `value` and the first one after it.
    pub(super) fn around(&self, value: f64) -> (f64, f64) {
        let turns = (value - self.first) / self.period;
        let at = |turns: f64| self.first + self.period * turns;
        let (mut low, mut high) = (at(turns.ceil() - 1.0), at(turns.floor() + 1.0));
        if low >= value {
            low -= self.period;
        }
        if high <= value {
            high += self.period;
        }
        (low, high)
    }
}
