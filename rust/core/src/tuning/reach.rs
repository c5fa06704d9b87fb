//! How large the gains of a shape may be in the loops that a search sees, and what they give there.

use std::cell::Cell;

use super::demands::{is_stable_loop, sensitivity_to};
use super::open::{Gap, Open, Scale, gaps};
use super::posed::{Posed, Ray, lasting};
use super::responses::figures;
use crate::frequency::Sought;
use crate::loops::Drive;
use crate::{Error, Task};

/// Cost of gains that miss a demand: above every other cost.
pub(super) const NEVER: f64 = 1e30;

/// Steps down a ray, each by this factor, and halvings, by which gains are sought that meet demands
/// other than Ms.
const DOWN: f64 = 0.85;
const STEPS_DOWN: usize = 60;
const HALVINGS: usize = 30;

/// Steps down that come no nearer to the demands after which a ray is given up.
const IDLE: usize = 4;

/// Relative accuracy of gains that meet other demands, and of these.
const KNOWN: f64 = 1e-8;

/// Difference of two growths of an argument, rad, below which both loops are stable or neither is:
/// between the quarter turn and the half turn that there are.
const SAME_GROWTH: f64 = 0.75 * std::f64::consts::PI;

/// Begin of a gap as a part of its end from which on it is narrow, and the parts of a narrow one in which
/// gains are tried: more of both find narrower stretches and take longer.
const NARROW: f64 = 0.8;
const PARTS: u32 = 6;

/// Factor on Ms that is put down to the frequencies between those that are seen.
const NEARLY: f64 = 1.01;

/// By how much the search aims below the demand on Ms, relatively.
const AIMED: f64 = 1e-7;

/// Factors on the two responses.
#[derive(Debug, Clone, Copy)]
pub(super) struct Weights {
    pub(super) load: f64,
    pub(super) set_point: f64,
}

/// A search, and the loops that it sees.
pub(super) struct Search<'a> {
    pub(super) posed: &'a Posed,
    pub(super) weights: Weights,
    pub(super) scale: Scale,
    pub(super) seen: Vec<(usize, Open)>,
    /// Must every loop that is seen be stable where gaps are chosen, or the nominal one alone?
    pub(super) checks_all: bool,
    /// Growth of the argument of 1 + L of the nominal loop with gains that are stable.
    pub(super) growth: Cell<Option<f64>>,
    pub(super) task: &'a Task,
}

impl<'a> Search<'a> {
    /// A search for the gains of these loops.
    ///
    /// # Errors
    /// [`Error::Argument`] where the response to a load does not follow from a free gain.
    pub(super) fn new(posed: &'a Posed, weights: Weights, task: &'a Task) -> Result<Self, Error> {
        let Some(nominal) = posed.loops.first() else {
            refuse!("no loop was given: give at least one");
        };
        let names = nominal.controller().kind.gains();
        let lead = names.get(posed.lead()).copied().unwrap_or("");
        refuse_if!(
            weights.load > 0.0 && !posed.free.contains(&posed.lead_of_load()),
            "the response to a load depends only on {}, which is fixed: leave this gain free, or \
             choose another objective",
            names.get(posed.lead_of_load()).copied().unwrap_or(lead)
        );
        let seen = posed.loops.iter().take(posed.first.max(1)).enumerate();
        let seen = seen.map(|(place, of)| Ok((place, Open::new(of, &posed.free, task)?)));
        Ok(Self {
            posed,
            weights,
            scale: Scale::of(nominal, task)?,
            seen: seen.collect::<Result<_, Error>>()?,
            checks_all: false,
            growth: Cell::new(None),
            task,
        })
    }

    /// The largest gains of this shape that meet the demands in the loops that are seen.
    pub(super) fn gains(&self, shape: &[f64]) -> Result<Option<Vec<f64>>, Error> {
        let Some((ray, gap)) = self.gap(shape)? else {
            return Ok(None);
        };
        if !self.posed.demands.has_others() {
            return Ok(Some(ray.at(gap.1)));
        }
        Ok(self.down(&ray, gap)?.map(|k| ray.at(k)))
    }

