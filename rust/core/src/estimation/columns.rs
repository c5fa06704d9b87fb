//! Least squares on a few columns, made orthonormal one after the other.

use crate::linear_algebra::vectors::dot;

/// Columns that were made orthonormal, and what they leave of a target.
pub(super) struct Columns {
    units: Vec<Vec<f64>>,
    /// Rows of R, one for each column that does not depend on those before.
    factor: Vec<Vec<f64>>,
    /// Shares of the target along the columns.
    shares: Vec<f64>,
    left: Vec<f64>,
    /// What is left of a column, as a share of it, below which it depends on others.
    dependent: f64,
}

impl Columns {
    /// No columns yet.
    pub(super) fn new(target: &[f64], dependent: f64) -> Self {
        Self {
            units: Vec::new(),
            factor: Vec::new(),
            shares: Vec::new(),
            left: target.to_vec(),
            dependent,
        }
    }

    /// Take one more, twice against rounding; false where it depends on the others.
    pub(super) fn take(&mut self, mut column: Vec<f64>) -> bool {
        let size = dot(&column, &column).sqrt();
        let mut entries = vec![0.0; self.units.len()];
        for _ in 0..2 {
            for (unit, entry) in self.units.iter().zip(&mut entries) {
                let share = dot(unit, &column);
                *entry += share;
                column
                    .iter_mut()
                    .zip(unit)
                    .for_each(|(x, u)| *x -= share * u);
            }
        }
        let rest = dot(&column, &column).sqrt();
        if rest.is_nan() || rest <= self.dependent * size {
            return false;
        }
        column.iter_mut().for_each(|x| *x /= rest);
        entries.push(rest);
        let share = dot(&column, &self.left);
        self.left
            .iter_mut()
            .zip(&column)
            .for_each(|(x, u)| *x -= share * u);
        self.shares.push(share);
        self.factor.push(entries);
        self.units.push(column);
        true
    }

    /// Sum of squares that is left.
    pub(super) fn power(&self) -> f64 {
        dot(&self.left, &self.left)
    }

    /// What is left.
    pub(super) fn left(&self) -> &[f64] {
        &self.left
    }

    /// Number of independent columns.
    pub(super) fn rank(&self) -> usize {
        self.units.len()
    }

    /// The weights of the first `count` columns by themselves.
    pub(super) fn weights(&self, count: usize) -> Vec<f64> {
        let mut weights = self.shares[..count].to_vec();
        for j in (0..count).rev() {
            weights[j] /= self.factor[j][j];
            for i in 0..j {
                weights[i] -= self.factor[j][i] * weights[j];
            }
        }
        weights
    }
}
