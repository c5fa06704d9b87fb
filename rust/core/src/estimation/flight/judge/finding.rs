//! What one test of a fit says.

use super::tolerances::LEVELS;

/// What may speak against a fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cause {
    /// The residuals are not white: their autocorrelation.
    Colour,
    /// The plant lacks a lag: its size, s.
    Lag,
    /// A lag would move delay and lags out of their interval: its size and their sum then, s.
    LagMoves,
    /// The plant lacks a lag with a zero: their sizes, s.
    Overshoot,
    /// The delay is at zero, and the slope of the likelihood leads below it.
    BelowZero,
    /// The delay changes: its standard deviation, s.
    Change,
    /// The noise grows with the speed of the output.
    Speed,
    /// Air that changes within a row moves the output: by so many deviations of the sensor.
    RestlessAir,
    /// Air moves the output more while the vehicle moves.
    MovingAir,
    /// The gains of recordings differ: each with its standard error.
    Gains,
    /// Their sums of delay and lags differ: each with its standard error, s.
    Totals,
}

impl Cause {
    /// Its name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Colour => "colour",
            Self::Lag => "lag",
            Self::LagMoves => "lag moves",
            Self::Overshoot => "overshoot",
            Self::BelowZero => "below zero",
            Self::Change => "change",
            Self::Speed => "speed",
            Self::RestlessAir => "restless air",
            Self::MovingAir => "moving air",
            Self::Gains => "gains",
            Self::Totals => "totals",
        }
    }
}

/// What one test says.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    /// What was tested.
    pub cause: Cause,
    /// The recording, where one alone was tested.
    pub run: Option<usize>,
    /// Its sizes, as the cause has them.
    pub sizes: Vec<f64>,
    /// Probability of as much where the fit is right; not a number where a size alone decides.
    pub p_value: f64,
    /// Does it speak against the fit?
    pub is_against: bool,
    /// Does it then say that the plant lacks something: a lag, or what the air stands for?
    pub plant_lacks: bool,
}

/// What a test at the level of each says.
pub(super) fn finding(cause: Cause, p_value: f64) -> Finding {
    Finding {
        cause,
        run: None,
        sizes: Vec::new(),
        p_value,
        is_against: p_value < LEVELS.test,
        plant_lacks: false,
    }
}
