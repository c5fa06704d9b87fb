//! Proved counts together with everything that an independent checker needs.
//!
//! A contour is divided into segments. For each, g = h e^(s τ_c) is enclosed at the middle m,
//! |g(m) − v| ≤ e, and its slope in the disc about m that reaches to both ends: |g′| ≤ D. Where
//! e + D r < |v|, r the radius of the disc, g stays in a disc that does not contain 0 along the
//! segment. A checker that confirms e and D for every segment knows the change of arg g from middle
//! to middle, which is less than half a turn each time, and with −τ_c Im s the change of arg h: the
//! winding number. D is |g′(m)| + e′ + B r with B the bound of `curvature_around` on |g″|, plus a
//! small share of |v|/r, so that a checker with a limited number of digits can confirm D where g is
//! almost constant. Next to several roots D is the bound of `taylor_bound`.
//!
//! The segments are longer or shorter than the steps of `winding`, which proves the same number
//! from both ends of each step; that number stands in the certificate.

use num_complex::Complex64;

use super::bounds;
use super::bounds::Dominance;
use super::cell::Cell;
use super::closed_region::{close, closed_sides};
use super::count::upper_half;
use super::prepared::Prepared;
use super::real_axis::{RealPart, survey_real};
use super::segment::{CLUSTER_SUSPECTED, Segment, TRIFLE};
use super::taylor_bound::TaylorBound;
use super::winding::{Walker, is_clear};
use crate::quasipoly::{QuasiPolynomial, modulus};
use crate::roots::region::Region;
use crate::{Error, Task};

/// Largest share of |v| that the error and the slope together may take. A larger share gives longer
/// segments and leaves less margin for the checker's rounding errors.
const SHARE: f64 = 0.95;

/// Covers the rounding of the sum that bounds the slope.
const MARGIN: f64 = 1e-12;

/// Upper limit on the number of segments (bounds the size of the certificate).
const MAX_SEGMENTS: usize = 1_000_000;

/// Length of the next segment tried, in lengths over which g is proved to stay away from 0; it
/// shrinks to a quarter at most and grows by half at most.
const STRETCH: f64 = 1.9;

/// The closed path around a rectangle, anticlockwise.
#[derive(Debug, Clone, PartialEq)]
pub struct Contour {
    /// Real parts.
    pub re: (f64, f64),
    /// Imaginary parts.
    pub im: (f64, f64),
    /// Is this the upper half of a rectangle symmetric about the real axis? The path then leaves
    /// out the axis, and `count` is that of the whole.
    pub symmetric: bool,
    /// Roots inside.
    pub count: u64,
    /// In order, each beginning where the one before ends.
    pub segments: Vec<Segment>,
}

/// A count and its proof.
///
/// Values are those of 2^`scale` h(s)/s^`zeros`. A region that lies more below the real axis than
/// above it is mirrored first.
#[derive(Debug, Clone, PartialEq)]
pub struct Certificate {
    /// Where roots were counted.
    pub region: Region,
    /// How many.
    pub count: u64,
    /// The power of two that h is multiplied by.
    pub scale: i32,
    /// The common power of s, which stands for exact roots at 0.
    pub zeros: u32,
    /// Row and radius: where |s| is at least the radius, in the strip of the region, the leading
    /// term of the row exceeds all the others together. Given where the imaginary part is open.
    pub beyond: Option<(usize, f64)>,
    /// The (mirrored) region with its open sides closed; a range that does not increase is empty.
    pub closed: Region,
    /// Paths around its parts.
    pub contours: Vec<Contour>,
    /// The real axis where it is an edge: its parts in order, each without roots or with a monotone
    /// g.
    pub real: Vec<RealPart>,
}

