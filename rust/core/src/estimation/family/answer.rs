//! The answer of the family to records: its verdict, its plants and their intervals.

use super::candidate::Candidate;
use super::cause::Cause;
use super::class::{Class, Numbers};
use super::hull::{Named, Triple, at, hull, mean_delay, turning};
use super::sensors::SensorFault;
use super::tolerances::EVIDENCE;
use super::verdict::Verdict;
use crate::{Error, Task};

/// The answer.
#[derive(Debug, Clone)]
pub struct Family {
    /// Whether it holds.
    pub verdict: Verdict,
    /// One for each class, the least BIC first.
    pub candidates: Vec<Candidate>,
    /// Intervals over the classes within reach.
    pub hull: Vec<Named>,
    /// Are commands taken as straight, and is that known?
    pub straight: bool,
    /// Was it known or decided?
    pub decided: bool,
    /// Was the plant taken to be at rest at the first row?
    pub at_rest: bool,
    /// Rows that count.
    pub rows: usize,
    /// The first of them in each record.
    pub first_rows: Vec<usize>,
    /// Rows by which the command was moved, above 0 to later ones.
    pub shift: i64,
    /// Frequencies at which the command has power, rad/s.
    pub excited: Vec<f64>,
    /// What the plant lacks, as far as the record shows it clearly.
    pub causes: Vec<Cause>,
    /// Rows that are no readings of the sensor.
    pub sensor: Vec<SensorFault>,
    /// The largest delay that may be, that was tried in the end, and one over the noise of each record.
    pub(super) largest_delay: f64,
    pub(super) delay_limit: f64,
    pub(super) weights: Vec<f64>,
    pub(super) minima: Vec<Candidate>,
}

impl Family {
    /// Classes that are not hopeless, with their numbers.
    pub(super) fn seeds(&self) -> Vec<(Class, Numbers)> {
        let best = self.candidates.first().map_or(0.0, |best| best.bic);
        let own = self.candidates.iter();
        own.filter(|one| one.bic <= best + EVIDENCE.hopeless)
            .map(|one| (one.class, one.numbers))
            .collect()
    }

    /// The candidates that so many rows may leave: of more rows than these, some that are further behind,
    /// for what a number adds to the likelihood grows with the rows.
    pub(super) fn worth_refining(&self, rows: usize) -> Vec<Candidate> {
        let best = self.candidates.first().map_or(0.0, |best| best.bic);
        let more = (rows as f64 / self.rows.max(1) as f64).max(1.0);
        let reach = (EVIDENCE.reach * more).min(EVIDENCE.hopeless);
        let mut out = self.minima.clone();
        for one in &self.candidates {
            if one.bic <= best + reach && out.iter().all(|known| known.class != one.class) {
                out.push(one.clone());
            }
        }
        out
    }

    /// Gain, phase and equivalent delay at frequencies, each with its ends.
    ///
    /// # Errors
    /// [`Error::Interrupted`] and [`Error::Memory`].
    pub fn at(&self, omega: &[f64], level: f64, task: &Task) -> Result<Vec<[Triple; 3]>, Error> {
        let minima = self.minima_at(level)?;
        let turning = turning(&minima, task)?;
        Ok(omega.iter().map(|omega| at(&turning, *omega)).collect())
    }

    /// The mean equivalent delay over frequencies, rad/s, with weights that add up to one, and its ends.
    ///
    /// # Errors
    /// As of [`Family::at`].
    pub fn mean_delay(
        &self,
        omega: &[f64],
        weight: &[f64],
        level: f64,
        task: &Task,
    ) -> Result<Triple, Error> {
        let minima = self.minima_at(level)?;
        Ok(mean_delay(&turning(&minima, task)?, omega, weight))
    }

    /// The intervals at another level.
    ///
    /// # Errors
    /// [`Error::Argument`] for a level not between 0 and 1, [`Error::Interrupted`], [`Error::Memory`].
    pub fn hull_at(&self, level: f64, task: &Task) -> Result<Vec<Named>, Error> {
        let minima = self.minima_at(level)?;
        Ok(hull(&turning(&minima, task)?, self.largest_delay))
    }

    /// BIC of the likeliest plant, with the error of its class.
    pub(super) fn least(&self) -> f64 {
        let all = self.minima.iter().map(|one| one.bic);
        all.fold(f64::INFINITY, f64::min)
    }

    /// Let the intervals hold those of another answer's plants, up to a BIC.
    pub(super) fn add_within(&mut self, other: &Self, floor: f64) {
        let some = other.minima.iter().filter(|one| one.bic <= floor);
        self.minima.extend(some.cloned());
    }

    /// The intervals anew.
    pub(super) fn rehull(&mut self, task: &Task) -> Result<(), Error> {
        self.hull = hull(&turning(&self.minima, task)?, self.largest_delay);
        Ok(())
    }

    fn minima_at(&self, level: f64) -> Result<Vec<Candidate>, Error> {
        check_level(level)?;
        Ok(self.minima.iter().map(|one| one.at_level(level)).collect())
    }
}

pub(super) fn check_level(level: f64) -> Result<(), Error> {
    refuse_if!(
        !(level > 0.0 && level < 1.0),
        "the level is {level}: give a level between 0 and 1"
    );
    Ok(())
}
