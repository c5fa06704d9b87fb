//! Plant and noise that make recordings likeliest, and Akaike's criterion of them.

use std::sync::{Arc, OnceLock};

use super::super::fit::{Fit, Model, Search};
use super::super::likelihood::{Evaluation, Noise};
use super::super::point::{Point, Timing};
use super::super::rows::Rows;
use super::median::median_step;
use super::plant::FlightPlant;
use super::rounded_rows::on_same_step;
use super::tolerances::{LESS, NO_LAG, PRICES, SHORTEST_LAG};
use crate::{Error, Task};

/// One recording.
#[derive(Debug, Clone, PartialEq)]
pub struct FlightRun {
    /// Its rows.
    pub rows: Rows,
    /// Median time between rows, s.
    pub row_time: f64,
    /// The step to which the output is rounded; zero where it is not.
    pub rounding: f64,
}

impl FlightRun {
    /// Checked rows, and the step to which their output is rounded.
    pub fn new(rows: Rows, rounding: f64) -> Self {
        Self {
            row_time: median_step(&rows.time),
            rows,
            rounding,
        }
    }

    /// The same with other marks of use.
    pub(super) fn with_used(&self, used: Vec<bool>) -> Self {
        let rows = Rows {
            used,
            ..self.rows.clone()
        };
        Self { rows, ..*self }
    }

    /// The same with slopes of the response, by which a scatter of the times of its rows counts.
    pub(super) fn with_speed(&self, speed: Vec<f64>) -> Self {
        let rows = Rows {
            speed,
            ..self.rows.clone()
        };
        Self { rows, ..*self }
    }

    /// The same under other commands.
    ///
    /// # Errors
    ///
    /// As for `Rows::checked`.
    pub fn under(&self, time: Vec<f64>, value: Vec<f64>) -> Result<Self, Error> {
        let mut rows = self.rows.clone();
        (rows.commands.time, rows.commands.value) = (time, value);
        let rows = rows.checked()?;
        Ok(Self { rows, ..*self })
    }

    /// Rows left out as outliers: not those of a rounded output that tell nothing besides another.
    pub fn left_out(&self) -> usize {
        let rows = self.rows.used.iter();
        if self.rounding > 0.0 {
            let same = on_same_step(&self.rows.output);
            return rows
                .zip(same)
                .filter(|(used, same)| !**used && !same)
                .count();
        }
        rows.filter(|used| !**used).count()
    }

    /// Number of rows that are used.
    pub fn count(&self) -> usize {
        self.rows.used.iter().filter(|used| **used).count()
    }
}

/// Plant and noise that make recordings likeliest.
#[derive(Debug, Clone)]
pub struct FlightFit {
    /// What was fitted.
    pub plant: FlightPlant,
    /// The recordings.
    pub runs: Arc<[FlightRun]>,
    /// Is there a constant input besides the command?
    pub trim: bool,
    /// The numbers, and −2 ln L there.
    pub fit: Fit,
    /// The gain, where it is not that of least squares on the rows of one recording.
    pub given_gain: Option<f64>,
    model: Arc<Model>,
    parts: OnceLock<Vec<Evaluation>>,
}

impl FlightFit {
    /// The numbers of a fit to recordings.
    ///
    /// # Errors
    ///
    /// As for `Model::new`.
    pub fn new(
        plant: FlightPlant,
        runs: Arc<[FlightRun]>,
        trim: bool,
        fit: Fit,
        given_gain: Option<f64>,
    ) -> Result<Self, Error> {
        let rows = runs.iter().map(|run| run.rows.clone()).collect();
        let model = plant.model(rows, trim)?;
        let found = Self::of(plant, runs, trim, fit, model);
        Ok(Self {
            given_gain,
            ..found
        })
    }

    /// The same with the likelihood of these recordings.
    pub(super) fn of(
        plant: FlightPlant,
        runs: Arc<[FlightRun]>,
        trim: bool,
        fit: Fit,
        model: Model,
    ) -> Self {
        Self {
            plant,
            runs,
            trim,
            fit,
            given_gain: None,
            model: Arc::new(model),
            parts: OnceLock::new(),
        }
    }

