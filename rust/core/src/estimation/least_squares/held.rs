//! The least cost with one quantity held, the others free.

use super::joint::{Joint, Space};
use super::search::{Minimum, along_trade};
use super::tolerances::SEARCH;
use crate::linear_algebra::lu::Lu;
use crate::linear_algebra::vectors::dot;
use crate::{Error, Task};

/// Added to the diagonal of the normal equations of the linearised model, as a share of it.
const RIDGE: f64 = 1e-14;

/// Least sum of squares with the sum of the parameters at these places held, from the minimum of the model
/// linearised at `best`.
///
/// A parameter that is below its bound in the best fit, at zero, is tried there too.
///
/// # Errors
/// As those of the misfit.
pub fn least_held(
    joint: &Joint<'_>,
    best: &Minimum,
    places: &[usize],
    value: f64,
    task: &Task,
) -> Result<f64, Error> {
    let (mut base, free) = joint.held(&best.point, places, value);
    let search = |base: &[f64], free: &[Vec<f64>]| {
        let start = linear(best, base, free);
        let space = Space::new(joint, base.to_vec(), free.to_vec());
        Ok::<_, Error>(along_trade(joint, &start, &space, SEARCH.to_hold, task)?.cost())
    };
    let mut least = search(&base, &free)?;
    for place in (0..joint.count()).filter(|place| best.point[*place] < joint.low[*place]) {
        let Some(column) = free.iter().position(|direction| direction[place] == 1.0) else {
            continue;
        };
        base[place] = best.point[place];
        let mut without = free.clone();
        without.remove(column);
        least = least.min(search(&base, &without)?);
    }
    Ok(least)
}

/// Minimum of the model linearised at `best`.
fn linear(best: &Minimum, base: &[f64], free: &[Vec<f64>]) -> Vec<f64> {
    let along = |direction: &[f64]| {
        let mut sum = vec![0.0; best.misfit.len()];
        for (column, d) in best
            .slopes
            .iter()
            .zip(direction)
            .filter(|(_, d)| **d != 0.0)
        {
            for (sum, x) in sum.iter_mut().zip(column) {
                *sum += d * x;
            }
        }
        sum
    };
    let from: Vec<f64> = best.point.iter().zip(base).map(|(x, b)| x - b).collect();
    let (target, n) = (along(&from), free.len());
    let columns: Vec<Vec<f64>> = free.iter().map(|direction| along(direction)).collect();
    let mut matrix = vec![0.0; n * n];
    for (i, one) in columns.iter().enumerate() {
        for (j, other) in columns.iter().enumerate() {
            let ridge = if i == j { RIDGE } else { 0.0 };
            matrix[i * n + j] = dot(one, other) * (1.0 + ridge);
        }
    }
    let mut q: Vec<f64> = columns.iter().map(|column| dot(column, &target)).collect();
    match Lu::regular(matrix, n) {
        Some(factors) => factors.solve(&mut q),
        None => q.fill(0.0),
    }
    let mut point = base.to_vec();
    for (q, direction) in q.iter().zip(free) {
        for (x, d) in point.iter_mut().zip(direction) {
            *x += q * d;
        }
    }
    point
}
