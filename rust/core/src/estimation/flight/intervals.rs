//! Intervals of the profile likelihood, with the degrees of freedom of the noise.
//!
//! −2 ln L rises by m ln(1 + t²/m) where a quantity is held at the end of its interval, m the rows
//! less the unknowns of the mean. The quantile t is that of Student's distribution with as many degrees
//! of freedom as the variance of the quantity is known with (Satterthwaite 1946; Kenward & Roger
//! 1997): slow air is seen a few times in a flight, however many rows there are.
//!
//! In a long recording the likelihood is close to a parabola, and each of its evaluations takes long:
//! intervals are t standard errors wide, from its curvature.

use std::sync::{Arc, Mutex, PoisonError};

use super::super::fit::Fit;
use super::super::point::Quantity;
use super::super::profile::{Limits, Seen};
use super::super::statistics::student_reach;
use super::covariance::{Common, variance};
use super::fit::FlightFit;
use super::noise_known::{degrees_of_freedom, unseen_air};
use super::numbers::FreeNumbers;
use super::start::is_long;
use super::tolerances::{INTERVALS, SEARCH};
use crate::{Error, Task};

/// A quantity of a fit, and how well it is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Known {
    /// Which.
    pub quantity: Quantity,
    /// Its value.
    pub value: f64,
    /// Standard error for the fitted noise.
    pub bound: f64,
    /// Factor on its square for air that is too weak to be seen, and for what else widens it.
    pub unseen: f64,
    /// Degrees of freedom of its variance.
    pub freedom: f64,
    /// Standard deviation that numbers add which are searched around the likelihood.
    pub added: f64,
}

impl Known {
    /// Standard error, also for air that may be there unseen, with those numbers known.
    fn own_error(&self) -> f64 {
        self.bound * self.unseen.sqrt()
    }

    /// Standard error, also for air that may be there unseen.
    pub fn error(&self) -> f64 {
        self.own_error().hypot(self.added)
    }
}

/// Ends found so far: of a quantity, at a level.
pub type Ends = Vec<(Quantity, f64, (f64, f64))>;

/// The profile of one fit.
#[derive(Debug, Clone)]
pub struct FlightProfile {
    /// The fit.
    pub fit: FlightFit,
    /// Its quantities.
    pub known: Vec<Known>,
    /// Covariance of the numbers that all recordings share, row-major.
    pub covariance: Vec<f64>,
    /// The fit with its gain, from which one quantity is moved.
    pub centre: Fit,
    /// Rows less unknowns of the mean.
    pub rows: usize,
    /// Each quantity as a sum of the numbers that all recordings share.
    pub weights: Vec<Vec<f64>>,
    /// The numbers that are searched around the likelihood.
    pub numbers: Option<Arc<FreeNumbers>>,
    /// Are the commands functions of the plant? Intervals are then those of the covariance.
    pub is_of_plant: bool,
    ends: Arc<Mutex<Ends>>,
}

impl FlightProfile {
    /// The profile over these quantities.
    ///
    /// # Errors
    ///
    /// If the recordings do not tell them apart, and as for `Model::at`.
    pub fn new(fit: FlightFit, quantities: &[Quantity], task: &Task) -> Result<Self, Error> {
        let parts = fit.parts(task)?;
        let rows: usize = parts.iter().map(|part| part.freedom).sum();
        let common = Common::new(&fit, task)?;
        let covariance = common.covariance(parts);
        let weights: Vec<Vec<f64>> = quantities.iter().map(|one| common.weights(*one)).collect();
        let squares: Vec<f64> = weights
            .iter()
            .map(|one| variance(&covariance, one))
            .collect();
        let is_known = covariance.iter().all(|entry| entry.is_finite());
        if !is_known || !squares.iter().all(|square| *square > 0.0) {
            return Err(Error::NotIdentifiable(
                "the recordings do not determine these parameters".into(),
            ));
        }
        let unseen = unseen_air(&fit, &common, &weights, &squares, task)?;
        let freedom = degrees_of_freedom(&fit, &common, &weights, rows as f64, task)?;
        let point = fit.with_gain(task)?.point;
        let own_lag = |quantity: Quantity| match quantity {
            Quantity::Total => fit.plant.own_lag,
            _ => 0.0,
        };
        let known = quantities.iter().enumerate().map(|(i, quantity)| Known {
            quantity: *quantity,
            value: quantity.value(&point) + own_lag(*quantity),
            bound: squares[i].sqrt(),
            unseen: unseen[i],
            freedom: freedom[i],
            added: 0.0,
        });
        let known = known.collect();
        drop(common);
        Self::restored(fit, known, covariance, weights, task)
    }