    /// Is the gain that of least squares on the rows?
    pub(super) fn gain_is_eliminated(&self) -> bool {
        self.plant.free.gain && self.runs.len() == 1
    }

    /// The likelihood that was maximised.
    pub fn model(&self) -> &Arc<Model> {
        &self.model
    }

    /// The likelihood of each recording at the numbers.
    ///
    /// # Errors
    ///
    /// As for `Model::at`.
    pub fn parts(&self, task: &Task) -> Result<&[Evaluation], Error> {
        if let Some(parts) = self.parts.get() {
            return Ok(parts);
        }
        let each = (0..self.runs.len()).map(|run| self.model.at(run, &self.fit.point, task));
        let parts = each.collect::<Result<Vec<_>, Error>>()?;
        Ok(self.parts.get_or_init(|| parts))
    }

    /// Akaike's criterion, from the plain likelihood: fits with and without trim compare.
    ///
    /// # Errors
    ///
    /// As for `parts`.
    pub fn criterion(&self, task: &Task) -> Result<f64, Error> {
        let mut total = 0.0;
        let noises = &self.fit.point.noise;
        for ((run, part), noise) in self.runs.iter().zip(self.parts(task)?).zip(noises) {
            let count = run.count() as f64;
            let price = |is: bool, price: f64| if is { price } else { 0.0 };
            total += count * (part.variance * part.freedom as f64 / count).ln() + part.log_det;
            total += price(noise.sensor > 0.0, PRICES.sensor) + price(self.trim, PRICES.trim);
            total += price(noise.stamps > 0.0, PRICES.scatter);
            total += price(noise.arrivals > 0.0, PRICES.scatter);
        }
        Ok(total)
    }

    /// Schwarz's criterion (BIC), from the plain likelihood, for so many unknown numbers of the plant
    /// and as many rows as were logged. The trim and coloured noise of the sensor are unknown too.
    ///
    /// # Errors
    ///
    /// As for `parts`.
    pub fn schwarz(&self, unknown: usize, task: &Task) -> Result<f64, Error> {
        let (mut total, mut unknown, mut rows) = (0.0, unknown, 0);
        let noises = &self.fit.point.noise;
        for ((run, part), noise) in self.runs.iter().zip(self.parts(task)?).zip(noises) {
            let count = run.count() as f64;
            total += count * (part.variance * part.freedom as f64 / count).ln() + part.log_det;
            unknown += usize::from(self.trim) + 2 * usize::from(noise.sensor > 0.0);
            rows += part.residuals.len();
        }
        Ok(total + unknown as f64 * (rows as f64).ln())
    }

    /// The gain.
    ///
    /// # Errors
    ///
    /// As for `parts`.
    pub fn gain(&self, task: &Task) -> Result<f64, Error> {
        match self.given_gain {
            Some(gain) => Ok(gain),
            None => Ok(self.parts(task)?.first().map_or(f64::NAN, |part| part.gain)),
        }
    }

    /// The numbers with the gain, which is not searched in a single recording.
    ///
    /// # Errors
    ///
    /// As for `parts`.
    pub fn with_gain(&self, task: &Task) -> Result<Fit, Error> {
        let mut fit = self.fit.clone();
        fit.point.gain = self.gain(task)?;
        Ok(fit)
    }

    /// The same at other numbers, with the same likelihood.
    #[must_use]
    pub fn moved(&self, fit: Fit) -> Self {
        Self {
            plant: self.plant.clone(),
            runs: Arc::clone(&self.runs),
            trim: self.trim,
            fit,
            given_gain: self.given_gain,
            model: Arc::clone(&self.model),
            parts: OnceLock::new(),
        }
    }

    /// The same numbers on other rows.
    ///
    /// # Errors
    ///
    /// As for `Model::new`.
    pub fn on(&self, runs: Arc<[FlightRun]>) -> Result<Self, Error> {
        let fit = self.fit.clone();
        Self::new(self.plant.clone(), runs, self.trim, fit, self.given_gain)
    }

