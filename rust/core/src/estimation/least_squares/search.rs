//! Levenberg and Marquardt's search for a minimum of a sum of squares.

use super::super::damped::{Normal, stepped};
use super::joint::{Joint, Space};
use super::tolerances::SEARCH;
use crate::linear_algebra::vectors::dot;
use crate::{Error, Task};

/// Where a sum of squares is least, with the misfit there and its derivatives.
#[derive(Debug, Clone, PartialEq)]
pub struct Minimum {
    /// The parameters.
    pub point: Vec<f64>,
    /// Weighted residuals.
    pub misfit: Vec<f64>,
    /// A column a parameter.
    pub slopes: Vec<Vec<f64>>,
}

impl Minimum {
    /// Sum of squares.
    pub fn cost(&self) -> f64 {
        dot(&self.misfit, &self.misfit)
    }
}

/// The lowest minimum from the best starting points.
///
/// # Errors
/// As those of the misfit.
pub fn solve(joint: &Joint<'_>, task: &Task) -> Result<Minimum, Error> {
    let all = Space::without(joint, vec![0.0; joint.count()], &[]);
    let mut best: Option<Minimum> = None;
    for start in joint.starts(SEARCH.refined, task)? {
        let found = descend(joint, &start, &all, SEARCH.to_compare, task)?;
        if best.as_ref().is_none_or(|best| found.cost() < best.cost()) {
            best = Some(found);
        }
    }
    let Some(best) = best else {
        refuse!("there is no starting point for the search")
    };
    minimise(joint, &best.point, &all, SEARCH.to_rounding, task)
}

/// A search from `start` over the points of a space, until a step promises less than this share.
///
/// # Errors
/// As those of the misfit.
pub(super) fn minimise(
    joint: &Joint<'_>,
    start: &[f64],
    space: &Space,
    tolerance: f64,
    task: &Task,
) -> Result<Minimum, Error> {
    let mut found = along_trade(joint, start, space, tolerance, task)?;
    if found.slopes.is_empty() {
        found.slopes = joint.slopes(&found.point, task)?;
    }
    Ok(found)
}

/// The same without derivatives at the end, where they were not needed.
///
/// To first order a lag of zero acts like a delay: where it ends on its bound, the way along which they
/// trade is level, and the search begins again with half of their sum in each.
pub(super) fn along_trade(
    joint: &Joint<'_>,
    start: &[f64],
    space: &Space,
    tolerance: f64,
    task: &Task,
) -> Result<Minimum, Error> {
    let found = descend(joint, start, space, tolerance, task)?;
    let Some((delay, lag)) = joint.trade.filter(|(_, lag)| space.moves(*lag)) else {
        return Ok(found);
    };
    let total = found.point[delay] + found.point[lag];
    if found.point[lag] - joint.low[lag] > SEARCH.on_bound * total {
        return Ok(found);
    }
    let mut middle = found.point.clone();
    middle[delay] = 0.5 * total;
    middle[lag] = 0.5 * total;
    let other = descend(joint, &middle, space, tolerance, task)?;
    Ok(if other.cost() < found.cost() {
        other
    } else {
        found
    })
}

/// A search from one start alone.
pub(super) fn descend(
    joint: &Joint<'_>,
    start: &[f64],
    space: &Space,
    tolerance: f64,
    task: &Task,
) -> Result<Minimum, Error> {
    let mut q = space.place(start);
    let mut point = space.point(&q);
    let mut misfit = joint.misfit(&point, task)?;
    let mut slopes = Vec::new();
    let mut cost = dot(&misfit, &misfit);
    let (mut damping, mut used) = (SEARCH.damping, 1);
    while !q.is_empty() && used < SEARCH.evaluations {
        slopes = joint.slopes(&point, task)?;
        let along = space.along(&slopes);
        let left: Vec<f64> = misfit.iter().map(|x| -x).collect();
        let normal = Normal::new(&along, &left);
        let mut lower = None;
        while damping < SEARCH.most_damping && used < SEARCH.evaluations {
            let Some(next) = stepped(&normal, &q, |x| space.clamp(x), damping) else {
                break;
            };
            if normal.promised(&q, &next) <= tolerance * cost {
                // A step that bounds cut short promises more where it is shorter.
                if space.cuts(&q, &next) {
                    damping *= SEARCH.change * SEARCH.change;
                    continue;
                }
                break;
            }
            let there = space.point(&next);
            let found = joint.misfit(&there, task)?;
            used += 1;
            let reached = dot(&found, &found);
            if reached < cost {
                damping /= SEARCH.change;
                lower = Some((next, there, found, reached));
                break;
            }
            damping *= SEARCH.change * SEARCH.change;
        }
        let Some((next, there, found, reached)) = lower else {
            break;
        };
        (q, point, misfit) = (next, there, found);
        slopes = Vec::new();
        let fall = cost - reached;
        cost = reached;
        if fall <= tolerance * cost {
            break;
        }
    }
    Ok(Minimum {
        point,
        misfit,
        slopes,
    })
}
