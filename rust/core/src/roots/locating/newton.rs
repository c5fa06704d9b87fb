//! One root: Newton's iteration, and a disc proved to hold it alone.
//!
//! Simple roots. At the last iterate z let a = |g(z)| + e, b = |g′(z)| − e′ (e, e′ the rounding
//! bounds) and B a bound on |g″| in the disc of radius t. On a circle of radius r ≤ t with a + B
//! r²/2 < b r, g differs from g′(z)(s − z) by less than the size of the latter: by Rouché's theorem
//! g has exactly one root within r. The least such r is the radius of the disc, the largest the
//! radius of isolation. Margins of 1e-9 cover the rounding errors of these few operations.
//!
//! Where double precision proves no disc, or only a wide one, double-double arithmetic is tried.
//! Next to other roots, where B exceeds |g″| by far, Taylor coefficients in double-double
//! arithmetic decide (`clusters`). Roots that cannot be separated are enclosed together
//! (`clusters`).

use num_complex::Complex64;

use super::clusters::single;
use crate::quasipoly::{Jet, Probe, modulus};
use crate::roots::counting::newton_step;
use crate::roots::disc::Disc;

const MAX_STEPS: u32 = 60;

/// Relative radius above which a disc is improved in double-double arithmetic.
pub(super) const PRECISE_ENOUGH: f64 = 1e-12;

/// If the value is below this share of its error, another step cannot improve it.
pub(super) const ARRIVED: f64 = 0.25;

/// If the value is below this multiple of its error, one more step is all that helps.
pub(super) const LOST: f64 = 2.0;

/// Limits on slopes whose squares stay in the range of double precision.
pub(super) const LEAST: f64 = 1e-150;
pub(super) const MOST: f64 = 1e150;

/// Factors that cover the rounding errors of radii.
pub(super) const SHRUNK: f64 = 1.0 - 1e-9;

/// The same upwards.
pub(super) const ENLARGED: f64 = 1.0 + 1e-9;

/// Range of the ratio of two steps in which several roots are assumed.
const STEADY: std::ops::Range<f64> = 0.45..0.95;

/// Largest imaginary part of that ratio.
const STEADY_TURN: f64 = 0.05;

/// Upper limit on the radii of isolation that are tried.
const MAX_ISOLATIONS: usize = 12;

/// How a Newton iteration ended.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Outcome {
    /// At a simple root, Im ≥ 0.
    Simple(Disc),
    /// At a point where rounding errors exceed the value, but no simple root is proved.
    Stalled(Complex64),
    /// At no root, or outside the window.
    Lost,
}

/// Newton's iteration from `start` as long as it stays in `window`.
pub(crate) fn newton(
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
        let lost_in_rounding = modulus(jet.value) <= LOST * jet.value_error;
        if modulus(jet.value) <= ARRIVED * jet.value_error
            && let Some(disc) = disc_from(probe, z, &jet)
            && disc.radius <= PRECISE_ENOUGH * modulus(z)
            && !disc.is_on_axis()
        {
            return Outcome::Simple(disc.mirrored_up());
        }
        let small = modulus(step) <= 2.0 * f64::EPSILON * modulus(z);
        let next = z - step;
        let ahead = next.is_finite() && window(next);
        if small || lost_in_rounding {
            // Next to a multiple root the slope is inaccurate as well, and the step may be wrong by
            // any factor.
            let end = if ahead { next } else { z };
            let disc = simple_disc(probe, end, Probe::jet);
            return match disc {
                Some(disc) if disc.radius <= PRECISE_ENOUGH * modulus(end) => Outcome::Simple(disc),
                // The radius of a root at 0 cannot be small relative to its modulus.
                Some(disc)
                    if disc.center.norm() <= disc.radius
                        && probe.function().order_at_zero(1) == 1 =>
                {
                    Outcome::Simple(disc)
                }
                other => newton_in_double_double(probe, z, window, other),
            };
        }
        if !ahead {
            return Outcome::Lost;
        }
        z = next;
    }
    Outcome::Lost
}

