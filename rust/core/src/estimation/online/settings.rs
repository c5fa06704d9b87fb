//! What an estimator is told before the first row.

use super::super::disturbance::Disturbance;
use super::super::plant::Plant;
use super::super::rows::check_times;
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
    /// Are there cells between them where rows tell the delay to less than their distance?
    pub follow: bool,
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
    pub(super) fn has_offset(&self) -> bool {
        !self.plant.integrates()
    }

    pub(super) fn check(&self) -> Result<(), Error> {
        let (count, delays) = (self.delays.len(), &self.delays);
        refuse_if!(count < 3, "{count} delays were given: give three or more");
        check_times("delay", delays)?;
        refuse_if!(
            delays[0] < 0.0,
            "a delay is {} s: give delays of zero or more",
            delays[0]
        );
        refuse_if!(
            self.layers.is_empty(),
            "no set of lags was given: give one or more"
        );
        let states = self.layers[0]
            .lags
            .iter()
            .filter(|lag| **lag != 0.0)
            .count();
        for layer in &self.layers {
            refuse_if!(
                layer.log_prior.len() != count,
                "{count} delays and {} prior weights are given: give one weight for each delay",
                layer.log_prior.len()
            );
            if let Some(lag) = layer
                .lags
                .iter()
                .find(|lag| !(lag.is_finite() && **lag >= 0.0))
            {
                refuse!("a lag is {lag} s: give finite lags of zero or more");
            }
            refuse_if!(
                layer.lags.iter().filter(|lag| **lag != 0.0).count() != states,
                "some sets of lags have a lag of zero, others not: give the same lags in all"
            );
            let best = layer
                .log_prior
                .iter()
                .copied()
                .fold(f64::NEG_INFINITY, f64::max);
            refuse_if!(
                best == f64::INFINITY || best.is_nan(),
                "a prior weight is {best}: give the logarithm of a finite weight"
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
                "{what} of {value}: give a number above zero"
            );
        }
        for (what, value) in [
            ("drift", self.drift),
            ("trim", self.trim),
            ("walk of the gain", self.gain_walk),
        ] {
            refuse_if!(
                !(value.is_finite() && value >= 0.0),
                "{what} of {value}: give a finite number, zero or more"
            );
        }
        refuse_if!(
            !(self.white.is_finite() && self.gain.0.is_finite() && self.gain.1.is_finite()),
            "the white noise is {}, and the gain {} ± {}: give finite numbers",
            self.white,
            self.gain.0,
            self.gain.1
        );
        refuse_if!(
            !(self.level > 0.0 && self.level < 1.0),
            "the level is {}: give a level between 0 and 1",
            self.level
        );
        Ok(())
    }

    /// The number of states of a cell.
    pub(super) fn states(&self) -> usize {
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
