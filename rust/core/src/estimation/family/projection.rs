//! Orthonormal columns by modified Gram–Schmidt, done twice where much is taken; columns that depend on others are left out.

use super::tolerances::SEARCH;
use std::ops::Range;

use crate::linear_algebra::vectors::{add_multiple, dot};

/// Share of a column that is left below which the rest is made orthogonal again: less loses digits.
const AGAIN: f64 = 1e-3;

/// A column that is zero outside of some rows, such as those of one record.
#[derive(Debug, Clone)]
pub(super) struct Column {
    /// The first of these rows.
    pub(super) from: usize,
    pub(super) values: Vec<f64>,
}

impl Column {
    /// These rows.
    pub(super) fn rows(&self) -> Range<usize> {
        self.from..self.from + self.values.len()
    }

    /// Add a multiple of it to a vector of all rows.
    pub(super) fn add_to(&self, out: &mut [f64], factor: f64) {
        add_multiple(&mut out[self.rows()], factor, &self.values);
    }
}

impl From<Vec<f64>> for Column {
    fn from(values: Vec<f64>) -> Self {
        Self { from: 0, values }
    }
}

/// X = Q R of columns.
#[derive(Debug, Default, Clone)]
pub(super) struct Projection {
    /// The orthonormal columns; empty where a column depends on those before it.
    columns: Vec<Column>,
    /// Column j of R, down to its diagonal.
    factor: Vec<Vec<f64>>,
}

impl Projection {
    pub(super) fn new(columns: impl IntoIterator<Item = impl Into<Column>>) -> Self {
        let mut out = Self::default();
        for column in columns {
            out.add(column.into());
        }
        out
    }

    fn add(&mut self, mut column: Column) {
        let (from, values) = (column.from, &mut column.values);
        let size = dot(values, values).sqrt();
        let mut parts = self.taken_from(from, values);
        let mut left = dot(values, values).sqrt();
        if left < AGAIN * size {
            for (part, more) in parts.iter_mut().zip(self.taken_from(from, values)) {
                *part += more;
            }
            left = dot(values, values).sqrt();
        }
        if left > SEARCH.dependent * size {
            values.iter_mut().for_each(|entry| *entry /= left);
            parts.push(left);
        } else {
            values.clear();
            parts.push(0.0);
        }
        self.columns.push(column);
        self.factor.push(parts);
    }

    /// Take the parts along the columns from a vector of all rows.
    pub(super) fn taken(&self, vector: &mut [f64]) -> Vec<f64> {
        self.taken_from(0, vector)
    }

    /// The same of a vector that begins at a row and is zero outside of its own.
    fn taken_from(&self, from: usize, vector: &mut [f64]) -> Vec<f64> {
        let end = from + vector.len();
        let part = |column: &Column| {
            let rows = column.rows();
            let (first, last) = (rows.start.max(from), rows.end.min(end));
            if first >= last {
                return 0.0;
            }
            let own = &column.values[first - column.from..last - column.from];
            let other = &mut vector[first - from..last - from];
            let part = dot(own, other);
            add_multiple(other, -part, own);
            part
        };
        self.columns.iter().map(part).collect()
    }

    /// The orthonormal columns of those that are independent.
    pub(super) fn into_columns(self) -> Vec<Vec<f64>> {
        let columns = self.columns.into_iter().map(|column| column.values);
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
