//! Whether a response that is in its settling band stays there.
//!
//! A response may pass through its band, or leave it slowly after the end of the run. It counts as
//! settled if it has been inside for three of the slowest time constants of the closed loop,
//! 1/|abscissa|, and the command within its limit: at the limit the loop is open, and its integral may
//! have to unwind. Where the reference needs the whole limit or more, the command rests there, and the
//! time constants are those of plant and controller alone.
//!
//! To ask the poles of a loop takes longer than its simulation, so they are asked in two cases only: if
//! the response had not decayed to well within the band, or if a pole or zero of plant or controller is
//! slow compared with the simulated time. Where that time is given, a count of the slow poles of a
//! continuous loop is enough; where it is to be found, they are computed.

use crate::dde::control_loop::sampled;
use crate::dde::ensemble::{Measures, Outcome};
use crate::dde::{Criteria, TIME_CONSTANTS};
use crate::roots::spectral_abscissa;
use crate::stability::HeldLoop;
use crate::{Error, Task, memory};

use super::control_loop::ControlLoop;
use super::equations::Input;
use super::sweep::{SWEEP, SweptLoops, at};

/// Loops that have not settled are simulated again over a longer time: the first one times powers of
/// 2^(1/`PER_DOUBLING`), so that loops with the same time run together. More fit the times better to the
/// loops and make smaller groups.
const PER_DOUBLING: f64 = 2.0;

/// The largest power: a larger one settles slower loops and takes longer.
const MOST_STEPS: f64 = 10.0 * PER_DOUBLING;

/// Simulation time of a loop whose output is outside its band at the end, in slowest time constants of
/// the closed loop. A deviation as large as the step has then decayed to 3e-4 of it (e^-8): fewer repeat
/// the simulation more often, more make it longer.
const TO_SETTLE: f64 = 8.0;

/// Added to a number of steps before it is rounded up, so that a rounding error does not make the time
/// too short.
const STEP_ROUNDING: f64 = 1e-6;

/// Part of the limit by which the command at rest may be below it and counts as at it: more covers larger
/// rounding errors, and takes more commands near the limit for ones at it.
const AT_LIMIT: f64 = 1e-12;

/// The default time of a step response is `SHORTEST` times the longest of all time constants, delays and
/// `LEAST` seconds: more show more of a slow end and less of a fast beginning.
const SHORTEST: f64 = 10.0;
const LEAST: f64 = 0.01;

/// Number of metrics, and of the columns with the last times at which commands were at their limits.
const METRICS: usize = 9;
const COLUMNS: usize = METRICS + 1;

/// Place of the settling time among the metrics.
const SETTLING_TIME: usize = 1;

/// First time of the response to a step, s, of states that follow x′ = A x with A of side `n`.
///
/// # Errors
/// [`Error::Convergence`] where the eigenvalues are not found.
pub fn first_duration(a: &[f64], n: usize, delay: f64) -> Result<f64, Error> {
    let poles = sampled::eigenvalues(a.to_vec(), n, n)?;
    let times = poles.iter().map(|pole| pole.norm());
    let times = times.filter(|size| *size > 0.0).map(|size| 1.0 / size);
    Ok(SHORTEST * times.fold(delay.max(LEAST), f64::max))
}

/// Metrics of many loops.
#[derive(Debug, Clone)]
pub struct SweptMetrics {
    /// Each metric of all loops, in the order of [`Metrics`](crate::dde::Metrics), and then the last times
    /// at which commands were at their limits.
    pub columns: Vec<f64>,
    /// What became of each loop.
    pub outcomes: Vec<Outcome>,
    /// Length of the longest response, s.
    pub span: f64,
}

impl SweptMetrics {
    /// Number of metrics.
    pub const METRICS: usize = METRICS;

    /// The metrics alone.
    pub fn into_metrics(mut self) -> Vec<f64> {
        self.columns.truncate(METRICS * self.outcomes.len());
        self.columns
    }

    fn new(count: usize, span: f64) -> Result<Self, Error> {
        Ok(Self {
            columns: memory::filled(SWEEP, f64::NAN, COLUMNS * count)?,
            outcomes: memory::filled(SWEEP, Outcome::Refused, count)?,
            span,
        })
    }

    /// One metric of all loops by its place.
    pub fn column(&self, metric: usize) -> &[f64] {
        let count = self.outcomes.len();
        &self.columns[metric * count..(metric + 1) * count]
    }

