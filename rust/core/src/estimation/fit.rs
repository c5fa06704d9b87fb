//! The numbers of plant and noise at which the likelihood of one or more recordings is largest.

use super::likelihood::{Evaluation, Noise, Through, Wanted, evaluate, evaluations};
use super::mean::{Derivatives, Gain, Values};
use super::over_delays::over_delays;
use super::plant::{MOST_STATES, Plant};
use super::point::{Point, Quantity, Timing};
use super::quotients::{Function, Slack, Value, Variable};
use super::rows::Rows;
use super::search::{Accuracy, minimise};
use super::variables::{Free, SHORTEST_LAG, Slot, Variables, mean_slots, put};
use super::waves::{Waves, waves};
use crate::{Error, Task};

/// Rise of the objective by a row of negative delay.
const PENALTY: f64 = 1e4;

/// A delay of so many rows is rounding.
const ROUNDING: f64 = 1e-9;

/// Recordings of one plant with what is unknown about it.
#[derive(Debug, Clone, PartialEq)]
pub struct Model {
    plant: Plant,
    runs: Vec<Rows>,
    pub(super) free: Free,
    /// Longest delay and lag, s.
    pub(super) longest: f64,
    /// Time between rows, s: the median of the first recording.
    pub(super) row_time: f64,
}

/// A maximum of the likelihood.
#[derive(Debug, Clone, PartialEq)]
pub struct Fit {
    /// Where.
    pub point: Point,
    /// −2 ln L there, but for a constant.
    pub objective: f64,
}

/// What a search moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Search {
    /// The numbers of the mean alone.
    Mean,
    /// Those of the noise too.
    All,
}

impl Model {
    /// Recordings of one plant, the given part `plant` of which follows the lags, and the longest
    /// delay and lag, s.
    ///
    /// # Errors
    ///
    /// If there is no recording, or a number is out of its range.
    pub fn new(plant: Plant, runs: Vec<Rows>, free: Free, longest: f64) -> Result<Self, Error> {
        let Some(first) = runs.first() else {
            refuse!("no recording was given: give at least one")
        };
        let row_time = first.row_time();
        refuse_if!(
            !(longest.is_finite() && longest >= SHORTEST_LAG * row_time),
            "the longest delay is {longest} s, and rows are {row_time} s apart: give a delay of \
             at least a thousandth of this time"
        );
        refuse_if!(
            free.zero && free.lags.is_empty() && !plant.takes_zero(),
            "a zero cannot be fitted without a lag: give the plant a lag"
        );
        let states = plant.states(free.lags.len());
        refuse_if!(
            states > MOST_STATES,
            "the plant with its lags has {states} states, but the likelihood can use at most \
             {MOST_STATES}"
        );
        Ok(Self {
            plant,
            runs,
            free,
            longest,
            row_time,
        })
    }

    /// The point with its lags measured from the delay if that is known or a lag is negative, and
    /// from both together otherwise: their sum is known better than each.
    pub fn timed(&self, mut point: Point) -> Point {
        point.timing = if self.free.delay && point.lags.iter().all(|lag| *lag >= 0.0) {
            Timing::Total(point.total())
        } else {
            Timing::Delay(point.delay())
        };
        point
    }

