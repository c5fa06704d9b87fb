//! Costs and values of steps of the reference, with hold and limit, simulated exactly.
//!
//! The settling time jumps where a peak leaves the band, and the shortest one lies next to such a jump.
//! Gains are therefore judged with gains half a percent beside them, over which rounding to three digits
//! may move them. Of overshoots up to a tenth of a percent counts as none, and the settling time decides
//! where it is equal.

use super::candidates::Candidates;
use super::goal::{NEVER, Objective};
use crate::dde::Criteria;
use crate::loops::{ControlLoop, Place, SweptLoops, SweptMetrics};
use crate::{Error, Task};

/// Relative distance of the neighbouring gains that are judged with the gains themselves: the largest
/// change by rounding to three digits.
const ROUNDING: f64 = 0.005;

/// Half width of the settling band, as a part of the step.
pub(super) const BAND: f64 = 0.02;

/// That of the search: a little narrower, as a margin for what lies between the gains and delays that
/// are tried.
const SEARCH_BAND: f64 = 0.0195;

/// Overshoot in % that counts as none, and the cost of each further percent in seconds of settling time.
const NO_OVERSHOOT: f64 = 0.1;
const OVERSHOOT_WEIGHT: f64 = 10.0;

/// Parts of the step between which a rise is measured.
const RISE: (f64, f64) = (0.1, 0.9);

/// Places of metrics.
const SETTLING_TIME: usize = 1;
const OVERSHOOT: usize = 3;

/// What is found of a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// s; NaN where the loop does not settle.
    pub settling_time: f64,
    /// %.
    pub overshoot: f64,
}

impl Objective {
    /// The cost of a step.
    fn cost_of(self, step: Step) -> f64 {
        let Step {
            settling_time,
            overshoot,
        } = step;
        if !settling_time.is_finite() {
            NEVER
        } else if self == Self::Overshoot {
            settling_time + OVERSHOOT_WEIGHT * (overshoot - NO_OVERSHOOT).max(0.0)
        } else {
            settling_time
        }
    }

    /// The figure of a step that is reported.
    fn figure_of(self, step: Step) -> f64 {
        if self == Self::Overshoot {
            step.overshoot
        } else {
            step.settling_time
        }
    }

    /// The worst figure of gains over all scenarios; of steps for the neighbours too.
    ///
    /// # Errors
    /// As [`Candidates::all_dominant`] and a simulation.
    pub fn value(
        self,
        of: &Candidates,
        gains: &[f64],
        amplitude: f64,
        task: &Task,
    ) -> Result<f64, Error> {
        // NaN remains.
        let most = |x: f64, y: f64| if x.is_nan() || x > y { x } else { y };
        match self {
            Self::Abscissa => {
                let costs = of.costs(self, &[gains], task)?;
                Ok(costs.into_iter().fold(f64::NEG_INFINITY, most))
            }
            Self::Damping => {
                let each = of.all_dominant(gains, task)?.into_iter();
                let each = each.map(|one| -one.damping);
                Ok(-each.fold(f64::NEG_INFINITY, most))
            }
            Self::SettlingTime | Self::Overshoot => {
                let around = with_neighbours(&[gains.to_vec()]);
                let steps = of.steps(&around, amplitude, BAND, task)?.concat();
                let figures = steps.into_iter().map(|step| self.figure_of(step));
                Ok(figures.fold(f64::NEG_INFINITY, most))
            }
        }
    }
}

