//! A step of Levenberg and Marquardt between bounds.

use crate::linear_algebra::lu::Lu;
use crate::linear_algebra::vectors::dot;

/// Damping added where a number changes nothing, as a share of the largest.
const FLOOR: f64 = 1e-12;

/// The normal equations of derivatives of a model and what it leaves.
pub(super) struct Normal {
    matrix: Vec<f64>,
    right: Vec<f64>,
}

impl Normal {
    pub(super) fn new(columns: &[Vec<f64>], left: &[f64]) -> Self {
        let n = columns.len();
        let mut matrix = vec![0.0; n * n];
        for (i, one) in columns.iter().enumerate() {
            for (j, other) in columns[..=i].iter().enumerate() {
                let product = dot(one, other);
                (matrix[i * n + j], matrix[j * n + i]) = (product, product);
            }
        }
        let right = columns.iter().map(|column| dot(column, left)).collect();
        Self { matrix, right }
    }

    /// The fall of the sum of squares that a step promises.
    pub(super) fn promised(&self, from: &[f64], to: &[f64]) -> f64 {
        let step: Vec<f64> = to.iter().zip(from).map(|(to, from)| to - from).collect();
        let rows = self.matrix.chunks(step.len().max(1));
        let squares = rows.zip(&step).map(|(row, own)| own * dot(row, &step));
        2.0 * dot(&self.right, &step) - squares.sum::<f64>()
    }
}

/// The next point by these equations; `None` where nothing moves.
pub(super) fn stepped(
    normal: &Normal,
    from: &[f64],
    clamp: impl Fn(&mut [f64]),
    damping: f64,
) -> Option<Vec<f64>> {
    let mut free: Vec<usize> = (0..normal.right.len()).collect();
    // A number that its range stops is left out, and the others step again.
    loop {
        let step = damped(normal, &free, damping)?;
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

fn damped(normal: &Normal, free: &[usize], damping: f64) -> Option<Vec<f64>> {
    let (n, all) = (free.len(), normal.right.len());
    let mut matrix = vec![0.0; n * n];
    for (i, one) in free.iter().enumerate() {
        for (j, other) in free.iter().enumerate() {
            matrix[i * n + j] = normal.matrix[one * all + other];
        }
    }
    for i in 0..n {
        let own = matrix[i * n + i];
        matrix[i * n + i] = own * (1.0 + damping) + FLOOR * own + f64::MIN_POSITIVE;
    }
    let mut right: Vec<f64> = free.iter().map(|at| normal.right[*at]).collect();
    Lu::regular(matrix, n)?.solve(&mut right);
    right.iter().all(|step| step.is_finite()).then_some(right)
}
