//! Misfit of the response of a plant to its commands, for least squares.
//!
//! y(t) = b + a F(t − T; lag): F is the response of unit gain to the commands as they were held, a the
//! gain, b the output at the start. That of an integrator has a closed form; any other plant is
//! propagated, and its derivatives are central difference quotients with an error of about 1e-9 of F.

use super::least_squares::Part;
use super::literature::HeldPath;
use super::path::held_response;
use super::plant::Plant;
use crate::dde::RateLimits;
use crate::{Error, Task};

/// Relative step of difference quotients: of a time constant, or of the time between two commands.
const STEP: f64 = 1e-5;

/// Relative step of quotients by limits of the rate: more is less exact, less has more rounding.
const LIMIT_STEP: f64 = 1e-4;

/// The number of a point, or of what is known, that a place holds.
const DELAY: usize = 0;
const GAIN: usize = 1;
const SLOW: usize = 2;
const RATE: usize = 3;

/// A plant of unit gain.
#[derive(Debug, Clone)]
pub enum UnitPlant {
    /// 1/(s (lag s + 1)).
    Integrator,
    /// 1/(T s + 1).
    Lag,
    /// All its numbers are known.
    Known(Plant),
}

/// One recording.
#[derive(Debug, Clone)]
pub struct Commanded {
    /// Times of the rows, s.
    pub time: Vec<f64>,
    /// The output.
    pub output: Vec<f64>,
    /// From when each command holds, s, and the commands.
    pub commands: (Vec<f64>, Vec<f64>),
    /// The plant.
    pub plant: UnitPlant,
    /// Are there limits of the rate of the command?
    pub is_limited: bool,
    /// Delay, gain, lag or time constant, the limits of rate and of its rate.
    pub known: [f64; 5],
    /// The places of these among the numbers that are fitted, in their order.
    pub places: [Option<usize>; 5],
    /// The output at the start; fitted too, as the last number, where there is none.
    pub start: Option<f64>,
}

impl Commanded {
    fn values(&self, point: &[f64]) -> [f64; 5] {
        std::array::from_fn(|i| self.places[i].map_or(self.known[i], |place| point[place]))
    }

    /// The commands that the plant gets.
    fn sent(&self, values: &[f64; 5]) -> Result<(Vec<f64>, Vec<f64>), Error> {
        let (time, command) = &self.commands;
        if !self.is_limited {
            return Ok(self.commands.clone());
        }
        let limits = RateLimits::new(values[RATE], values[RATE + 1])?;
        limits.held(time, command, RateLimits::PIECES)
    }

    /// F at some times.
    fn path(&self, times: &[f64], values: &[f64; 5], task: &Task) -> Result<Vec<f64>, Error> {
        let (time, command) = self.sent(values)?;
        match &self.plant {
            UnitPlant::Integrator => Ok(HeldPath::new(time, command).at(times, values[SLOW]).value),
            UnitPlant::Lag => {
                let plant = Plant::new(&[1.0], &[values[SLOW], 1.0])?;
                held_response(&plant, &time, &command, times, task)
            }
            UnitPlant::Known(plant) => held_response(plant, &time, &command, times, task),
        }
    }

    /// Difference quotient of F by a number.
    fn quotient(
        &self,
        times: &[f64],
        values: &[f64; 5],
        (number, share): (usize, f64),
        task: &Task,
    ) -> Result<Vec<f64>, Error> {
        let step = share * values[number].abs();
        let at = |by: f64| {
            let mut moved = *values;
            moved[number] += by;
            self.path(times, &moved, task)
        };
        Ok(quotient(&at(step)?, &at(-step)?, step))
    }

    /// dF/dt, and dF/dlag of an integrator.
    fn rates(
        &self,
        times: &[f64],
        values: &[f64; 5],
        task: &Task,
    ) -> Result<(Vec<f64>, Vec<f64>), Error> {
        let (time, command) = self.sent(values)?;
        if matches!(self.plant, UnitPlant::Integrator) {
            let found = HeldPath::new(time, command).at(times, values[SLOW]);
            return Ok((found.rate, found.by_lag));
        }
        let span = time
            .last()
            .zip(time.first())
            .map_or(1.0, |(last, first)| last - first);
        let step = STEP * span / (time.len().max(2) - 1) as f64;
        let at = |by: f64| {
            let moved: Vec<f64> = times.iter().map(|time| time + by).collect();
            self.path(&moved, values, task)
        };
        Ok((quotient(&at(step)?, &at(-step)?, step), Vec::new()))
    }

