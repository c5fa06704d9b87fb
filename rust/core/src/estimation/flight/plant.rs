//! A plant as it is fitted: a known part of unit gain behind lags, and what of it is unknown.

use super::super::fit::Model;
use super::super::plant::Plant;
use super::super::point::Quantity;
use super::super::rows::Rows;
use super::super::variables::Free;
use super::tolerances::START;
use crate::Error;

/// A plant as it is fitted.
#[derive(Debug, Clone, PartialEq)]
pub struct FlightPlant {
    /// The known part of unit gain, in descending powers of s.
    pub num: Vec<f64>,
    /// As long as its degree and one.
    pub den: Vec<f64>,
    /// The lags before it, s, from which their search starts.
    pub lags: Vec<f64>,
    /// What is unknown.
    pub free: Free,
    /// The zero behind the lags, s.
    pub zero: f64,
    /// The lag of num/den, s, where it counts among those of the plant.
    pub own_lag: f64,
    /// Does air act behind the lags, not through them?
    pub air_behind_lags: bool,
    /// Is the lag a time constant, of which the size is known?
    pub time_constant: bool,
}

impl FlightPlant {
    /// A plant num/den of which delay, gain and so many lags are unknown.
    pub fn new(num: Vec<f64>, den: Vec<f64>, lags: usize) -> Self {
        Self {
            num,
            den,
            lags: vec![0.0; lags],
            free: Free {
                delay: true,
                gain: true,
                lags: vec![true; lags],
                zero: false,
            },
            zero: 0.0,
            own_lag: 0.0,
            air_behind_lags: false,
            time_constant: false,
        }
    }

    /// Does a constant input let the output grow?
    pub fn integrates(&self) -> bool {
        self.den.len() > 1 && self.den.last() == Some(&0.0)
    }

    /// The same with a further lag, which is free.
    #[must_use]
    pub fn with_lag(&self) -> Self {
        let mut richer = self.clone();
        richer.lags.push(0.0);
        richer.free.lags.push(true);
        richer
    }

    /// The free numbers that all recordings share, in the order of their covariance.
    pub fn common(&self) -> Vec<Quantity> {
        let lags = self.free.lags.iter().enumerate();
        let lags = lags
            .filter(|(_, free)| **free)
            .map(|(i, _)| Quantity::Lag(i));
        let known = [
            (self.free.gain, Quantity::Gain),
            (self.free.delay, Quantity::Delay),
        ];
        let known = known
            .into_iter()
            .filter(|(free, _)| *free)
            .map(|(_, quantity)| quantity);
        let zero = self.free.zero.then_some(Quantity::Zero);
        known.chain(lags).chain(zero).collect()
    }

    /// The likelihood of these recordings, with or without a constant input besides the command.
    ///
    /// # Errors
    ///
    /// As for `Model::new`.
    pub fn model(&self, runs: Vec<Rows>, trim: bool) -> Result<Model, Error> {
        let longest = longest_delay(&runs);
        let plant = Plant::new(&self.num, &self.den)?.with_air_behind_lags(self.air_behind_lags);
        let runs = runs.into_iter().map(|rows| Rows { trim, ..rows }).collect();
        Model::new(plant, runs, self.free.clone(), longest)
    }
}

/// The longest delay of a search in these recordings, s.
pub(super) fn longest_delay(runs: &[Rows]) -> f64 {
    let spans = runs.iter().map(|rows| START.longest * rows.span());
    spans.fold(f64::INFINITY, f64::min)
}
