//! Proved numbers of roots in rectangles and half planes.
//!
//! Half planes: with R such that one leading term a sⁿ e^(−sτ) exceeds all others together where Re
//! s ≥ σ and |s| ≥ R, no root lies beyond R, and along the arc |s| = R arg h follows that of the
//! leading term, up to the principal argument of their quotient. arg h is followed along the chord
//! Re s = σ only, and only along its upper half because the coefficients are real. Where the row of
//! the leading term dominates, the steps are long (`dominated`).

use std::f64::consts::PI;

use num_complex::Complex64;

use super::bounds;
use super::bounds::Dominance;
use super::cell::Cell;
use super::closed_region::{close, endless};
use super::dominated::descend;
use super::prepared::Prepared;
use super::real_axis::survey_real;
use super::time_scaling::TimeScaling;
use super::turn::Turn;
use super::winding::{Walker, angle_error, is_clear};
use crate::elementary::angle;
use crate::quasipoly::{Jet, QuasiPolynomial, modulus};
use crate::roots::region::Region;
use crate::{Error, Task};

/// Upper limit on the evaluations on the real axis. Near a multiple real root the survey does not
/// end; the error then makes the caller locate the roots instead.
const SURVEY_LIMIT: u64 = 10_000;

/// Number of radii tried for the arc that closes a half plane, each eight times the one before. At
/// a larger radius the smaller terms have less influence.
const FURTHER: u32 = 5;

/// Factor on a radius or height that covers its rounding error.
const ENLARGED: f64 = 1.0 + 1e-9;

/// Least value at the end of the arc relative to its error, whose effect on the argument counts
/// twice.
const CLEAR_FACTOR: f64 = 32.0;

/// Error of the change along the arc, for each degree and for each radian of delay times height.
const ARC_ERROR: f64 = 4e-15;

/// Distance stated in the error where the count is not decided, as a share of the radius.
const UNDECIDED_SHARE: f64 = 1e-3;

/// The number of roots that are not below the real axis, of `count` roots in a symmetric region of
/// which `real` are real. The others form conjugate pairs.
pub(crate) fn upper_half(count: u64, real: u64) -> u64 {
    real + count.saturating_sub(real) / 2
}

/// The number of roots in a region, counted with their multiplicity.
///
/// Open sides are closed by proved bounds. If the lower or upper edge of the region is the real
/// axis, roots on that axis belong to the region.
///
/// # Errors
/// [`Error::Argument`] for the zero function, a bad region, or one that holds infinitely many
/// roots; [`Error::Contour`] where a root lies on the edge, or so close to it that its side cannot
/// be decided; [`Error::TooMuch`]; [`Error::Interrupted`].
///
/// ```
/// use deadtime::{Task, quasipoly::QuasiPolynomial, roots::{Region, count}};
/// let h = QuasiPolynomial::new(vec![vec![0.0, 1.0], vec![1.0]], vec![0.0, 1.0])?;
/// let region = Region::new((-12.0, 2.0), (0.0, 1000.0))?;
/// assert_eq!(count(&h, &region, &Task::new())?, 159);
/// # Ok::<(), deadtime::Error>(())
/// ```
pub fn count(h: &QuasiPolynomial, region: &Region, task: &Task) -> Result<u64, Error> {
    match TimeScaling::within(h, region) {
        None => count_as_given(h, region, task),
        Some(scaling) => count_as_given(&scaling.h, &scaling.region(region), task)
            .map_err(|error| scaling.explained(error)),
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
    match TimeScaling::within(h, &Region::right_of(sigma)) {
        None => count_right_of_as_given(h, sigma, task),
        Some(scaling) => count_right_of_as_given(&scaling.h, scaling.scaled(sigma), task)
            .map_err(|error| scaling.explained(error)),
    }
}

fn count_right_of_as_given(h: &QuasiPolynomial, sigma: f64, task: &Task) -> Result<u64, Error> {
    let region = Region::right_of(sigma);
    region.check()?;
    let prepared = Prepared::new(h)?;
    let zeros = u64::from(prepared.zeros_in(&region)?);
    Ok(zeros + half_plane(&mut Walker::new(&prepared.rest, task), sigma)?)
}

/// [`count_right_of`] for a finite `sigma` with an existing walker, whose hints are then those of
/// the chord.
pub(crate) fn half_plane(walker: &mut Walker<'_>, sigma: f64) -> Result<u64, Error> {
    let h = walker.probe.function();
    let re = (sigma, f64::INFINITY);
    let Dominance { row, radius } = bounds::dominance(h, re).ok_or_else(|| endless(h, re))?;
    let degree = h.degree();
    let radius = radius * ENLARGED;
    if sigma.abs() > radius {
        return Ok(if sigma > 0.0 { 0 } else { degree as u64 });
    }
    // All roots are at 0: any positive radius will do.
    let radius = if radius == 0.0 { 1.0 } else { radius };
    // Slightly outside the circle.
    let height =
        |radius: f64| ((radius - sigma) * (radius + sigma)).sqrt() * ENLARGED + f64::MIN_POSITIVE;
    walker.probe.refer_to(row);
    // At a larger radius the terms that are bounded only by their moduli are smaller.
    let tried =
        (0..FURTHER).map(|k| Complex64::new(sigma, height(radius * f64::from(1u32 << (3 * k)))));
    let mut jets = tried.map(|end| (end, walker.jet(end)));
    // The error of its argument enters twice.
    let sure = |jet: &Jet| is_clear(jet) && modulus(jet.value) > CLEAR_FACTOR * jet.value_error;
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
        // A power with n factors has the error 3.3 n u, n angles 8 n u, each of the three summands
        // and the sums u. The bound allows 36 u for each.
        slack: angle_error(jet.value_error, modulus(jet.value))
            + ARC_ERROR * (1.0 + degree as f64 + walker.probe.delay() * top),
    };
    let (place, skipped) = descend(walker, row, end);
    let chord = walker.walk(place, Complex64::new(sigma, 0.0))?;
    arc.then(skipped)
        .then(chord)
        .revolutions(PI)
        .ok_or(Error::contour(
            Complex64::new(sigma, 0.0),
            UNDECIDED_SHARE * radius,
        ))
}