    fn keep(&mut self, sets: &[usize], measures: &Measures) {
        let count = self.outcomes.len();
        for (column, values) in self
            .columns
            .chunks_mut(count.max(1))
            .zip(measures.columns())
        {
            put(column, sets, values);
        }
        for (set, outcome) in sets.iter().zip(measures.outcomes()) {
            self.outcomes[*set] = outcome;
        }
    }

    /// Places of loops that are outside of their bands at the end, or of which it is not known.
    fn open(&self) -> Vec<usize> {
        let is_open = |place: &usize| is_open(self.outcomes[*place]);
        (0..self.outcomes.len()).filter(is_open).collect()
    }

    /// Doubtful loops count as unsettled, and these have no settling time.
    fn concluded(mut self) -> Self {
        let count = self.outcomes.len();
        for (place, outcome) in self.outcomes.iter_mut().enumerate() {
            if is_open(*outcome) {
                *outcome = Outcome::Unsettled;
                self.columns[SETTLING_TIME * count + place] = f64::NAN;
            }
        }
        self
    }
}

fn is_open(outcome: Outcome) -> bool {
    matches!(outcome, Outcome::Unsettled | Outcome::Doubtful)
}

/// Write the first of `values` to the places of `sets`, which increase.
fn put(column: &mut [f64], sets: &[usize], values: &[f64]) {
    let (Some(&first), Some(&last)) = (sets.first(), sets.last()) else {
        return;
    };
    if last - first + 1 == sets.len()
        && let (Some(places), Some(values)) =
            (column.get_mut(first..=last), values.get(..sets.len()))
    {
        places.copy_from_slice(values);
        return;
    }
    for (&set, value) in sets.iter().zip(values) {
        if let Some(place) = column.get_mut(set) {
            *place = *value;
        }
    }
}

/// A loop at its limit: its decay rate without feedback, 1/s, and whether its command rests there.
#[derive(Debug, Clone, Copy)]
struct AtLimit {
    rate: f64,
    rests: bool,
}

impl AtLimit {
    fn new(command: f64, (low, high): (f64, f64), slowest: f64) -> Self {
        let part = 1.0 - AT_LIMIT;
        Self {
            rate: 1.0 / slowest,
            rests: command >= high * part || command <= low * part,
        }
    }

    /// For how long before `end` a response was in its band under the same poles, s, and whether these
    /// are those without feedback. `settled` is the time since which it is in its band, NaN for none, and
    /// `limited` the last time at which the command was at its limit.
    fn time_inside(self, settled: f64, limited: f64, end: f64) -> (f64, bool) {
        let stays = self.rests && limited >= end;
        // The sum comes first: it keeps NaN.
        let inside = end - settled;
        (
            if stays || limited <= settled || settled.is_nan() {
                inside
            } else {
                end - limited
            },
            stays,
        )
    }
}

/// Was a response inside long enough, by the decay rate of its slowest mode, 1/s?
fn is_long(inside: f64, rate: f64) -> bool {
    inside * rate >= TIME_CONSTANTS
}

/// The ratio of the simulated time after so many steps to the first one.
fn longer(steps: f64) -> f64 {
    libm::exp2(steps / PER_DOUBLING)
}

/// A loop that is simulated again until it has settled.
#[derive(Debug, Clone, Copy)]
struct Due {
    place: usize,
    /// Decay rate of the closed loop, 1/s.
    closed: f64,
    at_limit: AtLimit,
    steps: f64,
}

impl Due {
    /// The steps that this loop needs after it was simulated; none where it has settled or never will.
    fn judged(&mut self, found: &mut SweptMetrics, span: f64) -> bool {
        let count = found.outcomes.len();
        let end = span * longer(self.steps);
        let [settled, limited] =
            [SETTLING_TIME, METRICS].map(|metric| found.columns[metric * count + self.place]);
        let (inside, stays) = self.at_limit.time_inside(settled, limited, end);
        let rate = if stays {
            self.at_limit.rate
        } else {
            self.closed
        };
        if is_long(inside, rate) {
            found.outcomes[self.place] = Outcome::Ok;
            return false;
        }
        if !(rate > 0.0 && self.steps < MOST_STEPS) {
            return false;
        }
        let lasts = if inside.is_nan() {
            TO_SETTLE / rate
        } else {
            end - inside + TIME_CONSTANTS / rate
        };
        let needed = (PER_DOUBLING * libm::log2(lasts / span) + STEP_ROUNDING).ceil();
        self.steps = needed.max(self.steps + 1.0).min(MOST_STEPS);
        true
    }
}

