//! Roots so close together that no Newton iteration tells them apart: one disc for all of them.
//!
//! With the Taylor coefficients a_k of g at z, in two words and with their errors e_k, and a bound R on
//! the (m + 1)-st one in the disc of radius t, g has exactly m roots within every r ≤ t for which
//!     (|a_m| − e_m) rᵐ > Σ_{k<m} (|a_k| + e_k) rᵏ + R rᵐ⁺¹
//! (Pellet 1881, by Rouché's theorem against a_m (s − z)ᵐ). It is tested at radii a factor of two apart,
//! about the zero of the (m − 1)-st derivative next to z: where the m roots coincide it is theirs. The
//! smallest m for which a radius is found is taken. Divided by rᵐ, the sums lose (2m + 6) u of themselves; a
//! margin of 1e-9 covers that.

use num_complex::Complex64;

use super::newton::Disc;
use crate::quasipoly::{Expansion, Probe, expansion, modulus, remainder};

/// Most roots in one disc.
const MOST: usize = 20;

/// Relative radius at which the search for the least one begins.
const LEAST: f64 = 4.0 * f64::EPSILON;

const MARGIN: f64 = 1e-9;

/// The disc about the cluster at `z`, up to radius `most`; `None` where none is proved.
pub(super) fn cluster(probe: &mut Probe<'_>, z: Complex64, most: f64) -> Option<Disc> {
    probe.refer_to_dominant(z);
    let (h, reference) = (probe.function(), probe.reference());
    let near = expansion(h, reference, z, MOST);
    for m in 2..=MOST {
        let Some(mut center) = centre(&near, z, m) else {
            continue;
        };
        if modulus(center - z) > most {
            continue;
        }
        // One more step: the first was as long as the cluster is wide.
        let again = expansion(h, reference, center, m);
        center = self::centre(&again, center, m).unwrap_or(center);
        let mut disc = proved(probe, center, m, most);
        if disc.is_some_and(|disc| disc.is_on_axis()) && center.im != 0.0 {
            // A disc that holds its own mirror image is centred on the axis.
            disc = proved(probe, Complex64::new(center.re, 0.0), m, most);
        }
        if disc.is_some() {
            return disc.map(Disc::mirrored_up);
        }
    }
    None
}

/// The zero of the (m − 1)-st derivative next to `z`, by one step of Newton's iteration.
fn centre(near: &Expansion, z: Complex64, m: usize) -> Option<Complex64> {
    let (below, own) = (near.coefficients.get(m - 1)?, near.coefficients.get(m)?);
    // |a|² may leave the range where a does not.
    let size = modulus(*own);
    let center = z - (below / size) * (own.conj() / size) / m as f64;
    center.is_finite().then_some(center)
}

/// A disc about `center` with exactly `m` roots.
fn proved(probe: &Probe<'_>, center: Complex64, m: usize, most: f64) -> Option<Disc> {
    let (h, reference) = (probe.function(), probe.reference());
    let Expansion {
        coefficients,
        errors,
        ..
    } = expansion(h, reference, center, m);
    let sizes: Vec<f64> = coefficients.iter().copied().map(modulus).collect();
    let (own, lower) = sizes.split_last()?;
    let own = own - errors.last()?;
    let holds = |r: f64| {
        // Σ (|a_k| + e_k) r^(k − m)
        let sum = lower
            .iter()
            .zip(&errors)
            .fold(0.0, |sum, (size, error)| (sum + size + error) / r);
        let rest = remainder(h, reference, center, r, m + 1) * r;
        (sum + rest) * (1.0 + MARGIN) < own
    };
    let mut radius = LEAST * modulus(center).max(1e-9 * most);
    while !holds(radius) {
        radius *= 2.0;
        // Also where a value is not a number.
        if radius.is_nan() || radius > most {
            return None;
        }
    }
    let mut isolation = radius;
    while 2.0 * isolation <= most && holds(2.0 * isolation) {
        isolation *= 2.0;
    }
    Some(Disc {
        center,
        radius,
        isolation,
        multiplicity: u32::try_from(m).ok()?,
    })
}
