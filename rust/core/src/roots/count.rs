//! Proved numbers of roots in rectangles and half planes.
//!
//! Half planes: with R such that one leading term a sⁿ e^(−sτ) exceeds all others together where
//! Re s ≥ σ and |s| ≥ R, no root lies beyond R, and along the arc |s| = R arg h follows that of
//! the leading term, up to the principal argument of their quotient. Only the chord Re s = σ is
//! walked, and of that, coefficients being real, only the upper half: in long steps where the row
//! of the leading term dominates (`dominated`).

use std::f64::consts::PI;

use num_complex::Complex64;

use super::bounds::{self, Bound, Dominance};
use super::cell::Cell;
use super::dominated::descend;
use super::neutral::chain_abscissa;
use super::real::survey_real;
use super::region::Region;
use super::unit::OwnTime;
use super::winding::{Turn, Walker, is_clear};
use crate::elementary::angle;
use crate::quasipoly::{Jet, Kind, QuasiPolynomial, modulus};
use crate::{Error, Task};

/// Evaluations spent on the real axis before the roots themselves are asked for.
const SURVEY_LIMIT: u64 = 10_000;

/// Radii tried for the arc that closes a half plane, each eight times the one before.
const FURTHER: u32 = 5;

/// Coefficients are not scaled down to less than two to this power.
const LOWEST_EXPONENT: i32 = -1000;

/// A function made ready: h(s) = factor · sᵏ · `rest`(s) with k = `zeros`.
///
/// Common powers of s are exact roots at 0 and are taken out. Coefficients are scaled by a power
/// of two, to a largest one between 1 and 2 unless that would make the smallest one underflow.
/// Neither changes a root.
#[derive(Debug, Clone)]
pub(super) struct Prepared {
    pub(super) rest: QuasiPolynomial,
    pub(super) zeros: u32,
    /// The power of two in the factor: `rest` = 2^`scale` h/sᵏ.
    pub(super) scale: i32,
}

impl Prepared {
    /// # Errors
    /// [`Error::Argument`] for the zero function.
    pub(super) fn new(h: &QuasiPolynomial) -> Result<Self, Error> {
        let sizes = || {
            h.coefficients()
                .iter()
                .flatten()
                .map(|c| c.abs())
                .filter(|c| *c > 0.0)
        };
        let (smallest, largest) = sizes().fold((f64::INFINITY, 0.0f64), |(low, high), c| {
            (low.min(c), high.max(c))
        });
        if largest == 0.0 {
            return Err(Error::argument(
                "the zero function: every s is a root, there is nothing to count",
            ));
        }
        // Exponents and powers of two are exact.
        let shift = (-libm::ilogb(largest)).max((LOWEST_EXPONENT - libm::ilogb(smallest)).min(0));
        // In two steps: 2^1074 itself overflows.
        let half = shift / 2;
        let (first, second) = (libm::ldexp(1.0, half), libm::ldexp(1.0, shift - half));
        let lowest = |row: &Vec<f64>| row.iter().take_while(|c| **c == 0.0).count();
        let common = h.coefficients().iter().map(lowest).min().unwrap_or(0);
        let rows = h
            .coefficients()
            .iter()
            .map(|row| {
                row.iter()
                    .skip(common)
                    .map(|c| c * first * second)
                    .collect()
            })
            .collect();
        Ok(Self {
            rest: QuasiPolynomial::new(rows, h.delays().to_vec())?,
            zeros: u32::try_from(common).unwrap_or(u32::MAX),
            scale: shift,
        })
    }

    /// Exact roots at 0 in the region.
    ///
    /// # Errors
    /// [`Error::Contour`] where 0 lies on an edge other than one on the real axis.
    pub(super) fn zeros_in(&self, region: &Region) -> Result<u32, Error> {
        let Region { re, im } = *region;
        if self.zeros == 0 || re.0 > 0.0 || re.1 < 0.0 || im.0 > 0.0 || im.1 < 0.0 {
            return Ok(0);
        }
        if re.0 == 0.0 || re.1 == 0.0 {
            return Err(Error::Contour {
                place: Complex64::ZERO,
                distance: f64::MIN_POSITIVE,
            });
        }
        Ok(self.zeros)
    }
}

/// A region with its open sides closed by proved bounds, in the upper half plane as far as
/// symmetry allows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Closed {
    pub(super) re: (f64, f64),
    /// Height of the part that is symmetric about the real axis, if any.
    pub(super) symmetric: Option<f64>,
    /// Imaginary parts of what lies above it, if anything.
    pub(super) above: Option<(f64, f64)>,
    /// Is the lower edge the real axis? Roots below it do not belong to the region then.
    pub(super) half: bool,
    /// Was the region mirrored at the real axis to bring it here?
    pub(super) mirrored: bool,
}