impl Candidates {
    /// The worst cost of each point over the scenarios, with its neighbours or without.
    ///
    /// # Errors
    /// As [`all_dominant`](Self::all_dominant) and a simulation.
    pub(super) fn worst_costs(
        &self,
        objective: Objective,
        points: &[Vec<f64>],
        amplitude: f64,
        is_coarse: bool,
        task: &Task,
    ) -> Result<Vec<f64>, Error> {
        if !objective.is_simulated() {
            let rows: Vec<&[f64]> = points.iter().map(Vec::as_slice).collect();
            let costs = self.costs(objective, &rows, task)?;
            let each = costs.chunks(self.scenarios.len().max(1));
            return Ok(each.map(most).collect());
        }
        let around = if is_coarse {
            points.to_vec()
        } else {
            with_neighbours(points)
        };
        let together = around.len() / points.len().max(1);
        let mut worst = vec![f64::NEG_INFINITY; points.len()];
        for steps in self.steps(&around, amplitude, SEARCH_BAND, task)? {
            for (worst, steps) in worst.iter_mut().zip(steps.chunks(together.max(1))) {
                let costs: Vec<f64> = steps.iter().map(|step| objective.cost_of(*step)).collect();
                *worst = worst.max(most(&costs));
            }
        }
        Ok(worst)
    }

    /// The step of each point, scenario by scenario.
    fn steps(
        &self,
        points: &[Vec<f64>],
        amplitude: f64,
        band: f64,
        task: &Task,
    ) -> Result<Vec<Vec<Step>>, Error> {
        let columns = self.free.iter().enumerate().map(|(i, place)| {
            let column = points.iter().map(|point| point[i]);
            (Place::Controller(*place), column.collect::<Vec<f64>>())
        });
        let columns: Vec<_> = columns.collect();
        let each = self.scenarios.iter().map(|scenario| {
            let size = (points.len(), amplitude);
            let swept = SweptLoops::new(scenario, columns.clone(), None, size)?;
            let found = swept.measured(None, &criteria(band), task)?;
            let values = scenario.values();
            let high = values.limit.unwrap_or(f64::INFINITY);
            let low = values.low.unwrap_or(-high);
            let resting = swept.resting()?.into_iter().enumerate();
            let steps = resting.map(|(set, rest)| {
                let step = step_of(&found, set);
                // An output that the limit keeps away from its rest has not settled, even if it is
                // constant.
                if rest.command > high || rest.command < low {
                    return Step {
                        settling_time: f64::NAN,
                        ..step
                    };
                }
                step
            });
            Ok(steps.collect())
        });
        each.collect()
    }
}

/// The step of one loop in `span` seconds, or until it has settled, with the length of its simulation.
///
/// # Errors
/// As [`SweptLoops::measured`].
pub(super) fn one_step(
    of: &ControlLoop,
    span: Option<f64>,
    amplitude: f64,
    task: &Task,
) -> Result<(Step, f64), Error> {
    let swept = SweptLoops::new(of, Vec::new(), None, (1, amplitude))?;
    let found = swept.measured(span, &criteria(BAND), task)?;
    Ok((step_of(&found, 0), found.span))
}

fn criteria(band: f64) -> Criteria {
    Criteria {
        rise: RISE,
        settling: band,
    }
}

fn step_of(found: &SweptMetrics, set: usize) -> Step {
    let [settling_time, overshoot] =
        [SETTLING_TIME, OVERSHOOT].map(|metric| found.column(metric)[set]);
    Step {
        settling_time,
        overshoot,
    }
}

fn most(costs: &[f64]) -> f64 {
    costs.iter().copied().fold(f64::NEG_INFINITY, f64::max)
}

/// Each row of gains, and its neighbours behind it.
fn with_neighbours(points: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let mut found = Vec::new();
    for point in points {
        found.push(point.clone());
        for signs in 0..1_usize << point.len() {
            let moved = point.iter().enumerate().map(|(i, gain)| {
                let sign = if signs >> i & 1 == 0 { -1.0 } else { 1.0 };
                gain * (1.0 + ROUNDING * sign)
            });
            found.push(moved.collect());
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gains_are_judged_with_neighbours_on_every_side() {
        let found = with_neighbours(&[vec![2.0, -4.0]]);
        let sides = |point: &Vec<f64>| [point[0] > 2.0, point[1] > -4.0];
        assert_eq!(found[0], [2.0, -4.0]);
        for expected in [[false, false], [true, false], [false, true], [true, true]] {
            assert!(found[1..].iter().any(|point| sides(point) == expected));
        }
        assert!(found.len() == 5 && (found[1][0] - 1.99).abs() < 1e-12);
    }
}
