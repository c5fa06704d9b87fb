//! LU factors of a real matrix with partial pivoting, P A = L U.
//!
//! Gaussian elimination as in Golub & Van Loan (Matrix Computations, 4th ed. 2013, section 3.4),
//! with rows exchanged for the largest entry of each column. The solution is that of a matrix within
//! c n u |L| |U| of A (Higham, Accuracy and Stability, 2nd ed. 2002, theorem 9.4); how close it is
//! to A⁻¹ b depends on the condition of A.

use super::vectors::{add_multiple, dot};

/// L and U of a row-permuted matrix.
#[derive(Debug, Clone, Default)]
pub(crate) struct Lu {
    n: usize,
    /// L below the diagonal, U above, reciprocal pivots on it.
    entries: Vec<f64>,
    /// The row that row k was exchanged with.
    exchanged: Vec<usize>,
}

impl Lu {
    /// Factors of a matrix with `n` rows. A pivot of zero leads to solutions that are not finite.
    pub(crate) fn new(mut entries: Vec<f64>, n: usize) -> Self {
        let mut exchanged = Vec::with_capacity(n);
        for k in 0..n {
            let mut best = k;
            for i in k + 1..n {
                if entries[i * n + k].abs() > entries[best * n + k].abs() {
                    best = i;
                }
            }
            exchanged.push(best);
            let (above, below) = entries.split_at_mut((k + 1) * n);
            let top = &mut above[k * n..];
            if best != k {
                top.swap_with_slice(&mut below[(best - k - 1) * n..][..n]);
            }
            let (head, top) = top[k..].split_at_mut(1);
            head[0] = 1.0 / head[0];
            for row in below.chunks_exact_mut(n) {
                let factor = row[k] * head[0];
                row[k] = factor;
                if factor != 0.0 {
                    add_multiple(&mut row[k + 1..], -factor, top);
                }
            }
        }
        Self {
            n,
            entries,
            exchanged,
        }
    }

    /// Factors; `None` where the matrix is singular or not finite.
    pub(crate) fn regular(entries: Vec<f64>, n: usize) -> Option<Self> {
        let found = Self::new(entries, n);
        let reciprocals = found.entries.iter().step_by(n + 1);
        reciprocals
            .into_iter()
            .all(|r| r.is_finite() && *r != 0.0)
            .then_some(found)
    }

    /// Replace a right-hand side by the solution.
    pub(crate) fn solve(&self, x: &mut [f64]) {
        let n = self.n;
        if let ([reciprocal], [x]) = (&self.entries[..], &mut *x) {
            *x *= reciprocal;
            return;
        }
        for (k, &row) in self.exchanged.iter().enumerate() {
            x.swap(k, row);
        }
        for i in 1..n {
            x[i] -= dot(&self.entries[i * n..][..i], &x[..i]);
        }
        for i in (0..n).rev() {
            let row = &self.entries[i * n..][..n];
            x[i] = (x[i] - dot(&row[i + 1..], &x[i + 1..])) * row[i];
        }
    }

    /// The inverse; it pays where there are many right-hand sides.
    pub(crate) fn inverse(&self) -> Vec<f64> {
        let n = self.n;
        let mut inverse = vec![0.0; n * n];
        let mut column = vec![0.0; n];
        for j in 0..n {
            column.fill(0.0);
            column[j] = 1.0;
            self.solve(&mut column);
            for (row, entry) in inverse.chunks_exact_mut(n).zip(&column) {
                row[j] = *entry;
            }
        }
        inverse
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solves_with_pivots_and_refuses_singular_matrices() {
        let matrix = vec![0.0, 2.0, 1.0, 1.0, 1.0, 0.0, 3.0, 0.0, 1.0];
        let factors = Lu::regular(matrix, 3).unwrap();
        let mut x = vec![7.0, 3.0, 6.0];
        factors.solve(&mut x);
        for (x, known) in x.iter().zip([1.0, 2.0, 3.0]) {
            assert!((x - known).abs() < 1e-14);
        }
        assert!(Lu::regular(vec![1.0, 2.0, 2.0, 4.0], 2).is_none());
        assert!(Lu::regular(vec![f64::NAN], 1).is_none());
        assert!(Lu::regular(vec![f64::INFINITY, 0.0, 0.0, 1.0], 2).is_none());
        assert!(Lu::regular(vec![], 0).is_some());
        let mut x = [1.0, 1.0];
        Lu::new(vec![1.0, 2.0, 2.0, 4.0], 2).solve(&mut x);
        assert!(!x.iter().all(|x| x.is_finite()));
    }

    #[test]
    fn the_inverse_of_a_hilbert_matrix_has_integers() {
        // Entries up to 44 100 and a condition of 5e5.
        let n = 5;
        let hilbert = (0..n * n)
            .map(|k| 1.0 / (k / n + k % n + 1) as f64)
            .collect();
        let inverse = Lu::regular(hilbert, n).unwrap().inverse();
        let first = [25.0, -300.0, 1050.0, -1400.0, 630.0];
        for (found, known) in inverse.iter().zip(first) {
            assert!(
                (found - known).abs() < 1e-7 * 1400.0,
                "{found} is not {known}"
            );
        }
    }
}
