//! The numbers of plant and noise at which the likelihood of one or more recordings is largest.
//!
//! Half of the file is its tests.

use super::likelihood::{Evaluation, Noise, Wanted, evaluate, objectives};
use super::mean::{Derivatives, Gain, Values};
use super::over_delays::over_delays;
use super::plant::{MOST_STATES, Plant};
use super::point::{Point, Quantity, Timing};
use super::quotients::{Function, Slack, Value, Variable};
use super::rows::Rows;
use super::search::minimise;
use super::variables::{Free, SHORTEST_LAG, Slot, Variables, mean_slots, put};
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
            refuse!("no recording: give at least one")
        };
        let row_time = first.row_time();
        refuse_if!(
            !(longest.is_finite() && longest >= SHORTEST_LAG * row_time),
            "the longest delay is {longest} s and the time between rows {row_time} s: give a delay \
             of at least a thousandth of a row"
        );
        refuse_if!(
            free.zero && free.lags.is_empty() && !plant.takes_zero(),
            "a zero is searched without a lag: give the plant a lag"
        );
        let states = plant.states(free.lags.len());
        refuse_if!(
            states > MOST_STATES,
            "{states} states of the plant with its lags: the likelihood takes up to {MOST_STATES}"
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
            "{} lags and the noise of {} recordings: this likelihood has {} lags and {} recordings",
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
        let (Some(rows), Some(noise)) = (self.runs.get(run), point.noise.get(run)) else {
            refuse!(
                "recording {run} of {}: give the number of one of them, from zero",
                self.runs.len()
            )
        };
        evaluate(rows, &self.plant, &values, noise, &by, wanted, task)
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
            // A page has no room for the fast way.
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
        self.fit_near(start, held, searched, tolerance, &mut None, task)
    }

    /// The same from the inverse Hessian of a search near by, if there was one, which becomes that of
    /// this one.
    pub(super) fn fit_near(
        &self,
        start: &Point,
        held: Option<Quantity>,
        searched: Search,
        tolerance: f64,
        near: &mut Option<Vec<f64>>,
        task: &Task,
    ) -> Result<Fit, Error> {
        self.check(start)?;
        refuse_if!(
            !(tolerance.is_finite() && tolerance > 0.0),
            "a tolerance of {tolerance}: give a finite number above zero"
        );
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
        let found = minimise(&variables, tolerance, near, sum)?;
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

    /// The part of a recording that is kept from these numbers.
    fn known(&self, run: usize, own: &Point) -> Option<&Value> {
        let kept = self.kept.get(run)?.as_ref();
        kept.filter(|(point, _)| point == own).map(|(_, part)| part)
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

    fn at(&mut self, place: &[f64], wanted: Wanted) -> Result<Value, Error> {
        let owns = self.moved(place);
        let mut sum = Value::new(self.model.penalty(&self.trial), mean_slots(self.slots));
        for (run, own) in owns.into_iter().enumerate() {
            if let Some(part) = self.known(run, &own) {
                sum.add(part);
                continue;
            }
            let part = self
                .model
                .part(run, &self.trial, self.held, wanted, self.task)?;
            if wanted == Wanted::Value {
                sum.value += part.objective;
                continue;
            }
            let is_gain = matches!(
                self.model.gain_at(&self.trial, self.held),
                Gain::Searched(_)
            );
            let part = self.by.part(self.slots, &self.trial, is_gain, &part);
            sum.add(&part);
            if let Some(kept) = self.kept.get_mut(run) {
                *kept = Some((own, part));
            }
        }
        Ok(sum)
    }

    /// Places that differ in the noise alone share the mean: those of the last.
    fn values(&mut self, places: &[Vec<f64>]) -> Result<Vec<f64>, Error> {
        let mean = mean_slots(self.slots);
        let Some(last) = places.last() else {
            return Ok(Vec::new());
        };
        let own = places
            .iter()
            .take_while(|place| place[..mean] != last[..mean])
            .count();
        let mut found = Vec::with_capacity(places.len());
        for place in &places[..own] {
            found.push(self.at(place, Wanted::Value)?.value);
        }
        let points: Vec<Vec<Point>> = places[own..]
            .iter()
            .map(|place| self.moved(place))
            .collect();
        let mut sums = vec![self.model.penalty(&self.trial); points.len()];
        let (values, by) = self.model.mean(&self.trial, self.held);
        for (run, rows) in self.model.runs.iter().enumerate() {
            let (mut noises, mut open) = (Vec::new(), Vec::new());
            for (sum, point) in sums.iter_mut().zip(&points) {
                if let Some(part) = self.known(run, &point[run]) {
                    *sum += part.value;
                } else {
                    noises.extend(&point[run].noise);
                    open.push(sum);
                }
            }
            let plant = &self.model.plant;
            let parts = objectives(rows, plant, &values, &noises, &by, self.task)?;
            for (sum, part) in open.into_iter().zip(parts) {
                *sum += part;
            }
        }
        found.extend(sums);
        Ok(found)
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::recorded;
    use super::super::variables::{MOST_DEVIATION, QUIET};
    use super::*;

    const INTEGRATOR: (&[f64], &[f64]) = (&[1.0], &[1.0, 0.0]);
    const NOTHING: (&[f64], &[f64]) = (&[1.0], &[1.0]);

    fn free() -> Free {
        Free {
            delay: true,
            gain: true,
            lags: vec![true],
            zero: false,
        }
    }

    fn model(plant: (&[f64], &[f64]), runs: Vec<Rows>) -> Model {
        Model::new(Plant::new(plant.0, plant.1).unwrap(), runs, free(), 5.0).unwrap()
    }

    fn point(delay: f64, lag: f64, noise: Vec<Noise>) -> Point {
        Point {
            timing: Timing::Delay(delay),
            lags: vec![lag],
            zero: 0.0,
            gain: 1.0,
            noise,
        }
    }

    #[test]
    fn commands_that_are_late_in_an_exact_record_leave_a_finite_scatter() {
        // Half of the commands arrive 10 ms late, and there is no other error.
        let mut rows = recorded(INTEGRATOR, (0.31, 1.0, 0.02), 0.0, 1);
        let late = |i: usize| if i.is_multiple_of(2) { 0.01 } else { 0.0 };
        let sent = &rows.commands;
        for (time, output) in rows.time.iter().zip(&mut rows.output) {
            let mut before = 0.0;
            *output = 0.0;
            for (i, (from, value)) in sent.time.iter().zip(&sent.value).enumerate() {
                *output += (value - before) * (time - from - 0.31 - late(i)).max(0.0);
                before = *value;
            }
        }
        let model = model(INTEGRATOR, vec![rows]);
        let noise = Noise {
            arrivals: 1e9,
            ..QUIET
        };
        let found = fitted(&model, point(0.31, 0.02, vec![noise]));
        assert!(found.objective.is_finite());
        let largest = model.runs[0].largest_jump();
        assert!(found.point.noise[0].arrivals <= 1.001 * MOST_DEVIATION / largest);
        for lag in [0.005, 0.05, 0.5] {
            let mut moved = found.point.clone();
            moved.lags = vec![lag];
            let at = model.at(0, &moved, &Task::new()).unwrap();
            assert!(at.residuals.iter().all(|e| e.is_finite()));
        }
    }

    fn fitted(model: &Model, start: Point) -> Fit {
        model
            .fit(&model.timed(start), None, Search::All, 1e-6, &Task::new())
            .unwrap()
    }

    #[test]
    fn delay_gain_and_lag_are_recovered() {
        let model = model(
            INTEGRATOR,
            vec![recorded(INTEGRATOR, (0.31, 0.85, 0.17), 1e-5, 1)],
        );
        let found = fitted(&model, point(0.25, 0.3, vec![QUIET]));
        assert!((found.point.delay() - 0.31).abs() < 1e-4, "{found:?}");
        assert!((found.point.lags[0] - 0.17).abs() < 1e-4);
        let there = model.at(0, &found.point, &Task::new()).unwrap();
        assert!((there.gain - 0.85).abs() < 1e-5);
        assert!((there.variance.sqrt() / 1e-5 - 1.0).abs() < 0.2);
        assert_eq!(
            model.objective(&found.point, &Task::new()).unwrap(),
            found.objective
        );
    }

    #[test]
    fn air_that_is_not_there_is_fitted_to_nothing() {
        let model = model(
            INTEGRATOR,
            vec![recorded(INTEGRATOR, (0.31, 0.85, 0.17), 5e-3, 2)],
        );
        let windy = Noise {
            air_time: 1.0,
            air: 3.0,
            ..QUIET
        };
        let found = fitted(&model, point(0.3, 0.2, vec![windy]));
        let white = fitted(&model, point(0.3, 0.2, vec![QUIET]));
        assert!(found.objective <= white.objective + 1e-3);
        assert!(
            white.objective - found.objective < 8.0,
            "{white:?} {found:?}"
        );
        assert!((found.point.total() - 0.48).abs() < 0.02);
    }

    #[test]
    fn an_unstable_plant_of_first_order_has_a_negative_lag() {
        let unstable = recorded(NOTHING, (0.31, 0.85, -4.0), 1e-3, 3);
        let model = model(NOTHING, vec![unstable]);
        let found = fitted(&model, point(0.25, -3.7, vec![QUIET]));
        assert!((found.point.delay() - 0.31).abs() < 0.01, "{found:?}");
        assert!((found.point.lags[0] + 4.0).abs() < 0.01);
    }

    #[test]
    fn recordings_share_the_plant_and_keep_their_noise() {
        let numbers = (0.31, 0.85, 0.17);
        let runs = vec![
            recorded(INTEGRATOR, numbers, 1e-4, 4),
            recorded(INTEGRATOR, numbers, 1e-2, 5),
        ];
        let model = model(INTEGRATOR, runs);
        let found = fitted(&model, point(0.25, 0.3, vec![QUIET; 2]));
        assert!((found.point.delay() - 0.31).abs() < 1e-3, "{found:?}");
        assert!((found.point.gain - 0.85).abs() < 1e-3);
        for (run, deviation) in [1e-4, 1e-2].into_iter().enumerate() {
            let there = model.at(run, &found.point, &Task::new()).unwrap();
            assert_eq!(there.gain, found.point.gain);
            assert!((there.variance.sqrt() / deviation - 1.0).abs() < 0.2);
        }
        assert!(model.at(2, &found.point, &Task::new()).is_err());
    }

    #[test]
    fn a_known_delay_stays() {
        let runs = vec![recorded(INTEGRATOR, (0.31, 0.85, 0.17), 1e-5, 6)];
        let free = Free {
            delay: false,
            ..free()
        };
        let plant = Plant::new(INTEGRATOR.0, INTEGRATOR.1).unwrap();
        let model = Model::new(plant, runs, free, 5.0).unwrap();
        let found = fitted(&model, point(0.31, 0.5, vec![QUIET]));
        assert_eq!(found.point.delay(), 0.31);
        assert!((found.point.lags[0] - 0.17).abs() < 1e-4);
    }

    #[test]
    fn numbers_out_of_range_are_refused_by_value() {
        let runs = vec![recorded(INTEGRATOR, (0.31, 0.85, 0.17), 1e-5, 7)];
        let plant = || Plant::new(INTEGRATOR.0, INTEGRATOR.1).unwrap();
        let refusal = |model: Result<Model, Error>| model.unwrap_err().to_string();
        let many = Free {
            lags: vec![true; 9],
            ..free()
        };
        let zero = Free {
            lags: Vec::new(),
            zero: true,
            ..free()
        };
        for (found, expected) in [
            (
                refusal(Model::new(plant(), Vec::new(), free(), 5.0)),
                "no recording",
            ),
            (
                refusal(Model::new(plant(), runs.clone(), free(), f64::NAN)),
                "longest delay is NaN",
            ),
            (
                refusal(Model::new(plant(), runs.clone(), free(), -1.0)),
                "longest delay is -1",
            ),
            (
                refusal(Model::new(plant(), runs.clone(), many, 5.0)),
                "10 states",
            ),
            (
                refusal(Model::new(plant(), runs.clone(), zero, 5.0)),
                "without a lag",
            ),
        ] {
            assert!(found.contains(expected), "{found}");
        }
        let model = model(INTEGRATOR, runs);
        let noise = |air_time, air| {
            vec![Noise {
                air_time,
                air,
                ..QUIET
            }]
        };
        for (point, expected) in [
            (point(f64::NAN, 0.2, vec![QUIET]), "the delay is NaN"),
            (point(0.2, f64::INFINITY, vec![QUIET]), "the delay is"),
            (point(0.2, 0.2, vec![QUIET; 2]), "noise of 2 recordings"),
            (point(0.2, 0.2, noise(1.0, -2.0)), "noise of deviation -2"),
            (point(0.2, 0.2, noise(-3.0, 2.0)), "time constant -3"),
        ] {
            let point = Point { gain: 1.0, ..point };
            for found in [
                model.at(0, &point, &Task::new()).map(|_| ()),
                model.objective(&point, &Task::new()).map(|_| ()),
                model
                    .fit(&point, None, Search::All, 1e-6, &Task::new())
                    .map(|_| ()),
            ] {
                let found = found.unwrap_err().to_string();
                assert!(
                    found.contains(expected) || found.contains("lag is inf"),
                    "{found}"
                );
            }
        }
        let found = model.fit(
            &point(0.2, 0.2, vec![QUIET]),
            None,
            Search::All,
            0.0,
            &Task::new(),
        );
        assert!(found.unwrap_err().to_string().contains("a tolerance of 0"));
    }
}
