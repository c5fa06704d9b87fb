//! The inverse of a positive definite matrix by Cholesky's method (Golub & Van Loan, Matrix
//! Computations, 4th ed. 2013, section 4.2), on its unit diagonal.

use super::vectors::dot;

/// The inverse of a symmetric matrix with `n` rows, after its diagonal is scaled to 1 and `ridge` is
/// added to it; `None` where it is not positive definite.
pub(crate) fn inverse_of_positive(matrix: &[f64], n: usize, ridge: f64) -> Option<Vec<f64>> {
    let scales: Vec<f64> = (0..n).map(|i| matrix[i * n + i].sqrt().recip()).collect();
    if !scales.iter().all(|scale| scale.is_finite() && *scale > 0.0) {
        return None;
    }
    let mut l = vec![0.0; n * n];
    for i in 0..n {
        for j in 0..=i {
            let scaled = matrix[i * n + j] * scales[i] * scales[j];
            let left = scaled - dot(&l[i * n..][..j], &l[j * n..][..j]);
            l[i * n + j] = if i > j {
                left / l[j * n + j]
            } else if left + ridge > 0.0 {
                (left + ridge).sqrt()
            } else {
                return None;
            };
        }
    }
    // The solutions for the unit vectors.
    let mut inverse = vec![0.0; n * n];
    for unit in 0..n {
        let mut column = vec![0.0; n];
        for i in unit..n {
            let done: f64 = (unit..i).map(|k| l[i * n + k] * column[k]).sum();
            column[i] = (f64::from(u8::from(i == unit)) - done) / l[i * n + i];
        }
        for i in (0..n).rev() {
            let done: f64 = (i + 1..n).map(|k| l[k * n + i] * column[k]).sum();
            column[i] = (column[i] - done) / l[i * n + i];
            inverse[unit * n + i] = column[i] * scales[unit] * scales[i];
        }
    }
    Some(inverse)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_inverse_is_one_and_only_of_definite_matrices() {
        let matrix = [4.0, 1e-3, 2.0, 1e-3, 1e-6, 1e-4, 2.0, 1e-4, 3.0];
        let inverse = inverse_of_positive(&matrix, 3, 1e-7).unwrap();
        for i in 0..3 {
            for j in 0..3 {
                let sum: f64 = (0..3).map(|k| matrix[i * 3 + k] * inverse[k * 3 + j]).sum();
                let size = (inverse[j * 3 + j] * matrix[i * 3 + i]).sqrt();
                let unit = if i == j { 1.0 } else { 0.0 };
                assert!((sum - unit).abs() < 1e-5 * size, "{i} {j} {sum}");
            }
        }
        assert_eq!(inverse_of_positive(&[1.0, 2.0, 2.0, 1.0], 2, 1e-7), None);
        assert_eq!(inverse_of_positive(&[f64::NAN], 1, 1e-7), None);
        assert_eq!(inverse_of_positive(&[0.0], 1, 1e-7), None);
    }
}