impl Closed {
    /// The ranges in parts; `None` when they are empty.
    pub(super) fn of(re: (f64, f64), im: (f64, f64), mirrored: bool) -> Option<Self> {
        if re.0 >= re.1 || im.0 >= im.1 {
            return None;
        }
        let symmetric = (im.0 <= 0.0).then_some(if im.0 == 0.0 { im.1 } else { -im.0 });
        let above = match symmetric {
            None => Some(im),
            Some(height) => (height < im.1).then_some((height, im.1)),
        };
        Some(Self {
            re,
            symmetric,
            above,
            half: im.0 == 0.0,
            mirrored,
        })
    }
}

/// `region`, mirrored where it lies more below the real axis than above, with its open sides
/// closed; it may turn out empty.
///
/// # Errors
/// [`Error::Argument`] for a region that cannot be shown to hold finitely many roots.
pub(super) fn closed_sides(
    h: &QuasiPolynomial,
    region: &Region,
    bound: Bound,
) -> Result<Region, Error> {
    let Region { mut re, mut im } = if is_low(region) {
        region.mirrored()
    } else {
        *region
    };
    if im.0.is_infinite() || im.1.is_infinite() {
        let radius = bound(h, re)
            .map(|d| d.radius)
            .ok_or_else(|| endless(h, re))?;
        // A little beyond, so that the edge itself is clear.
        let radius = 1.01 * radius.max(1e-100);
        im = (im.0.max(-radius), im.1.min(radius));
        re = (re.0.max(-radius), re.1.min(radius));
    }
    let height = im.0.abs().max(im.1.abs());
    if re.1.is_infinite() || region.re.1.is_infinite() {
        // Mostly closer than the radius, which chains far up may make large.
        re.1 = re.1.min(bounds::right_edge(h, height));
    }
    if re.0.is_infinite() {
        re.0 = bounds::left_edge(h, height);
    }
    if !(re.0.is_finite() && re.1.is_finite()) {
        return Err(Error::argument(
            "no bound for the roots within the open side was found in double precision: close \
             the region",
        ));
    }
    Ok(Region { re, im })
}

/// Does the region lie more below the real axis than above it?
fn is_low(region: &Region) -> bool {
    region.im.1 + region.im.0 < 0.0
}

/// Close the open sides of `region`; `None` when it is empty of roots for sure.
///
/// # Errors
/// As [`closed_sides`].
pub(super) fn close(
    h: &QuasiPolynomial,
    region: &Region,
    bound: Bound,
) -> Result<Option<Closed>, Error> {
    let Region { re, im } = closed_sides(h, region, bound)?;
    Ok(Closed::of(re, im, is_low(region)))
}

/// Of `count` roots in a symmetric region, `real` of them real, those not below the axis: the
/// others come in pairs.
pub(super) fn upper_half(count: u64, real: u64) -> u64 {
    real + count.saturating_sub(real) / 2
}

fn endless(h: &QuasiPolynomial, re: (f64, f64)) -> Error {
    let reason = match h.kind() {
        Kind::Polynomial => "its coefficients span more than double precision holds".to_owned(),
        Kind::Retarded if re.0 >= 0.0 => {
            "its coefficients span more than double precision holds".to_owned()
        }
        Kind::Retarded => format!(
            "the real part is open to the left or reaches far left ({})",
            re.0
        ),
        Kind::Neutral | Kind::Difference => {
            format!(
                "a chain of roots lies at or left of Re s = {:.6}",
                chain_abscissa(h)
            )
        }
        Kind::Advanced => "the equation is advanced".to_owned(),
    };
    Error::argument(format!(
        "the region re=({}, {}) with an open imaginary part holds infinitely many roots, or cannot \
         be shown to hold finitely many: {reason}; give both ends of im, or move re",
        re.0, re.1
    ))
}

/// The number of roots in a region, counted with their multiplicity.
///
/// Open sides are closed by proved bounds. Roots on the real axis belong to a region whose lower
/// (or upper) edge it is.
///
/// # Errors
/// [`Error::Argument`] for the zero function, a bad region, or one that holds infinitely many
/// roots; [`Error::Contour`] where a root lies on the edge or too close to it to tell the side;
/// [`Error::TooMuch`]; [`Error::Interrupted`].
///
/// ```
/// use deadtime::{Task, quasipoly::QuasiPolynomial, roots::{Region, count}};
/// let h = QuasiPolynomial::new(vec![vec![0.0, 1.0], vec![1.0]], vec![0.0, 1.0])?;
/// let region = Region::new((-12.0, 2.0), (0.0, 1000.0))?;
/// assert_eq!(count(&h, &region, &Task::new())?, 159);
/// # Ok::<(), deadtime::Error>(())
/// ```
pub fn count(h: &QuasiPolynomial, region: &Region, task: &Task) -> Result<u64, Error> {
    match OwnTime::within(h, region) {
        None => count_as_given(h, region, task),
        Some(own) => {
            count_as_given(&own.h, &own.region(region), task).map_err(|error| own.explained(error))
        }
    }
}