    /// An error unless the point is one of this model.
    fn check(&self, point: &Point) -> Result<(), Error> {
        refuse_if!(
            point.lags.len() != self.free.lags.len() || point.noise.len() != self.runs.len(),
            "{} lags and the noise of {} recordings are given, but this likelihood has {} lags \
             and {} recordings",
            point.lags.len(),
            point.noise.len(),
            self.free.lags.len(),
            self.runs.len()
        );
        let named = [
            ("delay", point.delay()),
            ("zero", point.zero),
            ("gain", point.gain),
        ];
        let lags = point.lags.iter().map(|lag| ("lag", *lag));
        for (name, value) in named.into_iter().chain(lags) {
            refuse_if!(
                !value.is_finite(),
                "the {name} is {value}: give a finite number"
            );
        }
        point.noise.iter().try_for_each(Noise::check)
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
    /// If there are fewer rows than unknowns, for a point that is not one of this model, and after a
    /// request to stop.
    pub fn at(&self, run: usize, point: &Point, task: &Task) -> Result<Evaluation, Error> {
        self.check(point)?;
        self.part(run, point, None, Wanted::All, task)
    }

    /// One recording at a point under each of these noises in the place of its own, without what has a
    /// value for each row.
    ///
    /// # Errors
    ///
    /// As for `at`, and for numbers that are not those of noise.
    pub fn under(
        &self,
        run: usize,
        point: &Point,
        noises: &[Noise],
        task: &Task,
    ) -> Result<Vec<Evaluation>, Error> {
        self.check(point)?;
        noises.iter().try_for_each(Noise::check)?;
        let (values, by) = self.mean(point, None);
        let (rows, _) = self.recorded(run, point)?;
        let noises: Vec<Through> = noises.iter().map(|one| one.through(&values)).collect();
        let wanted = Wanted::Covariance;
        evaluations(rows, &self.plant, &values, &noises, &by, wanted, task)
    }

    /// What delays that change by so many waves over the commands do to the rows of one recording.
    ///
    /// # Errors
    ///
    /// As for `at`.
    pub fn waves(
        &self,
        run: usize,
        point: &Point,
        number: usize,
        task: &Task,
    ) -> Result<Waves, Error> {
        self.check(point)?;
        let (values, by) = self.mean(point, None);
        let (rows, noise) = self.recorded(run, point)?;
        let through = noise.through(&values);
        waves(rows, &self.plant, &values, &through, &by, number, task)
    }

    /// The rows of a recording and its noise.
    fn recorded<'a>(
        &'a self,
        run: usize,
        point: &'a Point,
    ) -> Result<(&'a Rows, &'a Noise), Error> {
        let (Some(rows), Some(noise)) = (self.runs.get(run), point.noise.get(run)) else {
            refuse!(
                "recording number {run} does not exist: give a number below {}",
                self.runs.len()
            )
        };
        Ok((rows, noise))
    }

    /// The numbers of the mean at a point, and by which there are derivatives.
    fn mean(&self, point: &Point, held: Option<Quantity>) -> (Values, Derivatives) {
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
        (values, by)
    }

    fn part(
        &self,
        run: usize,
        point: &Point,
        held: Option<Quantity>,
        wanted: Wanted,
        task: &Task,
    ) -> Result<Evaluation, Error> {
        let (values, by) = self.mean(point, held);
        let (rows, noise) = self.recorded(run, point)?;
        let noise = noise.through(&values);
        evaluate(rows, &self.plant, &values, &noise, &by, wanted, task)
    }

    /// −2 ln L of all recordings.
    ///
    /// # Errors
    ///
    /// As for `at`.
    pub fn objective(&self, point: &Point, task: &Task) -> Result<f64, Error> {
        self.check(point)?;
        let mut sum = self.penalty(point);
        for run in 0..self.runs.len() {
            sum += self.part(run, point, None, Wanted::Slopes, task)?.objective;
        }
        Ok(sum)
    }

    /// −2 ln L of all recordings at each of these delays and the other numbers of a point; finite also
    /// where the numbers that are searched cannot be told apart.
    ///
    /// # Errors
    ///
    /// As for `at`.
    pub fn over_delays(
        &self,
        point: &Point,
        delays: &[f64],
        task: &Task,
    ) -> Result<Vec<f64>, Error> {
        self.check(point)?;
        let mut at = point.clone();
        let (values, by) = self.mean(point, None);
        let mut sums = Vec::with_capacity(delays.len());
        for delay in delays {
            at.timing = Timing::Delay(*delay);
            sums.push(self.penalty(&at));
        }
        for (run, (rows, noise)) in self.runs.iter().zip(&point.noise).enumerate() {
            // A page does without the fast method, to stay small.
            let all = if cfg!(target_family = "wasm") {
                None
            } else {
                over_delays(rows, &self.plant, &values, noise, &by, delays, task)?
            };
            let mut all = all.into_iter().flatten();
            for (sum, delay) in sums.iter_mut().zip(delays) {
                *sum += if let Some(value) = all.next() {
                    value
                } else {
                    at.timing = Timing::Delay(*delay);
                    self.part(run, &at, None, Wanted::Value, task)?.objective
                };
            }
        }
        Ok(sums)
    }