/// [`count`](crate::roots::count), with the proof.
///
/// # Errors
/// As [`count`](crate::roots::count).
///
/// ```
/// use deadtime::{Task, quasipoly::QuasiPolynomial, roots::{Region, certify}};
/// let h = QuasiPolynomial::new(vec![vec![0.0, 1.0], vec![1.0]], vec![0.0, 1.0])?;
/// let proof = certify(&h, &Region::new((-12.0, 2.0), (0.0, 1000.0))?, &Task::new())?;
/// assert_eq!(proof.count, 159);
/// for segment in &proof.contours[0].segments {
///     let r = (segment.end - segment.start).norm() / 2.0;
///     assert!(segment.error + segment.slope * r < segment.value.norm());
/// }
/// # Ok::<(), deadtime::Error>(())
/// ```
pub fn certify(h: &QuasiPolynomial, region: &Region, task: &Task) -> Result<Certificate, Error> {
    let prepared = Prepared::new(h)?;
    let h = &prepared.rest;
    region.check()?;
    let zeros_inside = u64::from(prepared.zeros_in(region)?);
    let open = region.im.0.is_infinite() || region.im.1.is_infinite();
    let beyond = bounds::plain_dominance(h, region.re).filter(|_| open);
    let mut certificate = Certificate {
        region: *region,
        count: zeros_inside,
        scale: prepared.scale,
        zeros: prepared.zeros,
        beyond: beyond.map(|Dominance { row, radius }| (row, radius)),
        closed: closed_sides(h, region, bounds::plain_dominance)?,
        contours: Vec::new(),
        real: Vec::new(),
    };
    let Some(closed) = close(h, region, bounds::plain_dominance)? else {
        return Ok(certificate);
    };
    let mut walker = Walker::new(h, task);
    let lower = closed.symmetric.map(|height| ((0.0, height), true));
    let upper = closed.above.map(|im| (im, false));
    for (im, symmetric) in [lower, upper].into_iter().flatten() {
        let count = Cell::new(&mut walker, closed.re, im, symmetric)?.count;
        certificate.count += if symmetric && closed.half {
            let keep = |part| certificate.real.push(part);
            let real = survey_real(&mut walker, closed.re, (1.0, u64::MAX), keep)?;
            upper_half(count, real)
        } else {
            count
        };
        certificate.contours.push(Contour {
            re: closed.re,
            im,
            symmetric,
            count,
            segments: path(&mut walker, closed.re, im, symmetric)?,
        });
    }
    Ok(certificate)
}

/// Segments around a rectangle.
fn path(
    walker: &mut Walker<'_>,
    re: (f64, f64),
    im: (f64, f64),
    symmetric: bool,
) -> Result<Vec<Segment>, Error> {
    let corner = Complex64::new;
    let mut segments = Vec::new();
    let mut here = corner(re.1, im.0);
    if !symmetric {
        line(walker, corner(re.0, im.0), here, &mut segments)?;
    }
    for next in [corner(re.1, im.1), corner(re.0, im.1), corner(re.0, im.0)] {
        line(walker, here, next, &mut segments)?;
        here = next;
    }
    Ok(segments)
}

/// Segments along a line parallel to an axis.
fn line(
    walker: &mut Walker<'_>,
    from: Complex64,
    to: Complex64,
    segments: &mut Vec<Segment>,
) -> Result<(), Error> {
    let length = |a: Complex64, b: Complex64| (b - a).re.abs() + (b - a).im.abs();
    let along = (to - from) / length(from, to);
    walker.probe.refer_to_dominant(from);
    let mut here = from;
    let mut span = f64::INFINITY;
    while here != to {
        walker.pause()?;
        if segments.len() >= MAX_SEGMENTS {
            return Err(Error::TooMuch {
                what: "the certificate",
                limit: MAX_SEGMENTS as u64,
                unit: "segments",
                advice: "certify a smaller region".into(),
            });
        }
        let rest = length(here, to);
        let end = if span < rest { here + along * span } else { to };
        if end == here {
            return Err(walker.blocked(here));
        }
        let middle = here + 0.5 * (end - here);
        let radius = length(here, middle).max(length(middle, end));
        match segment(walker, here, middle, end, radius) {
            Ok(segment) => {
                segments.push(segment);
                here = end;
                span = 4.0 * radius;
            }
            Err(reach) => span = (STRETCH * reach).max(0.25 * radius).min(1.5 * radius),
        }
    }
    Ok(())
}

/// The segment with these ends if it can be proved. Otherwise the length over which g is proved to
/// stay away from 0.
fn segment(
    walker: &mut Walker<'_>,
    start: Complex64,
    middle: Complex64,
    end: Complex64,
    radius: f64,
) -> Result<Segment, f64> {
    let mut jet = walker.jet(middle);
    if let Some(larger) = jet.overtaken_by {
        walker.probe.refer_to(larger);
        jet = walker.jet(middle);
    }
    let bend = walker
        .probe
        .curvature_around(modulus(middle) + radius, radius);
    let flat = modulus(jet.slope) + jet.slope_error;
    let trifle = TRIFLE * modulus(jet.value) / radius;
    let margin = SHARE * modulus(jet.value) - jet.value_error;
    let mut slope = (flat + bend * radius) * (1.0 + MARGIN) + trifle;
    let mut reach = 2.0 * margin / (flat + (flat * flat + 4.0 * bend * margin).sqrt());
    let clear = is_clear(&jet);
    if clear && slope * radius >= margin && reach < CLUSTER_SUSPECTED * margin / flat {
        let taylor = TaylorBound::new(&walker.probe, middle);
        slope = taylor.slope(radius) + trifle;
        reach = reach.max(taylor.steady_reach(SHARE, radius));
    }
    if clear && slope * radius < margin {
        return Ok(Segment {
            start,
            end,
            middle,
            reference: walker.probe.reference(),
            value: jet.value,
            error: jet.value_error,
            slope,
        });
    }
    Err(if reach.is_finite() { reach } else { 0.0 })
}
