//! The best of many gains, the best gains around a start, and the worst delay for gains.
//!
//! Every cost has kinks, where two poles are equally far right or two scenarios equally bad, and the
//! best gains lie on them. So nothing is differentiated. None of this proves a global minimum.

use super::candidates::{Candidates, margins_or_none};
use super::goal::{Decisive, Goal, Objective, UNSTABLE};
use super::simplices;
use crate::loops::{ControlLoop, Place};
use crate::{Error, Task, between, parallel};

/// Accuracy of the gains as a fraction of their ranges, of one gain and of several. Where roots meet
/// the abscissa has cusps: gains known to 1e-7 leave it known to 1e-3.
const ONE_GAIN_KNOWN: f64 = 1e-9;
const GAINS_KNOWN: f64 = 1e-7;

/// Accuracy of the worst delay, relative to the longest.
const DELAY_KNOWN: f64 = 1e-6;

/// Most evaluations along one gain, and along the delay.
const ALONG_GAIN: usize = 200;
const ALONG_DELAY: usize = 500;

/// Where gains are sought.
#[derive(Debug, Clone)]
pub(super) struct Within {
    /// Where the search begins.
    pub(super) start: Vec<f64>,
    /// How far from it better ones may be.
    pub(super) reach: Vec<f64>,
    /// Ends of each gain.
    pub(super) bounds: Vec<(f64, f64)>,
}

impl Candidates {
    /// The cost of each point in each scenario, points first.
    ///
    /// # Errors
    /// As [`Candidates::all_dominant`].
    pub fn costs(
        &self,
        objective: Objective,
        points: &[&[f64]],
        task: &Task,
    ) -> Result<Vec<f64>, Error> {
        self.each(points.len() * self.scenarios.len(), task, |place| {
            objective.cost(&self.pair(points, place), task)
        })
    }

    /// The worst spectral abscissa of each point; infinite where one scenario is not stable.
    ///
    /// # Errors
    /// Those that end all work.
    pub(super) fn stable_abscissae(
        &self,
        points: &[&[f64]],
        task: &Task,
    ) -> Result<Vec<f64>, Error> {
        self.each(points.len(), task, |place| {
            let mut worst = f64::NEG_INFINITY;
            for scenario in &self.scenarios {
                let found = Objective::Abscissa.cost(&self.at(points[place], scenario), task)?;
                worst = worst.max(found);
                if worst >= 0.0 {
                    return Ok(f64::INFINITY);
                }
            }
            Ok(worst)
        })
    }

    /// Gain, phase and delay margin of each point in each scenario, where all of them are stable.
    ///
    /// # Errors
    /// Those that end all work.
    pub fn all_margins(&self, points: &[&[f64]], task: &Task) -> Result<Vec<[f64; 3]>, Error> {
        self.each(points.len() * self.scenarios.len(), task, |place| {
            margins_or_none(&self.pair(points, place), (f64::INFINITY, true), task)
        })
    }

    /// The shortfall of each point, whose loops are stable; see [`Goal::shortfall`].
    ///
    /// # Errors
    /// Those that end all work.
    pub(super) fn shortfalls(
        &self,
        goal: &Goal,
        points: &[&[f64]],
        most: f64,
        task: &Task,
    ) -> Result<Vec<f64>, Error> {
        self.each(points.len(), task, |place| {
            goal.shortfall(self, points[place], most, &mut Decisive::default(), task)
        })
    }

    /// The loop of a place among all points in all scenarios, points first.
    fn pair(&self, points: &[&[f64]], place: usize) -> ControlLoop {
        let count = self.scenarios.len();
        self.at(points[place / count], &self.scenarios[place % count])
    }

    fn each<T: Default + Send>(
        &self,
        count: usize,
        task: &Task,
        find: impl Fn(usize) -> Result<T, Error> + Sync,
    ) -> Result<Vec<T>, Error> {
        parallel::results(
            "the loops of a design",
            count,
            || (),
            |(), place| {
                task.check()?;
                find(place)
            },
        )
    }
}

/// The place and the cost of the best point, by the abscissa: that of an unstable loop counts as
/// zero.
///
/// # Errors
/// Those that end all work.
pub(super) fn least(
    of: &Candidates,
    goal: &Goal,
    points: &[&[f64]],
    task: &Task,
) -> Result<(usize, f64), Error> {
    let (unit, middle) = (goal.penalty(), points.len() / 2);
    let (mut best, mut last) = ((0, f64::INFINITY), Decisive::default());
    // The middle is the best one so far, to which most others lose in one scenario.
    let others = (0..points.len()).filter(|place| *place != middle);
    for place in std::iter::once(middle).chain(others) {
        task.check()?;
        let (_, least) = best;
        let Some(point) = points.get(place) else {
            break;
        };
        let abscissa = Objective::Abscissa;
        let late = abscissa.worst(of, point, f64::min(least, 0.0), &mut last, task)?;
        let cost = if late >= 0.0 {
            unit * UNSTABLE
        } else if late > least {
            continue;
        } else {
            late + unit * goal.shortfall(of, point, (least - late) / unit, &mut last, task)?
        };
        if cost < best.1 || (cost == best.1 && place < best.0) {
            best = (place, cost);
        }
    }
    Ok(best)
}

/// The best gains that are found within reach of a start.
///
/// # Errors
/// As [`Candidates::all_dominant`].
pub(super) fn best_within(
    of: &Candidates,
    goal: &Goal,
    within: &Within,
    task: &Task,
) -> Result<Vec<f64>, Error> {
    let Within {
        start,
        reach,
        bounds,
    } = within;
    let mut last = Decisive::default();
    let mut cost = |gains: &[f64], most: f64| {
        task.check()?;
        goal.total(of, gains, most, &mut last, task)
    };
    if let ([start], [reach], [(low, high)]) = (&start[..], &reach[..], &bounds[..]) {
        let ends = ((start - reach).max(*low), (start + reach).min(*high));
        let known = ONE_GAIN_KNOWN * (high - low);
        let found = between::minimum(|gain| cost(&[gain], f64::INFINITY), ends, known, ALONG_GAIN)?;
        let is_better = found.1 <= cost(&[*start], f64::INFINITY)?;
        return Ok(vec![if is_better { found.0 } else { *start }]);
    }
    let sides: Vec<f64> = reach.iter().map(|side| 0.5 * side).collect();
    simplices::minimum(cost, start, &sides, bounds, GAINS_KNOWN)
}

/// The delay between two ends at which a loop costs most, and that cost.
///
/// # Errors
/// As [`Candidates::costs`].
pub(super) fn worst_delay(
    of: &ControlLoop,
    objective: Objective,
    ends: (f64, f64),
    task: &Task,
) -> Result<(f64, f64), Error> {
    let cost = |late: f64| {
        task.check()?;
        Ok(-objective.cost(&of.with_number(Place::Delay, late), task)?)
    };
    let (late, cost) = between::minimum(cost, ends, DELAY_KNOWN * ends.1, ALONG_DELAY)?;
    Ok((late, -cost))
}