    /// The profile of a fit with what was found of it before.
    ///
    /// # Errors
    ///
    /// As for `FlightFit::parts`.
    pub fn restored(
        fit: FlightFit,
        known: Vec<Known>,
        covariance: Vec<f64>,
        weights: Vec<Vec<f64>>,
        task: &Task,
    ) -> Result<Self, Error> {
        let mut centre = fit.with_gain(task)?;
        centre.point = fit.model().timed(centre.point);
        let rows = fit.parts(task)?.iter().map(|part| part.freedom).sum();
        Ok(Self {
            fit,
            known,
            covariance,
            centre,
            rows,
            weights,
            numbers: None,
            is_of_plant: false,
            ends: Arc::default(),
        })
    }

    /// Covariance of quantities that all recordings share, and of the numbers around them.
    pub fn covariance_of(&self, quantities: &[Quantity]) -> Vec<f64> {
        let common = self.fit.plant.common();
        let place = |one: &Quantity| common.iter().position(|own| own == one).unwrap_or(0);
        let places: Vec<usize> = quantities.iter().map(place).collect();
        let (n, all) = (places.len(), common.len());
        let entry = |at: usize| self.covariance[places[at / n] * all + places[at % n]];
        let own: Vec<f64> = (0..n * n).map(entry).collect();
        match &self.numbers {
            Some(numbers) => numbers.joined(quantities, &own),
            None => own,
        }
    }

    /// The same of a fit whose commands are functions of its plant, with this covariance.
    #[must_use]
    pub fn of_plant(mut self, covariance: Vec<f64>) -> Self {
        for (known, weights) in self.known.iter_mut().zip(&self.weights) {
            known.bound = variance(&covariance, weights).sqrt();
        }
        self.covariance = covariance;
        self.is_of_plant = true;
        self.ends = Arc::default();
        self
    }

    /// The same with numbers that were searched around the likelihood.
    #[must_use]
    pub fn beside(mut self, numbers: FreeNumbers) -> Self {
        for known in &mut self.known {
            known.added = numbers.added(known.quantity);
        }
        self.numbers = Some(Arc::new(numbers));
        self
    }

    /// Ends found so far.
    pub fn found(&self) -> Ends {
        self.ends
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }

    /// Keep the ends of an interval.
    pub fn keep(&self, quantity: Quantity, level: f64, ends: (f64, f64)) {
        let mut kept = self.ends.lock().unwrap_or_else(PoisonError::into_inner);
        kept.push((quantity, level, ends));
    }

    /// The profile, or that of a better minimum which the intervals of the `first` quantities find.
    ///
    /// # Errors
    ///
    /// As for `new` and `Model::end`.
    pub fn best(
        fit: FlightFit,
        quantities: &[Quantity],
        first: &[Quantity],
        task: &Task,
    ) -> Result<Self, Error> {
        let level = INTERVALS.level;
        let mut profile = Self::new(fit, quantities, task)?;
        if is_long(&profile.fit.runs) {
            return Ok(profile);
        }
        for _ in 0..INTERVALS.restarts {
            let mut better = None;
            for quantity in first {
                let (ends, lowest) = profile.ends(*quantity, level, INTERVALS.better, task)?;
                if lowest.objective < profile.centre.objective - INTERVALS.better {
                    better = Some(lowest);
                    break;
                }
                profile.keep(*quantity, level, ends);
            }
            let Some(better) = better else {
                break;
            };
            let found = profile.fit.fitted(&better.point, SEARCH.fine, task)?;
            profile = Self::new(profile.fit.moved(found), quantities, task)?;
        }
        Ok(profile)
    }

