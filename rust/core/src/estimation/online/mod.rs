//! The delay while a loop runs: a bank of Kalman filters over delays and lags.
//!
//! Each cell of the bank holds the states of plant and noise if its delay and lags are the right
//! ones; given the command the output is linear in them, the gain included, so that each filter is
//! exact and the weights of the cells are the posterior. The states are physical and mean the same
//! in every cell. So the delay may walk from cell to cell (`walk`), and jump: a second bank holds
//! the states if it has jumped, and its weights are the sum over the times of the jump and the new
//! delays of the likelihood ratio (`Settings::alarm`). Both need information about the delay (`Bank`
//! gates them): while no command changes nothing is forgotten.

mod bank;
mod cell;
mod history;
mod judge;
mod posterior;
mod response;
mod walk;

pub use posterior::Known;

use super::disturbance::Disturbance;
use super::plant::Plant;
use super::rows::check_times;
use crate::Error;

/// One set of lags.
#[derive(Debug, Clone, PartialEq)]
pub struct Lags {
    /// The lags, s.
    pub lags: Vec<f64>,
    /// Time constant of the zero behind them, s.
    pub zero: f64,
    /// Logarithm of the prior weight at each delay.
    pub log_prior: Vec<f64>,
}

/// What is known before the first row.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// The plant of unit gain.
    pub plant: Plant,
    /// The lag that is part of it, s.
    pub own_lag: f64,
    /// Delays of the cells, s, increasing.
    pub delays: Vec<f64>,
    /// Sets of lags.
    pub layers: Vec<Lags>,
    /// Air and coloured noise, in deviations of the white noise.
    pub disturbances: Vec<Disturbance>,
    /// Mean and deviation of the gain.
    pub gain: (f64, f64),
    /// Deviation of a constant input beside the command, zero where there is none.
    pub trim: f64,
    /// Deviation of the white noise, and the number of rows that it is known from.
    pub white: f64,
    /// May be infinite: then the deviation stays as it is.
    pub freedom: f64,
    /// Time over which it is estimated again, s.
    pub memory: f64,
    /// Deviation that the delay gains by its walk in a second, s.
    pub drift: f64,
    /// The same of the gain.
    pub gain_walk: f64,
    /// Walk and jumps have half their size where five seconds tell the delay to this deviation, s.
    pub width: f64,
    /// The sum of hazard times likelihood ratio at which the delay counts as changed. The hazard is
    /// one a second. The sum less its hazard is a martingale while nothing changes, so that the mean
    /// time to a false alarm is at least as many seconds (Pollak 1985); infinite for none.
    pub alarm: f64,
    /// One in how many delays the second bank has.
    pub every: usize,
    /// Is the plant at rest before the first command? Otherwise rows count from the time on when
    /// the first command has arrived at every delay.
    pub at_rest: bool,
    /// Of the intervals.
    pub level: f64,
}

impl Settings {
    fn has_offset(&self) -> bool {
        !self.plant.integrates()
    }

