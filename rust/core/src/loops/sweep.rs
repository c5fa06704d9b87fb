//! Step responses of many loops that differ in some numbers.
//!
//! The equations are written for all loops of a block at once, over [`Each`]; blocks bound the memory.

use crate::dde::Criteria;
use crate::dde::ensemble::{self, Alone, Measures, Outcome, Sets};
use crate::stability::{abscissae, decay};
use crate::{Error, Task, memory, parallel};

use super::control_loop::{ControlLoop, Place, Values};
use super::each::Each;
use super::equations::Input;
use super::load::{DeviationAsked, Figures};
use super::plant::Fraction;
use super::rest::rest_gains;
use super::settled::slowest;

/// Number of loops that are built and simulated together: more leave the caches, fewer take more calls.
const BLOCK: usize = 1 << 13;

/// What memory is asked for.
pub(super) const SWEEP: &str = "the sweep";

/// Many loops, and the step of their reference.
#[derive(Debug, Clone)]
pub struct SweptLoops<'a> {
    of: &'a ControlLoop,
    values: Values<Each>,
    count: usize,
    /// Height of the step.
    amplitude: f64,
}

/// A loop without its reference: what a judgement of its settling needs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Resting {
    /// Output at rest; NaN where the command that it needs is beyond the limit.
    pub steady: f64,
    /// Command at rest, limit left out.
    pub command: f64,
    /// Upper bound on the slowest time constant of plant and controller, s.
    pub slowest: f64,
}

impl<'a> SweptLoops<'a> {
    /// `count` loops, whose numbers in `moving` differ; `given` are the polynomials of a
    /// [`Plant::Given`](super::Plant::Given).
    ///
    /// # Errors
    /// [`Error::Argument`] for a filter that runs on samples.
    pub fn new(
        of: &'a ControlLoop,
        moving: Vec<(Place, Vec<f64>)>,
        given: Option<Fraction<Each>>,
        (count, amplitude): (usize, f64),
    ) -> Result<Self, Error> {
        let mut values = of.values().entries::<Each>();
        for (place, numbers) in moving {
            values.set(place, Each::from(numbers));
        }
        let own = || {
            let given = of.values().given.as_ref()?;
            let list = |part: &[f64]| part.iter().copied().map(Each::from).collect();
            Some(Fraction {
                num: list(&given.num),
                den: list(&given.den),
            })
        };
        values.given = given.or_else(own);
        refuse_if!(
            of.controller().is_discretised() && values.sample_time.is_some(),
            "a sweep cannot have a filter that runs on samples: leave discretisation out, or \
             simulate the loops one by one"
        );
        Ok(Self {
            of,
            values,
            count,
            amplitude,
        })
    }

    /// The loop whose numbers differ.
    pub(super) fn of(&self) -> &ControlLoop {
        self.of
    }

    /// Number of loops.
    pub(super) fn len(&self) -> usize {
        self.count
    }

    /// The numbers of all loops.
    pub(super) fn values(&self) -> &Values<Each> {
        &self.values
    }

    pub(super) fn is_sampled(&self) -> bool {
        self.values.sample_time.is_some()
    }

    /// The loops in these places.
    pub(super) fn only(&self, places: &[usize]) -> Self {
        Self {
            values: self.values_at(places),
            count: places.len(),
            ..*self
        }
    }

    /// The numbers of the loops in these places.
    fn values_at(&self, places: &[usize]) -> Values<Each> {
        let part = |each: &Each| match each {
            Each::Own(numbers) => {
                let numbers = places.iter().map(|place| numbers[*place]);
                Each::from(numbers.collect::<Vec<_>>())
            }
            shared @ Each::Shared(_) => shared.clone(),
        };
        let mut values = self.values.each(&part);
        values.given = self.values.given.as_ref().map(|given| Fraction {
            num: given.num.iter().map(part).collect(),
            den: given.den.iter().map(part).collect(),
        });
        values
    }

    /// What the settling of each loop is judged by.
    ///
    /// # Errors
    /// [`Error::Argument`] for a plant without polynomials.
    pub fn resting(&self) -> Result<Vec<Resting>, Error> {
        let parts = self.of.polynomials(&self.values)?;
        let limit = self
            .values
            .limit
            .clone()
            .unwrap_or(Each::Shared(f64::INFINITY));
        let low = self.values.low.clone();
        // The reference path has the denominator of the feedback.
        let (mut shared, mut own) = (0.0_f64, Vec::new());
        for part in &parts[..4] {
            if part.iter().all(|c| matches!(c, Each::Shared(_))) {
                let numbers: Vec<f64> = part.iter().map(|c| at(c, 0)).collect();
                shared = shared.max(slowest(&numbers));
            } else {
                own.push(part);
            }
        }
        let mut numbers = Vec::new();
        let mut resting = |set: usize| {
            let ends = parts
                .each_ref()
                .map(|part| part.last().map_or(0.0, |c| at(c, set)));
            let (output, command) = rest_gains(ends);
            let command = command * self.amplitude;
            let high = at(&limit, set);
            let least = low.as_ref().map_or(-high, |low| at(low, set));
            let within = command >= least && command <= high;
            let times = own.iter().map(|part| {
                numbers.clear();
                numbers.extend(part.iter().map(|c| at(c, set)));
                slowest(&numbers)
            });
            Resting {
                steady: if within {
                    output * self.amplitude
                } else {
                    f64::NAN
                },
                command,
                slowest: times.fold(shared, f64::max),
            }
        };
        memory::collected(SWEEP, (0..self.count).map(&mut resting))
    }