    /// What a negative delay costs.
    fn penalty(&self, point: &Point) -> f64 {
        PENALTY * (-point.delay() / self.row_time).max(0.0)
    }

    /// The maximum of the likelihood from a starting point, with one quantity held if given.
    ///
    /// The search ends where a step promises less than `tolerance` of −2 ln L. The noise stays as it
    /// is unless it is searched too.
    ///
    /// # Errors
    ///
    /// As for `at`.
    pub fn fit(
        &self,
        start: &Point,
        held: Option<Quantity>,
        searched: Search,
        tolerance: f64,
        task: &Task,
    ) -> Result<Fit, Error> {
        refuse_if!(
            !(tolerance.is_finite() && tolerance > 0.0),
            "a tolerance of {tolerance}: give a finite number above zero"
        );
        let mut accuracy = Accuracy::of(tolerance);
        // The numbers of the mean alone are those of least squares on whitened rows.
        accuracy.takes_known |= searched == Search::Mean;
        self.fit_near(start, held, searched, accuracy, &mut None, task)
    }

    /// The same from the inverse Hessian of a search near by, if there was one, which becomes that of
    /// this one.
    pub(super) fn fit_near(
        &self,
        start: &Point,
        held: Option<Quantity>,
        searched: Search,
        accuracy: Accuracy,
        near: &mut Option<Vec<f64>>,
        task: &Task,
    ) -> Result<Fit, Error> {
        self.check(start)?;
        let by = Variables {
            runs: &self.runs,
            free: &self.free,
            integrates: self.plant.integrates(),
            longest: self.longest,
            row_time: self.row_time,
        };
        let mut slots = by.slots(start, held);
        if searched == Search::Mean {
            slots.truncate(mean_slots(&slots));
        }
        let variables: Vec<Variable> = slots.iter().map(|slot| by.variable(*slot, start)).collect();
        let sum = Sum {
            model: self,
            by,
            slots: &slots,
            held,
            trial: start.clone(),
            kept: vec![None; self.runs.len()],
            task,
        };
        let found = minimise(&variables, accuracy, near, sum)?;
        let mut point = start.clone();
        for (slot, value) in slots.iter().zip(&found.place) {
            put(&mut point, *slot, *value);
        }
        if matches!(point.timing, Timing::Total(_))
            && point.delay().abs() < ROUNDING * self.row_time
        {
            point.timing = Timing::Total(point.lag());
        }
        Ok(Fit {
            point,
            objective: found.value,
        })
    }
}

/// −2 ln L of all recordings as the function of a search.
struct Sum<'a> {
    model: &'a Model,
    by: Variables<'a>,
    slots: &'a [Slot],
    held: Option<Quantity>,
    trial: Point,
    /// Recordings whose numbers did not change keep their part of the sum.
    kept: Vec<Option<(Point, Value)>>,
    task: &'a Task,
}