    fn check(&self) -> Result<(), Error> {
        let (count, delays) = (self.delays.len(), &self.delays);
        refuse_if!(count < 3, "{count} delays: give three or more");
        check_times("delay", delays)?;
        refuse_if!(
            delays[0] < 0.0,
            "the delay {} s: give delays of at least zero",
            delays[0]
        );
        refuse_if!(self.layers.is_empty(), "no set of lags: give one or more");
        let states = self.layers[0]
            .lags
            .iter()
            .filter(|lag| **lag != 0.0)
            .count();
        for layer in &self.layers {
            refuse_if!(
                layer.log_prior.len() != count,
                "{count} delays and {} prior weights: give equally many",
                layer.log_prior.len()
            );
            if let Some(lag) = layer
                .lags
                .iter()
                .find(|lag| !(lag.is_finite() && **lag >= 0.0))
            {
                refuse!("the lag {lag} s: give finite lags of at least zero");
            }
            refuse_if!(
                layer.lags.iter().filter(|lag| **lag != 0.0).count() != states,
                "sets of lags with and without a lag of zero: give the same lags in all"
            );
            let best = layer
                .log_prior
                .iter()
                .copied()
                .fold(f64::NEG_INFINITY, f64::max);
            refuse_if!(
                best == f64::INFINITY || best.is_nan(),
                "a prior weight is {best}"
            );
        }
        let tops = self
            .layers
            .iter()
            .flat_map(|layer| layer.log_prior.iter().copied());
        refuse_if!(
            !tops.fold(f64::NEG_INFINITY, f64::max).is_finite(),
            "all prior weights are zero: give at least one delay a weight"
        );
        let above = [
            ("white noise", self.white),
            ("memory", self.memory),
            ("freedom", self.freedom),
            ("width", self.width),
            ("alarm", self.alarm),
            ("deviation of the gain", self.gain.1),
        ];
        for (what, value) in above {
            refuse_if!(
                value.is_nan() || value <= 0.0,
                "{what} of {value}: give one above zero"
            );
        }
        for (what, value) in [
            ("drift", self.drift),
            ("trim", self.trim),
            ("walk of the gain", self.gain_walk),
        ] {
            refuse_if!(
                !(value.is_finite() && value >= 0.0),
                "{what} of {value}: give a finite one of at least zero"
            );
        }
        refuse_if!(
            !(self.white.is_finite() && self.gain.0.is_finite() && self.gain.1.is_finite()),
            "white noise of {} and a gain of {} ± {}: give finite numbers",
            self.white,
            self.gain.0,
            self.gain.1
        );
        refuse_if!(
            !(self.level > 0.0 && self.level < 1.0),
            "a level of {}: give one between zero and one",
            self.level
        );
        Ok(())
    }

    /// The number of states of a cell.
    fn states(&self) -> usize {
        let lags = self.layers[0]
            .lags
            .iter()
            .filter(|lag| **lag != 0.0)
            .count();
        self.plant.states(lags)
            + self.disturbances.len()
            + 1
            + usize::from(self.trim > 0.0)
            + usize::from(self.has_offset())
    }
}

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
    /// Fisher information about the delay a second, of the last seconds, 1/s³.
    pub rate: f64,
    /// The share of the walk that there is at this information.
    pub gate: f64,
    /// Whether a change of the delay was found at this row.
    pub changed: bool,
    /// The sum that is compared with the alarm.
    pub change_ratio: f64,
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

impl Answer {
    fn none(time: f64, settings: &Settings) -> Self {
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
            rate: 0.0,
            gate: 0.0,
            changed: false,
            change_ratio: 0.0,
            white: settings.white,
            colour: 0.0,
            unexplained: 0.0,
            lowest: 0.0,
            highest: 0.0,
            evidence: 0.0,
        }
    }
}

/// An estimator that takes rows as they come.
pub trait Online: Send + Sync {
    /// A command that holds from `time` on.
    ///
    /// # Errors
    ///
    /// If a number is not finite, or the time does not follow that of the command before.
    fn command(&mut self, time: f64, value: f64) -> Result<(), Error>;

    /// A row: its output, or none where that was lost.
    ///
    /// # Errors
    ///
    /// If a number is not finite, or the time does not follow that of the row before.
    fn row(&mut self, time: f64, output: Option<f64>) -> Result<Answer, Error>;
}

/// An estimator with these settings.
///
/// # Errors
///
/// If a setting is out of its range, or a cell would have more than nine states.
pub fn online(settings: Settings) -> Result<Box<dyn Online>, Error> {
    settings.check()?;
    macro_rules! bank {
        ($($states:literal)*) => {
            match settings.states() {
                $($states => Ok(Box::new(bank::Bank::<$states>::new(settings)?)),)*
                n => refuse!("{n} states of plant, noise, gain and level: the bank takes up to 9"),
            }
        };
    }
    bank!(2 3 4 5 6 7 8 9)
}
