//! Least cost at each of several delays, and the lowest minimum from there.

use super::super::damped::{Normal, stepped};
use super::joint::{Joint, Space};
use super::search::{Minimum, descend, minimise};
use super::tolerances::{SEARCH, ZERO};
use crate::linear_algebra::vectors::dot;
use crate::{Error, Task};

/// Costs over a range of delays, with the parameters of each.
#[derive(Debug, Clone, PartialEq)]
pub struct Scan {
    /// Sums of squares.
    pub costs: Vec<f64>,
    /// The parameters, the delay first.
    pub points: Vec<Vec<f64>>,
}

/// One step in all parameters but the delay, which comes first, from the better of a guess and the point
/// at the delay before.
///
/// # Errors
/// As those of the misfit.
pub fn scan(joint: &Joint<'_>, delays: &[f64], guess: &[f64], task: &Task) -> Result<Scan, Error> {
    let mut found = Scan {
        costs: Vec::new(),
        points: Vec::new(),
    };
    let mut point = guess.to_vec();
    for delay in delays {
        let at = |from: &[f64]| {
            let mut start = from.to_vec();
            start[0] = *delay;
            Ok::<_, Error>((joint.misfit(&start, task)?, start))
        };
        let (one, other) = (at(guess)?, at(&point)?);
        let (misfit, start) = if dot(&other.0, &other.0) < dot(&one.0, &one.0) {
            other
        } else {
            one
        };
        let mut cost = dot(&misfit, &misfit);
        point = start;
        let mut base = vec![0.0; guess.len()];
        base[0] = *delay;
        let space = Space::without(joint, base, &[0]);
        if guess.len() > 1 {
            let along = space.along(&joint.slopes(&point, task)?);
            let left: Vec<f64> = misfit.iter().map(|x| -x).collect();
            let (normal, from) = (Normal::new(&along, &left), point[1..].to_vec());
            if let Some(next) = stepped(&normal, &from, |x| space.clamp(x), 0.0) {
                let there = space.point(&next);
                let reached = joint.cost(&there, task)?;
                if reached < cost {
                    (point, cost) = (there, reached);
                }
            }
        }
        found.costs.push(cost);
        found.points.push(point.clone());
    }
    Ok(found)
}

/// Places with a lower cost than both neighbours.
pub fn local_minima(costs: &[f64]) -> Vec<usize> {
    let windows = costs.windows(3).enumerate();
    windows
        .filter(|(_, near)| near[1] < near[0] && near[1] <= near[2])
        .map(|(place, _)| place + 1)
        .collect()
}

/// The lowest of the refined local minima; with the shortest lag (in its place) and a longer delay where
/// that fits as well, to `rounding`.
///
/// # Errors
/// As those of the misfit.
pub fn refined(
    joint: &Joint<'_>,
    scan: &Scan,
    lag: Option<usize>,
    rounding: f64,
    task: &Task,
) -> Result<Minimum, Error> {
    let mut places = local_minima(&scan.costs);
    let by_cost = |one: &usize, other: &usize| scan.costs[*one].total_cmp(&scan.costs[*other]);
    let Some(least) = (0..scan.costs.len()).min_by(by_cost) else {
        refuse!("no delay was given: give at least one")
    };
    places.push(least);
    places.sort_by(by_cost);
    places.dedup();
    let all = Space::without(joint, vec![0.0; joint.count()], &[]);
    let mut best: Option<Minimum> = None;
    for place in places.into_iter().take(SEARCH.refined) {
        let start = &scan.points[place];
        let found = descend(joint, start, &all, SEARCH.to_compare, task)?;
        if best.as_ref().is_none_or(|best| found.cost() < best.cost()) {
            best = Some(found);
        }
    }
    let Some(best) = best else {
        refuse!("no delay was given: give at least one")
    };
    let best = minimise(joint, &best.point, &all, SEARCH.to_rounding, task)?;
    let Some(lag) = lag else { return Ok(best) };
    let mut start = best.point.clone();
    start[0] += best.point[lag] - joint.low[lag];
    start[lag] = joint.low[lag];
    let space = Space::without(joint, start.clone(), &[lag]);
    let without = minimise(joint, &start, &space, SEARCH.to_rounding, task)?;
    let as_well = without.cost() <= best.cost() * (1.0 + ZERO.rise) + rounding;
    Ok(if as_well { without } else { best })
}
