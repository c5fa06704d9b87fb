//! Gains with the best response to a load or a set point under a largest Ms over many loops.
//!
//! Gains are taken by rays: ratios of the gains give a direction, along which the gaps of `open` are
//! all that Ms leaves, and the response to a load is best at the upper end of a stable one. What is
//! searched are the ratios: on a grid, and from its best point by parabolas or simplices. Gains are
//! then judged with the exact margins of every loop; the frequencies at which Ms is too large, and the
//! loops, are added to those the search sees, and it is repeated (exchange: Hettich and Kortanek 1993,
//! SIAM Review 35). Margins of the result are exact; that no better gains exist is not proved.

use std::cell::Cell;

use super::demands::{Demands, is_stable_loop, margins_of, sensitivity_of};
use super::open::{Gap, Open, Scale, gaps};
use super::responses::figures;
use super::simplices;
use crate::between::minimum;
use crate::elementary::exp;
use crate::frequency::{Margins, Peak, first_term};
use crate::loops::{ControlLoop, Drive, Place};
use crate::{Error, Task, parallel};

/// Integral times of the grid in units of one over the phase crossover of the plant, as logarithms, and
/// how many: wider and more find stranger best gains and take time in proportion.
const INTEGRAL: (f64, f64, usize) = (-3.0, 6.2, 33);

/// Derivative times in tenths of that unit, as inverse hyperbolic sines, and how many.
const DERIVATIVE: (f64, f64, usize) = (-1.5, 5.5, 15);

/// Most points of the grid whose responses are simulated where nothing bounds them.
const SIMULATED: usize = 60;

/// Evaluations of a search by parabolas, and the accuracies of ratios of which one or two are sought:
/// finer ones improve the best value by less than its last digits.
const ALONG: usize = 40;
const RATIO_KNOWN: f64 = 1e-6;
const RATIOS_KNOWN: f64 = 1e-4;

/// Cost of gains that miss a demand: above every other cost.
const NEVER: f64 = 1e30;

/// Rounds of the exchange, and the relative excess of Ms that counts as none and at which the search
/// aims below the demand.
const ROUNDS: usize = 40;
const EXCESS: f64 = 2e-7;
const AIMED: f64 = 1e-7;

/// Excess of Ms up to which the ratios are kept and only the gains become smaller.
const SMALL: f64 = 1e-2;

/// Loops that are added to the search in one round.
const ADDED: usize = 3;

/// Steps down a ray, each by this factor, and halvings, by which gains are sought that meet demands
/// other than Ms.
const DOWN: f64 = 0.85;
const STEPS_DOWN: usize = 60;
const HALVINGS: usize = 30;

/// Relative accuracy of gains that meet other demands, and of these.
const KNOWN: f64 = 1e-8;

/// Sampled loops, of those with the least delay margin by their crossings, whose exact one is computed,
/// which takes long.
const LATEST: usize = 2;

/// Difference of two growths of an argument, rad, below which both loops are stable or neither is:
/// between the quarter turn and the half turn that there are.
const SAME_GROWTH: f64 = 0.75 * std::f64::consts::PI;

/// How far around the best ratios neighbours are looked for, in the units of the grid, and at how many
/// points of each of one or two ratios.
const AROUND_ONE: (f64, usize) = (1.6, 33);
const AROUND_TWO: (f64, usize) = (0.8, 7);

/// Most loops, those with the largest Ms, whose margins are all computed.
const WORST: usize = 12;

/// What is made best.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wish {
    /// Weight of the response to a load, between 0 and 1; the rest is that of a set point.
    pub load: f64,
    /// Is the integral of the error of a load what counts, and not that of its modulus?
    pub by_integral: bool,
    /// Is the settling time of a set point what counts, and not the integral of the modulus?
    pub by_settling: bool,
}

