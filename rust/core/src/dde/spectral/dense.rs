//! LU factors with partial pivoting of a full matrix of modest size.

/// L and U of a row-permuted matrix, row-major in one array.
#[derive(Debug, Clone, Default)]
pub(super) struct Factors {
    n: usize,
    lu: Vec<f64>,
    pivots: Vec<usize>,
}

impl Factors {
    /// Factors of the row-major `matrix`; `None` where it is singular or not finite.
    pub(super) fn new(n: usize, mut matrix: Vec<f64>) -> Option<Self> {
        let mut pivots = Vec::with_capacity(n);
        for column in 0..n {
            let mut pivot = column;
            for row in column + 1..n {
                if matrix[row * n + column].abs() > matrix[pivot * n + column].abs() {
                    pivot = row;
                }
            }
            pivots.push(pivot);
            if pivot != column {
                let (upper, lower) = matrix.split_at_mut(pivot * n);
                upper[column * n..(column + 1) * n].swap_with_slice(&mut lower[..n]);
            }
            let (upper, lower) = matrix.split_at_mut((column + 1) * n);
            let top = &upper[column * n..];
            if !(top[column].abs() > 0.0 && top[column].is_finite()) {
                return None;
            }
            for row in lower.chunks_exact_mut(n) {
                let factor = row[column] / top[column];
                row[column] = factor;
                if factor != 0.0 {
                    for (entry, above) in row[column + 1..].iter_mut().zip(&top[column + 1..]) {
                        *entry -= factor * above;
                    }
                }
            }
        }
        Some(Self {
            n,
            lu: matrix,
            pivots,
        })
    }

    /// Solve in place.
    pub(super) fn solve(&self, x: &mut [f64]) {
        let n = self.n;
        for (row, &pivot) in self.pivots.iter().enumerate() {
            x.swap(row, pivot);
        }
        for row in 1..n {
            let (known, rest) = x.split_at_mut(row);
            rest[0] -= dot(&self.lu[row * n..row * n + row], known);
        }
        for row in (0..n).rev() {
            let (head, known) = x.split_at_mut(row + 1);
            let line = &self.lu[row * n..(row + 1) * n];
            head[row] = (head[row] - dot(&line[row + 1..], known)) / line[row];
        }
    }
}

impl Factors {
    /// The inverse, row-major; it pays where there are many right-hand sides.
    pub(super) fn inverse(&self) -> Vec<f64> {
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

/// Σ a_i b_i in four partial sums.
#[inline]
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a4, a1) = a.as_chunks::<4>();
    let (b4, b1) = b.as_chunks::<4>();
    let mut sums = [0.0; 4];
    for (a, b) in a4.iter().zip(b4) {
        for ((sum, a), b) in sums.iter_mut().zip(a).zip(b) {
            *sum += a * b;
        }
    }
    let rest: f64 = a1.iter().zip(b1).map(|(a, b)| a * b).sum();
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}

/// Add a multiple of one vector to another.
#[inline]
pub(super) fn add_multiple(out: &mut [f64], factor: f64, vector: &[f64]) {
    for (out, entry) in out.iter_mut().zip(vector) {
        *out += factor * entry;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solves_with_pivots_and_refuses_singular_matrices() {
        let matrix = vec![0.0, 2.0, 1.0, 1.0, 1.0, 0.0, 3.0, 0.0, 1.0];
        let factors = Factors::new(3, matrix).unwrap();
        let mut x = vec![7.0, 3.0, 6.0];
        factors.solve(&mut x);
        for (x, known) in x.iter().zip([1.0, 2.0, 3.0]) {
            assert!((x - known).abs() < 1e-14);
        }
        assert!(Factors::new(2, vec![1.0, 2.0, 2.0, 4.0]).is_none());
        assert!(Factors::new(1, vec![f64::NAN]).is_none());
    }
}