    /// Hand blocks of loops with equal numbers of states to `work`, with their places.
    fn blocks(
        &self,
        mut work: impl FnMut(&[usize], &Sets<'_>) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let [num, den, ..] = self.of.polynomials(&self.values)?;
        for first in (0..self.count).step_by(BLOCK) {
            let places: Vec<usize> = (first..self.count.min(first + BLOCK)).collect();
            for places in groups(places, [&num, &den]) {
                let values = self.values_at(&places);
                let (states, entries) = self.entries(&values)?;
                let entries: Vec<&[f64]> = entries.iter().map(Each::numbers).collect();
                let is_ahead = self.of.is_measured();
                let sets = Sets::new(states, places.len(), &entries, self.amplitude, is_ahead)?;
                work(&places, &sets)?;
            }
        }
        Ok(())
    }

    /// Number of states, and the entries in the order of a row of [`Sets`].
    fn entries(&self, values: &Values<Each>) -> Result<(usize, Vec<Each>), Error> {
        let found = self.of.equations(values, Input::Reference, None)?;
        let states = found.b.len();
        let or = |own: &Option<Each>, other: f64| own.clone().unwrap_or(Each::Shared(other));
        let mut entries = found.a;
        entries.extend(found.b);
        entries.extend(found.e);
        entries.extend(found.k);
        entries.extend(found.c);
        entries.extend([found.l, found.m, found.d, found.impulse]);
        entries.extend([
            values.delay.clone(),
            or(&values.sample_time, 0.0),
            or(&values.limit, f64::INFINITY),
        ]);
        Ok((states, entries))
    }

    /// Measure every response from its start to `span` seconds after it; `keep` receives places, which
    /// increase within a call, with their metrics.
    ///
    /// # Errors
    /// As [`ensemble::metrics`].
    pub fn metrics(
        &self,
        span: f64,
        criteria: &Criteria,
        task: &Task,
        mut keep: impl FnMut(&[usize], &Measures),
    ) -> Result<(), Error> {
        let resting = self.resting()?;
        if self.is_guarded() {
            let numbers = resting.iter().map(|one| (one.steady, one.slowest));
            let numbers: Vec<_> = numbers.collect();
            let one = |set| self.alone(set);
            return ensemble::metrics_alone(&numbers, one, (span, criteria), task, keep);
        }
        self.blocks(|places, sets| {
            let column = |of: fn(&Resting) -> f64| -> Vec<f64> {
                places.iter().map(|place| of(&resting[*place])).collect()
            };
            let (steady, slowest) = (column(|one| one.steady), column(|one| one.slowest));
            let mut own = Vec::new();
            ensemble::metrics(
                sets,
                (&steady, &slowest),
                span,
                criteria,
                task,
                |found, measures| {
                    own.clear();
                    own.extend(found.iter().map(|set| places[*set]));
                    keep(&own, measures);
                },
            )
        })
    }

    /// Outputs at times after the start, a row a loop, and what became of each.
    ///
    /// # Errors
    /// As [`ensemble::responses`].
    pub fn responses(&self, times: &[f64], task: &Task) -> Result<(Vec<f64>, Vec<Outcome>), Error> {
        let width = times.len();
        let mut outputs = memory::filled(SWEEP, f64::NAN, self.count.saturating_mul(width))?;
        let mut outcomes = memory::filled(SWEEP, Outcome::Refused, self.count)?;
        if self.is_guarded() {
            let rows = outputs.chunks_mut(width.max(1)).zip(&mut outcomes);
            parallel::each(
                SWEEP,
                rows,
                |set, (row, place): (&mut [f64], &mut Outcome)| {
                    task.check()?;
                    if let Some(one) = self.alone(set) {
                        let (found, outcome) = one.response(times, task)?;
                        if found.len() == width {
                            row.copy_from_slice(&found);
                        }
                        *place = outcome;
                    }
                    task.advance(1);
                    Ok(())
                },
            )?;
            return Ok((outputs, outcomes));
        }
        self.blocks(|places, sets| {
            let (found, status) = ensemble::responses(sets, times, task)?;
            for ((place, row), outcome) in places.iter().zip(found.chunks(width)).zip(status) {
                outputs[place * width..(place + 1) * width].copy_from_slice(row);
                outcomes[*place] = outcome;
            }
            Ok(())
        })?;
        Ok((outputs, outcomes))
    }

    /// Figures of the deviation after a step of each loop, and what became of it.
    ///
    /// # Errors
    /// [`Error::Interrupted`], [`Error::Memory`].
    pub fn deviations(
        &self,
        asked: &DeviationAsked,
        task: &Task,
    ) -> Result<Vec<(Figures, Outcome)>, Error> {
        let of = |(): &mut (), set: usize| {
            task.check()?;
            let found = self.of.with(self.values_of(set)).deviation(asked, task);
            task.advance(1);
            match found {
                Ok(found) if found.is_settled => Ok(Some((found, Outcome::Ok))),
                Ok(found) => Ok(Some((found, Outcome::Unsettled))),
                Err(error) if error.ends_all() => Err(error),
                Err(Error::Diverges { .. }) => Ok(Some((Figures::UNKNOWN, Outcome::Diverged))),
                Err(_) => Ok(None),
            }
        };
        let found = parallel::results(SWEEP, self.count, || (), of)?;
        let refused = (Figures::UNKNOWN, Outcome::Refused);
        memory::collected(
            SWEEP,
            found.into_iter().map(|found| found.unwrap_or(refused)),
        )
    }

    /// Do the bounds of the commands need more than a row of numbers holds?
    fn is_guarded(&self) -> bool {
        self.of.with(self.values_of(0)).is_guarded()
    }

    /// One loop, to run by itself; none where its numbers are not those of a loop.
    fn alone(&self, set: usize) -> Option<Alone> {
        let one = self.of.with(self.values_of(set));
        let plant = one.linear(Input::Reference).ok()?;
        Some(Alone {
            ahead: one.output_lead(),
            plant,
            amplitude: self.amplitude,
        })
    }

    /// The numbers of one loop.
    fn values_of(&self, set: usize) -> Values {
        let number = |each: &Each| at(each, set);
        let list = |part: &Vec<Each>| part.iter().map(number).collect();
        Values {
            given: self.values.given.as_ref().map(|given| Fraction {
                num: list(&given.num),
                den: list(&given.den),
            }),
            ..self.values.each(&number)
        }
    }

    /// Spectral abscissae without the limits, 1/s; NaN where none is found.
    ///
    /// # Errors
    /// [`Error::Interrupted`].
    pub fn abscissae(&self, task: &Task) -> Result<Vec<f64>, Error> {
        self.each_found(f64::NAN, |_, sets| abscissae(sets, task))
    }

    /// Does each loop without its limit decay at its rate in 1/s at least? Not where that is not found.
    ///
    /// # Errors
    /// [`Error::Interrupted`].
    pub fn decay(&self, rates: &[f64], task: &Task) -> Result<Vec<bool>, Error> {
        self.each_found(false, |places, sets| {
            let least: Vec<f64> = places.iter().map(|place| rates[*place]).collect();
            decay(sets, &least, task)
        })
    }

    fn each_found<T: Copy>(
        &self,
        unknown: T,
        mut find: impl FnMut(&[usize], &Sets<'_>) -> Result<Vec<T>, Error>,
    ) -> Result<Vec<T>, Error> {
        let mut all = memory::filled(SWEEP, unknown, self.count)?;
        self.blocks(|places, sets| {
            for (place, found) in places.iter().zip(find(places, sets)?) {
                all[*place] = found;
            }
            Ok(())
        })?;
        Ok(all)
    }
}

/// The number of a loop.
pub(super) fn at(each: &Each, place: usize) -> f64 {
    match each {
        Each::Shared(number) => *number,
        Each::Own(numbers) => numbers.get(place).copied().unwrap_or(f64::NAN),
    }
}

/// Places by the leading coefficients that are zero: these remove states, as a lag of zero does.
fn groups(places: Vec<usize>, polynomials: [&[Each]; 2]) -> Vec<Vec<usize>> {
    let may_vanish = |p: &[Each]| {
        p.first()
            .is_some_and(|c| c.numbers().len() > 1 && c.numbers().contains(&0.0))
    };
    if !polynomials.into_iter().any(may_vanish) {
        return vec![places];
    }
    let mut groups: Vec<([usize; 2], Vec<usize>)> = Vec::new();
    for place in places {
        let order = polynomials.map(|p| p.iter().take_while(|c| at(c, place) == 0.0).count());
        match groups.iter_mut().find(|(known, _)| *known == order) {
            Some((_, group)) => group.push(place),
            None => groups.push((order, vec![place])),
        }
    }
    groups.into_iter().map(|(_, group)| group).collect()
}
