//! A radius for the roots of neutral systems with one delayed derivative, from all its phases.
//!
//! On Re s = σ, s (I + C e^(iθ)) x = Σ F A_j e^(−s τ_j) x with C = F N e^(−σ τ), so that
//!     |s| ≤ max_θ Σ ‖(I + C e^(iθ))⁻¹ F A_j‖ w_j,  w_j = e^(−σ τ_j).
//! Right of the chains (I + C z)⁻¹ F A_j is analytic in |z| ≤ 1, where its norm is largest on the
//! circle, so that the bound holds for larger Re s as well. With R the computed inverse at θ₀,
//! (I + C e^(iθ₀)) R = I − Y, and ‖Δ‖ ≤ |θ − θ₀| ‖C‖ + (errors), the quotient at θ is at most
//!     (‖R F A_j‖ + ‖R‖ ‖F A_j‖ |Y|/(1 − |Y|))/(1 − ‖R‖ ‖Δ‖/(1 − |Y|)).

use std::f64::consts::PI;

use num_complex::Complex64;

use super::difference::{Difference, norm};
use super::factor::{ROUNDING, factor};
use crate::elementary::sin_cos;
use crate::linear_algebra::rows::Rows;
use crate::{Error, Task};

const MARGIN: f64 = 1.0 + 1e-9;

/// Largest ‖R‖ ‖Δ‖ over a step of the phase. Larger: fewer steps; smaller: a better bound.
const STEP: f64 = 0.25;

/// Upper limit on the steps.
const MAX_STEPS: usize = 3_000;

/// F A_j, a bound on the norm of its error, and w_j.
pub(super) struct Value {
    pub(super) matrix: Rows,
    pub(super) lost: f64,
    pub(super) weight: f64,
}

impl Difference {
    /// The bound for Re s ≥ `sigma`, which has to lie right of the chains, for one delayed
    /// derivative; `None` where it takes too many steps.
    pub(super) fn quotient_bound(
        &self,
        sigma: f64,
        values: &[Value],
        task: &Task,
    ) -> Result<Option<f64>, Error> {
        let (late, lost) = self.at(sigma, &[]);
        let size = norm(&late);
        let (mut angle, mut half, mut most) = (0.0, STEP, 0.0f64);
        for _ in 0..MAX_STEPS {
            task.check()?;
            let Some((inverse, bound)) = quotient_at(&late, angle + half, values) else {
                half *= 0.5;
                continue;
            };
            let moved = inverse * (half * size + lost) * MARGIN;
            if moved > STEP {
                half *= (0.9 * STEP / moved).min(0.5);
                continue;
            }
            most = most.max(bound / (1.0 - moved) * MARGIN);
            // Conjugation mirrors the phases.
            angle += 2.0 * half;
            if angle > PI {
                return Ok(Some(most));
            }
            half *= (0.9 * STEP / moved.max(0.1 * STEP)).min(2.0);
        }
        Ok(None)
    }
}

/// Bounds on ‖(I + C e^(iθ))⁻¹‖ and on the sum of the quotients at one phase.
fn quotient_at(late: &Rows, angle: f64, values: &[Value]) -> Option<(f64, f64)> {
    let n = late.size;
    let (sine, cosine) = sin_cos(angle);
    let turn = Complex64::new(cosine, sine);
    let mut whole = Rows::zeros(n);
    for i in 0..n {
        whole.add(i, i, Complex64::ONE);
        for j in 0..n {
            whole.add(i, j, late.get(i, j) * turn);
        }
    }
    let found = factor(whole)?;
    // Rounding of the turn and of the sums.
    let residual = found.residual + 8.0 * ROUNDING * (norm(late) + 1.0) * norm(&found.inverse);
    if residual.is_nan() || residual > 0.1 {
        return None;
    }
    let own = norm(&found.inverse);
    let units = (n as f64 + 4.0) * 2.0 * ROUNDING;
    let mut sum = 0.0;
    for Value {
        matrix,
        lost,
        weight,
    } in values
    {
        let mut product = Rows::zeros(n);
        for i in 0..n {
            for j in 0..n {
                let entry: Complex64 = (0..n)
                    .map(|k| found.inverse.get(i, k) * matrix.get(k, j).re)
                    .sum();
                product.add(i, j, entry);
            }
        }
        let size = norm(matrix) * (n as f64).sqrt();
        let off = size * (units + residual / (1.0 - residual)) + lost;
        sum += weight * (norm(&product) + own * off) * MARGIN;
    }
    Some((own / (1.0 - residual) * MARGIN, sum))
}
