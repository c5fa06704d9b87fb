//! Gains that are best in the worst case, by exchange.
//!
//!   min over gains of max over p of cost(gains; p),   margins(gains; p) >= required for all p
//!
//! has infinitely many p: every delay of an interval. The exchange method takes a few (ends and middles),
//! finds the best gains for those, looks over the whole interval for a p that is worse, adds it, and
//! repeats until there is none (Hettich and Kortanek, "Semi-infinite programming", SIAM Review 35, 1993).
//! The margins of the search are estimates: a requirement that the exact margins miss is raised by what is
//! missing, in the same rounds.
//!
//! The look over the intervals is a search, not a proof: a fine grid of scenarios, and between the
//! neighbours of the worst of them a search along the delay; or the points around the region of an
//! estimate.

use super::candidates::Candidates;
use super::goal::{NEVER, Objective};
use super::pattern::Pattern;
use super::search::worst_delay;
use super::steps::Step;
use super::survey::Survey;
use super::tail::proved_step;
use crate::loops::{ControlLoop, Place};
use crate::{Error, Task};

/// Most rounds of the exchange: two or three suffice where costs are continuous, and where steps are
/// simulated, which jump, more do not help.
const ROUNDS: usize = 12;
const ROUNDS_SIMULATED: usize = 5;

/// How far above a required margin the search aims, relatively: less needs more rounds.
const ABOVE: f64 = 1e-5;

/// Relative shortfall of an exact margin that counts as rounding.
const MISSED: f64 = 1e-12;

/// What is added to a requirement, as a multiple of what the exact margins miss of it.
const RAISED: f64 = 1.1;

/// Relative improvement below which a round is the last: where roots meet at some delay, the worst case
/// has cusps in the delay, and a few scenarios never bound it exactly.
const STALLED: f64 = 1e-3;

/// Estimated shortfall of the margins beyond which further rounds cannot meet them.
const HOPELESS: f64 = 3e-3;

/// Points of a region for each margin in which exact margins are computed.
const LEAST: usize = 2;

/// Halvings of the way to gains that miss a margin: more end closer to them.
const HALVINGS: usize = 40;

/// What gains are sought for.
#[derive(Debug, Clone)]
pub struct Sought {
    /// The loops in all scenarios.
    pub loops: Vec<ControlLoop>,
    /// Places of the free gains.
    pub free: Vec<usize>,
    /// The scenarios with which the search begins.
    pub corners: Vec<usize>,
    /// Those in which its result is judged.
    pub fine: Vec<usize>,
    /// Those in which exact margins are computed; without them, those of `fine` with the least estimates.
    pub places: Option<Vec<usize>>,
    /// What is made best.
    pub objective: Objective,
    /// The least margins: a factor, degrees, s; zero for none.
    pub required: [f64; 3],
    /// Height of the step, where steps are simulated.
    pub amplitude: f64,
    /// Where the search begins.
    pub survey: Survey,
}

/// A scenario: its place among the loops, and its delay.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spot {
    /// Of the loop that has all other numbers.
    pub place: usize,
    /// s.
    pub delay: f64,
}

/// What was found.
#[derive(Debug, Clone)]
pub enum Found {
    /// Gains.
    Gains(Robust),
    /// No gains have the margins: what is to be had of each margin alone, and the gains that miss them
    /// least with their least margins.
    Unmet([f64; 3], Vec<f64>, [f64; 3]),
}

/// Gains, the scenarios they are best for, and their cost in the worst of all scenarios.
#[derive(Debug, Clone)]
pub struct Robust {
    /// Of the free gains.
    pub gains: Vec<f64>,
    /// The last ones of the exchange.
    pub scenarios: Vec<Spot>,
    /// In the worst of all.
    pub cost: f64,
    /// That one.
    pub worst: Spot,
    /// In how many scenarios the cost was judged.
    pub checked: usize,
    /// The figure in all of `fine` and the worst.
    pub value: f64,
}

/// The state of an exchange.
struct Exchange<'a> {
    of: &'a Sought,
    scenarios: Vec<Spot>,
    survey: Survey,
    task: &'a Task,
}

impl Sought {
    /// The best gains in the worst scenario of all, from the map or from around a start.
    ///
    /// # Errors
    /// As [`Pattern::globally`].
    pub fn best(&self, start: Option<&[f64]>, task: &Task) -> Result<Found, Error> {
        let exchange = Exchange {
            of: self,
            scenarios: self.corners.iter().map(|place| self.spot(*place)).collect(),
            survey: self.survey.clone(),
            task,
        };
        exchange.run(start)
    }