    /// The ray of a shape and the highest stable gap that Ms leaves on it.
    pub(super) fn gap(&self, shape: &[f64]) -> Result<Option<(Ray, Gap)>, Error> {
        let ray = self.posed.ray(shape, self.scale);
        let most = self.posed.demands.max_sensitivity;
        let least = 1.0 / (most * (1.0 - AIMED));
        let mut list: Vec<Gap> = Vec::new();
        for (_, open) in &self.seen {
            open.exclude(&ray.offset, &ray.along, least, &mut list);
        }
        let (low, high) = self.posed.within(&ray);
        for (from, to) in gaps(list, low.max(0.0)) {
            let end = to.min(high);
            if end <= from * (1.0 + 1e-12) {
                continue;
            }
            // Beyond the frequencies that are seen nothing is excluded.
            let is_open = end == f64::INFINITY;
            let end = match is_open {
                true if from > 0.0 => 2.0 * from,
                true => 1.0,
                false => end,
            };
            let Some(end) = self.exactly(&ray, (from, end))? else {
                continue;
            };
            if !self.is_stable(&ray.at(end))? {
                continue;
            }
            refuse_if!(
                is_open,
                "nothing limits the gains of this loop, because Ms stays below {most} for all \
                 gains. Give the loop the delay or the lags that the real loop has, or give \
                 ranges="
            );
            return Ok(Some((ray, (from, end))));
        }
        Ok(None)
    }

    /// The largest k of a gap, by the exact Ms where it is so narrow that it may be no more than what lies
    /// between two frequencies that are seen.
    fn exactly(&self, ray: &Ray, (from, end): Gap) -> Result<Option<f64>, Error> {
        let most = self.posed.demands.max_sensitivity;
        if from <= 0.0 {
            // Small gains of two integrators have their peak below all frequencies that are seen.
            let of = self.posed.at(0, &ray.at(end));
            let asked = Sought::Above(most * NEARLY);
            let found = match sensitivity_to(&of, Some(asked), self.task) {
                Err(error) if error.ends_all() => return Err(error),
                found => found.ok().flatten(),
            };
            let is_near = found.is_some_and(|peak| peak.value <= most * NEARLY);
            return Ok(is_near.then_some(end));
        }
        if from <= NARROW * end {
            return Ok(Some(end));
        }
        let holds = |k: f64| -> Result<bool, Error> {
            for (place, _) in &self.seen {
                let of = self.posed.at(*place, &ray.at(k));
                let level = most / (1.0 + 0.5 * AIMED);
                let found = match sensitivity_to(&of, Some(Sought::Above(level)), self.task) {
                    Err(error) if error.ends_all() => return Err(error),
                    found => found.ok().flatten(),
                };
                if !found.is_some_and(|peak| peak.value <= level) {
                    return Ok(false);
                }
            }
            Ok(true)
        };
        if holds(end)? {
            return Ok(Some(end));
        }
        for part in 1..PARTS {
            let mut good = end - (end - from) * f64::from(part) / f64::from(PARTS);
            if !holds(good)? {
                continue;
            }
            let mut bad = end;
            while bad - good > KNOWN * good {
                let middle = 0.5 * (good + bad);
                if holds(middle)? {
                    good = middle;
                } else {
                    bad = middle;
                }
            }
            return Ok(Some(good));
        }
        Ok(None)
    }

    /// By how much gains miss the other demands in the worst of the loops that are seen.
    pub(super) fn missed(&self, gains: &[f64]) -> Result<f64, Error> {
        let mut worst = f64::NEG_INFINITY;
        for (place, _) in &self.seen {
            let of = self.posed.at(*place, gains);
            worst = worst.max(self.posed.demands.missed(&of, self.task)?);
        }
        Ok(worst)
    }

