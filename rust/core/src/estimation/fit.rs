//! The numbers of plant and noise at which the likelihood of one or more recordings is largest.

use super::likelihood::{Derivatives, Evaluation, Gain, Noise, Rows, Values, Wanted, evaluate};
use super::plant::Plant;
use super::profile::Quantity;
use super::search::{Variable, minimise};
use crate::{Error, Task};

/// Shortest lag of a search, as a share of the time between rows; shorter ones act as a delay.
pub(super) const SHORTEST_LAG: f64 = 1e-3;

/// Ends of the time constant of a disturbance: of the time between rows, and of the record.
const SHORTEST_TIME: f64 = 0.3;
const LONGEST_TIME: f64 = 20.0;

/// Ends of the deviation of the air in white deviations, per record and per row for plants that
/// integrate; of the coloured noise, and of the air before other plants.
const LEAST_DEVIATION: f64 = 1e-3;
const MOST_DEVIATION: f64 = 1e5;

/// Steps of difference quotients: of times, in rows; of logarithms; of the gain, as a share of it.
const TIME_STEP: f64 = 2e-3;
const LOG_STEP: f64 = 0.02;
const GAIN_STEP: f64 = 1e-4;

/// Rise of the objective by a row of negative delay.
const PENALTY: f64 = 1e4;

/// What is unknown.
#[derive(Debug, Clone, PartialEq)]
pub struct Free {
    /// The delay.
    pub delay: bool,
    /// The gain.
    pub gain: bool,
    /// Each lag.
    pub lags: Vec<bool>,
    /// The zero.
    pub zero: bool,
}

/// Recordings of one plant with what is unknown about it.
#[derive(Debug, Clone, PartialEq)]
pub struct Model {
    /// The given part of the plant.
    pub plant: Plant,
    /// The recordings.
    pub runs: Vec<Rows>,
    /// What is unknown.
    pub free: Free,
    /// Longest delay and lag, s.
    pub longest: f64,
}

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

/// A maximum of the likelihood.
#[derive(Debug, Clone, PartialEq)]
pub struct Fit {
    /// Where.
    pub point: Point,
    /// −2 ln L there, but for a constant.
    pub objective: f64,
}

/// A number that a search moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Slot {
    Time,
    Lag(usize),
    Zero,
    Gain,
    AirTime(usize),
    Air(usize),
    SensorTime(usize),
    Sensor(usize),
}

impl Model {
    /// Time between rows, s: the median of the first recording.
    pub(super) fn row_time(&self) -> f64 {
        let mut between: Vec<f64> = self
            .runs
            .first()
            .map(|run| run.time.windows(2).map(|pair| pair[1] - pair[0]).collect())
            .unwrap_or_default();
        between.sort_by(f64::total_cmp);
        between.get(between.len() / 2).copied().unwrap_or(1.0)
    }

    fn gain_at(&self, point: &Point, held: Option<Quantity>) -> Gain {
        if !self.free.gain {
            Gain::Known(point.gain)
        } else if self.runs.len() > 1 || held == Some(Quantity::Gain) {
            Gain::Searched(point.gain)
        } else {
            Gain::Eliminated
        }
    }

    /// One recording at a point.
    ///
    /// # Errors
    ///
    /// If there are fewer rows than unknowns, or after a request to stop.
    pub fn at(
        &self,
        run: usize,
        point: &Point,
        held: Option<Quantity>,
        all: bool,
        task: &Task,
    ) -> Result<Evaluation, Error> {
        let values = Values {
            delay: point.delay().max(0.0),
            lags: point.lags.clone(),
            zero: point.zero,
            gain: self.gain_at(point, held),
        };
        let by = Derivatives {
            delay: self.free.delay,
            lags: self.free.lags.clone(),
            zero: self.free.zero,
        };
        let wanted = if all { Wanted::All } else { Wanted::Objective };
        let (Some(rows), Some(noise)) = (self.runs.get(run), point.noise.get(run)) else {
            refuse!("recording {run} of {}", self.runs.len())
        };
        evaluate(rows, &self.plant, &values, noise, &by, wanted, task)
    }

    /// −2 ln L of all recordings.
    ///
    /// # Errors
    ///
    /// As for `at`.
    pub fn objective(
        &self,
        point: &Point,
        held: Option<Quantity>,
        task: &Task,
    ) -> Result<f64, Error> {
        let mut sum = PENALTY * (-point.delay() / self.row_time()).max(0.0);
        for run in 0..self.runs.len() {
            sum += self.at(run, point, held, false, task)?.objective;
        }
        Ok(sum)
    }