impl Sum<'_> {
    /// Move to a place; the numbers there that a recording depends on, for each.
    fn moved(&mut self, place: &[f64]) -> Vec<Point> {
        for (slot, value) in self.slots.iter().zip(place) {
            put(&mut self.trial, *slot, *value);
        }
        let noise = self.trial.noise.iter();
        noise
            .map(|noise| Point {
                noise: vec![*noise],
                ..self.trial.clone()
            })
            .collect()
    }

    /// The function at places that differ in the noise alone.
    fn under_noises(
        &mut self,
        places: &[Vec<f64>],
        wanted: Wanted,
        found: &mut Vec<Value>,
    ) -> Result<(), Error> {
        let Model { plant, runs, .. } = self.model;
        let points: Vec<Vec<Point>> = places.iter().map(|place| self.moved(place)).collect();
        let zero = Value::new(self.model.penalty(&self.trial), mean_slots(self.slots));
        let mut sums = vec![zero; places.len()];
        let (values, by) = self.model.mean(&self.trial, self.held);
        let is_gain = matches!(values.gain, Gain::Searched(_));
        for (run, (rows, kept)) in runs.iter().zip(&mut self.kept).enumerate() {
            let known = |point: &Point| kept.as_ref().is_some_and(|(kept, _)| kept == point);
            let mut open: Vec<&Point> = Vec::new();
            for own in points.iter().map(|points| &points[run]) {
                if !known(own) && !open.contains(&own) {
                    open.push(own);
                }
            }
            let first = points.first().map(|points| &points[run]);
            let is_first = open.first().is_some_and(|point| Some(*point) == first);
            let mut noises: Vec<Through> = open
                .iter()
                .map(|point| point.noise[0].through(&values))
                .collect();
            let moved = match (wanted, noises.first()) {
                (Wanted::Slopes, Some(own)) if is_first && plant.lags_move_air() => {
                    self.by.moved_lags(self.slots, own)
                }
                _ => Vec::new(),
            };
            noises.extend(moved.iter().flat_map(|(_, _, both)| both.clone()));
            let mut parts = evaluations(rows, plant, &values, &noises, &by, wanted, self.task)?;
            let of_air: Vec<f64> = parts
                .drain(open.len()..)
                .map(|part| part.objective)
                .collect();
            let part = |part: Evaluation| match wanted {
                Wanted::Value => Value::new(part.objective, 0),
                _ => self.by.part(self.slots, &self.trial, is_gain, &part),
            };
            let mut parts: Vec<Value> = parts.into_iter().map(part).collect();
            for ((slot, step, _), far) in moved.iter().zip(of_air.chunks_exact(2)) {
                parts[0].bend(*slot, *step, far);
            }
            for (sum, points) in sums.iter_mut().zip(&points) {
                let own = &points[run];
                let made = open.iter().position(|point| *point == own);
                let made = made.and_then(|place| parts.get(place));
                let known = kept.as_ref().map(|(_, part)| part);
                made.or(known).into_iter().for_each(|part| sum.add(part));
            }
            // That of the first place, around which the others are.
            if let (Wanted::Slopes, true, Some(point), Some(part)) =
                (wanted, is_first, first, parts.first())
            {
                *kept = Some((point.clone(), part.clone()));
            }
        }
        found.extend(sums);
        Ok(())
    }
}

impl Function for Sum<'_> {
    /// The delay, where it is what is left of delay and lags together.
    fn slack(&self, place: &[f64]) -> Option<Slack> {
        let slots = &self.slots[..mean_slots(self.slots)];
        let mut point = self.trial.clone();
        for (slot, value) in slots.iter().zip(place) {
            put(&mut point, *slot, *value);
        }
        let by = |slot: &Slot| match slot {
            Slot::Time | Slot::Zero => 1.0,
            Slot::Lag(i) => -point.lags[*i],
            _ => 0.0,
        };
        let slope: Vec<f64> = slots.iter().map(by).collect();
        let is_bound =
            matches!(point.timing, Timing::Total(_)) && slope.iter().any(|by| *by != 0.0);
        is_bound.then(|| Slack {
            value: point.delay(),
            slope,
        })
    }

    fn at(&mut self, places: &[Vec<f64>], wanted: Wanted) -> Result<Vec<Value>, Error> {
        let mean = mean_slots(self.slots);
        let mut found = Vec::with_capacity(places.len());
        for alike in places.chunk_by(|one, other| one[..mean] == other[..mean]) {
            self.under_noises(alike, wanted, &mut found)?;
        }
        Ok(found)
    }
}

#[cfg(test)]
mod tests;
