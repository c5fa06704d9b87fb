//! A step of Levenberg and Marquardt between bounds.

use crate::linear_algebra::lu::Lu;
use crate::linear_algebra::vectors::dot;

/// Damping added where a number changes nothing, as a share of the largest.
const FLOOR: f64 = 1e-12;

/// The next point by these derivatives of a model and what it leaves; `None` where nothing moves.
pub(super) fn stepped(
    columns: &[Vec<f64>],
    left: &[f64],
    from: &[f64],
    clamp: impl Fn(&mut [f64]),
    damping: f64,
) -> Option<Vec<f64>> {
    let mut free: Vec<usize> = (0..columns.len()).collect();
    // A number that its range stops is left out, and the others step again.
    loop {
        let step = damped(columns, left, &free, damping)?;
        let mut x = from.to_vec();
        for (at, step) in free.iter().zip(&step) {
            x[*at] += step;
        }
        let mut inside = x.clone();
        clamp(&mut inside);
        let stopped = |at: &usize| inside[*at] == from[*at] && x[*at] != from[*at];
        let moving: Vec<usize> = free.iter().copied().filter(|at| !stopped(at)).collect();
        if moving.len() == free.len() {
            return (inside != from).then_some(inside);
        }
        if moving.is_empty() {
            return None;
        }
        free = moving;
    }
}

fn damped(columns: &[Vec<f64>], left: &[f64], free: &[usize], damping: f64) -> Option<Vec<f64>> {
    let n = free.len();
    let mut matrix = vec![0.0; n * n];
    for (i, one) in free.iter().enumerate() {
        for (j, other) in free.iter().enumerate() {
            matrix[i * n + j] = dot(&columns[*one], &columns[*other]);
        }
    }
    for i in 0..n {
        let own = matrix[i * n + i];
        matrix[i * n + i] = own * (1.0 + damping) + FLOOR * own + f64::MIN_POSITIVE;
    }
    let mut right: Vec<f64> = free.iter().map(|at| dot(&columns[*at], left)).collect();
    Lu::regular(matrix, n)?.solve(&mut right);
    right.iter().all(|step| step.is_finite()).then_some(right)
}
