//! Roots so close together that Newton's iteration cannot separate them: one disc for all of them.
//!
//! With the Taylor coefficients a_k of g at z up to the n-th, in double-double arithmetic and with
//! their errors e_k, and a bound R on the next one in the disc of radius t, g has exactly m roots
//! within every r ≤ t for which
//!     (|a_m| − e_m) rᵐ > Σ_{k≤n, k≠m} (|a_k| + e_k) rᵏ + R rⁿ⁺¹
//! (Pellet 1881, by Rouché's theorem against a_m (s − z)ᵐ). The inequality is tested at radii a
//! factor of two apart, about the zero of the (m − 1)-st derivative next to z, which is the m-fold
//! root where the m roots coincide. The smallest m for which a radius is found is taken. Divided by
//! rᵐ, the sums have the relative error (2n + 6) u, which a margin of 1e-9 covers.

use num_complex::Complex64;

use crate::quasipoly::{Expansion, Probe, expansion, modulus, remainder};
use crate::roots::disc::Disc;

/// Upper limit on the number of roots in one disc.
const MOST: usize = 20;

/// Number of Taylor coefficients beyond the m-th. The bound on the next one is a sum of moduli,
/// which may be far above the true coefficient where terms cancel.
const BEYOND: usize = 6;

/// Smallest radius tried, relative to |z|.
const LEAST: f64 = 4.0 * f64::EPSILON;

/// Largest radius, relative to |z|, for the disc of a single root among others.
const CLOSE: f64 = 1e-3;

const MARGIN: f64 = 1e-9;

/// The disc about the cluster at `z`, up to radius `most`; `None` where none is proved.
pub(crate) fn cluster(probe: &mut Probe<'_>, z: Complex64, most: f64) -> Option<Disc> {
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
        // One more step, because the first one was as long as the cluster is wide.
        let again = expansion(h, reference, center, m);
        center = self::centre(&again, center, m).unwrap_or(center);
        let mut disc = proved(probe, center, m, most);
        if disc.is_some_and(|disc| disc.is_on_axis()) && center.im != 0.0 {
            // A disc that contains its own mirror image is centred on the axis.
            disc = proved(probe, Complex64::new(center.re, 0.0), m, most);
        }
        if disc.is_some() {
            return disc.map(Disc::mirrored_up);
        }
    }
    None
}

/// The disc of the only root next to `z`, if it can be proved. Other roots may be at a distance
/// that is a small share of |z|.
pub(crate) fn single(probe: &Probe<'_>, z: Complex64) -> Option<Disc> {
    let most = CLOSE * modulus(z);
    let disc = proved(probe, z, 1, most)?;
    if disc.is_on_axis() && z.im != 0.0 {
        return proved(probe, Complex64::new(z.re, 0.0), 1, most);
    }
    Some(disc.mirrored_up())
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
    let near = expansion(h, reference, center, m + BEYOND);
    let bounds: Vec<f64> = near
        .coefficients
        .iter()
        .zip(&near.errors)
        .map(|(value, error)| modulus(*value) + error)
        .collect();
    let own = modulus(*near.coefficients.get(m)?) - near.errors.get(m)?;
    let (lower, higher) = (bounds.get(..m)?, bounds.get(m + 1..)?);
    let holds = |r: f64| {
        // Σ (|a_k| + e_k) r^(k − m), below m and above.
        let below = lower.iter().fold(0.0, |sum, size| (sum + size) / r);
        let rest = remainder(h, reference, center, r, m + BEYOND + 1);
        let above = higher.iter().rev().fold(rest, |sum, size| sum * r + size) * r;
        (below + above) * (1.0 + MARGIN) < own
    };
    let mut radius = LEAST * modulus(center).max(1e-9 * most);
    if radius <= 0.0 {
        // At 0 there is no scale for the smallest radius.
        return None;
    }
    while !holds(radius) {
        radius *= 2.0;
        // This also holds where a value is not a number.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quasipoly::make;

    #[test]
    fn a_disc_about_exactly_0_is_found_or_given_up() {
        // s − 1 + e^(−s) = s²/2 − s³/6 + …
        let double = make(&[&[-1.0, 1.0], &[1.0]], &[0.0, 1.0]);
        let mut probe = Probe::new(&double);
        let found = cluster(&mut probe, Complex64::ZERO, 1.0);
        assert!(found.is_some_and(|disc| {
            disc.center == Complex64::ZERO && disc.multiplicity == 2 && disc.radius < 1e-13
        }));
        // Twice a radius of 0 is 0: the search for a larger radius once did not end.
        for multiplicity in 1..4 {
            for most in [0.0, f64::MIN_POSITIVE, f64::NAN] {
                assert!(proved(&probe, Complex64::ZERO, multiplicity, most).is_none());
            }
        }
        // |z| = 0 gives no scale for the search of a single root either.
        let simple = make(&[&[-1.0, 2.0], &[1.0]], &[0.0, 1.0]);
        assert!(single(&Probe::new(&simple), Complex64::ZERO).is_none());
    }
}
