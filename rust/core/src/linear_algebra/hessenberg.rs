//! Reduction to Hessenberg form by Householder's reflections.
//!
//! Golub & Van Loan (Matrix Computations, 4th ed. 2013, algorithm 7.4.2): Qᵀ A Q with zeros below the
//! first subdiagonal, backward stable, in 10/3 n³ operations.

use super::vectors::{add_multiple, dot};

/// Replace a matrix with `n` rows by its Hessenberg form. Entries are moderate: squares of the
/// largest do not overflow.
pub(super) fn reduce(a: &mut [f64], n: usize) {
    let (mut v, mut sums) = (vec![0.0; n], vec![0.0; n]);
    for k in 0..n.saturating_sub(2) {
        let below = k + 1;
        let v = &mut v[below..];
        for (v, row) in v.iter_mut().zip(a.chunks_exact(n).skip(below)) {
            *v = row[k];
        }
        let (head, tau) = reflector(v);
        let rows = || v.iter().enumerate().filter(|(_, v)| **v != 0.0);
        let sums = &mut sums[below..];
        sums.fill(0.0);
        for (i, v) in rows() {
            add_multiple(sums, *v, &a[(below + i) * n + below..][..n - below]);
        }
        for (i, v) in rows() {
            add_multiple(
                &mut a[(below + i) * n + below..][..n - below],
                -tau * v,
                sums,
            );
        }
        for row in a.chunks_exact_mut(n) {
            let row = &mut row[below..];
            let share = tau * dot(row, v);
            add_multiple(row, -share, v);
        }
        for (i, row) in a.chunks_exact_mut(n).skip(below).enumerate() {
            row[k] = if i == 0 { head } else { 0.0 };
        }
    }
}

/// Sizes at and below which a number is zero beside entries of moderate size.
pub(super) const TINY: f64 = f64::MIN_POSITIVE / f64::EPSILON;

/// Replace x by v with v_0 = 1, so that (I − τ v vᵀ) x = (β, 0, …, 0); β and τ, which is 0 where all
/// but the first entry are zero.
#[inline(always)]
pub(super) fn reflector(x: &mut [f64]) -> (f64, f64) {
    let Some((first, rest)) = x.split_first_mut() else {
        return (0.0, 0.0);
    };
    let size = rest.iter().fold(0.0_f64, |size, x| size.max(x.abs()));
    if size <= TINY {
        return (*first, 0.0);
    }
    let size = size.max(first.abs());
    let unit = 1.0 / size;
    let alpha = *first * unit;
    let squares: f64 = rest.iter().map(|x| (x * unit) * (x * unit)).sum();
    let beta = -(alpha * alpha + squares).sqrt().copysign(alpha);
    let scale = unit / (alpha - beta);
    rest.iter_mut().for_each(|x| *x *= scale);
    *first = 1.0;
    (beta * size, (beta - alpha) / beta)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reflections_leave_one_entry_of_any_size() {
        for scale in [1e-280, 1.0, 1e150] {
            let x = [3.0, -4.0, 0.0, 12.0].map(|x| x * scale);
            let mut v = x;
            let (beta, tau) = reflector(&mut v);
            let error = 1e-15 * 13.0 * scale;
            assert!((beta + 13.0 * scale).abs() <= error);
            let share = tau * dot(&v, &x);
            for ((x, v), left) in x.iter().zip(v).zip([beta, 0.0, 0.0, 0.0]) {
                assert!((x - share * v - left).abs() <= error);
            }
        }
        assert_eq!(reflector(&mut [2.0, 0.0]), (2.0, 0.0));
        assert_eq!(reflector(&mut [2.0, 1e-310]), (2.0, 0.0));
    }

    #[test]
    fn the_form_has_the_traces_of_the_matrix() {
        let n = 9;
        let a: Vec<f64> = (0..n * n).map(|k| ((k * k + 3) as f64).sin()).collect();
        let mut h = a.clone();
        reduce(&mut h, n);
        let square = |a: &[f64]| -> f64 {
            let places = (0..n * n).map(|k| a[k] * a[k % n * n + k / n]);
            places.sum()
        };
        let trace = |a: &[f64]| -> f64 { a.iter().step_by(n + 1).sum() };
        assert!((trace(&a) - trace(&h)).abs() < 1e-13);
        assert!((square(&a) - square(&h)).abs() < 1e-13);
        assert!((0..n * n).all(|k| k / n <= k % n + 1 || h[k] == 0.0));
    }
}
