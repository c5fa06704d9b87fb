//! One set of numbers of plant and noise, and what a profile holds of it.

use super::likelihood::Noise;

/// What the lags are measured from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Timing {
    /// The delay, s.
    Delay(f64),
    /// Delay and lags together, s.
    Total(f64),
}

/// One set of numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    /// Delay, or delay and lags together.
    pub timing: Timing,
    /// s.
    pub lags: Vec<f64>,
    /// s.
    pub zero: f64,
    /// The gain; without effect where it is eliminated.
    pub gain: f64,
    /// The noise of each recording.
    pub noise: Vec<Noise>,
}

impl Point {
    /// Delay and lags together, s.
    pub fn total(&self) -> f64 {
        match self.timing {
            Timing::Delay(delay) => delay + self.lags.iter().sum::<f64>(),
            Timing::Total(total) => total,
        }
    }

    /// s.
    pub fn delay(&self) -> f64 {
        match self.timing {
            Timing::Delay(delay) => delay,
            Timing::Total(total) => total - self.lags.iter().sum::<f64>(),
        }
    }
}

/// A quantity that a profile holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// The delay.
    Delay,
    /// Delay and lags together.
    Total,
    /// The gain.
    Gain,
    /// A lag.
    Lag(usize),
}

impl Quantity {
    /// Its value at a point; a gain that is eliminated is no part of a point.
    pub fn value(self, point: &Point) -> f64 {
        match self {
            Self::Delay => point.delay(),
            Self::Total => point.total(),
            Self::Gain => point.gain,
            Self::Lag(i) => point.lags.get(i).copied().unwrap_or(0.0),
        }
    }
}
