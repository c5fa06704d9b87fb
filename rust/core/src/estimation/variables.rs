//! The variables of a search: what they are in plant and noise, their bounds, and their steps.

use super::likelihood::{Evaluation, Noise, Searched, Through};
use super::point::{Point, Quantity, Timing};
use super::quotients::{Value, Variable};
use super::rows::Rows;

/// Shortest lag of a search, as a share of the time between rows; shorter ones act as a delay.
pub(super) const SHORTEST_LAG: f64 = 1e-3;

/// Ends of the time constant of a disturbance: of the time between rows, and of the record.
const SHORTEST_TIME: f64 = 0.3;
const LONGEST_TIME: f64 = 20.0;

/// Ends of the deviation of the air in white deviations, per record and per row for plants that
/// integrate; of the coloured noise, and of the air before other plants.
const LEAST_DEVIATION: f64 = 1e-3;
pub(super) const MOST_DEVIATION: f64 = 1e5;

/// Steps of difference quotients: of times, in rows; of logarithms; of the gain, as a share of it.
const TIME_STEP: f64 = 2e-3;
const LOG_STEP: f64 = 0.02;
const GAIN_STEP: f64 = 1e-4;

/// Step of the logarithms of the lags that air passes: the covariance of the air bends more by them than
/// by its own numbers.
const AIR_STEP: f64 = 5e-3;

/// Longest steps of the search: of times, in rows; of logarithms; of the gain, as a share of it.
const LONGEST_TIME_STEP: f64 = 1.0;
const LONGEST_LOG_STEP: f64 = 1.2;
const LONGEST_GAIN_STEP: f64 = 0.5;

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

/// A number that a search moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Slot {
    Time,
    Lag(usize),
    Zero,
    Gain,
    AirTime(usize),
    Air(usize),
    SensorTime(usize),
    Sensor(usize),
    Stamps(usize),
    Arrivals(usize),
}

/// What the variables depend on: recordings, what is unknown, whether the plant integrates, the
/// longest delay and lag, and the time between rows, s.
#[derive(Debug, Clone, Copy)]
pub(super) struct Variables<'a> {
    pub(super) runs: &'a [Rows],
    pub(super) free: &'a Free,
    pub(super) integrates: bool,
    pub(super) longest: f64,
    pub(super) row_time: f64,
}

