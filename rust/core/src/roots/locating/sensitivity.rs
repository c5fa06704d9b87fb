//! How a simple root moves with the coefficients and the delays.
//!
//! From h(s; p) = 0 follows ds/dp = −(∂h/∂p) / h′(s). For the coefficient a of sᵏ e^(−sτ) that is
//! −sᵏ e^(−sτ) / h′(s); for a delay τ_j it is s p_j(s) e^(−sτ_j) / h′(s), the sum over the row of
//! −s a times the former. With the delay τ_c of the term that dominates, e^(sτ_c) cancels: h′
//! e^(sτ_c) = g′ at a root, so that nothing overflows. The root is first improved by Newton's
//! iteration and proved to be simple. A multiple root has no derivative: it moves like a fractional
//! power of the change.

use num_complex::Complex64;

use super::clusters::cluster;
use super::newton::{Outcome, newton};
use crate::quasipoly::{Probe, QuasiPolynomial, modulus, relative_turn};
use crate::roots::counting::{Prepared, Walker};
use crate::roots::disc::Disc;
use crate::{Error, Task};

/// A cluster of roots is sought within this distance of the given point, relative to its modulus or
/// to one over the longest delay.
const NEARBY: f64 = 0.1;

/// The simple root of h at `near` and its derivatives with respect to the coefficients of sᵏ
/// e^(−sτ), for each pair (τ, k) of `terms`, whether h has such a term or not.
///
/// # Errors
/// [`Error::Argument`] where `near` is no root, or the root is not simple to working precision.
///
/// ```
/// use deadtime::{Task, quasipoly::QuasiPolynomial, roots::sensitivity};
/// use num_complex::Complex64;
/// // s + a = 0 has the root −a.
/// let h = QuasiPolynomial::new(vec![vec![2.0, 1.0]], vec![0.0])?;
/// let near = Complex64::new(-2.0, 0.0);
/// let (root, slopes) = sensitivity(&h, near, &[(0.0, 0)], &Task::new())?;
/// assert_eq!((root, slopes[0]), (near, Complex64::new(-1.0, 0.0)));
/// # Ok::<(), deadtime::Error>(())
/// ```
pub fn sensitivity(
    h: &QuasiPolynomial,
    near: Complex64,
    terms: &[(f64, u32)],
    task: &Task,
) -> Result<(Complex64, Vec<Complex64>), Error> {
    refuse_if!(
        !near.is_finite(),
        "the root is {near}: give a finite number"
    );
    let root = simple_root(h, near, task)?;
    let mut probe = Probe::new(h);
    probe.refer_to_dominant(root);
    // Near another root the slope is small although its terms are not.
    let slope = probe.double_double_jet(root).slope;
    let size = modulus(slope);
    let per_slope = |value: Complex64| -(value / size) * (slope.conj() / size);
    let slopes = terms.iter().map(|(delay, power)| {
        let turn = relative_turn(*delay, probe.delay(), root);
        per_slope((0..*power).fold(turn, |value, _| value * root))
    });
    Ok((root, slopes.collect()))
}

/// The simple root that `near` belongs to.
fn simple_root(h: &QuasiPolynomial, near: Complex64, task: &Task) -> Result<Complex64, Error> {
    let prepared = Prepared::new(h)?;
    // The coefficients are near 1, unless a power of s was taken out together with the factor.
    let scaled = if prepared.zeros == 0 {
        &prepared.rest
    } else {
        h
    };
    let mut walker = Walker::new(scaled, task);
    let span = scaled.delays().last().copied().unwrap_or(0.0)
        - scaled.delays().first().copied().unwrap_or(0.0);
    let reach = NEARBY * modulus(near).max(if span > 0.0 { 1.0 / span } else { 0.0 });
    let reach = if reach > 0.0 { reach } else { NEARBY };
    let upper = Complex64::new(near.re, near.im.abs());
    let window = |s: Complex64| modulus(s - upper) <= reach;
    match newton(&mut walker.probe, upper, window) {
        Outcome::Simple(Disc {
            center, isolation, ..
        }) if modulus(center - upper) <= isolation => {
            Ok(if near.im < 0.0 { center.conj() } else { center })
        }
        Outcome::Stalled(place) => {
            let many = match cluster(&mut walker.probe, place, reach) {
                Some(disc) => format!(
                    "double-double arithmetic cannot separate {} roots that lie within {:.1e} of \
                     {}",
                    disc.multiplicity, disc.radius, disc.center
                ),
                None => format!("rounding errors exceed the function near {place}"),
            };
            refuse!(
                "the root {near} is not simple: {many}. A multiple root has no derivative, \
                 because it splits when a coefficient changes"
            )
        }
        _ => refuse!(
            "{near} is not a root, and too far from the nearest root: give a root from `roots` or \
             `rightmost`"
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quasipoly::make;

    #[test]
    fn a_chain_root_far_out_moves_as_finite_differences_say() -> Result<(), Error> {
        let at = |gain: f64| make(&[&[0.0, 1.0], &[gain]], &[0.0, 0.36]);
        let task = Task::new();
        let near = Complex64::new(-19.586_391_650_761_6, 2_308.174_365_039_91);
        let step = 1e-4;
        let (up, _) = sensitivity(&at(2.0 + step), near, &[], &task)?;
        let (down, _) = sensitivity(&at(2.0 - step), near, &[], &task)?;
        let (_, slopes) = sensitivity(&at(2.0), near, &[(0.36, 0)], &task)?;
        let wanted = (up - down) / (2.0 * step);
        let margin = 1e-7 * wanted.norm();
        assert!(slopes.iter().all(|s| (s - wanted).norm() < margin));
        Ok(())
    }

    #[test]
    fn multiple_roots_and_other_places_are_refused() {
        let double = make(&[&[-1.0, 1.0], &[1.0]], &[0.0, 1.0]);
        for near in [Complex64::ZERO, Complex64::new(1e-9, 0.0)] {
            let refused = sensitivity(&double, near, &[], &Task::new());
            assert!(matches!(refused, Err(Error::Argument(m)) if m.contains("2 roots")));
        }
        let cubed = make(&[&[0.0, 0.0, 0.0, 1.0]], &[0.0]);
        let refused = sensitivity(&cubed, Complex64::ZERO, &[], &Task::new());
        assert!(matches!(refused, Err(Error::Argument(m)) if m.contains("3 roots")));
        let far = sensitivity(&double, Complex64::new(3.0, 1.0), &[], &Task::new());
        assert!(matches!(far, Err(Error::Argument(m)) if m.contains("not a root")));
    }
}
