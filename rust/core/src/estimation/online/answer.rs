//! What an estimator says at each row.

use super::posterior::Known;
use super::settings::{Lags, Settings};

/// What is known at one row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Answer {
    /// Of the row, s.
    pub time: f64,
    /// Whether rows count yet; otherwise the intervals are the whole range.
    pub started: bool,
    /// The delay, s.
    pub delay: Known,
    /// Delay and lags together, s.
    pub together: Known,
    /// Posterior mean of the lags together, s.
    pub lag: f64,
    /// Posterior mean and deviation of the gain.
    pub gain: f64,
    /// Posterior mean and deviation of the gain.
    pub gain_deviation: f64,
    /// The share of the walk that there is at this information.
    pub gate: f64,
    /// Whether a change of the delay was found at this row.
    pub changed: bool,
    /// The deviation of the white noise.
    pub white: f64,
    /// Correlation of neighbouring innovations, in its deviations.
    pub colour: f64,
    /// Covariance of innovations and commands, about χ² of six degrees.
    pub unexplained: f64,
    /// Probability of the lowest delay.
    pub lowest: f64,
    /// Probability of the highest delay.
    pub highest: f64,
    /// Logarithm of the density of all rows, but for a constant a row.
    pub evidence: f64,
}

/// Share of the walk from which the last rows told something.
const INFORMED: f64 = 0.5;

impl Answer {
    /// Did the last rows tell something of the delay?
    pub fn is_informed(&self) -> bool {
        self.gate > INFORMED
    }

    pub(super) fn none(time: f64, settings: &Settings) -> Self {
        let whole = |lag: f64| {
            let (low, high) = (
                settings.delays[0] + lag,
                settings.delays[settings.delays.len() - 1] + lag,
            );
            Known {
                mean: 0.5 * (low + high),
                deviation: (high - low) / 12.0_f64.sqrt(),
                low,
                high,
            }
        };
        let total = |layer: &Lags| layer.lags.iter().sum::<f64>() - layer.zero + settings.own_lag;
        let least = settings
            .layers
            .iter()
            .map(total)
            .fold(f64::INFINITY, f64::min);
        let most = settings
            .layers
            .iter()
            .map(total)
            .fold(f64::NEG_INFINITY, f64::max);
        let mut together = whole(0.5 * (least + most));
        (together.low, together.high) = (whole(least).low, whole(most).high);
        Self {
            time,
            started: false,
            delay: whole(0.0),
            together,
            lag: 0.5 * (least + most),
            gain: settings.gain.0,
            gain_deviation: settings.gain.1,
            gate: 0.0,
            changed: false,
            white: settings.white,
            colour: 0.0,
            unexplained: 0.0,
            lowest: 0.0,
            highest: 0.0,
            evidence: 0.0,
        }
    }
}
