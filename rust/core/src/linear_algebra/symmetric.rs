//! Eigenvalues and eigenvectors of a small symmetric matrix, by rotations that clear one entry after
//! the other (Jacobi 1846; Golub & Van Loan, Matrix Computations, 4th ed. 2013, section 8.5).

/// Most sweeps over all entries; about six are enough.
const SWEEPS: usize = 40;

/// Size of an entry, as a share of those of its diagonal, from which it is zero.
const NONE: f64 = 1e-17;

/// A = V Λ Vᵀ.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Symmetric {
    /// The eigenvalues.
    pub(crate) values: Vec<f64>,
    /// Columns of V.
    pub(crate) vectors: Vec<Vec<f64>>,
}

impl Symmetric {
    /// Of a matrix with n rows, row-major.
    pub(crate) fn new(matrix: &[f64], n: usize) -> Self {
        let mut a = matrix.to_vec();
        let unit = |j: usize| (0..n).map(|i| f64::from(u8::from(i == j))).collect();
        let mut vectors: Vec<Vec<f64>> = (0..n).map(unit).collect();
        for _ in 0..SWEEPS {
            let mut moved = false;
            for p in 0..n {
                for q in p + 1..n {
                    let (pp, qq, pq) = (a[p * n + p], a[q * n + q], a[p * n + q]);
                    if pq == 0.0 || pq.abs() <= NONE * (pp.abs() + qq.abs()) || !pq.is_finite() {
                        continue;
                    }
                    moved = true;
                    let ratio = (qq - pp) / (2.0 * pq);
                    let tan = 1.0_f64.copysign(ratio) / (ratio.abs() + ratio.hypot(1.0));
                    let cos = 1.0 / tan.hypot(1.0);
                    let sin = tan * cos;
                    for k in 0..n {
                        let (kp, kq) = (a[k * n + p], a[k * n + q]);
                        a[k * n + p] = cos * kp - sin * kq;
                        a[k * n + q] = sin * kp + cos * kq;
                    }
                    for k in 0..n {
                        let (pk, qk) = (a[p * n + k], a[q * n + k]);
                        a[p * n + k] = cos * pk - sin * qk;
                        a[q * n + k] = sin * pk + cos * qk;
                    }
                    let (below, above) = vectors.split_at_mut(q);
                    for (p, q) in below[p].iter_mut().zip(&mut above[0]) {
                        (*p, *q) = (cos * *p - sin * *q, sin * *p + cos * *q);
                    }
                }
            }
            if !moved {
                break;
            }
        }
        Self {
            values: (0..n).map(|i| a[i * n + i]).collect(),
            vectors,
        }
    }

    /// xᵀ A⁻¹ x with no eigenvalue below `least`.
    pub(crate) fn inverse_square(&self, x: &[f64], least: f64) -> f64 {
        let along = |vector: &Vec<f64>| vector.iter().zip(x).map(|(v, x)| v * x).sum::<f64>();
        let pairs = self.values.iter().zip(&self.vectors);
        pairs
            .map(|(value, vector)| along(vector).powi(2) / value.max(least))
            .sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_parts_are_those_of_the_matrix() {
        let a = [4.0, 1.0, -2.0, 1.0, 0.5, 0.3, -2.0, 0.3, -1.0];
        let found = Symmetric::new(&a, 3);
        for i in 0..3 {
            for j in 0..3 {
                let sum: f64 = (0..3)
                    .map(|k| found.values[k] * found.vectors[k][i] * found.vectors[k][j])
                    .sum();
                assert!((sum - a[i * 3 + j]).abs() < 1e-14, "{i} {j} {sum}");
            }
        }
    }

    #[test]
    fn the_inverse_square_has_no_small_eigenvalue() {
        let found = Symmetric::new(&[2.0, 0.0, 0.0, 1e-9], 2);
        assert!((found.inverse_square(&[2.0, 1.0], 0.25) - 6.0).abs() < 1e-12);
    }
}