    /// The maximum from a starting point, to this accuracy of −2 ln L.
    ///
    /// # Errors
    ///
    /// As for `Model::at`.
    pub fn fitted(&self, start: &Point, tolerance: f64, task: &Task) -> Result<Fit, Error> {
        fitted(&self.model, start, tolerance, task)
    }

    /// The rows of the recordings.
    pub(super) fn rows(&self) -> Vec<Rows> {
        self.runs.iter().map(|run| run.rows.clone()).collect()
    }

    /// The noise of each recording.
    pub fn noises(&self) -> &[Noise] {
        &self.fit.point.noise
    }

    /// Delay and lags less the zero, with the lag of the known part, s.
    pub fn total(&self) -> f64 {
        self.fit.point.total() + self.plant.own_lag
    }
}

/// The numbers of a loop with a plant.
#[derive(Debug, Clone, PartialEq)]
pub struct LoopNumbers {
    /// s.
    pub delay: f64,
    /// The gain.
    pub gain: f64,
    /// s.
    pub lags: Vec<f64>,
    /// s.
    pub zero: f64,
}

impl FlightFit {
    /// The numbers of the loop; a lag at its lower bound is none.
    ///
    /// # Errors
    ///
    /// If no lag is left beside a zero: its effect would be a pulse between rows. And as for `parts`.
    pub fn loop_numbers(&self, task: &Task) -> Result<LoopNumbers, Error> {
        let (plant, point) = (&self.plant, &self.fit.point);
        let row_time = self.runs.first().map_or(1.0, |run| run.row_time);
        let (mut delay, mut lags) = (point.delay(), point.lags.clone());
        for lag in lags.iter_mut().filter(|_| !plant.time_constant) {
            if *lag <= NO_LAG * SHORTEST_LAG * row_time {
                delay += *lag;
                *lag = 0.0;
            }
        }
        let is_gone = !lags.is_empty() && lags.iter().all(|lag| *lag == 0.0);
        if point.zero != 0.0 && is_gone && plant.den.len() <= 2 {
            return Err(Error::NotIdentifiable(
                "the lags are estimated as zero, where a zero has no effect on the rows: leave \
                 'zero' and the lags out of free=, or give the plant a further lag"
                    .into(),
            ));
        }
        Ok(LoopNumbers {
            delay: if plant.free.delay {
                delay.max(0.0)
            } else {
                point.delay()
            },
            gain: self.gain(task)?,
            lags,
            zero: point.zero,
        })
    }

    /// Does the plant beside the noise explain far less of a recording than a fit of least squares?
    ///
    /// # Errors
    ///
    /// As for `parts`.
    pub fn explains_less(&self, white: &Self, task: &Task) -> Result<bool, Error> {
        let mut pairs = self.parts(task)?.iter().zip(white.parts(task)?);
        Ok(pairs
            .any(|(part, least)| deviation(&part.residuals) > LESS * deviation(&least.residuals)))
    }

    /// Is every recording rounded, and has no other noise than white beside?
    pub fn is_rounding_alone(&self) -> bool {
        let is_white = |one: &Noise| {
            let parts = [one.air, one.sensor, one.stamps, one.arrivals];
            parts.iter().all(|part| *part == 0.0)
        };
        let mut pairs = self.runs.iter().zip(self.noises());
        pairs.all(|(run, noise)| run.rounding > 0.0 && is_white(noise))
    }