impl SweptLoops<'_> {
    /// Measure every response over `span` seconds, a doubtful one settled if it was in its band for long
    /// enough; or without that until it has settled, or is known not to.
    ///
    /// # Errors
    /// As [`metrics`](Self::metrics).
    pub fn measured(
        &self,
        span: Option<f64>,
        criteria: &Criteria,
        task: &Task,
    ) -> Result<SweptMetrics, Error> {
        let found = match span {
            Some(span) => self.decided(span, criteria, task)?,
            None => self.until_settled(criteria, task)?,
        };
        Ok(found.concluded())
    }

    fn over(&self, span: f64, criteria: &Criteria, task: &Task) -> Result<SweptMetrics, Error> {
        let mut found = SweptMetrics::new(self.len(), span)?;
        self.metrics(span, criteria, task, |sets, measures| {
            found.keep(sets, measures);
        })?;
        Ok(found)
    }

    fn decided(&self, span: f64, criteria: &Criteria, task: &Task) -> Result<SweptMetrics, Error> {
        let mut found = self.over(span, criteria, task)?;
        let doubtful = (0..self.len()).filter(|set| found.outcomes[*set] == Outcome::Doubtful);
        let doubtful: Vec<usize> = doubtful.collect();
        if doubtful.is_empty() {
            return Ok(found);
        }
        let these = self.only(&doubtful);
        let inside: Vec<(f64, bool, f64)> = these
            .at_limit()?
            .into_iter()
            .zip(&doubtful)
            .map(|(at_limit, set)| {
                let [settled, limited] =
                    [SETTLING_TIME, METRICS].map(|metric| found.column(metric)[*set]);
                let (inside, stays) = at_limit.time_inside(settled, limited, span);
                (inside, stays, at_limit.rate)
            })
            .collect();
        let stays: Vec<bool> = if self.is_sampled() {
            let rates = these.rates(task)?;
            let each = inside.iter().zip(rates);
            each.map(|((inside, ..), rate)| is_long(*inside, rate))
                .collect()
        } else {
            let least = inside
                .iter()
                .map(|(inside, ..)| TIME_CONSTANTS / inside.max(0.0));
            these.decay(&least.collect::<Vec<f64>>(), task)?
        };
        for ((set, (inside, is_open, alone)), stays) in doubtful.iter().zip(inside).zip(stays) {
            if if is_open {
                is_long(inside, alone)
            } else {
                stays
            } {
                found.outcomes[*set] = Outcome::Ok;
            }
        }
        Ok(found)
    }

    fn until_settled(&self, criteria: &Criteria, task: &Task) -> Result<SweptMetrics, Error> {
        let span = self.first_duration()?;
        let mut found = self.over(span, criteria, task)?;
        let mut places = found.open();
        if places.is_empty() {
            return Ok(found);
        }
        // Poles are expensive, and most of these settle within twice the first time.
        let mut longest = PER_DOUBLING;
        self.run_on(&places, span * longer(longest), criteria, task, &mut found)?;
        places.retain(|place| is_open(found.outcomes[*place]));
        let open = self.only(&places);
        let mut due: Vec<Due> = places
            .into_iter()
            .zip(open.rates(task)?)
            .zip(open.at_limit()?)
            .map(|((place, closed), at_limit)| Due {
                place,
                closed,
                at_limit,
                steps: longest,
            })
            .collect();
        while !due.is_empty() {
            due.retain_mut(|each| each.judged(&mut found, span));
            let mut steps: Vec<f64> = due.iter().map(|each| each.steps).collect();
            steps.sort_by(f64::total_cmp);
            steps.dedup();
            longest = steps.iter().copied().fold(longest, f64::max);
            for steps in steps {
                let these = due.iter().filter(|each| each.steps == steps);
                let these: Vec<usize> = these.map(|each| each.place).collect();
                self.run_on(&these, span * longer(steps), criteria, task, &mut found)?;
            }
            due.retain(|each| is_open(found.outcomes[each.place]));
        }
        found.span = span * longer(longest);
        Ok(found)
    }

    /// Measure the loops in these places over a longer time.
    fn run_on(
        &self,
        places: &[usize],
        span: f64,
        criteria: &Criteria,
        task: &Task,
        found: &mut SweptMetrics,
    ) -> Result<(), Error> {
        // They were not done after all.
        task.take_back(places.len() as u64);
        let again = self.only(places).over(span, criteria, task)?;
        let count = found.outcomes.len();
        for (from, (place, outcome)) in places.iter().zip(&again.outcomes).enumerate() {
            if *outcome == Outcome::Refused {
                found.outcomes[*place] = Outcome::Unsettled;
                continue;
            }
            found.outcomes[*place] = *outcome;
            for metric in 0..COLUMNS {
                found.columns[metric * count + place] = again.column(metric)[from];
            }
        }
        Ok(())
    }

    /// The time over which all responses are simulated first, s.
    fn first_duration(&self) -> Result<f64, Error> {
        let of = self.of();
        let values = self.values();
        let wait = |set: usize| {
            let hold = values
                .sample_time
                .as_ref()
                .map_or(0.0, |time| at(time, set));
            at(&values.delay, set) + hold
        };
        let longest = (0..self.len()).map(wait).fold(0.0, f64::max);
        let equations = of.equations(of.values(), Input::Reference, None)?;
        first_duration(&equations.a, equations.b.len(), longest)
    }

    fn at_limit(&self) -> Result<Vec<AtLimit>, Error> {
        let values = self.values();
        let resting = self.resting()?.into_iter().enumerate();
        let each = resting.map(|(set, one)| {
            let high = values
                .limit
                .as_ref()
                .map_or(f64::INFINITY, |limit| at(limit, set));
            let low = values.low.as_ref().map_or(-high, |low| at(low, set));
            AtLimit::new(one.command, (low, high), one.slowest)
        });
        Ok(each.collect())
    }

    /// Decay rates of the slowest roots without the limits, 1/s; NaN where none is found.
    fn rates(&self, task: &Task) -> Result<Vec<f64>, Error> {
        let mut rates = self.abscissae(task)?;
        rates.iter_mut().for_each(|rate| *rate = -*rate);
        Ok(rates)
    }
}

