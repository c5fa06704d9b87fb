//! The triangular factor R of columns, X = Q R, by modified Gram–Schmidt on blocks of rows.
//!
//! Each block is made orthonormal below the factor of the rows before it (Golub & Van Loan 2013,
//! section 5.2), so that long columns are read once and a block stays in the cache. R is as accurate as by
//! Householder's reflections (Björck 1967); with the target as a last column it holds the solution
//! and the sum of squares, and Q is not needed.

use pulp::{Simd, WithSimd};

use super::vectors::dot;
use crate::simd::Instructions;
use crate::{Error, Task, memory};

/// Norm of what is left of a column, as a share of its norm, below which it depends on the others.
const DEPENDENT: f64 = 1e-9;

/// Most rows of a block, or this multiple of the columns if that is more.
const BLOCK: usize = 256;
const BLOCK_SHARE: usize = 2;

/// Columns, for the same operations in the same order in wider registers where the machine has them.
struct Columns<'a> {
    columns: &'a [f64],
    length: usize,
    count: usize,
    task: &'a Task,
}

impl WithSimd for Columns<'_> {
    type Output = Result<Triangle, Error>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Self::Output {
        Triangle::made(self.columns, self.length, self.count, self.task)
    }
}

/// R of some columns.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Triangle {
    /// Column by column; row i of column j at j (j + 1)/2 + i.
    factor: Vec<f64>,
}

impl Triangle {
    /// R of `count` columns of this length, one after the other.
    pub(crate) fn new(
        columns: &[f64],
        length: usize,
        count: usize,
        task: &Task,
    ) -> Result<Self, Error> {
        Instructions::chosen().run(Columns {
            columns,
            length,
            count,
            task,
        })
    }

    #[inline(always)]
    fn made(columns: &[f64], length: usize, count: usize, task: &Task) -> Result<Self, Error> {
        const WHAT: &str = "the triangular factor";
        // Blocks of about equal length: a short last one would cost as much as the others.
        let most = BLOCK.max(BLOCK_SHARE * count);
        let block = length.div_ceil(length.div_ceil(most).max(1));
        let stride = count + block;
        let mut factor = memory::filled(WHAT, 0.0, count * (count + 1) / 2)?;
        let mut stacked = memory::filled(WHAT, 0.0, stride * count)?;
        for start in (0..length).step_by(block.max(1)) {
            task.check()?;
            let rows = block.min(length - start);
            for (j, to) in stacked.chunks_exact_mut(stride).enumerate() {
                let (above, below) = to.split_at_mut(count);
                above.fill(0.0);
                above[..=j].copy_from_slice(&factor[j * (j + 1) / 2..][..=j]);
                let from = j * length + start;
                below[..rows].copy_from_slice(&columns[from..from + rows]);
                below[rows..].fill(0.0);
            }
            for j in 0..count {
                let (before, rest) = stacked.split_at_mut(j * stride);
                let own = &mut rest[..stride];
                let parts = &mut factor[j * (j + 1) / 2..][..=j];
                for (part, q) in parts.iter_mut().zip(before.chunks_exact(stride)) {
                    *part = dot(q, own);
                    for (own, q) in own.iter_mut().zip(q) {
                        *own -= *part * q;
                    }
                }
                let left = dot(own, own).sqrt();
                let inverse = if left > 0.0 { 1.0 / left } else { 0.0 };
                own.iter_mut().for_each(|entry| *entry *= inverse);
                parts[j] = left;
            }
        }
        Ok(Self { factor })
    }

    /// R with these columns, each down to its diagonal.
    pub(crate) fn of(factor: Vec<f64>) -> Self {
        Self { factor }
    }

    /// A column of R down to its diagonal.
    pub(crate) fn column(&self, j: usize) -> &[f64] {
        &self.factor[j * (j + 1) / 2..][..=j]
    }

    /// Is one of the first `count` columns not independent of those before it?
    pub(crate) fn is_dependent(&self, count: usize) -> bool {
        (0..count).any(|j| {
            let column = self.column(j);
            let size = dot(column, column).sqrt();
            // Not a number is not independent.
            (column[j] / size).partial_cmp(&DEPENDENT) != Some(std::cmp::Ordering::Greater)
        })
    }

    /// ln det of the Gram matrix of the first `count` columns.
    pub(crate) fn log_det(&self, count: usize) -> f64 {
        (0..count)
            .map(|j| 2.0 * self.column(j)[j].max(f64::MIN_POSITIVE).ln())
            .sum()
    }

    /// The solution of R x = `right` for the first columns, as many as entries.
    pub(crate) fn solve(&self, right: &[f64]) -> Vec<f64> {
        let mut x = right.to_vec();
        for j in (0..x.len()).rev() {
            let column = self.column(j);
            let value = x[j] / column[j];
            x[j] = value;
            for (x, entry) in x[..j].iter_mut().zip(column) {
                *x -= entry * value;
            }
        }
        x
    }

