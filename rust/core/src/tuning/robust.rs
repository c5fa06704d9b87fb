//! Gains with the best response to a load or a set point under a largest Ms over many loops.
//!
//! Gains are taken by rays: ratios of the gains give a direction, along which the gaps of `open` are
//! all that Ms leaves, and the response to a load is best at the upper end of a stable one. What is
//! searched are the ratios: on a grid, and from its best point by parabolas or simplices. Gains are
//! then judged with the exact margins of every loop; the frequencies at which Ms is too large, and the
//! loops, are added to those the search sees, and it is repeated (exchange: Hettich and Kortanek 1993,
//! SIAM Review 35). Margins of the result are exact; that no better gains exist is not proved.

use super::demands::{margins_of, sensitivity_of};
use super::open::Open;
use super::posed::{Best, Neighbour, Posed, grid};
use super::reach::{NEVER, Search, Weights};
use super::simplices;
use crate::between::minimum;
use crate::frequency::{Margins, Peak};
use crate::{Error, Task, parallel};

/// Most points of the grid whose responses are simulated where nothing bounds them.
const SIMULATED: usize = 60;

/// Evaluations of a search by parabolas, and the accuracies of ratios of which one or two are sought:
/// finer ones improve the best value by less than its last digits.
const ALONG: usize = 40;
const RATIO_KNOWN: f64 = 1e-6;
const RATIOS_KNOWN: f64 = 1e-4;

/// The first of these accuracies where responses are simulated.
const SIMULATED_KNOWN: f64 = 1e-4;

/// Part of the first surroundings that is searched again once Ms is sharp.
const AGAIN: f64 = 0.1;

/// Rounds of the exchange, and the relative excess of Ms that counts as none: more than that by which
/// the search aims below the demand.
const ROUNDS: usize = 40;
const EXCESS: f64 = 2e-7;

/// Excess of Ms up to which the ratios are kept and only the gains become smaller.
const SMALL: f64 = 1e-2;

/// Loops that are added to the search in one round.
const ADDED: usize = 3;

/// Sampled loops, of those with the least delay margin by their crossings, whose exact one is computed,
/// which takes long.
const LATEST: usize = 2;

/// How far around the best ratios neighbours are looked for, in the units of the grid, and at how many
/// points of each of one or two ratios.
const AROUND_ONE: (f64, usize) = (1.6, 13);
const AROUND_TWO: (f64, usize) = (0.8, 5);

/// Halvings of the range of a ratio, until its end lies where the slack does.
const HALVINGS: usize = 5;

/// Most loops, those with the largest Ms, whose margins are all computed.
const WORST: usize = 12;

/// Value, ratios and gains that meet the demands, with Ms of each loop.
type Judged = (f64, Vec<f64>, Vec<f64>, Vec<Option<Peak>>);

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

impl Search<'_> {
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
                    shape = self.refined(shape, AGAIN)?;
                    is_new = false;
                }
                Some(excess) => is_new = !is_given && excess > SMALL,
            }
        }
        refuse!(
            "no gains have Ms of at most {} in all {} loops: allow a larger Ms, or give a smaller \
             region",
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
            let each = found
                .iter()
                .flat_map(|found| found.phase_margins.iter().zip(&found.gain_crossovers));
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
        let most = (1.0 + self.posed.slack) * value;
        let mut axes = Vec::new();
        for (axis, x) in shape.iter().enumerate() {
            let low = self.extent(shape, axis, -reach, most)?;
            let high = self.extent(shape, axis, reach, most)?;
            axes.push((x + low, x + high, count));
        }
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

    /// How far a ratio may move towards `reach` with no more than `most` lost, nearly.
    fn extent(&self, shape: &[f64], axis: usize, reach: f64, most: f64) -> Result<f64, Error> {
        let (mut inside, mut outside) = (0.0, 2.0 * reach);
        for _ in 0..=HALVINGS {
            self.task.check()?;
            let middle = 0.5 * (inside + outside);
            let mut moved = shape.to_vec();
            moved[axis] += middle;
            let is_good = match self.gains(&moved)? {
                None => false,
                Some(gains) => self.value(&gains, most)? <= most,
            };
            if is_good && middle == reach {
                return Ok(reach);
            }
            *if is_good { &mut inside } else { &mut outside } = middle;
        }
        Ok(inside)
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
                    "no gains were found for which all loops are stable: give a smaller region, \
                     or give ranges="
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
            let demands = &self.posed.demands;
            refuse!(
                "no gains were found with Ms of at most {}{}: allow a larger Ms, use a controller \
                 with a derivative, or give ranges=",
                demands.max_sensitivity,
                if demands.has_others() {
                    " that meet the other demands"
                } else {
                    ""
                }
            );
        };
        self.refined(start, 1.0)
    }

    /// Better ratios around a start, within a part of a cell of the grid.
    fn refined(&self, start: Vec<f64>, part: f64) -> Result<Vec<f64>, Error> {
        let axes = self.posed.axes();
        let sides: Vec<f64> = axes
            .iter()
            .map(|(low, high, count)| part * (high - low) / (*count - 1) as f64)
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
                let known = if self.simulates() {
                    SIMULATED_KNOWN
                } else {
                    RATIO_KNOWN
                };
                let (place, least) = minimum(along, ends, known, ALONG)?;
                Ok(vec![if least <= cost(&[*x], f64::INFINITY)? {
                    place
                } else {
                    *x
                }])
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
}
