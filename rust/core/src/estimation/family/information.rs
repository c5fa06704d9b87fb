//! Information of numbers from whitened columns, and their covariance.

use crate::linear_algebra::cholesky::inverse_of_positive;
use crate::linear_algebra::vectors::dot;

/// The spread of a number about which the record says nothing, in its scale: errors end there.
pub(super) const UNKNOWN: f64 = 10.0;

/// WᵀW/σ² in the scale of each number.
pub(super) fn products(columns: &[Vec<f64>], scales: &[f64], variance: f64) -> Vec<f64> {
    let mut out = Vec::with_capacity(columns.len() * columns.len());
    for (left, a) in columns.iter().zip(scales) {
        for (right, b) in columns.iter().zip(scales) {
            out.push(dot(left, right) * a * b / variance);
        }
    }
    out
}

/// The covariance from the information, with the little that is known without a record.
pub(super) fn covariance(information: &[f64], scales: &[f64], factor: f64) -> Vec<f64> {
    let n = scales.len();
    let mut matrix = information.to_vec();
    for i in 0..n {
        matrix[i * n + i] = matrix[i * n + i] / factor + 1.0 / (UNKNOWN * UNKNOWN);
        for j in 0..n {
            if i != j {
                matrix[i * n + j] /= factor;
            }
        }
    }
    let mut out = inverse_of_positive(&matrix, n, 0.0).unwrap_or_else(|| {
        let unknown = |at: usize| {
            if at.is_multiple_of(n + 1) {
                UNKNOWN * UNKNOWN
            } else {
                0.0
            }
        };
        (0..n * n).map(unknown).collect()
    });
    for i in 0..n {
        for j in 0..n {
            out[i * n + j] *= scales[i] * scales[j];
        }
    }
    out
}