    /// The same with factors on the variances.
    ///
    /// # Errors
    ///
    /// If there is not one for each quantity.
    pub fn widened(&self, factors: &[f64]) -> Result<Self, Error> {
        refuse_if!(
            factors.len() != self.known.len(),
            "{} factors are given for {} quantities: give one factor for each",
            factors.len(),
            self.known.len()
        );
        let mut wider = self.clone();
        wider.ends = Arc::default();
        for (known, factor) in wider.known.iter_mut().zip(factors) {
            known.unseen *= factor;
        }
        Ok(wider)
    }

    /// Are intervals those of the curvature?
    pub fn is_long(&self) -> bool {
        is_long(&self.fit.runs)
    }

    /// How well a quantity is known.
    ///
    /// # Errors
    ///
    /// If it has no interval.
    pub fn known_of(&self, quantity: Quantity) -> Result<&Known, Error> {
        let mut known = self.known.iter();
        match known.find(|known| known.quantity == quantity) {
            Some(known) => Ok(known),
            None => {
                refuse!("{quantity:?} was not fitted: give a quantity that the profile contains")
            }
        }
    }

    /// The rise of −2 ln L at the ends of an interval.
    ///
    /// # Errors
    ///
    /// As for `known_of`.
    pub fn rise(&self, quantity: Quantity, level: f64) -> Result<f64, Error> {
        let (known, rows) = (self.known_of(quantity)?, self.rows as f64);
        let reach = student_reach(level, known.freedom);
        Ok(rows * (known.unseen * reach * reach / rows).ln_1p())
    }

    /// The squared t for which a value is the end of an interval.
    ///
    /// # Errors
    ///
    /// As for `known_of` and `Model::held`.
    pub fn statistic(&self, quantity: Quantity, value: f64, task: &Task) -> Result<f64, Error> {
        let (known, rows) = (self.known_of(quantity)?, self.rows as f64);
        if self.is_of_plant {
            return Ok(((value - known.value) / known.error()).powi(2));
        }
        let value = value - self.outside(quantity);
        let held = self.fit.model().held(&self.centre, quantity, value, task)?;
        let rise = (held.objective - self.centre.objective).max(0.0);
        let share = if known.added > 0.0 {
            known.own_error() / known.error()
        } else {
            1.0
        };
        Ok(rows * (rise / rows).exp_m1() / known.unseen * share * share)
    }

    /// Ends of an interval; of a long recording from the curvature.
    ///
    /// # Errors
    ///
    /// As for `known_of` and `Model::end`.
    pub fn interval(
        &self,
        quantity: Quantity,
        level: f64,
        task: &Task,
    ) -> Result<(f64, f64), Error> {
        let (low, high) = self.with_numbers_known(quantity, level, task)?;
        let known = self.known_of(quantity)?;
        if known.added == 0.0 {
            return Ok((low, high));
        }
        let added = student_reach(level, known.freedom) * known.added;
        let floor = if quantity == Quantity::Gain {
            f64::NEG_INFINITY
        } else {
            0.0
        };
        let low = known.value - (known.value - low).hypot(added);
        Ok((
            low.max(floor),
            known.value + (high - known.value).hypot(added),
        ))
    }

    fn with_numbers_known(
        &self,
        quantity: Quantity,
        level: f64,
        task: &Task,
    ) -> Result<(f64, f64), Error> {
        if is_long(&self.fit.runs) || self.is_of_plant {
            return self.from_curvature(quantity, level);
        }
        let found = self.found().into_iter();
        let mut found = found.filter(|(own, at, _)| *own == quantity && *at == level);
        let (low, high) = if let Some((_, _, ends)) = found.next() {
            ends
        } else {
            let ends = self.ends(quantity, level, f64::INFINITY, task)?.0;
            self.keep(quantity, level, ends);
            ends
        };
        let outside = self.outside(quantity);
        Ok((low + outside, high + outside))
    }

