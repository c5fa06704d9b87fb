//! One root: Newton's iteration, and a disc proved to hold exactly its multiplicity.
//!
//! Simple roots. At the last iterate z let a = |g(z)| + e, b = |g′(z)| − e′ (e, e′ the rounding
//! bounds) and B a bound on |g″| in the disc of radius t. On a circle of radius r ≤ t with
//! a + B r²/2 < b r, g differs from g′(z)(s − z) by less than the size of the latter: by Rouché's
//! theorem g has exactly one root within r. The least such r is the radius claimed, the largest
//! the radius of isolation; margins of 1e-9 cover the rounding of these few operations.
//!
//! Multiple roots and clusters that double precision does not tell apart: the winding number
//! along the smallest square on which it can be proved, centred at the root of the (m−1)-st
//! derivative, which is simple where the root is m-fold.

use num_complex::Complex64;

use super::cell::Cell;
use super::winding::{Walker, is_clear, newton_step};
use crate::Error;
use crate::quasipoly::{Probe, modulus};

const MAX_STEPS: u32 = 60;

/// Squares of slopes outside these leave the range of double precision.
const LEAST: f64 = 1e-150;
const MOST: f64 = 1e150;

/// A disc in which the number of roots is proved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Disc {
    pub(super) center: Complex64,
    /// All `multiplicity` roots are within this of the centre.
    pub(super) radius: f64,
    /// And no other root is within this.
    pub(super) isolation: f64,
    pub(super) multiplicity: u32,
}

impl Disc {
    /// Does the disc meet the real axis? Its roots are then their own mirror images.
    pub(super) fn is_on_axis(&self) -> bool {
        self.center.im.abs() <= self.radius
    }

    /// Roots in the disc and its mirror image.
    pub(super) fn weight(&self) -> u64 {
        u64::from(self.multiplicity) * if self.is_on_axis() { 1 } else { 2 }
    }

    fn mirrored_up(mut self) -> Self {
        self.center.im = self.center.im.abs();
        self
    }
}

/// How a Newton iteration ended.
#[derive(Debug, Clone, Copy)]
pub(super) enum Outcome {
    /// In a simple root, Im ≥ 0.
    Simple(Disc),
    /// Where values are lost in rounding although no simple root is proved.
    Stalled(Complex64),
    /// Nowhere, or outside the window.
    Lost,
}

/// Newton's iteration from `start` as long as it stays in `window`.
pub(super) fn newton(
    probe: &mut Probe<'_>,
    start: Complex64,
    window: impl Fn(Complex64) -> bool,
) -> Outcome {
    let mut z = start;
    probe.refer_to_dominant(z);
    for _ in 0..MAX_STEPS {
        let mut jet = probe.jet(z);
        if let Some(larger) = jet.overtaken_by {
            probe.refer_to(larger);
            jet = probe.jet(z);
        }
        let step = newton_step(&jet);
        let lost_in_rounding = modulus(jet.value) <= 2.0 * jet.value_error;
        let small = modulus(step) <= 2.0 * f64::EPSILON * modulus(z);
        let next = z - step;
        let ahead = next.is_finite() && window(next);
        if small || lost_in_rounding {
            // Next to a multiple root the slope is lost as well, and the step may lead anywhere.
            let end = if ahead { next } else { z };
            let disc = simple_disc(probe, end).and_then(|disc| real_if_mirrored(probe, disc));
            return disc.map_or(Outcome::Stalled(z), Outcome::Simple);
        }
        if !ahead {
            return Outcome::Lost;
        }
        z = next;
    }
    Outcome::Lost
}

