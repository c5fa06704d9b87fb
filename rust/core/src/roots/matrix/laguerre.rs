//! Laguerre's iteration towards a root of det M, where Newton's steps are short.
//!
//! Amid n roots Newton's step is about 1/n of the distance to them, and passes by the next one. With
//! K = M′ M⁻¹, S = tr K and H = tr K² ≈ −S′, Laguerre's is
//!     −n/(S ± √((n − 1)(n H − S²))),
//! with the sign of the larger modulus; it is exact for a root of multiplicity m beside n − m equal
//! others. Roots r that are known are divided out, S − Σ 1/(s − r) and H − Σ 1/(s − r)², so that it
//! leads to another one (Maehly 1954). Nothing here is proved.

use num_complex::Complex64;

use super::factor::factor;
use super::simple_root::Dense;
use super::walker::{MatrixWalker, NEAR_ROOT};
use crate::Error;

/// Upper limit on the steps. More: farther roots are reached; fewer: less time in vain.
const MAX_STEPS: usize = 12;

/// Length of a step, relative to the modulus, after which Newton's iteration goes on.
const CLOSE: f64 = 1e-3;

/// A point near a root that is not known, from one farther away.
///
/// # Errors
/// Those of [`MatrixWalker::spend`].
pub(super) fn towards_root(
    walker: &mut MatrixWalker<'_>,
    known: &[Complex64],
    start: Complex64,
) -> Result<Complex64, Error> {
    let mut s = start;
    for _ in 0..MAX_STEPS {
        walker.spend()?;
        let Some(step) = step(walker, known, s).filter(|step| step.is_finite()) else {
            break;
        };
        s -= step;
        if step.norm() <= CLOSE * s.norm() {
            break;
        }
    }
    Ok(s)
}

fn step(walker: &mut MatrixWalker<'_>, known: &[Complex64], s: Complex64) -> Option<Complex64> {
    let system = walker.system;
    let n = system.size();
    let balanced = walker.balanced(s, NEAR_ROOT)?;
    let dense = Dense::new(system, balanced, s, 0.0);
    let inverse = factor(dense.g)?.inverse;
    let mut k = vec![Complex64::ZERO; n * n];
    for (i, (row, reference)) in k.chunks_exact_mut(n).zip(&balanced.references).enumerate() {
        for l in 0..n {
            let slope = dense.slope.get(i, l);
            for (j, sum) in row.iter_mut().enumerate() {
                *sum += slope * inverse.get(l, j);
            }
        }
        // G carries the factor e^(s τ_c) of its row.
        *row.get_mut(i)? -= *system.delays().get(*reference)?;
    }
    let entry = |i: usize, j: usize| k.get(i * n + j).copied().unwrap_or_default();
    let mut trace: Complex64 = (0..n).map(|i| entry(i, i)).sum();
    let mut square: Complex64 = (0..n)
        .flat_map(|i| (0..n).map(move |j| (i, j)))
        .map(|(i, j)| entry(i, j) * entry(j, i))
        .sum();
    for root in known {
        let share = (s - root).inv();
        trace -= share;
        square -= share * share;
    }
    let size = n.saturating_sub(known.len()).max(2) as f64;
    let root = ((size - 1.0) * (size * square - trace * trace)).sqrt();
    let (plus, minus) = (trace + root, trace - root);
    let larger = if plus.norm() >= minus.norm() {
        plus
    } else {
        minus
    };
    Some(size / larger)
}
