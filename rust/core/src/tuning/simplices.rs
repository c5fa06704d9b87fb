//! Minima of functions of a few variables with kinks, by the simplices of Nelder and Mead (1965).
//!
//! A simplex that has collapsed on a kink is freed: the search begins again around what it found,
//! with a smaller simplex turned the other way.

use crate::Error;
use crate::simplex::{Corner, Simplex};

/// Most simplices in sequence, the ratio of their sizes, and the evaluations of each for every
/// variable but one: more find a minimum at the end of a long kink and take time in proportion.
const SIMPLICES: usize = 6;
const SMALLER: f64 = 0.35;
const EVALUATIONS: usize = 150;

/// Improvement, relative to the cost, that counts as none: after two such simplices the search ends.
const IDLE: f64 = 1e-4;

/// A place near `start` with the least cost that simplices of the sides `size` find within bounds;
/// each ends when its corners are as close as `tolerance`, as a part of the bounds. The second argument of `cost` is the most
/// that matters: a cost above it may be any other above it.
///
/// # Errors
/// Those of `cost`.
pub(super) fn minimum(
    mut cost: impl FnMut(&[f64], f64) -> Result<f64, Error>,
    start: &[f64],
    size: &[f64],
    bounds: &[(f64, f64)],
    tolerance: f64,
) -> Result<Vec<f64>, Error> {
    let mut best = (start.to_vec(), cost(start, f64::INFINITY)?);
    let evaluations = EVALUATIONS * (bounds.len().max(2) - 1);
    let (mut scale, mut idle) = (1.0, 0);
    for _ in 0..SIMPLICES {
        let mut corners = vec![best.0.clone()];
        for (i, side) in size.iter().enumerate() {
            let mut corner = best.0.clone();
            corner[i] += scale * side;
            corners.push(corner);
        }
        let within = |mut place: Vec<f64>, most: f64| {
            for (x, (low, high)) in place.iter_mut().zip(bounds) {
                *x = x.max(*low).min(*high);
            }
            let cost = cost(&place, most)?;
            Ok((place, cost))
        };
        let is_enough = |corners: &[Corner]| width(corners, bounds) <= tolerance;
        let found = Simplex::around(corners, evaluations, within)?.contracted(is_enough)?;
        let gained = best.1 - found.1;
        if gained > 0.0 {
            best = found;
        }
        idle = if gained < IDLE * best.1.abs() {
            idle + 1
        } else {
            0
        };
        if idle == 2 {
            break;
        }
        scale *= -SMALLER;
    }
    Ok(best.0)
}

/// The largest distance of the others from the best corner, as a part of the bounds.
fn width(corners: &[Corner], bounds: &[(f64, f64)]) -> f64 {
    let (first, others) = (&corners[0].0, &corners[1..]);
    let away = |corner: &Corner| {
        let sides = corner.0.iter().zip(first).zip(bounds);
        let parts = sides.map(|((x, y), (low, high))| (x - y).abs() / (high - low));
        parts.fold(0.0, f64::max)
    };
    others.iter().map(away).fold(0.0, f64::max)
}
