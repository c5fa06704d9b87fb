//! Least squares by modified Gram–Schmidt with the target as a last column (Björck 1967), which is
//! as stable as Householder's reflections for the solution and the residuals.

use super::path::dot;

/// Norm of what is left of a column, as a share of its norm, below which it depends on the others.
const DEPENDENT: f64 = 1e-9;

/// Columns made orthogonal, with the triangular factor R.
#[derive(Debug, Clone)]
pub(super) struct Orthogonal {
    /// Column by column; row i of column j at j (j + 1)/2 + i.
    factor: Vec<f64>,
    /// Number of columns.
    pub(super) count: usize,
    /// Does one column depend on those before it?
    pub(super) dependent: bool,
}

impl Orthogonal {
    /// Make the `count` columns of this length orthonormal in place.
    pub(super) fn new(columns: &mut [f64], length: usize, count: usize) -> Self {
        let mut found = Self {
            factor: Vec::with_capacity(count * (count + 1) / 2),
            count: 0,
            dependent: false,
        };
        for _ in 0..count {
            let (before, rest) = columns.split_at_mut(found.count * length);
            found.push(before, &mut rest[..length]);
        }
        found
    }

    /// Subtract from `target` its parts along the columns, and return these.
    pub(super) fn project(&self, columns: &[f64], target: &mut [f64]) -> Vec<f64> {
        columns
            .chunks_exact(target.len().max(1))
            .take(self.count)
            .map(|column| {
                let part = dot(column, target);
                for (target, column) in target.iter_mut().zip(column) {
                    *target -= part * column;
                }
                part
            })
            .collect()
    }

    /// Make one more column orthonormal to those `before`.
    pub(super) fn push(&mut self, before: &[f64], column: &mut [f64]) {
        let size = dot(column, column).sqrt();
        let mut parts = self.project(before, column);
        let left = dot(column, column).sqrt();
        let stands_out = left > DEPENDENT * size;
        self.dependent |= !stands_out;
        let inverse = if left > 0.0 { 1.0 / left } else { 0.0 };
        column.iter_mut().for_each(|entry| *entry *= inverse);
        parts.push(left);
        self.factor.extend(parts);
        self.count += 1;
    }

    fn entry(&self, row: usize, column: usize) -> f64 {
        self.factor[column * (column + 1) / 2 + row]
    }

    /// ln det of the Gram matrix of the columns.
    pub(super) fn log_det(&self) -> f64 {
        (0..self.count)
            .map(|j| 2.0 * self.entry(j, j).max(f64::MIN_POSITIVE).ln())
            .sum()
    }

    /// The solution of R x = `parts`, for the first columns, as many as there are parts.
    pub(super) fn solve(&self, parts: &[f64]) -> Vec<f64> {
        let mut x = parts.to_vec();
        for j in (0..x.len()).rev() {
            x[j] /= self.entry(j, j);
            let (above, own) = x.split_at_mut(j);
            for (i, x) in above.iter_mut().enumerate() {
                *x -= self.entry(i, j) * own[0];
            }
        }
        x
    }

    /// (RᵀR)⁻¹, row-major.
    pub(super) fn inverse(&self) -> Vec<f64> {
        let n = self.count;
        let columns: Vec<Vec<f64>> = (0..n)
            .map(|j| {
                let mut unit = vec![0.0; n];
                unit[j] = 1.0;
                self.solve(&unit)
            })
            .collect();
        let mut out = vec![0.0; n * n];
        for i in 0..n {
            for j in 0..n {
                out[i * n + j] = columns.iter().map(|column| column[i] * column[j]).sum();
            }
        }
        out
    }
}