    /// Standard error of a number that was searched around the likelihood.
    ///
    /// # Errors
    ///
    /// If there is no such number; so for the next two.
    pub fn error_of_number(&self, place: usize) -> Result<f64, Error> {
        let (value, deviation) = self.number(place)?;
        Ok(value.abs() * deviation)
    }

    /// The squared t for which a value of such a number is the end of an interval.
    ///
    /// # Errors
    ///
    /// See above.
    pub fn statistic_of_number(&self, place: usize, value: f64) -> Result<f64, Error> {
        let (own, deviation) = self.number(place)?;
        let log = (value / own).ln();
        Ok(if log.is_nan() {
            f64::INFINITY
        } else {
            (log / deviation).powi(2)
        })
    }

    /// The ends of the interval of such a number.
    ///
    /// # Errors
    ///
    /// See above.
    pub fn interval_of_number(&self, place: usize, level: f64) -> Result<(f64, f64), Error> {
        let (value, deviation) = self.number(place)?;
        let reach = student_reach(level, self.least_freedom()) * deviation;
        let (one, other) = (value / reach.exp(), value * reach.exp());
        Ok((one.min(other), one.max(other)))
    }

    /// The least degrees of freedom of the quantities.
    pub fn least_freedom(&self) -> f64 {
        let freedoms = self.known.iter().map(|known| known.freedom);
        freedoms.fold(f64::INFINITY, f64::min)
    }

    /// A number and the standard deviation of its logarithm.
    fn number(&self, place: usize) -> Result<(f64, f64), Error> {
        let numbers = self.numbers.as_ref();
        let found = numbers.and_then(|own| Some((*own.values.get(place)?, own.deviation(place))));
        match found {
            Some(found) => Ok(found),
            None => refuse!("parameter number {place} was not fitted: give one that was fitted"),
        }
    }

    /// The interval that standard errors give.
    ///
    /// # Errors
    ///
    /// As for `known_of`.
    pub fn from_curvature(&self, quantity: Quantity, level: f64) -> Result<(f64, f64), Error> {
        let known = self.known_of(quantity)?;
        let reach = student_reach(level, known.freedom) * known.own_error();
        let low = known.value - reach;
        let low = if quantity == Quantity::Gain {
            low
        } else {
            low.max(0.0)
        };
        Ok((low, known.value + reach))
    }

    /// What a sum of times holds besides the numbers that are searched, s.
    fn outside(&self, quantity: Quantity) -> f64 {
        match quantity {
            Quantity::Total => self.fit.plant.own_lag,
            _ => 0.0,
        }
    }

    /// The interval, and the lowest minimum that was seen on the way, at which the search ends if it
    /// is `lower` by as much: there is no interval then.
    fn ends(
        &self,
        quantity: Quantity,
        level: f64,
        lower: f64,
        task: &Task,
    ) -> Result<((f64, f64), Fit), Error> {
        let plant = &self.fit.plant;
        let leads = plant.free.zero || plant.zero > 0.0;
        let floor = match quantity {
            Quantity::Gain | Quantity::Zero => f64::NEG_INFINITY,
            Quantity::Total if leads => f64::NEG_INFINITY,
            Quantity::Lag(_) => {
                SEARCH.shortest * self.fit.runs.first().map_or(1.0, |run| run.row_time)
            }
            _ => 0.0,
        };
        let rise = self.rise(quantity, level)?;
        let reach = (self.known_of(quantity)?.own_error() * rise.sqrt()).max(INTERVALS.reach);
        let limits = Limits { floor, lower };
        let (mut lowest, mut seen) = (self.centre.clone(), Seen::default());
        let mut found = Vec::new();
        for sign in [-1.0, 1.0] {
            let model = self.fit.model();
            let to = (sign * reach, rise);
            let (end, low) = model.end_near(&self.centre, quantity, to, limits, &mut seen, task)?;
            found.push(if end == floor { 0.0 } else { end });
            if low.objective < lowest.objective {
                lowest = low;
            }
            if lowest.objective < self.centre.objective - lower {
                break;
            }
        }
        let ends = (found[0], found[found.len() - 1]);
        Ok((ends, lowest))
    }
}
