//! Starts for Newton's iteration towards roots of very different size.
//!
//! Nothing is proved here: the discs in which the iteration ends prove where the roots are.

use std::f64::consts::PI;

use num_complex::Complex64;

use crate::elementary::{exp, log, sin_cos};

/// The roots that a polynomial would have if only two of its terms counted at a time. They lie on
/// circles whose radii follow from the upper hull of the points (k, log |c_k|) (Pellet 1881,
/// Ostrowski 1940).
pub(crate) fn tropical_roots(row: &[f64]) -> Vec<Complex64> {
    let points: Vec<(usize, f64)> = row
        .iter()
        .enumerate()
        .filter(|(_, c)| **c != 0.0)
        .map(|(k, c)| (k, log(c.abs())))
        .collect();
    let fall = |a: &(usize, f64), b: &(usize, f64)| (a.1 - b.1) / (b.0 as f64 - a.0 as f64);
    let mut roots = Vec::new();
    let mut left = 0;
    while let Some(from) = points.get(left) {
        let right = points.iter().enumerate().skip(left + 1);
        let Some((index, to)) = right.min_by(|a, b| fall(from, a.1).total_cmp(&fall(from, b.1)))
        else {
            break;
        };
        let many = to.0 - from.0;
        let sign = |k: usize| row.get(k).map_or(1.0, |c| c.signum());
        let first = if sign(from.0) == sign(to.0) { PI } else { 0.0 };
        let radius = exp(fall(from, to));
        roots.extend((0..=many / 2).map(|k| {
            let (sine, cosine) = sin_cos((first + 2.0 * PI * k as f64) / many as f64);
            Complex64::new(radius * cosine, radius * sine)
        }));
        left = index;
    }
    roots
}
