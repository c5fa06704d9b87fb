//! Orthonormal columns by modified Gram–Schmidt, done twice where much is taken; columns that depend on others are left out.

use super::tolerances::SEARCH;
use crate::linear_algebra::vectors::{add_multiple, dot};

/// Share of a column that is left below which the rest is made orthogonal again: less loses digits.
const AGAIN: f64 = 1e-3;

/// X = Q R of columns.
#[derive(Debug, Default, Clone)]
pub(super) struct Projection {
    /// The orthonormal columns; empty where a column depends on those before it.
    columns: Vec<Vec<f64>>,
    /// Column j of R, down to its diagonal.
    factor: Vec<Vec<f64>>,
}

impl Projection {
    pub(super) fn new(columns: Vec<Vec<f64>>) -> Self {
        let mut out = Self::default();
        for column in columns {
            out.add(column);
        }
        out
    }

    fn add(&mut self, mut column: Vec<f64>) {
        let size = dot(&column, &column).sqrt();
        let mut parts = self.taken(&mut column);
        let mut left = dot(&column, &column).sqrt();
        if left < AGAIN * size {
            for (part, more) in parts.iter_mut().zip(self.taken(&mut column)) {
                *part += more;
            }
            left = dot(&column, &column).sqrt();
        }
        if left > SEARCH.dependent * size {
            column.iter_mut().for_each(|entry| *entry /= left);
            parts.push(left);
        } else {
            column.clear();
            parts.push(0.0);
        }
        self.columns.push(column);
        self.factor.push(parts);
    }

    /// Take the parts along the columns from a vector.
    pub(super) fn taken(&self, vector: &mut [f64]) -> Vec<f64> {
        let part = |column: &Vec<f64>| {
            if column.is_empty() {
                return 0.0;
            }
            let part = dot(column, vector);
            add_multiple(vector, -part, column);
            part
        };
        self.columns.iter().map(part).collect()
    }

    /// The orthonormal columns of those that are independent.
    pub(super) fn into_columns(self) -> Vec<Vec<f64>> {
        let columns = self.columns.into_iter();
        columns.filter(|column| !column.is_empty()).collect()
    }

    /// Coefficients of the columns from parts along the orthonormal ones.
    pub(super) fn coefficients(&self, parts: &[f64]) -> Vec<f64> {
        let mut x = parts.to_vec();
        for j in (0..x.len()).rev() {
            let column = &self.factor[j];
            let value = if column[j] > 0.0 {
                x[j] / column[j]
            } else {
                0.0
            };
            x[j] = value;
            for (x, entry) in x[..j].iter_mut().zip(column) {
                *x -= entry * value;
            }
        }
        x
    }
}
