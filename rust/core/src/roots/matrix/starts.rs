//! Guesses of the rightmost roots: eigenvalues of a linearisation at a real point.
//!
//! With K = M′ M⁻¹ at x, the roots of det(M(x) + (s − x) M′(x)) are x − 1/μ for the eigenvalues μ
//! of K (Ruhe 1973). They are close to roots of det M while |s − x| is small compared with one over
//! the delays. The point is moved to the largest real part among them. Nothing here is proved.

use num_complex::Complex64;

use super::factor::factor;
use super::simple_root::Dense;
use super::system::Irreducible;
use super::walker::{MatrixWalker, NEAR_ROOT};
use crate::linear_algebra::eigenvalues::eigenvalues;
use crate::order::sort_down;

/// Upper limit on the points at which M is linearised.
const MAX_POINTS: usize = 4;

/// Largest distance, in units of one over the longest delay, at which the guesses are trusted.
/// Larger: worse guesses count; smaller: more points.
const TRUSTED: f64 = 1.5;

/// Distance, in the same unit, at which the point need not be moved again.
const CLOSE: f64 = 0.5;

/// Least modulus of an eigenvalue, relative to the delays, that is used.
const LEAST: f64 = 1e-6;

/// Shift of a point at which M is singular, in units of the rate of the system.
const SHIFT: f64 = 1e-3;

/// Guesses of the rightmost roots, Im s ≥ 0: first those close to the point of linearisation, by
/// falling real part, and only these where there are any.
pub(super) fn starts(system: &Irreducible, walker: &mut MatrixWalker<'_>) -> Vec<Complex64> {
    let unit = system.longest();
    let mut x = 0.0;
    let mut found = Vec::new();
    for _ in 0..MAX_POINTS {
        let shifted = x + SHIFT * system.rate();
        let mut at = |x| linearised(system, walker, x);
        let Some(list) = at(x).or_else(|| at(shifted)) else {
            break;
        };
        found = list;
        let near = |s: &&Complex64| (*s - x).norm() * unit <= TRUSTED;
        let largest = |a: f64, s: &Complex64| a.max(s.re);
        let trusted = found.iter().filter(near).fold(f64::NEG_INFINITY, largest);
        // Far away, only that a root lies in that direction is likely.
        let target = if trusted.is_finite() {
            trusted
        } else {
            let far = found.iter().fold(f64::NEG_INFINITY, largest);
            far.clamp(x - TRUSTED / unit, x + TRUSTED / unit)
        };
        let moved = (target - x).abs() * unit;
        if !target.is_finite() || moved <= CLOSE {
            break;
        }
        x = target;
    }
    let near: Vec<Complex64> = found
        .iter()
        .copied()
        .filter(|s| (s - x).norm() * unit <= TRUSTED)
        .collect();
    let mut list = if near.is_empty() { found } else { near };
    sort_down(&mut list, |start| start.re);
    list
}

/// The roots of the linearisation at x, Im s ≥ 0.
fn linearised(
    system: &Irreducible,
    walker: &mut MatrixWalker<'_>,
    x: f64,
) -> Option<Vec<Complex64>> {
    let n = system.size();
    let z = Complex64::new(x, 0.0);
    let balanced = walker.balanced(z, NEAR_ROOT)?;
    let dense = Dense::new(system, balanced, z, 0.0);
    let inverse = factor(dense.g)?.inverse;
    let mut k = vec![0.0; n * n];
    let rows = k.chunks_exact_mut(n).zip(&balanced.references);
    for (i, (row, reference)) in rows.enumerate() {
        for (slope, from) in dense
            .slope
            .row(i)
            .0
            .iter()
            .zip(inverse.re.chunks_exact(inverse.stride()))
        {
            for (sum, x) in row.iter_mut().zip(from) {
                *sum += slope * x;
            }
        }
        // G carries the factor e^(s τ_c) of its row.
        *row.get_mut(i)? -= system.delays().get(*reference)?;
    }
    let least = LEAST * system.longest();
    let found = eigenvalues(&k, n)?
        .into_iter()
        .filter(|mu| mu.im >= 0.0 && mu.norm() > least)
        .map(|mu| {
            let s = z - mu.inv();
            // Guesses need few digits, and these do not depend on rounding errors.
            Complex64::new(f64::from(s.re as f32), f64::from(s.im.abs() as f32))
        })
        .filter(|s| s.is_finite());
    Some(found.collect())
}