    /// The largest k of a gap whose gains meet the other demands, by regula falsi (Illinois: Dowell and
    /// Jarratt 1971, BIT 11).
    pub(super) fn down(&self, ray: &Ray, (from, end): Gap) -> Result<Option<f64>, Error> {
        let (mut good, mut bad) = (end, None);
        let (mut least, mut idle) = (f64::INFINITY, 0);
        for _ in 0..STEPS_DOWN {
            self.task.check()?;
            let short = self.missed(&ray.at(good))?;
            idle = if short < least { 0 } else { idle + 1 };
            least = least.min(short);
            if idle == IDLE {
                return Ok(None);
            }
            if short > 0.0 {
                bad = Some((good, short));
                good *= DOWN;
                if good <= from {
                    return Ok(None);
                }
                continue;
            }
            let Some((mut bad, mut over)) = bad else {
                return Ok(Some(good));
            };
            let mut under = short;
            for _ in 0..HALVINGS {
                let share = under / (under - over);
                let is_known = share.is_finite() && over.is_finite();
                let middle = good + (bad - good) * if is_known { share } else { 0.5 };
                let found = self.missed(&ray.at(middle))?;
                if found > 0.0 {
                    (bad, over) = (middle, found);
                    under *= 0.5;
                } else {
                    (good, under) = (middle, found);
                    over *= 0.5;
                }
                if (bad - good) <= KNOWN * good || (found <= 0.0 && found > -KNOWN) {
                    break;
                }
            }
            return Ok(Some(good));
        }
        Ok(None)
    }

    pub(super) fn is_stable(&self, gains: &[f64]) -> Result<bool, Error> {
        if let (false, Some(growth), Some((_, open))) =
            (self.checks_all, self.growth.get(), self.seen.first())
        {
            return Ok((open.growth(gains) - growth).abs() < SAME_GROWTH);
        }
        let count = if self.checks_all { self.seen.len() } else { 1 };
        for (place, _) in self.seen.iter().take(count) {
            let of = self.posed.at(*place, gains);
            if !is_stable_loop(&of, self.task)? {
                return Ok(false);
            }
        }
        if let Some((_, open)) = self.seen.first() {
            self.growth.set(Some(open.growth(gains)));
        }
        Ok(true)
    }

    /// A bound from below on the value of gains, without a simulation.
    pub(super) fn least(&self, gains: &[f64]) -> Result<f64, Error> {
        if self.weights.load == 0.0 {
            return Ok(0.0);
        }
        let mut worst = 0.0f64;
        for (place, _) in &self.seen {
            let of = self.posed.at(*place, gains);
            worst = worst.max(lasting(&of)?);
        }
        Ok(self.weights.load * worst)
    }

    /// Is the integral of the modulus after a load what counts? Without an integral it is the rest.
    fn is_absolute(&self) -> bool {
        let first = self.posed.loops.first();
        let integrates = first.is_some_and(|of| of.controller().kind.integrates());
        integrates && !self.posed.wish.by_integral
    }

    /// Are responses simulated?
    pub(super) fn simulates(&self) -> bool {
        self.weights.set_point > 0.0 || self.is_absolute()
    }

    /// The value of gains in the worst of the loops that are seen; where it is more than `most`, perhaps
    /// less than it is.
    pub(super) fn value(&self, gains: &[f64], most: f64) -> Result<f64, Error> {
        let (wish, weights) = (&self.posed.wish, self.weights);
        let is_absolute = self.is_absolute();
        let least = self.least(gains)?;
        if !self.simulates() || least > most {
            return Ok(least);
        }
        let mut worst = least;
        for (place, _) in &self.seen {
            let of = self.posed.at(*place, gains);
            let number = |found: f64| if found.is_nan() { NEVER } else { found };
            let of_step = |drive, is_settling: bool| -> Result<f64, Error> {
                let found = figures(&of, drive, self.task)?.map(|found| found.deviation);
                Ok(number(found.map_or(f64::NAN, |found| {
                    if is_settling {
                        found.recovery_time
                    } else {
                        found.iae
                    }
                })))
            };
            let load = match (weights.load > 0.0, is_absolute) {
                (false, _) => 0.0,
                (true, false) => lasting(&of)?,
                (true, true) => of_step(Drive::Load, false)?,
            };
            let set_point = if weights.set_point > 0.0 {
                of_step(Drive::Reference, wish.by_settling)?
            } else {
                0.0
            };
            worst = worst.max(weights.load * load + weights.set_point * set_point);
            if worst > most {
                break;
            }
        }
        Ok(worst)
    }
}
