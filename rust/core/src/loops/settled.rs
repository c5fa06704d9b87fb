//! How slow the parts of a loop are.

use crate::Error;

use super::control_loop::ControlLoop;

impl ControlLoop {
    /// Upper bound in s on 1/|root| of plant and controller, except for roots at zero.
    ///
    /// # Errors
    /// [`Error::Argument`] for a plant without polynomials.
    pub fn slowest_time(&self) -> Result<f64, Error> {
        let [b, a, f, g, _] = self.polynomials(self.values())?;
        Ok([b, a, f, g].iter().map(|p| slowest(p)).fold(0.0, f64::max))
    }
}

/// Upper bound on 1/|root| of a polynomial (descending), except for roots at zero.
///
/// 1/|root| ≤ 2 max_k |c_k/c₀|^(1/k) for c₀ + c₁ s + … + c_n sⁿ, where c_n counts by half (Fujiwara
/// 1916).
pub(super) fn slowest(descending: &[f64]) -> f64 {
    // Lower powers are roots at zero.
    let Some(low) = descending.iter().rposition(|c| *c != 0.0) else {
        return 0.0;
    };
    let first = descending[low].abs();
    let bounds = descending[..low].iter().rev().zip(1..).map(|(c, k)| {
        let share = if k == low { 0.5 } else { 1.0 };
        let ratio = share * c.abs() / first;
        2.0 * if k == 1 {
            ratio
        } else {
            libm::pow(ratio, 1.0 / k as f64)
        }
    });
    bounds.fold(0.0, f64::max)
}