impl ControlLoop {
    /// The spectral abscissa without the limit, 1/s.
    ///
    /// # Errors
    /// As [`spectral_abscissa`] and [`HeldLoop::abscissa`].
    pub fn abscissa(&self, task: &Task) -> Result<f64, Error> {
        if self.values().sample_time.is_none() {
            return spectral_abscissa(&self.characteristic()?, true, task);
        }
        HeldLoop::new(&self.linear(Input::Reference)?)?.abscissa(task)
    }

    /// Does a simulated response stay in the band in which it is since `settled`, s? It is a matter of the
    /// loop only if its command was or is to be at the limit. `times` count from the start, `command` is
    /// that at rest without limits, NaN without a rest.
    ///
    /// # Errors
    /// Those that end all work, and as [`slowest_time`](Self::slowest_time).
    pub fn stays_settled(
        &self,
        times: &[f64],
        commands: &[f64],
        command: f64,
        settled: f64,
        task: &Task,
    ) -> Result<bool, Error> {
        let values = self.values();
        if (values.limit.is_none() && values.rate.is_none()) || !settled.is_finite() {
            return Ok(true);
        }
        let high = values.limit.unwrap_or(f64::INFINITY);
        let low = values.low.unwrap_or(-high);
        let at_limit = AtLimit::new(command, (low, high), self.slowest_time()?);
        let last = commands.iter().rposition(|u| *u >= high || *u <= low);
        if last.is_none() && !at_limit.rests {
            return Ok(true);
        }
        // The command left its limit before the output after the last one at which it was there.
        let last = last.map_or(0, |last| (last + 1).min(times.len() - 1));
        let (Some(limited), Some(end)) = (times.get(last), times.last()) else {
            return Ok(true);
        };
        let (inside, stays) = at_limit.time_inside(settled, *limited, *end);
        if stays {
            return Ok(is_long(inside, at_limit.rate));
        }
        match self.abscissa(task) {
            Ok(abscissa) => Ok(is_long(inside, -abscissa)),
            Err(Error::Convergence { .. }) => Ok(false),
            Err(error) => Err(error),
        }
    }
}