impl Variables<'_> {
    /// What a search moves, with one quantity held if given: the numbers of the mean first.
    pub(super) fn slots(&self, start: &Point, held: Option<Quantity>) -> Vec<Slot> {
        let mut slots = Vec::new();
        if self.free.delay && !matches!(held, Some(Quantity::Delay | Quantity::Total)) {
            slots.push(Slot::Time);
        }
        for (i, free) in self.free.lags.iter().enumerate() {
            if *free && held != Some(Quantity::Lag(i)) {
                slots.push(Slot::Lag(i));
            }
        }
        if self.free.zero && held != Some(Quantity::Zero) {
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
            if noise.stamps > 0.0 {
                slots.push(Slot::Stamps(run));
            }
            if noise.arrivals > 0.0 {
                slots.push(Slot::Arrivals(run));
            }
        }
        slots
    }

    /// A slot as a variable of the search.
    pub(super) fn variable(&self, slot: Slot, start: &Point) -> Variable {
        let row_time = self.row_time;
        let span = |run: usize| self.runs.get(run).map_or(1.0, Rows::span);
        let noise = |run: usize| start.noise.get(run).copied().unwrap_or(Noise::QUIET);
        let logarithm = |start: f64, low: f64, high: f64| Variable {
            start: start.abs().ln(),
            low: low.ln(),
            // A recording may be shorter than a row of the first.
            high: high.max(low).ln(),
            step: LOG_STEP,
            longest: LONGEST_LOG_STEP,
        };
        let time =
            |run, start| logarithm(start, SHORTEST_TIME * row_time, LONGEST_TIME * span(run));
        let scatter =
            |start: f64, most: f64| logarithm(start, LEAST_DEVIATION / most, MOST_DEVIATION / most);
        match slot {
            Slot::Time => Variable {
                start: match start.timing {
                    Timing::Delay(time) | Timing::Total(time) => time,
                },
                low: match start.timing {
                    // A zero may be longer than delay and lags.
                    Timing::Total(_) if start.zero > 0.0 || self.free.zero => -self.longest,
                    _ => 0.0,
                },
                high: self.longest,
                step: TIME_STEP * row_time,
                longest: LONGEST_TIME_STEP * row_time,
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
                longest: LONGEST_TIME_STEP * row_time,
            },
            Slot::Gain => Variable {
                start: start.gain,
                low: f64::NEG_INFINITY,
                high: f64::INFINITY,
                step: GAIN_STEP * start.gain.abs().max(f64::MIN_POSITIVE),
                longest: LONGEST_GAIN_STEP * start.gain.abs().max(f64::MIN_POSITIVE),
            },
            Slot::AirTime(run) => time(run, noise(run).air_time),
            Slot::SensorTime(run) => time(run, noise(run).sensor_time),
            Slot::Air(run) => {
                let (low, high) = if self.integrates {
                    (LEAST_DEVIATION / span(run), MOST_DEVIATION / row_time)
                } else {
                    (LEAST_DEVIATION, MOST_DEVIATION)
                };
                logarithm(noise(run).air, low, high)
            }
            Slot::Sensor(run) => logarithm(noise(run).sensor, LEAST_DEVIATION, MOST_DEVIATION),
            // What the scatter moves a row by is a deviation like the others.
            Slot::Stamps(run) => scatter(
                noise(run).stamps,
                self.runs.get(run).map_or(1.0, Rows::top_speed),
            ),
            Slot::Arrivals(run) => scatter(
                noise(run).arrivals,
                self.runs.get(run).map_or(1.0, Rows::largest_jump),
            ),
        }
    }

    /// The same noise with each lag and the zero that its air passes a step up and down, with the place
    /// of the variable and the step.
    pub(super) fn moved_lags(
        &self,
        slots: &[Slot],
        own: &Through,
    ) -> Vec<(usize, f64, [Through; 2])> {
        if own.noise.air == 0.0 {
            return Vec::new();
        }
        let moved = |(place, slot): (usize, &Slot)| {
            let mut both = [own.clone(), own.clone()];
            let step = match *slot {
                Slot::Lag(i) => {
                    both[0].lags[i] *= AIR_STEP.exp();
                    both[1].lags[i] *= (-AIR_STEP).exp();
                    AIR_STEP
                }
                Slot::Zero => {
                    let step = TIME_STEP * self.row_time;
                    both[0].zero += step;
                    both[1].zero -= step;
                    step
                }
                _ => return None,
            };
            Some((place, step, both))
        };
        let of_mean = slots[..mean_slots(slots)].iter().enumerate();
        of_mean.filter_map(moved).collect()
    }

    /// The part of one recording, with its derivatives by the variables of the mean, which come first;
    /// the gain may be `searched`.
    pub(super) fn part(
        &self,
        slots: &[Slot],
        point: &Point,
        searched: bool,
        part: &Evaluation,
    ) -> Value {
        let count = mean_slots(slots);
        let mut found = Value::new(part.objective, count);
        let from_lags = usize::from(searched) + usize::from(self.free.delay);
        let is_by = |i: usize| self.free.lags.get(i) == Some(&true) && point.lags[i] != 0.0;
        let zero = from_lags + (0..point.lags.len()).filter(|i| is_by(*i)).count();
        // With the sum of the times as a variable, the delay follows the lags.
        let with_delay = |own: (usize, f64), later: f64| {
            let mut moves = vec![own];
            if matches!(point.timing, Timing::Total(_)) && self.free.delay {
                moves.push((usize::from(searched), later));
            }
            moves
        };
        // By which of the searched numbers each variable moves the mean, and how much.
        let moves: Vec<Vec<(usize, f64)>> = slots[..count]
            .iter()
            .map(|slot| match *slot {
                Slot::Gain => vec![(0, 1.0)],
                Slot::Time => vec![(usize::from(searched), 1.0)],
                Slot::Lag(i) => {
                    let lag = point.lags[i];
                    let place = from_lags + (0..i).filter(|i| is_by(*i)).count();
                    with_delay((place, lag), -lag)
                }
                _ => with_delay((zero, 1.0), 1.0),
            })
            .collect();
        let Searched { slope, curvature } = &part.searched;
        for (i, moves_i) in moves.iter().enumerate() {
            for (a, by_a) in moves_i {
                found.slope[i] += by_a * slope[*a];
                for (j, moves_j) in moves.iter().enumerate() {
                    for (b, by_b) in moves_j {
                        found.curvature[i * count + j] +=
                            by_a * by_b * curvature[a * slope.len() + b];
                    }
                }
            }
        }
        found
    }
}

/// Number of the variables that move the mean; they come first.
pub(super) fn mean_slots(slots: &[Slot]) -> usize {
    let of_mean =
        |slot: &&Slot| matches!(slot, Slot::Time | Slot::Lag(_) | Slot::Zero | Slot::Gain);
    slots.iter().take_while(of_mean).count()
}

/// Put the value of a variable into a point.
pub(super) fn put(point: &mut Point, slot: Slot, value: f64) {
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
        Slot::Stamps(run) => point.noise[run].stamps = value.exp(),
        Slot::Arrivals(run) => point.noise[run].arrivals = value.exp(),
    }
}
