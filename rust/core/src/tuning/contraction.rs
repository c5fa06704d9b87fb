//! Bounds of all that follows, from the sizes at the end of one period and of what is left of them.

use crate::linear_algebra::lu::Lu;

/// A matrix, its rows of equal length one after the other.
pub(super) type Matrix = Vec<f64>;

/// Part of the deviation that may be left after a period; the period is doubled until it is, at most this
/// many times.
const CONTRACTED: f64 = 0.6;
pub(super) const DOUBLINGS: u32 = 14;

/// Most steps of the power method that bounds what is left.
const POWERS: usize = 60;

/// A margin of what is bounded for rounding, relative.
const ROUNDING: f64 = 1e-6;

/// Bounds on output and command for all later times.
pub(super) type Bounds = (f64, f64);

/// Is at most the part [`CONTRACTED`] left after a period? The spectral radius of Q without negative elements is at
/// most the largest (Q x)ᵢ/xᵢ of any x > 0 (Collatz 1942; Berman and Plemmons 1994, theorem 2.1.11).
pub(super) fn contracts(period: &[f64], n: usize) -> bool {
    let mut x = vec![1.0; n];
    for _ in 0..POWERS {
        let after = times(period, &x, n);
        let ratios: Vec<f64> = after.iter().zip(&x).map(|(q, x)| q / x).collect();
        if ratios.iter().all(|&ratio| ratio < CONTRACTED) {
            return true;
        }
        if ratios.iter().all(|&ratio| ratio >= CONTRACTED) {
            return false;
        }
        // Q + I has the same vector and no other root on its largest circle.
        x.iter_mut().zip(&after).for_each(|(x, q)| *x += q);
        let largest = most(&x);
        x.iter_mut().for_each(|x| *x /= largest);
    }
    false
}

/// Bound on the sizes at the ends of all later periods; none where these do not contract.
pub(super) fn later(period: &[f64], sizes: &[f64]) -> Option<Vec<f64>> {
    let n = sizes.len();
    let matrix = identity(n).iter().zip(period).map(|(i, q)| i - q).collect();
    let mut found = sizes.to_vec();
    Lu::regular(matrix, n)?.solve(&mut found);
    let after = times(period, &found, n);
    let mut each = found.iter().zip(sizes).zip(&after);
    let holds = each.all(|((v, size), after)| {
        *v >= 0.0 && size + after <= v * (1.0 + 1e-3 * ROUNDING) + f64::MIN_POSITIVE
    });
    holds.then(|| found.iter().map(|v| v * (1.0 + ROUNDING)).collect())
}

/// The moduli of the elements.
pub(super) fn moduli(matrix: &[f64]) -> Matrix {
    matrix.iter().map(|x| x.abs()).collect()
}

pub(super) fn identity(n: usize) -> Matrix {
    let entry = |k: usize| f64::from(u8::from(k / n == k % n));
    (0..n * n).map(entry).collect()
}

/// The product of matrices, of which the first has rows of `inner` elements.
pub(super) fn times(left: &[f64], right: &[f64], inner: usize) -> Matrix {
    let width = right.len() / inner.max(1);
    let mut found = Vec::with_capacity(left.len() / inner.max(1) * width);
    for row in left.chunks_exact(inner.max(1)) {
        let mut sums = vec![0.0; width];
        for (x, other) in row.iter().zip(right.chunks_exact(width.max(1))) {
            for (sum, y) in sums.iter_mut().zip(other) {
                *sum += x * y;
            }
        }
        found.extend(sums);
    }
    found
}

/// The largest of numbers that are not negative.
pub(super) fn most(values: &[f64]) -> f64 {
    values.iter().copied().fold(0.0, f64::max)
}
