//! Singular values by rotations of pairs of columns (Hestenes 1958; Golub & Van Loan, Matrix
//! Computations, 4th ed. 2013, section 8.6.3): each value to the relative accuracy of its column.

use super::vectors::dot;

/// Cosine between two columns from which they are orthogonal.
const ORTHOGONAL: f64 = 1e-15;

/// Most sweeps over all pairs; about six are enough.
const SWEEPS: usize = 40;

/// A = U Σ Vᵀ of a square matrix.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Singular {
    /// Columns of U, the largest value first; zero where the value is.
    pub(crate) left: Vec<Vec<f64>>,
    pub(crate) values: Vec<f64>,
    /// Columns of V.
    pub(crate) right: Vec<Vec<f64>>,
}

impl Singular {
    /// Of a matrix with n rows.
    pub(crate) fn new(matrix: &[f64], n: usize) -> Self {
        let column = |j: usize| matrix[j.min(matrix.len())..].iter().step_by(n.max(1));
        let mut left: Vec<Vec<f64>> = (0..n).map(|j| column(j).copied().collect()).collect();
        let mut right: Vec<Vec<f64>> = (0..n)
            .map(|j| (0..n).map(|i| f64::from(u8::from(i == j))).collect())
            .collect();
        for _ in 0..SWEEPS {
            let mut moved = false;
            for i in 0..n {
                for j in i + 1..n {
                    if let Some(turn) = rotation(&left[i], &left[j]) {
                        rotate(&mut left, i, j, turn);
                        rotate(&mut right, i, j, turn);
                        moved = true;
                    }
                }
            }
            if !moved {
                break;
            }
        }
        let values: Vec<f64> = left.iter().map(|own| dot(own, own).sqrt()).collect();
        for (own, value) in left.iter_mut().zip(&values) {
            let inverse = if *value > 0.0 { 1.0 / value } else { 0.0 };
            own.iter_mut().for_each(|entry| *entry *= inverse);
        }
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by(|i, j| values[*j].total_cmp(&values[*i]));
        Self {
            left: order.iter().map(|i| left[*i].clone()).collect(),
            right: order.iter().map(|i| right[*i].clone()).collect(),
            values: order.iter().map(|i| values[*i]).collect(),
        }
    }

    /// The pseudo-inverse, row-major, without values below this share of the largest.
    pub(crate) fn pseudo_inverse(&self, share: f64) -> Vec<f64> {
        let n = self.values.len();
        let least = share * self.values.first().copied().unwrap_or(0.0);
        let mut out = vec![0.0; n * n];
        for ((left, right), value) in self.left.iter().zip(&self.right).zip(&self.values) {
            if *value <= least {
                continue;
            }
            for (row, own) in out.chunks_exact_mut(n).zip(right) {
                for (place, other) in row.iter_mut().zip(left) {
                    *place += own * other / value;
                }
            }
        }
        out
    }
}

/// Cosine and sine that make two columns orthogonal; none where they are.
fn rotation(one: &[f64], other: &[f64]) -> Option<(f64, f64)> {
    let (alpha, beta, gamma) = (dot(one, one), dot(other, other), dot(one, other));
    // Not a number is left as it is.
    let is_along = gamma.abs() > ORTHOGONAL * (alpha * beta).sqrt();
    if !is_along {
        return None;
    }
    let zeta = (beta - alpha) / (2.0 * gamma);
    let tangent = 1.0_f64.copysign(zeta) / (zeta.abs() + zeta.mul_add(zeta, 1.0).sqrt());
    let cosine = 1.0 / tangent.mul_add(tangent, 1.0).sqrt();
    Some((cosine, cosine * tangent))
}

fn rotate(columns: &mut [Vec<f64>], i: usize, j: usize, (cosine, sine): (f64, f64)) {
    let (before, rest) = columns.split_at_mut(j);
    for (x, y) in before[i].iter_mut().zip(&mut rest[0]) {
        (*x, *y) = (cosine * *x - sine * *y, sine * *x + cosine * *y);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_parts_give_the_matrix_and_its_inverse() {
        let matrix = [4.0, 1e-3, 2.0, 1.0, 1e-6, 1e-4, 2.0, -3.0, 3.0];
        let found = Singular::new(&matrix, 3);
        assert!(found.values.windows(2).all(|pair| pair[0] >= pair[1]));
        let inverse = found.pseudo_inverse(1e-15);
        for i in 0..3 {
            for j in 0..3 {
                let parts = (0..3).map(|k| found.left[k][i] * found.values[k] * found.right[k][j]);
                assert!((parts.sum::<f64>() - matrix[i * 3 + j]).abs() < 1e-14);
                let unit: f64 = (0..3).map(|k| matrix[i * 3 + k] * inverse[k * 3 + j]).sum();
                assert!((unit - f64::from(u8::from(i == j))).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn a_matrix_of_rank_one_has_one_value() {
        let found = Singular::new(&[1.0, 2.0, 2.0, 4.0], 2);
        assert!((found.values[0] - 5.0).abs() < 1e-14);
        assert!(found.values[1] < 1e-14);
        let inverse = found.pseudo_inverse(1e-12);
        assert!((inverse[0] - 0.04).abs() < 1e-15 && (inverse[3] - 0.16).abs() < 1e-15);
        assert_eq!(Singular::new(&[0.0], 1).values, vec![0.0]);
    }
}