/// Newton's iteration in double-double arithmetic, from where double precision makes no progress.
/// `known` is the disc that double precision could prove.
fn newton_in_double_double(
    probe: &mut Probe<'_>,
    start: Complex64,
    window: impl Fn(Complex64) -> bool,
    known: Option<Disc>,
) -> Outcome {
    let mut z = start;
    let mut before = Complex64::ZERO;
    for _ in 0..MAX_STEPS {
        let jet = probe.double_double_jet(z);
        let step = newton_step(&jet);
        let lost_in_rounding = modulus(jet.value) <= LOST * jet.value_error;
        let small = modulus(step) <= 2.0 * f64::EPSILON * modulus(z);
        let mut next = z - step * multiple(step, before);
        if !window(next) {
            next = z - step;
        }
        let ahead = next.is_finite() && window(next);
        if small || lost_in_rounding || !ahead {
            break;
        }
        before = step;
        z = next;
    }
    simple_disc(probe, z, Probe::double_double_jet)
        .or(known)
        .or_else(|| single(probe, z))
        .map_or(Outcome::Stalled(z), Outcome::Simple)
}

/// The multiple of Newton's step that is taken. At an m-fold root, and at some distance from m
/// close roots, each step is (m − 1)/m of the one before, so that m steps lead to the root.
fn multiple(step: Complex64, before: Complex64) -> f64 {
    let ratio = step * before.conj() / before.norm_sqr();
    let steady = STEADY.contains(&ratio.re) && ratio.im.abs() < STEADY_TURN;
    if steady {
        (1.0 / (1.0 - ratio.re)).round()
    } else {
        1.0
    }
}

/// The disc of a simple root next to `z`, if it can be proved from the jets that `at` returns. A
/// disc that meets the real axis is centred on it.
fn simple_disc<'a>(
    probe: &mut Probe<'a>,
    z: Complex64,
    at: fn(&mut Probe<'a>, Complex64) -> Jet,
) -> Option<Disc> {
    let jet = at(probe, z);
    let disc = disc_from(probe, z, &jet)?;
    if !disc.is_on_axis() {
        return Some(disc.mirrored_up());
    }
    let foot = Complex64::new(disc.center.re, 0.0);
    if disc.center == foot {
        return Some(disc);
    }
    // The disc about the axis holds the same root, which is then the only one and its own mirror
    // image.
    let jet = at(probe, foot);
    let real = disc_from(probe, foot, &jet)?;
    let same = (disc.center - foot).norm() + disc.radius <= real.isolation;
    same.then_some(real)
}

/// The disc of a simple root next to `z`, if one can be proved from the `jet` there.
fn disc_from(probe: &Probe<'_>, z: Complex64, jet: &Jet) -> Option<Disc> {
    let a = modulus(jet.value) + jet.value_error;
    let b = modulus(jet.slope) - jet.slope_error;
    if !(b > LEAST && b < MOST && a < MOST) {
        return None;
    }
    let size = modulus(z);
    // Radii at which the linear part exceeds the rest, with the curvature bound of the disc of
    // radius t.
    let radii = |t: f64| {
        let bend = probe.curvature_around(size + t, t);
        let root = b * b * SHRUNK - 2.0 * bend * a;
        (root > 0.0).then(|| {
            let root = root.sqrt();
            (
                2.0 * a / (b + root) * ENLARGED,
                ((b + root) / bend).min(t) * SHRUNK,
            )
        })
    };
    let first = 4.0 * a / b;
    let (radius, mut isolation) = radii(first)?;
    if radius > isolation {
        return None;
    }
    // The linear part exceeds the rest up to 2 b over the curvature, and this is known where the
    // disc is small.
    let mut t = b / probe.curvature_around(size, 0.0);
    for _ in 0..MAX_ISOLATIONS {
        match radii(t) {
            Some((least, most)) if least < most && least <= isolation => {
                isolation = isolation.max(most);
                if most < 0.99 * t {
                    break;
                }
                t *= 2.0;
            }
            _ if t > isolation => t *= 0.25,
            _ => break,
        }
    }
    Some(Disc {
        center: z,
        radius: radius.max(f64::MIN_POSITIVE),
        isolation,
        multiplicity: 1,
    })
}