    /// Is what is left of each recording below this share of the range of its output?
    ///
    /// # Errors
    ///
    /// As for `parts`.
    pub fn leaves_less_than(&self, share: f64, task: &Task) -> Result<bool, Error> {
        let mut pairs = self.parts(task)?.iter().zip(self.runs.iter());
        Ok(pairs.all(|(part, run)| {
            let output = run.rows.output.iter();
            let ends = output.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), y| {
                (low.min(*y), high.max(*y))
            });
            let most = share * (ends.1 - ends.0);
            part.residuals.iter().all(|left| left.abs() <= most)
        }))
    }

    /// The fitted output at the start of the first recording; not a number where it is given.
    ///
    /// # Errors
    ///
    /// As for `parts`.
    pub fn initial_output(&self, task: &Task) -> Result<f64, Error> {
        let place = usize::from(self.gain_is_eliminated());
        let is_free = self.runs.first().is_some_and(|run| run.rows.offset);
        let part = self.parts(task)?.first().filter(|_| is_free);
        Ok(part
            .and_then(|part| part.linear.get(place))
            .copied()
            .unwrap_or(f64::NAN))
    }

    /// Trim and white deviation of a recording.
    ///
    /// # Errors
    ///
    /// As for `parts`.
    pub fn trim_and_white(&self, run: usize, task: &Task) -> Result<(f64, f64), Error> {
        let (Some(part), Some(rows)) = (self.parts(task)?.get(run), self.runs.get(run)) else {
            refuse!(
                "recording number {run} does not exist: give a number below {}",
                self.runs.len()
            )
        };
        let place = usize::from(self.gain_is_eliminated()) + usize::from(rows.rows.offset);
        let trim = part.linear.get(place).filter(|_| self.trim);
        Ok((trim.copied().unwrap_or(0.0), part.variance.sqrt()))
    }
}

/// The standard deviation of values.
fn deviation(values: &[f64]) -> f64 {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    (values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / count).sqrt()
}

/// The noise of a recording in the units of its output.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NoiseInUnits {
    /// Standard deviation of the white noise.
    pub white: f64,
    /// That of the air, and its time constant, s, infinite without air.
    pub air: (f64, f64),
    /// The constant input.
    pub trim: f64,
    /// Standard deviation of the coloured noise of the sensor, and its time constant, s, zero without it.
    pub sensor: (f64, f64),
}

impl FlightFit {
    /// The noise of a recording in the units of its output.
    ///
    /// # Errors
    ///
    /// As for `trim_and_white`.
    pub fn noise_in_units(&self, run: usize, task: &Task) -> Result<NoiseInUnits, Error> {
        let (trim, white) = self.trim_and_white(run, task)?;
        let one = &self.noises()[run];
        let time = |is: bool, time: f64, none: f64| if is { time } else { none };
        Ok(NoiseInUnits {
            white,
            air: (
                white * one.air,
                time(one.air > 0.0, one.air_time, f64::INFINITY),
            ),
            trim,
            sensor: (
                white * one.sensor,
                time(one.sensor > 0.0, one.sensor_time, 0.0),
            ),
        })
    }
}

/// The maximum of a likelihood from a starting point, to this accuracy of −2 ln L.
pub(super) fn fitted(
    model: &Model,
    start: &Point,
    tolerance: f64,
    task: &Task,
) -> Result<Fit, Error> {
    let start = model.timed(start.clone());
    model.fit(&start, None, Search::All, tolerance, task)
}

/// The likeliest of the maxima from these starts.
pub(super) fn likeliest(
    model: &Model,
    starts: &[Point],
    tolerance: f64,
    task: &Task,
) -> Result<Option<Fit>, Error> {
    let mut best: Option<Fit> = None;
    for start in starts {
        let found = fitted(model, start, tolerance, task)?;
        if best
            .as_ref()
            .is_none_or(|best| found.objective < best.objective)
        {
            best = Some(found);
        }
    }
    Ok(best)
}

/// The same numbers of the plant under other noise.
pub(super) fn with_noise(point: &Point, noise: Vec<Noise>) -> Point {
    Point {
        timing: Timing::Delay(point.delay()),
        noise,
        ..point.clone()
    }
}

/// The same with another delay and other lags.
pub(super) fn with_times(point: &Point, delay: f64, lags: Vec<f64>) -> Point {
    Point {
        timing: Timing::Delay(delay),
        lags,
        ..point.clone()
    }
}