/// The disc of a simple root next to `z`, if there is one that can be proved.
pub(super) fn simple_disc(probe: &mut Probe<'_>, z: Complex64) -> Option<Disc> {
    let jet = probe.jet(z);
    let a = modulus(jet.value) + jet.value_error;
    let b = modulus(jet.slope) - jet.slope_error;
    if !(b > LEAST && b < MOST && a < MOST) {
        return None;
    }
    let size = modulus(z);
    // Radii at which the linear part wins, with the curvature of the disc of radius t.
    let radii = |t: f64| {
        let bend = probe.curvature_around(size + t, t);
        let root = b * b * (1.0 - 1e-9) - 2.0 * bend * a;
        (root > 0.0).then(|| {
            let root = root.sqrt();
            (
                2.0 * a / (b + root) * (1.0 + 1e-9),
                ((b + root) / bend).min(t) * (1.0 - 1e-9),
            )
        })
    };
    let first = 4.0 * a / b;
    let (radius, mut isolation) = radii(first)?;
    if radius > isolation {
        return None;
    }
    let mut t = first.max(f64::MIN_POSITIVE);
    for _ in 0..60 {
        t *= 4.0;
        match radii(t) {
            Some((least, most)) if least < most && least <= isolation => {
                isolation = isolation.max(most)
            }
            _ => break,
        }
        if isolation < 0.5 * t {
            break;
        }
    }
    Some(Disc {
        center: z,
        radius: radius.max(f64::MIN_POSITIVE),
        isolation,
        multiplicity: 1,
    })
}

/// A disc that meets the real axis holds a real root, if the disc about the axis shows the same
/// root: it is then the only one and its own mirror image. `None` where that fails.
fn real_if_mirrored(probe: &mut Probe<'_>, disc: Disc) -> Option<Disc> {
    if !disc.is_on_axis() {
        return Some(disc.mirrored_up());
    }
    let foot = Complex64::new(disc.center.re, 0.0);
    if disc.center == foot {
        return Some(disc);
    }
    let real = simple_disc(probe, foot)?;
    let same = (disc.center - foot).norm() + disc.radius <= real.isolation;
    same.then_some(real)
}

/// The smallest disc about the cluster at `z` in which the number of roots can be proved.
///
/// # Errors
/// Those of [`Walker::walk`] except [`Error::Contour`]: `Ok(None)` when no square up to
/// half-side `most` can be walked.
pub(super) fn cluster(
    walker: &mut Walker<'_>,
    z: Complex64,
    most: f64,
) -> Result<Option<Disc>, Error> {
    let Some(first) = smallest_square(walker, z, most)? else {
        return Ok(None);
    };
    if first.multiplicity == 0 {
        return Ok(None);
    }
    let Ok(derivative) = walker.probe.function().derivative(first.multiplicity - 1) else {
        return Ok(Some(first));
    };
    let near = |s: Complex64| (s - first.center).norm() <= 2.0 * first.radius;
    let Outcome::Simple(disc) = newton(&mut Probe::new(&derivative), first.center, near) else {
        return Ok(Some(first));
    };
    let side = if first.center.im < 0.0 {
        disc.center.conj()
    } else {
        disc.center
    };
    let second = smallest_square(walker, side, most)?;
    // The better centre is worth a disc that is one step of the search for its size larger.
    let as_good = |second: &Disc| {
        second.multiplicity == first.multiplicity && second.radius <= 1.6 * first.radius
    };
    Ok(Some(second.filter(as_good).unwrap_or(first)))
}

fn smallest_square(
    walker: &mut Walker<'_>,
    z: Complex64,
    most: f64,
) -> Result<Option<Disc>, Error> {
    let mut half = 8.0 * f64::EPSILON * modulus(z).max(most * 1e-9);
    walker.probe.refer_to_dominant(z);
    while half < most {
        let corners = [(1.0, 1.0), (-1.0, 1.0), (1.0, 0.0), (0.0, 1.0), (-1.0, 0.0)];
        let clear = corners
            .iter()
            .all(|(x, y)| is_clear(&walker.probe.jet(z + Complex64::new(x * half, y * half))));
        if clear {
            // A square that would meet the real axis is made symmetric about it.
            let symmetric = z.im.abs() <= 1.5 * half;
            let (center, im) = if symmetric {
                (Complex64::new(z.re, 0.0), (0.0, half))
            } else {
                (z, (z.im - half, z.im + half))
            };
            let re = (center.re - half, center.re + half);
            match Cell::new(walker, re, im, symmetric) {
                Ok(cell) => {
                    return Ok(u32::try_from(cell.count).ok().map(|multiplicity| {
                        // The half-diagonal, with the rounding of the corners.
                        let radius = half * 1.4143 + 2.0 * f64::EPSILON * modulus(center);
                        Disc {
                            center,
                            radius,
                            isolation: half,
                            multiplicity,
                        }
                        .mirrored_up()
                    }));
                }
                Err(Error::Contour { .. }) => {}
                Err(other) => return Err(other),
            }
        }
        half *= 1.5;
    }
    Ok(None)
}