    /// The best gains in some scenarios alone, and their value there.
    ///
    /// # Errors
    /// As [`Pattern::globally`].
    pub fn best_in(
        &self,
        spots: &[Spot],
        required: [f64; 3],
        task: &Task,
    ) -> Result<(Vec<f64>, f64), Error> {
        let of = self.candidates(spots);
        let pattern = Pattern {
            of,
            objective: self.objective,
            required,
            survey: self.survey.clone(),
            amplitude: self.amplitude,
            task,
        };
        let gains = pattern.globally()?;
        let value = self
            .objective
            .value(&pattern.of, &gains, self.amplitude, task)?;
        Ok((gains, value))
    }

    /// Steps with gains in these scenarios, proved to rest; none where that fails.
    ///
    /// # Errors
    /// Those that end all work.
    pub fn proved_steps(
        &self,
        spots: &[Spot],
        gains: &[f64],
        task: &Task,
    ) -> Result<Vec<Option<Step>>, Error> {
        let of = self.candidates(spots);
        let each = of.scenarios.iter();
        each.map(|scenario| proved_step(&of.at(gains, scenario), self.amplitude, task))
            .collect()
    }

    /// A scenario by its place.
    pub fn spot(&self, place: usize) -> Spot {
        Spot {
            place,
            delay: self.loops[place].values().delay,
        }
    }

    fn loop_at(&self, spot: Spot) -> ControlLoop {
        self.loops[spot.place].with_number(Place::Delay, spot.delay)
    }

    fn candidates(&self, spots: &[Spot]) -> Candidates {
        let loops = spots.iter().map(|spot| self.loop_at(*spot));
        Candidates::new(loops.collect(), self.free.clone())
    }

    fn has_requirements(&self) -> bool {
        self.required.iter().any(|least| *least > 0.0)
    }
}