    fn times(&self, values: &[f64; 5]) -> Vec<f64> {
        self.time.iter().map(|time| time - values[DELAY]).collect()
    }
}

fn quotient(higher: &[f64], lower: &[f64], step: f64) -> Vec<f64> {
    let pairs = higher.iter().zip(lower);
    pairs
        .map(|(high, low)| (high - low) / (2.0 * step))
        .collect()
}

impl Part for Commanded {
    fn misfit(&self, point: &[f64], task: &Task) -> Result<Vec<f64>, Error> {
        let values = self.values(point);
        let start = self.start.or(point.last().copied()).unwrap_or(0.0);
        let path = self.path(&self.times(&values), &values, task)?;
        let rows = path.iter().zip(&self.output);
        Ok(rows.map(|(f, y)| values[GAIN] * f + (start - y)).collect())
    }

    fn slopes(&self, point: &[f64], task: &Task) -> Result<Vec<Vec<f64>>, Error> {
        let values = self.values(point);
        let times = self.times(&values);
        let (rate, by_lag) = self.rates(&times, &values, task)?;
        let count = point.len() - usize::from(self.start.is_none());
        let mut columns = vec![Vec::new(); count];
        for (number, place) in self.places.iter().enumerate() {
            let Some(place) = *place else { continue };
            let (own, factor) = match number {
                DELAY => (rate.clone(), -values[GAIN]),
                GAIN => (self.path(&times, &values, task)?, 1.0),
                SLOW if !by_lag.is_empty() => (by_lag.clone(), values[GAIN]),
                _ => {
                    let share = if number == SLOW { STEP } else { LIMIT_STEP };
                    let own = self.quotient(&times, &values, (number, share), task)?;
                    (own, values[GAIN])
                }
            };
            columns[place] = own.iter().map(|x| factor * x).collect();
        }
        if self.start.is_none() {
            columns.push(vec![1.0; self.time.len()]);
        }
        Ok(columns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn recorded(plant: UnitPlant, is_limited: bool, slow: f64) -> Commanded {
        let time: Vec<f64> = (0..80).map(|k| 0.05 * f64::from(k)).collect();
        let command: Vec<f64> = time.iter().map(|t| (2.0 * t).sin().signum()).collect();
        Commanded {
            output: vec![0.0; 80],
            commands: (time.clone(), command),
            time,
            plant,
            is_limited,
            known: [0.123, 0.8, slow, 4.0, 30.0],
            places: [Some(0), Some(1), Some(2), None, None],
            start: None,
        }
    }

    /// Columns are the slopes of the misfit between the points around.
    fn check(own: &Commanded, point: &[f64]) {
        let task = Task::new();
        let columns = own.slopes(point, &task).unwrap();
        for (place, column) in columns.iter().enumerate() {
            let at = |by: f64| {
                let mut moved = point.to_vec();
                moved[place] += by;
                own.misfit(&moved, &task).unwrap()
            };
            for (slope, found) in quotient(&at(1e-6), &at(-1e-6), 1e-6).iter().zip(column) {
                assert!((slope - found).abs() < 2e-4, "{place}: {slope} {found}");
            }
        }
    }

    #[test]
    fn derivatives_are_those_of_the_misfit() {
        let point = [0.131, 0.9, 0.21, 0.03];
        check(&recorded(UnitPlant::Integrator, false, 0.2), &point);
        check(&recorded(UnitPlant::Lag, false, 0.2), &point);
        check(&recorded(UnitPlant::Lag, true, 0.2), &point);
        let mut limited = recorded(UnitPlant::Integrator, true, 0.2);
        limited.places = [Some(0), Some(1), None, Some(2), Some(3)];
        check(&limited, &[0.131, 0.9, 4.3, 27.0, 0.03]);
    }

    #[test]
    fn a_known_plant_is_one_of_the_others() {
        let lag = recorded(UnitPlant::Lag, false, 0.2);
        let known = Plant::new(&[1.0], &[0.2, 1.0]).unwrap();
        let mut same = recorded(UnitPlant::Known(known), false, f64::NAN);
        same.places = [Some(0), Some(1), None, None, None];
        let task = Task::new();
        let one = lag.misfit(&[0.131, 0.9, 0.2, 0.03], &task).unwrap();
        let other = same.misfit(&[0.131, 0.9, 0.03], &task).unwrap();
        assert_eq!(one, other);
    }
}
