//! Eigenvalues of small dense matrices, by the QR algorithm of nalgebra.

use nalgebra::{DMatrix, Schur};
use num_complex::Complex64;

/// Upper limit on the turns of the QR algorithm for each eigenvalue.
const MOST_TURNS: usize = 60;

/// Reflections that are tried where it does not converge.
const REFLECTIONS: u32 = 3;

/// Eigenvalues of a real matrix, row-major with n rows; `None` where the algorithm fails.
///
/// Its double shifts leave some matrices as they are, such as that of a cyclic permutation. A
/// similar matrix, reflected at a plane, has the same eigenvalues and is not one of these.
pub(crate) fn eigenvalues(matrix: &[f64], n: usize) -> Option<Vec<Complex64>> {
    let matrix = DMatrix::from_row_slice(n, n, matrix);
    if !matrix.iter().all(|entry| entry.is_finite()) {
        return None;
    }
    (0..=REFLECTIONS).find_map(|count| by_schur(reflected(&matrix, count)))
}

fn by_schur(matrix: DMatrix<f64>) -> Option<Vec<Complex64>> {
    let turns = MOST_TURNS * matrix.nrows();
    let found = Schur::try_new(matrix, f64::EPSILON, turns)?.complex_eigenvalues();
    let finite = found.iter().all(|z| z.re.is_finite() && z.im.is_finite());
    finite.then(|| found.iter().copied().collect())
}

/// H A H for the reflection H = I − 2 v vᵀ / vᵀv with v = (1, c, c², …); A itself for 0.
fn reflected(matrix: &DMatrix<f64>, count: u32) -> DMatrix<f64> {
    if count == 0 {
        return matrix.clone();
    }
    let n = matrix.nrows();
    let ratio = 1.0 - 1.0 / (n as f64 * f64::from(count) + 1.0);
    let v = DMatrix::from_fn(n, 1, |i, _| ratio.powi(i as i32));
    let h = DMatrix::identity(n, n) - &v * v.transpose() * (2.0 / v.norm_squared());
    &h * matrix * &h
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sorted(mut list: Vec<Complex64>) -> Vec<Complex64> {
        list.sort_by(|a, b| a.re.total_cmp(&b.re).then(a.im.total_cmp(&b.im)));
        list
    }

    #[test]
    fn cyclic_permutations_have_the_roots_of_one() {
        for n in [3, 4, 7, 30] {
            let mut matrix = vec![0.0; n * n];
            for i in 0..n {
                matrix[i * n + (i + 1) % n] = 1.0;
            }
            let found = eigenvalues(&matrix, n).unwrap();
            for k in 0..n {
                let root = Complex64::cis(std::f64::consts::TAU * k as f64 / n as f64);
                let near = found.iter().map(|z| (z - root).norm());
                assert!(near.fold(f64::INFINITY, f64::min) < 1e-12, "{n} {root}");
            }
        }
    }

    #[test]
    fn a_block_triangular_matrix_has_the_eigenvalues_of_its_blocks() {
        // 2 ± 3i, -1, 0.5 and zero in a chain of two.
        let matrix = [
            2.0, -3.0, 1.0, 4.0, 0.0, 1.0, //
            3.0, 2.0, 0.0, 1.0, 5.0, 0.0, //
            0.0, 0.0, -1.0, 7.0, 1.0, 2.0, //
            0.0, 0.0, 0.0, 0.5, 1.0, 1.0, //
            0.0, 0.0, 0.0, 0.0, 0.0, 1.0, //
            0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
        ];
        let found = sorted(eigenvalues(&matrix, 6).unwrap());
        let known = [
            (-1.0, 0.0),
            (0.0, 0.0),
            (0.0, 0.0),
            (0.5, 0.0),
            (2.0, -3.0),
            (2.0, 3.0),
        ];
        for (z, (re, im)) in found.iter().zip(known) {
            assert!((z - Complex64::new(re, im)).norm() < 1e-7, "{z}");
        }
    }

    #[test]
    fn what_is_not_finite_has_none() {
        assert!(eigenvalues(&[1.0, f64::NAN, 0.0, 1.0], 2).is_none());
    }
}