impl Exchange<'_> {
    fn pattern(&self, required: [f64; 3]) -> Pattern<'_> {
        Pattern {
            of: self.of.candidates(&self.scenarios),
            objective: self.of.objective,
            required,
            survey: self.survey.clone(),
            amplitude: self.of.amplitude,
            task: self.task,
        }
    }

    fn run(mut self, start: Option<&[f64]>) -> Result<Found, Error> {
        let (of, objective) = (self.of, self.of.objective);
        let mut aimed = above(of.required);
        let mut gains = match start {
            None => self.pattern(aimed).globally()?,
            Some(start) => self.pattern(aimed).locally(start)?,
        };
        let mut best: Option<Robust> = None;
        let rounds = if objective.is_simulated() {
            ROUNDS_SIMULATED
        } else {
            ROUNDS
        };
        for _ in 0..rounds {
            let everywhere = self.everywhere();
            let (cost, worst) = self.worst(&gains, &everywhere)?;
            let seen = self.cost(&gains, &self.scenarios)?;
            let mut added = Vec::new();
            if cost > seen + objective.tolerance() * seen.abs() {
                added.push(worst);
            }
            let (mut missing, mut underestimated) = ([0.0; 3], [0.0; 3]);
            if of.has_requirements() {
                let mut places = self.margin_places(&gains)?;
                places.extend(&self.scenarios[of.corners.len()..]);
                let each = self.exact_margins(&gains, &places)?;
                missing = missed(of.required, &each);
                for (i, _) in missing
                    .iter()
                    .enumerate()
                    .filter(|(_, short)| **short > 0.0)
                {
                    let column = each.iter().map(|margins| margins[i]).map(known);
                    let least = super::survey::least(&column.collect::<Vec<_>>());
                    added.extend(least.map(|(place, _)| places[place]));
                }
                let seen = places.iter().zip(&each);
                let seen = seen.filter(|(place, _)| self.scenarios.contains(place));
                let seen: Vec<[f64; 3]> = seen.map(|(_, margins)| *margins).collect();
                if !seen.is_empty() {
                    underestimated = missed(of.required, &seen);
                }
            }
            let is_met = missing.iter().all(|short| *short <= 0.0);
            let stalled = best
                .as_ref()
                .is_some_and(|best| cost > best.cost - STALLED * best.cost.abs());
            if is_met && best.as_ref().is_none_or(|best| cost < best.cost) {
                best = Some(Robust {
                    gains: gains.clone(),
                    scenarios: Vec::new(),
                    cost,
                    worst,
                    checked: everywhere.len(),
                    value: f64::NAN,
                });
            }
            if !is_met && self.pattern(aimed).short(&gains)? > HOPELESS {
                break;
            }
            added.retain(|one| !self.scenarios.contains(one));
            if is_met && (stalled || added.is_empty()) {
                break;
            }
            for one in added {
                if !self.scenarios.contains(&one) {
                    self.scenarios.push(one);
                }
            }
            for (aimed, short) in aimed.iter_mut().zip(underestimated) {
                *aimed += RAISED * short;
            }
            gains = self.pattern(aimed).locally(&gains)?;
            if of.has_requirements() && self.pattern(aimed).short(&gains)? > HOPELESS {
                // Gains that have the margins in an added scenario may be far away.
                self.survey_again()?;
                gains = self.pattern(aimed).globally()?;
            }
        }
        if best.is_none() {
            best = self.just_inside(&gains)?;
        }
        let Some(mut best) = best else {
            return self.unmet(gains, aimed);
        };
        if best.cost < NEVER {
            let mut judged: Vec<Spot> = of.fine.iter().map(|place| of.spot(*place)).collect();
            judged.push(best.worst);
            let of = of.candidates(&judged);
            best.value = objective.value(&of, &best.gains, self.of.amplitude, self.task)?;
        }
        best.scenarios = self.scenarios;
        Ok(Found::Gains(best))
    }

    /// The scenarios in which gains are judged.
    fn everywhere(&self) -> Vec<Spot> {
        let fine = self.of.fine.iter().map(|place| self.of.spot(*place));
        let added = self.scenarios.iter().skip(self.of.corners.len());
        fine.chain(added.copied()).collect()
    }

    /// The cost of gains in the worst of these scenarios.
    fn cost(&self, gains: &[f64], spots: &[Spot]) -> Result<f64, Error> {
        let of = self.of.candidates(spots);
        let (objective, amplitude) = (self.of.objective, self.of.amplitude);
        let costs = of.worst_costs(objective, &[gains.to_vec()], amplitude, false, self.task)?;
        Ok(costs.first().copied().unwrap_or(f64::INFINITY))
    }

    /// Cost of gains in the worst scenario, which may lie between those given, and that scenario.
    fn worst(&self, gains: &[f64], spots: &[Spot]) -> Result<(f64, Spot), Error> {
        let objective = self.of.objective;
        let (mut most, mut worst) = (f64::NEG_INFINITY, self.of.spot(0));
        for spot in spots {
            let cost = self.cost(gains, &[*spot])?;
            if cost > most {
                (most, worst) = (cost, *spot);
            }
        }
        if objective.is_simulated() || self.of.places.is_none() {
            return Ok((most, worst));
        }
        let delays = spots.iter().map(|spot| spot.delay);
        let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
        for delay in delays {
            if delay < worst.delay {
                low = low.max(delay);
            } else if delay > worst.delay {
                high = high.min(delay);
            }
        }
        let ends = (
            if low.is_finite() { low } else { worst.delay },
            if high.is_finite() { high } else { worst.delay },
        );
        if ends.1 > ends.0 {
            let of = self.of.candidates(&[worst]);
            let of = of.at(gains, &of.scenarios[0]);
            let (delay, cost) = worst_delay(&of, objective, ends, self.task)?;
            if cost > most {
                return Ok((cost, Spot { delay, ..worst }));
            }
        }
        Ok((most, worst))
    }

    /// Those its exact margins are computed in: of a region the points with the least estimates.
    fn margin_places(&self, gains: &[f64]) -> Result<Vec<Spot>, Error> {
        if let Some(places) = &self.of.places {
            return Ok(places.iter().map(|place| self.of.spot(*place)).collect());
        }
        let spots: Vec<Spot> = self
            .of
            .fine
            .iter()
            .map(|place| self.of.spot(*place))
            .collect();
        let each = self
            .of
            .candidates(&spots)
            .all_margins(&[gains], self.task)?;
        let mut found = Vec::new();
        for i in 0..3 {
            let mut order: Vec<usize> = (0..each.len()).collect();
            order.sort_by(|p, q| each[*p][i].total_cmp(&each[*q][i]));
            found.extend(order.into_iter().take(LEAST));
        }
        found.sort_unstable();
        found.dedup();
        Ok(found.into_iter().map(|place| spots[place]).collect())
    }

    /// Gain, phase and delay margin in each scenario; that of the delay, which takes most of the time,
    /// only where it is required.
    fn exact_margins(&self, gains: &[f64], spots: &[Spot]) -> Result<Vec<[f64; 3]>, Error> {
        let of = self.of.candidates(spots);
        let found = of.margins(gains, self.of.required[2] > 0.0, self.task)?;
        let each = found.iter();
        Ok(each
            .map(|one| [one.gain_margin, one.phase_margin, one.delay_margin])
            .collect())
    }

    /// The cells that are stable in the added scenarios too.
    fn survey_again(&mut self) -> Result<(), Error> {
        let added = self.scenarios.get(self.of.corners.len()..).unwrap_or(&[]);
        let of = self.of.candidates(added);
        let (places, points): (Vec<usize>, Vec<Vec<f64>>) =
            self.survey.stable().into_iter().unzip();
        let rows: Vec<&[f64]> = points.iter().map(Vec::as_slice).collect();
        let late = of.stable_abscissae(&rows, self.task)?;
        if late.iter().all(|late| late.is_infinite()) {
            return Ok(());
        }
        for (place, late) in places.into_iter().zip(late) {
            self.survey.abscissa[place] = self.survey.abscissa[place].max(late);
        }
        Ok(())
    }

    /// The last gains that have the margins, on the way to gains that miss them by little.
    ///
    /// Where the best loop is deadbeat its cost falls without bound, whatever margin it misses.
    fn just_inside(&self, gains: &[f64]) -> Result<Option<Robust>, Error> {
        let pattern = self.pattern(above(self.of.required));
        let points: Vec<Vec<f64>> = self.survey.stable().into_iter().map(|one| one.1).collect();
        if points.is_empty() || pattern.short(gains)? > HOPELESS {
            return Ok(None);
        }
        let nearest = super::survey::least(&pattern.shortfalls(&points, f64::INFINITY)?);
        let Some((place, _)) = nearest else {
            return Ok(None);
        };
        let (mut inside, mut outside) = (points[place].clone(), gains.to_vec());
        if pattern.short(&inside)? > 0.0 {
            return Ok(None);
        }
        for _ in 0..HALVINGS {
            let middle = inside.iter().zip(&outside).map(|(x, y)| 0.5 * (x + y));
            let middle: Vec<f64> = middle.collect();
            if pattern.short(&middle)? > 0.0 {
                outside = middle;
            } else {
                inside = middle;
            }
        }
        let each = self.exact_margins(&inside, &self.scenarios)?;
        if missed(self.of.required, &each)
            .iter()
            .any(|short| *short > 0.0)
        {
            return Ok(None);
        }
        let everywhere = self.everywhere();
        let (cost, worst) = self.worst(&inside, &everywhere)?;
        Ok(Some(Robust {
            gains: inside,
            scenarios: Vec::new(),
            cost,
            worst,
            checked: everywhere.len(),
            value: f64::NAN,
        }))
    }

    fn unmet(&self, gains: Vec<f64>, aimed: [f64; 3]) -> Result<Found, Error> {
        let pattern = self.pattern(aimed);
        let points: Vec<Vec<f64>> = self.survey.stable().into_iter().map(|one| one.1).collect();
        let rows: Vec<&[f64]> = points.iter().map(Vec::as_slice).collect();
        let each = pattern.of.all_margins(&rows, self.task)?;
        let mut alone = [f64::NEG_INFINITY; 3];
        for scenarios in each.chunks(self.scenarios.len().max(1)) {
            for (most, had) in alone.iter_mut().zip(least_of(scenarios)) {
                *most = most.max(had);
            }
        }
        let short = pattern.shortfalls(&points, f64::INFINITY)?;
        let nearest = super::survey::least(&short).map(|(place, _)| points[place].clone());
        let mut best = gains;
        if let Some(nearest) = nearest
            && pattern.short(&nearest)? < pattern.short(&best)?
        {
            best = nearest;
        }
        let margins = pattern.of.margins(&best, true, self.task)?;
        let each = margins.iter();
        let each: Vec<[f64; 3]> = each
            .map(|one| [one.gain_margin, one.phase_margin, one.delay_margin])
            .collect();
        Ok(Found::Unmet(alone, best, least_of(&each)))
    }
}

impl Objective {
    /// Relative difference of costs that counts as none.
    fn tolerance(self) -> f64 {
        match self {
            Self::Abscissa => 1e-6,
            Self::Damping => 1e-4,
            Self::SettlingTime | Self::Overshoot => 1e-3,
        }
    }
}

fn above(required: [f64; 3]) -> [f64; 3] {
    required.map(|least| (1.0 + ABOVE) * least)
}

/// A margin; none of a loop that is not stable.
fn known(margin: f64) -> f64 {
    if margin.is_nan() { 0.0 } else { margin }
}

fn least_of(each: &[[f64; 3]]) -> [f64; 3] {
    each.iter().fold([f64::INFINITY; 3], |mut least, margins| {
        for (least, margin) in least.iter_mut().zip(margins) {
            *least = least.min(known(*margin));
        }
        least
    })
}

/// What margins miss of the requirements at their least.
fn missed(required: [f64; 3], each: &[[f64; 3]]) -> [f64; 3] {
    let least = least_of(each);
    let mut short = [0.0; 3];
    for ((short, required), had) in short.iter_mut().zip(required).zip(least) {
        if required > 0.0 {
            *short = (required * (1.0 - MISSED) - had).max(0.0);
        }
    }
    short
}