    /// The maximum of the likelihood from a starting point, with one quantity held if given.
    ///
    /// The search ends where a step promises less than `tolerance` of −2 ln L.
    ///
    /// # Errors
    ///
    /// As for `at`.
    pub fn fit(
        &self,
        start: &Point,
        held: Option<Quantity>,
        tolerance: f64,
        task: &Task,
    ) -> Result<Fit, Error> {
        let row_time = self.row_time();
        let slots = self.slots(start, held);
        let variables: Vec<Variable> = slots
            .iter()
            .map(|slot| self.variable(*slot, start, row_time))
            .collect();
        let mut penalty_row = row_time;
        if !(penalty_row > 0.0) {
            penalty_row = 1.0;
        }
        let mut trial = start.clone();
        // Recordings whose numbers did not change keep their part of the sum.
        let mut kept: Vec<Option<(Point, f64)>> = vec![None; self.runs.len()];
        let found = minimise(&variables, tolerance, |z| {
            for (slot, value) in slots.iter().zip(z) {
                put(&mut trial, *slot, *value);
            }
            let mut sum = PENALTY * (-trial.delay() / penalty_row).max(0.0);
            for run in 0..self.runs.len() {
                let mut own = trial.clone();
                if self.runs.len() > 1 {
                    own.noise = trial.noise.get(run).copied().into_iter().collect();
                }
                let part = match kept.get(run) {
                    Some(Some((point, value))) if *point == own => *value,
                    _ => self.at(run, &trial, held, false, task)?.objective,
                };
                if let Some(place) = kept.get_mut(run) {
                    *place = Some((own, part));
                }
                sum += part;
            }
            Ok(sum)
        })?;
        let mut point = start.clone();
        for (slot, value) in slots.iter().zip(&found.place) {
            put(&mut point, *slot, *value);
        }
        Ok(Fit {
            point,
            objective: found.value,
        })
    }

    fn slots(&self, start: &Point, held: Option<Quantity>) -> Vec<Slot> {
        let mut slots = Vec::new();
        if self.free.delay && !matches!(held, Some(Quantity::Delay | Quantity::Total)) {
            slots.push(Slot::Time);
        }
        for (i, free) in self.free.lags.iter().enumerate() {
            if *free && held != Some(Quantity::Lag(i)) {
                slots.push(Slot::Lag(i));
            }
        }
        if self.free.zero {
            slots.push(Slot::Zero);
        }
        if self.free.gain && self.runs.len() > 1 && held != Some(Quantity::Gain) {
            slots.push(Slot::Gain);
        }
        for (run, noise) in start.noise.iter().enumerate() {
            if noise.air > 0.0 {
                slots.extend([Slot::AirTime(run), Slot::Air(run)]);
            }
            if noise.sensor > 0.0 {
                slots.extend([Slot::SensorTime(run), Slot::Sensor(run)]);
            }
        }
        slots
    }

    fn variable(&self, slot: Slot, start: &Point, row_time: f64) -> Variable {
        let span = |run: usize| {
            self.runs.get(run).map_or(1.0, |rows| {
                let ends = (rows.time.first(), rows.time.last());
                if let (Some(first), Some(last)) = ends {
                    last - first
                } else {
                    1.0
                }
            })
        };
        let noise = |run: usize| start.noise.get(run).copied().unwrap_or(QUIET);
        let logarithm = |start: f64, low: f64, high: f64| Variable {
            start: start.abs().ln(),
            low: low.ln(),
            high: high.ln(),
            step: LOG_STEP,
        };
        let time =
            |run, start| logarithm(start, SHORTEST_TIME * row_time, LONGEST_TIME * span(run));
        match slot {
            Slot::Time => Variable {
                start: match start.timing {
                    Timing::Delay(time) | Timing::Total(time) => time,
                },
                low: 0.0,
                high: self.longest,
                step: TIME_STEP * row_time,
            },
            Slot::Lag(i) => logarithm(
                start.lags.get(i).copied().unwrap_or(row_time),
                SHORTEST_LAG * row_time,
                self.longest,
            ),
            Slot::Zero => Variable {
                start: start.zero,
                low: -self.longest,
                high: self.longest,
                step: TIME_STEP * row_time,
            },
            Slot::Gain => Variable {
                start: start.gain,
                low: f64::NEG_INFINITY,
                high: f64::INFINITY,
                step: GAIN_STEP * start.gain.abs().max(f64::MIN_POSITIVE),
            },
            Slot::AirTime(run) => time(run, noise(run).air_time),
            Slot::SensorTime(run) => time(run, noise(run).sensor_time),
            Slot::Air(run) => {
                let (low, high) = if self.plant.integrates() {
                    (LEAST_DEVIATION / span(run), MOST_DEVIATION / row_time)
                } else {
                    (LEAST_DEVIATION, MOST_DEVIATION)
                };
                logarithm(noise(run).air, low, high)
            }
            Slot::Sensor(run) => logarithm(noise(run).sensor, LEAST_DEVIATION, MOST_DEVIATION),
        }
    }
}

/// No noise but white noise.
const QUIET: Noise = Noise {
    air_time: 1.0,
    air: 0.0,
    sensor_time: 1.0,
    sensor: 0.0,
};

/// Put the value of a variable into a point.
fn put(point: &mut Point, slot: Slot, value: f64) {
    match slot {
        Slot::Time => {
            point.timing = match point.timing {
                Timing::Delay(_) => Timing::Delay(value),
                Timing::Total(_) => Timing::Total(value),
            }
        }
        Slot::Lag(i) => point.lags[i] = value.exp().copysign(point.lags[i]),
        Slot::Zero => point.zero = value,
        Slot::Gain => point.gain = value,
        Slot::AirTime(run) => point.noise[run].air_time = value.exp(),
        Slot::Air(run) => point.noise[run].air = value.exp(),
        Slot::SensorTime(run) => point.noise[run].sensor_time = value.exp(),
        Slot::Sensor(run) => point.noise[run].sensor = value.exp(),
    }
}