/// Loops that differ in what is not known of them, the first one the nominal.
#[derive(Debug, Clone)]
pub struct Posed {
    /// All have the same controller, whose free gains do not matter.
    pub loops: Vec<ControlLoop>,
    /// How many of them the search begins with.
    pub first: usize,
    /// Places of the free gains.
    pub free: Vec<usize>,
    /// What is made best.
    pub wish: Wish,
    /// What must hold.
    pub demands: Demands,
    /// Where each free gain may be, if that is given.
    pub bounds: Option<Vec<(f64, f64)>>,
    /// The ratios of the gains, if they are given: only the size of the gains is sought.
    pub shape: Option<Vec<f64>>,
    /// Part of the best value that neighbours may lose.
    pub slack: f64,
}

/// Gains beside the best ones, with the largest Ms in the loops that the search saw.
#[derive(Debug, Clone)]
pub struct Neighbour {
    /// The ratios.
    pub shape: Vec<f64>,
    /// The free gains.
    pub gains: Vec<f64>,
    /// What is made best.
    pub value: f64,
}

/// What was found.
#[derive(Debug, Clone)]
pub struct Best {
    /// The free gains.
    pub gains: Vec<f64>,
    /// What was made best, in the worst of the loops that the search saw.
    pub value: f64,
    /// The loop with the largest Ms.
    pub worst: usize,
    /// The exact margins of the loops in which they may be least, that one first.
    pub margins: Vec<Margins>,
    /// Those that lose no more than the slack.
    pub neighbours: Vec<Neighbour>,
}

/// Factors on the two responses.
#[derive(Debug, Clone, Copy)]
struct Weights {
    load: f64,
    set_point: f64,
}

struct Search<'a> {
    posed: &'a Posed,
    weights: Weights,
    scale: Scale,
    seen: Vec<(usize, Open)>,
    /// Must every loop that is seen be stable where gaps are chosen, or the nominal one alone?
    checks_all: bool,
    /// Growth of the argument of 1 + L of the nominal loop with gains that are stable.
    growth: Cell<Option<f64>>,
    task: &'a Task,
}

/// Value, ratios and gains that meet the demands, with Ms of each loop.
type Judged = (f64, Vec<f64>, Vec<f64>, Vec<Option<Peak>>);

/// Gains on a ray.
struct Ray {
    offset: Vec<f64>,
    along: Vec<f64>,
}

/// The best gains; of a wish with two parts each counts in units of its own best value.
///
/// # Errors
/// [`Error::Argument`] where no gains are found that meet the demands, or nothing limits them.
pub fn best(posed: &Posed, task: &Task) -> Result<Best, Error> {
    let alone = |load: f64| Weights {
        load,
        set_point: 1.0 - load,
    };
    let weight = posed.wish.load;
    if weight == 0.0 || weight == 1.0 {
        return Search::new(posed, alone(weight), task)?.run();
    }
    let load = Search::new(posed, alone(1.0), task)?.run()?.value;
    let set_point = Search::new(posed, alone(0.0), task)?.run()?.value;
    let both = Weights {
        load: weight / load,
        set_point: (1.0 - weight) / set_point,
    };
    Search::new(posed, both, task)?.run()
}