fn count_as_given(h: &QuasiPolynomial, region: &Region, task: &Task) -> Result<u64, Error> {
    if region.re.1 == f64::INFINITY
        && region.im == Region::right_of(0.0).im
        && region.re.0.is_finite()
    {
        return count_right_of_as_given(h, region.re.0, task);
    }
    let prepared = Prepared::new(h)?;
    let h = &prepared.rest;
    region.check()?;
    let mut total = u64::from(prepared.zeros_in(region)?);
    let Some(closed) = close(h, region, bounds::dominance)? else {
        return Ok(total);
    };
    let mut walker = Walker::new(h, task);
    if let Some(height) = closed.symmetric {
        let cell = Cell::new(&mut walker, closed.re, (0.0, height), true)?;
        total += if closed.half {
            let real = survey_real(&mut walker, closed.re, (0.5, SURVEY_LIMIT), |_| ())?;
            upper_half(cell.count, real)
        } else {
            cell.count
        };
    }
    if let Some(im) = closed.above {
        total += Cell::new(&mut walker, closed.re, im, false)?.count;
    }
    Ok(total)
}

/// The number of roots right of the line Re s = `sigma`.
///
/// # Errors
/// As [`count`]; [`Error::Argument`] also where the line does not lie right of the chains of a
/// neutral equation.
///
/// ```
/// use deadtime::{Task, quasipoly::QuasiPolynomial, roots::count_right_of};
/// let h = QuasiPolynomial::new(vec![vec![0.0, 1.0], vec![5.0]], vec![0.0, 0.36])?;
/// assert_eq!(count_right_of(&h, 0.0, &Task::new())?, 2);
/// # Ok::<(), deadtime::Error>(())
/// ```
pub fn count_right_of(h: &QuasiPolynomial, sigma: f64, task: &Task) -> Result<u64, Error> {
    match OwnTime::within(h, &Region::right_of(sigma)) {
        None => count_right_of_as_given(h, sigma, task),
        Some(own) => count_right_of_as_given(&own.h, own.scaled(sigma), task)
            .map_err(|error| own.explained(error)),
    }
}

fn count_right_of_as_given(h: &QuasiPolynomial, sigma: f64, task: &Task) -> Result<u64, Error> {
    let region = Region::right_of(sigma);
    region.check()?;
    let prepared = Prepared::new(h)?;
    let zeros = u64::from(prepared.zeros_in(&region)?);
    Ok(zeros + half_plane(&mut Walker::new(&prepared.rest, task), sigma)?)
}

/// [`count_right_of`] for a finite `sigma` with a walker that is already there; its hints are
/// those of the chord.
pub(super) fn half_plane(walker: &mut Walker<'_>, sigma: f64) -> Result<u64, Error> {
    let h = walker.probe.function();
    let re = (sigma, f64::INFINITY);
    let Dominance { row, radius } = bounds::dominance(h, re).ok_or_else(|| endless(h, re))?;
    let degree = h.degree();
    let radius = radius * (1.0 + 1e-9);
    if sigma.abs() > radius {
        return Ok(if sigma > 0.0 { 0 } else { degree as u64 });
    }
    // All roots are at 0: any radius will do.
    let radius = if radius == 0.0 { 1.0 } else { radius };
    // Just beyond the circle.
    let height = |radius: f64| {
        ((radius - sigma) * (radius + sigma)).sqrt() * (1.0 + 1e-9) + f64::MIN_POSITIVE
    };
    walker.probe.refer_to(row);
    // The further out, the smaller the terms of which nothing but the size is known there.
    let tried =
        (0..FURTHER).map(|k| Complex64::new(sigma, height(radius * f64::from(1u32 << (3 * k)))));
    let mut jets = tried.map(|end| (end, walker.jet(end)));
    // The error of its angle counts twice.
    let sure = |jet: &Jet| is_clear(jet) && modulus(jet.value) > 32.0 * jet.value_error;
    let Some((end, jet)) = jets.find(|(_, jet)| sure(jet)) else {
        return Err(super::winding::overflow(Complex64::new(
            sigma,
            height(radius),
        )));
    };
    let top = end.im;
    let direction = (end / modulus(end)).powu(u32::try_from(degree).unwrap_or(u32::MAX));
    let leading = h
        .coefficients()
        .get(row)
        .and_then(|row| row.last())
        .copied()
        .unwrap_or(1.0);
    let quotient = direction.conj() * jet.value * leading.signum();
    let arc = Turn {
        angle: degree as f64 * angle(top, sigma) + angle(quotient.im, quotient.re)
            - walker.probe.delay() * top,
        // A power of n factors loses 3.3 n u, n angles 8 n u, each of the three summands and the
        // sums u: 36 u for each leaves room.
        slack: 1.58 * jet.value_error / modulus(jet.value)
            + 4e-15 * (1.0 + degree as f64 + walker.probe.delay() * top),
    };
    let (place, skipped) = descend(walker, row, end);
    let chord = walker.walk(place, Complex64::new(sigma, 0.0))?;
    arc.then(skipped)
        .then(chord)
        .revolutions(PI)
        .ok_or(Error::Contour {
            place: Complex64::new(sigma, 0.0),
            distance: 1e-3 * radius,
        })
}
