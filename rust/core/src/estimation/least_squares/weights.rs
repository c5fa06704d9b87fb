//! Weights of several recordings by what is left of each.

use super::joint::{Joint, Space};
use super::search::{Minimum, minimise};
use super::tolerances::{SEARCH, WEIGHTING};
use crate::linear_algebra::vectors::dot;
use crate::{Error, Task};

/// Iterate weights and fit until the weights converge.
///
/// # Errors
/// As those of the misfit.
pub fn by_scatter(joint: &mut Joint<'_>, first: &Minimum, task: &Task) -> Result<Minimum, Error> {
    let mut found = first.clone();
    for _ in 0..WEIGHTING.iterations {
        let size = |(piece, weight): (&[f64], &f64)| {
            (dot(piece, piece) / piece.len() as f64).sqrt() / weight
        };
        let pieces = joint.pieces(&found.misfit).zip(&joint.weights);
        let mut scatter: Vec<f64> = pieces.map(size).collect();
        let most = scatter.iter().copied().fold(0.0, f64::max);
        if most.is_nan() || most <= 0.0 {
            break;
        }
        for size in &mut scatter {
            *size = size.max(WEIGHTING.least_share * most);
        }
        let least = scatter.iter().copied().fold(f64::INFINITY, f64::min);
        let weights: Vec<f64> = scatter.iter().map(|size| least / size).collect();
        let change = |(new, old): (&f64, &f64)| (new - old).abs();
        let changes = weights.iter().zip(&joint.weights).map(change);
        let converged = changes.fold(0.0, f64::max) <= WEIGHTING.converged;
        joint.weights = weights;
        let all = Space::without(joint, vec![0.0; joint.count()], &[]);
        found = minimise(joint, &found.point, &all, SEARCH.to_rounding, task)?;
        if converged {
            break;
        }
    }
    Ok(found)
}