    /// (RᵀR)⁻¹ of the first `count` columns, row-major.
    pub(crate) fn inverse(&self, count: usize) -> Result<Vec<f64>, Error> {
        const WHAT: &str = "the covariance of the unknowns";
        let mut unit = vec![0.0; count];
        let mut columns = memory::reserved(WHAT, count * count)?;
        for j in 0..count {
            unit[j] = 1.0;
            columns.extend(self.solve(&unit));
            unit[j] = 0.0;
        }
        let mut out = memory::filled(WHAT, 0.0, count * count)?;
        for column in columns.chunks_exact(count.max(1)) {
            for (row, left) in out.chunks_exact_mut(count).zip(column) {
                for (place, right) in row.iter_mut().zip(column) {
                    *place += left * right;
                }
            }
        }
        Ok(out)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear_algebra::lu::Lu;

    fn factor(columns: &[Vec<f64>]) -> Triangle {
        let all = columns.concat();
        Triangle::new(&all, columns[0].len(), columns.len(), &Task::new()).unwrap()
    }

    /// Columns of numbers in −1 … 1.
    fn random(length: usize, count: usize) -> Vec<Vec<f64>> {
        let entry = |k: usize| {
            2.0 * (12.9898 * (k + 1) as f64)
                .sin()
                .mul_add(43_758.5, 1e6)
                .fract()
                - 1.0
        };
        let columns = (0..count).map(|j| (0..length).map(|i| entry(j * length + i)).collect());
        columns.collect()
    }

    /// XᵀX of the first columns, row-major.
    fn products(columns: &[Vec<f64>], count: usize) -> Vec<f64> {
        let places = (0..count * count).map(|at| dot(&columns[at / count], &columns[at % count]));
        places.collect()
    }

    /// RᵀR is XᵀX, and ln det that of its pivots.
    fn assert_factor(found: &Triangle, columns: &[Vec<f64>]) {
        let (count, length) = (columns.len(), columns[0].len() as f64);
        for (at, expected) in products(columns, count).iter().enumerate() {
            let (i, j) = (at / count, at % count);
            let product = dot(&found.column(i)[..=i.min(j)], &found.column(j)[..=i.min(j)]);
            // Columns have a norm below √length.
            assert!((product - expected).abs() < 1e-14 * length);
        }
        assert!((0..count).all(|j| found.column(j)[j] > 0.0));
    }

    #[test]
    fn the_factor_is_that_of_the_normal_equations() {
        // One row more than columns; one block; several; more columns than half a block.
        for (length, count) in [(6, 5), (120, 5), (700, 5), (2000, 150)] {
            let columns = random(length, count);
            let found = factor(&columns);
            assert_factor(&found, &columns);
            let log_det: f64 = (0..count).map(|j| 2.0 * found.column(j)[j].ln()).sum();
            assert!((found.log_det(count) - log_det).abs() < 1e-12);
            assert!(!found.is_dependent(count));
        }
    }

    #[test]
    fn the_solution_and_the_covariance_are_those_of_the_normal_equations() {
        let columns = random(900, 4);
        let found = factor(&columns);
        // The last column is the target.
        let inner = Lu::regular(products(&columns, 3), 3).unwrap();
        let mut expected: Vec<f64> = (0..3).map(|j| dot(&columns[j], &columns[3])).collect();
        inner.solve(&mut expected);
        for (found, expected) in found.solve(&found.column(3)[..3]).iter().zip(expected) {
            assert!((found - expected).abs() < 1e-13);
        }
        for (found, expected) in found.inverse(3).unwrap().iter().zip(inner.inverse()) {
            assert!((found - expected).abs() < 1e-15);
        }
    }

    #[test]
    fn columns_that_begin_with_zeros_are_independent() {
        // The response to a command is zero until the delay is over.
        let mut columns = random(900, 3);
        columns[0][..600].fill(0.0);
        columns[1][..300].fill(0.0);
        let found = factor(&columns);
        assert!(!found.is_dependent(3));
        assert_factor(&found, &columns);
    }

    #[test]
    fn a_column_that_depends_on_others_is_seen() {
        let mut columns = random(700, 3);
        columns[2] = columns[0]
            .iter()
            .zip(&columns[1])
            .map(|(x, y)| 3.0 * x - y)
            .collect();
        assert!(factor(&columns).is_dependent(3));
        assert!(!factor(&columns).is_dependent(2));
        columns[2].fill(0.0);
        assert!(factor(&columns).is_dependent(3));
        columns[2].fill(f64::NAN);
        assert!(factor(&columns).is_dependent(3));
    }
}