impl<'a> Search<'a> {
    fn new(posed: &'a Posed, weights: Weights, task: &'a Task) -> Result<Self, Error> {
        let Some(nominal) = posed.loops.first() else {
            refuse!("no loops: give one at least");
        };
        let names = nominal.controller().kind.gains();
        let lead = names.get(posed.lead()).copied().unwrap_or("");
        refuse_if!(
            weights.load > 0.0 && !posed.free.contains(&posed.lead_of_load()),
            "the response to a load follows from {}, which is given: leave it free, or choose \
             another objective",
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

    fn run(mut self) -> Result<Best, Error> {
        let is_given = self.posed.shape.is_some();
        let mut shape = self.posed.shape.clone().unwrap_or_default();
        let (mut is_new, mut known) = (!is_given, None);
        for _ in 0..ROUNDS {
            if is_new {
                shape = self.shape()?;
            }
            let Some(gains) = self.gains(&shape)? else {
                refuse_if!(
                    is_given,
                    "no gains with these ratios have Ms of at most {}",
                    self.posed.demands.max_sensitivity
                );
                is_new = true;
                continue;
            };
            let (posed, task) = (self.posed, self.task);
            let peaks = parallel::results(
                "the loops of a design",
                posed.loops.len(),
                || (),
                |(), place| sensitivity_of(&posed.at(place, &gains), task),
            )?;
            match self.learn(&gains, &peaks)? {
                None => {
                    // The frequencies that were added sharpen what Ms allows of other ratios.
                    let value = self.value(&gains, f64::INFINITY)?;
                    let before = known.replace((value, shape.clone(), gains, peaks));
                    if is_given || shape.is_empty() || before.is_some() {
                        return self.judged(before, known);
                    }
                    shape = self.refined(shape)?;
                    is_new = false;
                }
                Some(excess) => is_new = !is_given && excess > SMALL,
            }
        }
        refuse!(
            "no gains with Ms of at most {} over all of {} loops were found: ask for less, or take a \
             smaller region",
            self.posed.demands.max_sensitivity,
            self.posed.loops.len()
        )
    }

    /// The better of two results, with the margins of the loops in which they may be least.
    fn judged(&self, before: Option<Judged>, last: Option<Judged>) -> Result<Best, Error> {
        let both = before.into_iter().chain(last);
        let best = both.min_by(|x, y| x.0.total_cmp(&y.0));
        let Some((value, shape, gains, peaks)) = best else {
            refuse!("no gains were found");
        };
        let neighbours = self.neighbours(&shape, value)?;
        let size = |place: &usize| peaks[*place].map_or(f64::INFINITY, |peak| peak.value);
        let mut order: Vec<usize> = (0..peaks.len()).collect();
        order.sort_by(|i, j| size(j).total_cmp(&size(i)));
        order.truncate(WORST);
        for (place, _) in &self.seen {
            if !order.contains(place) {
                order.push(*place);
            }
        }
        let (posed, task) = (self.posed, self.task);
        let with = posed.demands.delay_margin > 0.0;
        let mut margins = parallel::results(
            "the loops of a design",
            order.len(),
            || (),
            |(), index| margins_of(&posed.at(order[index], &gains), with, task).map(Some),
        )?;
        let estimate = |found: &Option<Margins>| {
            let each = found.iter().flat_map(|found| {
                found.phase_margins.iter().zip(&found.gain_crossovers)
            });
            each.map(|(turn, omega)| turn.rem_euclid(360.0) / omega)
                .fold(f64::INFINITY, f64::min)
        };
        let mut late: Vec<usize> = (0..margins.len()).collect();
        late.sort_by(|i, j| estimate(&margins[*i]).total_cmp(&estimate(&margins[*j])));
        for index in late.into_iter().take(LATEST) {
            let is_known = |found: &Margins| !found.delay_margin.is_nan();
            if !margins[index].as_ref().is_some_and(is_known) {
                margins[index] = Some(margins_of(&posed.at(order[index], &gains), true, task)?);
            }
        }
        Ok(Best {
            gains,
            value,
            worst: order.first().copied().unwrap_or(0),
            margins: margins.into_iter().flatten().collect(),
            neighbours,
        })
    }

    /// Gains around the best ratios that lose no more than the slack.
    fn neighbours(&self, shape: &[f64], value: f64) -> Result<Vec<Neighbour>, Error> {
        let mut found = Vec::new();
        if self.posed.slack <= 0.0 {
            return Ok(found);
        }
        let (reach, count) = match shape.len() {
            0 => return Ok(found),
            1 => AROUND_ONE,
            _ => AROUND_TWO,
        };
        let axes: Vec<(f64, f64, usize)> = shape
            .iter()
            .map(|x| (x - reach, x + reach, count))
            .collect();
        let most = (1.0 + self.posed.slack) * value;
        for shape in grid(&axes) {
            self.task.check()?;
            if let Some(gains) = self.gains(&shape)? {
                let value = self.value(&gains, most)?;
                if value <= most {
                    found.push(Neighbour {
                        shape,
                        gains,
                        value,
                    });
                }
            }
        }
        Ok(found)
    }

    /// Add where the demands are missed; the largest excess, or none where they are met.
    fn learn(&mut self, gains: &[f64], peaks: &[Option<Peak>]) -> Result<Option<f64>, Error> {
        let most = self.posed.demands.max_sensitivity;
        let mut missed: Vec<(f64, usize)> = Vec::new();
        for (place, found) in peaks.iter().enumerate() {
            let excess = found.map_or(f64::INFINITY, |peak| peak.value / most - 1.0);
            let is_seen = self.seen.iter().any(|(known, _)| *known == place);
            let others = if self.posed.demands.has_others() && !is_seen && excess <= EXCESS {
                let of = self.posed.at(place, gains);
                self.posed.demands.missed(&of, self.task)?
            } else {
                0.0
            };
            if excess > EXCESS || others > EXCESS {
                missed.push((excess.max(others), place));
            }
        }
        missed.sort_by(|x, y| y.0.total_cmp(&x.0));
        let Some(worst) = missed.first().map(|first| first.0) else {
            return Ok(None);
        };
        for (_, place) in missed.into_iter().take(ADDED) {
            let known = self.seen.iter().position(|(known, _)| *known == place);
            let known = match known {
                Some(known) => known,
                None => {
                    let of = &self.posed.loops[place];
                    let open = Open::new(of, &self.posed.free, self.task)?;
                    self.seen.push((place, open));
                    self.seen.len() - 1
                }
            };
            if let Some(peak) = peaks[place] {
                self.seen[known].1.add(peak.omega, self.task)?;
            } else if self.checks_all {
                refuse!(
                    "no gains were found with which all loops are stable: give a smaller region, or \
                     ranges="
                );
            } else {
                self.checks_all = true;
            }
        }
        Ok(Some(worst))
    }

    /// The best ratios of the gains.
    fn shape(&mut self) -> Result<Vec<f64>, Error> {
        let mut found = self.on_grid()?;
        if found.is_none() {
            self.scale.sign = -self.scale.sign;
            found = self.on_grid()?;
        }
        let Some(start) = found else {
            refuse!(
                "no gains with Ms of at most {} are stable: ask for less, take a controller with a \
                 derivative, or give ranges=",
                self.posed.demands.max_sensitivity
            );
        };
        self.refined(start)
    }

    /// Better ratios around a start.
    fn refined(&self, start: Vec<f64>) -> Result<Vec<f64>, Error> {
        let axes = self.posed.axes();
        let sides: Vec<f64> = axes
            .iter()
            .map(|(low, high, count)| (high - low) / (*count - 1) as f64)
            .collect();
        let cost = |shape: &[f64], most: f64| {
            self.task.check()?;
            match self.gains(shape)? {
                Some(gains) => self.value(&gains, most),
                None => Ok(NEVER),
            }
        };
        match (&start[..], &sides[..]) {
            ([], _) => Ok(start),
            ([x], [side]) => {
                let ends = (x - side, x + side);
                let along = |x: f64| cost(&[x], f64::INFINITY);
                let (place, least) = minimum(along, ends, RATIO_KNOWN, ALONG)?;
                Ok(vec![if least <= cost(&[*x], f64::INFINITY)? { place } else { *x }])
            }
            _ => {
                let bounds: Vec<(f64, f64)> = axes
                    .iter()
                    .zip(&sides)
                    .map(|((low, high, _), side)| (low - side, high + side))
                    .collect();
                let sides: Vec<f64> = sides.iter().map(|side| 0.5 * side).collect();
                simplices::minimum(cost, &start, &sides, &bounds, RATIOS_KNOWN)
            }
        }
    }

    /// The best point of the grid.
    fn on_grid(&self) -> Result<Option<Vec<f64>>, Error> {
        let mut points: Vec<(f64, Vec<f64>)> = Vec::new();
        for shape in grid(&self.posed.axes()) {
            self.task.check()?;
            // Other demands leave smaller gains, which lasting loads do not like.
            if let Some((ray, gap)) = self.gap(&shape)? {
                points.push((self.least(&ray.at(gap.1))?, shape));
            }
        }
        points.sort_by(|x, y| x.0.total_cmp(&y.0));
        if self.weights.set_point > 0.0 && points.len() > SIMULATED {
            let stride = points.len().div_ceil(SIMULATED);
            points = points.into_iter().step_by(stride).collect();
        }
        let mut best: Option<(f64, Vec<f64>)> = None;
        for (least, shape) in points {
            let most = best.as_ref().map_or(NEVER, |best| best.0);
            if least >= most {
                break;
            }
            let Some(gains) = self.gains(&shape)? else {
                continue;
            };
            let value = self.value(&gains, most)?;
            if value < most {
                best = Some((value, shape));
            }
        }
        Ok(best.map(|best| best.1))
    }

    /// The largest gains of this shape that meet the demands in the loops that are seen.
    fn gains(&self, shape: &[f64]) -> Result<Option<Vec<f64>>, Error> {
        let Some((ray, gap)) = self.gap(shape)? else {
            return Ok(None);
        };
        if !self.posed.demands.has_others() {
            return Ok(Some(ray.at(gap.1)));
        }
        Ok(self.down(&ray, gap)?.map(|k| ray.at(k)))
    }

    /// The ray of a shape and the highest stable gap that Ms leaves on it.
    fn gap(&self, shape: &[f64]) -> Result<Option<(Ray, Gap)>, Error> {
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
            let end = if is_open { 2.0 * from.max(f64::MIN_POSITIVE) } else { end };
            if !self.is_stable(&ray.at(end))? {
                continue;
            }
            refuse_if!(
                is_open,
                "nothing limits the gains of this loop: Ms stays below {most} for all of them; give \
                 it the delay or the lags that the real loop has, or ranges="
            );
            return Ok(Some((ray, (from, end))));
        }
        Ok(None)
    }

    /// By how much gains miss the other demands in the worst of the loops that are seen.
    fn missed(&self, gains: &[f64]) -> Result<f64, Error> {
        let mut worst = f64::NEG_INFINITY;
        for (place, _) in &self.seen {
            let of = self.posed.at(*place, gains);
            worst = worst.max(self.posed.demands.missed(&of, self.task)?);
        }
        Ok(worst)
    }

    /// The largest k of a gap whose gains meet the other demands, by regula falsi (Illinois: Dowell and
    /// Jarratt 1971, BIT 11).
    fn down(&self, ray: &Ray, (from, end): Gap) -> Result<Option<f64>, Error> {
        let (mut good, mut bad) = (end, None);
        for _ in 0..STEPS_DOWN {
            let short = self.missed(&ray.at(good))?;
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

    fn is_stable(&self, gains: &[f64]) -> Result<bool, Error> {
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
    fn least(&self, gains: &[f64]) -> Result<f64, Error> {
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

    /// The value of gains in the worst of the loops that are seen; where it is more than `most`, perhaps
    /// less than it is.
    fn value(&self, gains: &[f64], most: f64) -> Result<f64, Error> {
        let (wish, weights) = (&self.posed.wish, self.weights);
        let integrates = self.posed.loops[0].controller().kind.integrates();
        let simulates = integrates && !wish.by_integral;
        let least = self.least(gains)?;
        if (weights.set_point == 0.0 && !simulates) || least > most {
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
            let load = match (weights.load > 0.0, simulates) {
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

impl Posed {
    /// A loop with these free gains.
    fn with(&self, of: &ControlLoop, gains: &[f64]) -> ControlLoop {
        let pairs = self.free.iter().zip(gains);
        pairs.fold(of.clone(), |made, (place, gain)| {
            made.with_number(Place::Controller(*place), *gain)
        })
    }

    /// The loop in a place with these free gains.
    fn at(&self, place: usize, gains: &[f64]) -> ControlLoop {
        self.with(&self.loops[place], gains)
    }

    /// The gain that all others are in proportion to: the first free one.
    fn lead(&self) -> usize {
        self.free.first().copied().unwrap_or(0)
    }

    /// The gain from which the response to a load follows at rest.
    fn lead_of_load(&self) -> usize {
        let integrates = self.loops.first().map(|of| of.controller().kind.integrates());
        usize::from(integrates == Some(true))
    }

    fn name(&self, place: usize) -> &'static str {
        let names = self.loops.first().map(|of| of.controller().kind.gains());
        names.and_then(|names| names.get(place)).copied().unwrap_or("")
    }

    /// Ends and numbers of points of each ratio.
    fn axes(&self) -> Vec<(f64, f64, usize)> {
        let others = self.free.iter().skip(1);
        others
            .map(|place| match self.name(*place) {
                "Ki" => INTEGRAL,
                _ => DERIVATIVE,
            })
            .collect()
    }

    /// The ray of a shape. With the proportional gain free all others are in proportion to it; where
    /// it is given, the derivative gain is in proportion to that and the integral gain is sought.
    fn ray(&self, shape: &[f64], scale: Scale) -> Ray {
        let (lead, unit) = (self.lead(), 1.0 / scale.omega);
        let mut ray = Ray {
            offset: vec![0.0; self.free.len()],
            along: vec![0.0; self.free.len()],
        };
        if let Some(first) = ray.along.first_mut() {
            *first = scale.sign;
        }
        let given = self.loops.first().and_then(|of| of.values().controller.first().copied());
        let derivative = |x: f64| 0.05 * unit * (exp(x) - exp(-x));
        for ((index, place), x) in self.free.iter().enumerate().skip(1).zip(shape) {
            match (self.name(*place), self.name(lead)) {
                ("Ki", _) => ray.along[index] = scale.sign * exp(-x) / unit,
                (_, "Kp") => ray.along[index] = scale.sign * derivative(*x),
                _ => ray.offset[index] = given.unwrap_or(0.0) * derivative(*x),
            }
        }
        ray
    }

    /// The k with which a ray is within the bounds.
    fn within(&self, ray: &Ray) -> (f64, f64) {
        let mut ends = (f64::NEG_INFINITY, f64::INFINITY);
        let Some(bounds) = &self.bounds else {
            return ends;
        };
        for ((offset, along), (low, high)) in ray.offset.iter().zip(&ray.along).zip(bounds) {
            if *along == 0.0 {
                if offset < low || offset > high {
                    return (0.0, 0.0);
                }
                continue;
            }
            let [a, b] = [(low - offset) / along, (high - offset) / along];
            ends = (ends.0.max(a.min(b)), ends.1.min(a.max(b)));
        }
        ends
    }
}

impl Ray {
    fn at(&self, k: f64) -> Vec<f64> {
        let pairs = self.offset.iter().zip(&self.along);
        pairs.map(|(offset, along)| offset + k * along).collect()
    }
}

/// What a unit load leaves: the integral of the error, 1/|Ki|, or without an integral the deviation at
/// rest, |P/(1 + P Kp)| with the steady gain P of the plant.
pub fn lasting(of: &ControlLoop) -> Result<f64, Error> {
    let gains = &of.values().controller;
    if of.controller().kind.integrates() {
        return Ok(1.0 / gains.get(1).copied().unwrap_or(0.0).abs());
    }
    let (n, d) = of.with_number(Place::Controller(0), 1.0).loop_gain()?;
    let ((above, zeros), (below, poles)) = (first_term(&n), first_term(&d));
    let gain = gains.first().copied().unwrap_or(0.0);
    Ok(match zeros.cmp(&poles) {
        std::cmp::Ordering::Less => 1.0 / gain.abs(),
        std::cmp::Ordering::Equal => 1.0 / (below / above + gain).abs(),
        std::cmp::Ordering::Greater => 0.0,
    })
}

/// All points of the axes.
fn grid(axes: &[(f64, f64, usize)]) -> Vec<Vec<f64>> {
    axes.iter().fold(vec![Vec::new()], |points, (low, high, count)| {
        let values = (0..*count).map(|k| low + (high - low) * k as f64 / (*count - 1) as f64);
        let values: Vec<f64> = values.collect();
        let join = |point: &Vec<f64>, x: &f64| [&point[..], &[*x]].concat();
        let each = points.iter();
        each.flat_map(|point| values.iter().map(move |x| join(point, x)).collect::<Vec<_>>())
            .collect()
    })
}
