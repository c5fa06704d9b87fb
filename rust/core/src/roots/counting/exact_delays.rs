//! Chains of roots when the delays are exact multiples of one base.
//!
//! The difference part D(s) = Σ b_j e^(−s d_j) is then periodic along vertical lines, a polynomial
//! in e^(−s base). If D does not wind about 0 over a period of Re s = σ, it has no zeros right of
//! the line, and |1/D| takes its maximum over that half plane on the line (maximum principle),
//! where samples and a Lipschitz constant bound it. |D| ≥ δ then gives a radius beyond which δ |s|ⁿ
//! exceeds all lower powers: right of the line no root lies beyond that radius, and only the roots
//! of a rectangle have to be counted. Rationally independent delays have no such base, and delays
//! close to the given ones need not have one; `chains::abscissa` has the bound for both.

use std::f64::consts::PI;

use num_complex::Complex64;

use super::bounds::right_edge;
use super::cauchy::cauchy_radius;
use super::cell::Cell;
use super::closed_region::{EDGE_MARGIN, LEAST_RADIUS};
use super::winding::Walker;
use crate::elementary::exp_above;
use crate::quasipoly::{Kind, QuasiPolynomial, modulus};
use crate::roots::chains::{base_delay, chain_abscissa, difference_part};
use crate::{Error, Task};

/// Upper limit on the samples of a period (bounds the time).
const MAX_SAMPLES: u32 = 1 << 20;

/// Upper limit on the bisections of the interval that holds the abscissa of the chains.
const HALVINGS: u32 = 200;

/// Largest distance to a sample in steps, with the rounding error of the places.
const SAMPLE_SPACING: f64 = 0.51;

/// Samples of the first attempt; each further one has four times as many.
const FIRST_SAMPLES: u32 = 256;

/// Covers the rounding errors of weights.
const ENLARGED: f64 = 1.0 + 1e-9;

/// Covers the rounding errors of the weights in the Lipschitz constant.
const LIPSCHITZ_ENLARGED: f64 = 1.0 + 1e-12;

/// Part of the least sample that the bound has to keep. Larger: more samples, smaller radii; smaller:
/// the reverse.
const KEPT: f64 = 0.5;

/// Is the difference part, of period 2π/`base`, proved to have no zero with Re s ≥ `sigma`?
fn is_free(
    difference: &QuasiPolynomial,
    base: f64,
    sigma: f64,
    task: &Task,
) -> Result<bool, Error> {
    // D(s̄) is the conjugate of D(s): half a period is enough, its ends are real.
    let top = Complex64::new(sigma, PI / base);
    match Walker::new(difference, task).walk(Complex64::new(sigma, 0.0), top) {
        Ok(turn) => Ok(turn.angle.abs() + turn.slack < 0.5 * PI),
        Err(Error::Contour { .. }) => Ok(false),
        Err(error) => Err(error),
    }
}

/// The supremum of the real parts of the chains of a neutral or difference equation whose delays
/// are taken as exact, to rounding. `None` where the delays have no common base.
///
/// # Errors
/// [`Error::TooMuch`], [`Error::Interrupted`].
///
///
/// ```
/// use deadtime::{Task, quasipoly::QuasiPolynomial, roots::{chain_abscissa, exact_chain_abscissa}};
/// // 1 − 0.75 z + 0.5 z² has |z| = √2.
/// let h = QuasiPolynomial::new(vec![vec![1.0], vec![-0.75], vec![0.5]], vec![0.0, 1.0, 2.0])?;
/// let exact = exact_chain_abscissa(&h, &Task::new())?;
/// assert!(exact.is_some_and(|c| (c + 0.5 * 2f64.ln()).abs() < 1e-12));
/// assert!(chain_abscissa(&h) > 0.0);
/// # Ok::<(), deadtime::Error>(())
/// ```
pub fn exact_chain_abscissa(h: &QuasiPolynomial, task: &Task) -> Result<Option<f64>, Error> {
    if !matches!(h.kind(), Kind::Neutral | Kind::Difference) {
        return Ok(Some(chain_abscissa(h)));
    }
    let difference = difference_part(h)?;
    let Some(base) = base_delay(&difference) else {
        return Ok(None);
    };
    // There is no zero right of C_D. The product of all |z| is given by the outer coefficients, so
    // that at least one zero lies at or right of the mean.
    let mut high = chain_abscissa(h);
    let sizes = difference.coefficients().iter().flatten().map(|c| c.abs());
    let (first, last) = sizes.fold((None, 0.0), |(first, _), c| (first.or(Some(c)), c));
    let longest = difference.delays().last().copied().unwrap_or(base);
    let ratio = last / first.unwrap_or(1.0);
    let mut low = (crate::elementary::log(ratio) / longest).min(high);
    for _ in 0..HALVINGS {
        task.check()?;
        let middle = low + 0.5 * (high - low);
        if !(low < middle && middle < high) {
            break;
        }
        if is_free(&difference, base, middle, task)? {
            high = middle;
        } else {
            low = middle;
        }
    }
    Ok(Some(high))
}

/// No root with Re s ≥ `sigma` has a modulus above this number. `None` where the difference part
/// has zeros there or the delays have no common base.
pub(crate) fn height_by_period(
    h: &QuasiPolynomial,
    sigma: f64,
    task: &Task,
) -> Result<Option<f64>, Error> {
    let difference = difference_part(h)?;
    let Some(base) = base_delay(&difference) else {
        return Ok(None);
    };
    if !is_free(&difference, base, sigma, task)? {
        return Ok(None);
    }
    let weight = |delay: &f64| exp_above(-delay * sigma) * LIPSCHITZ_ENLARGED;
    let terms = difference.coefficients().iter().flatten();
    let lipschitz: f64 = terms
        .zip(difference.delays())
        .map(|(c, delay)| c.abs() * delay * weight(delay))
        .sum();
    let half = PI / base;
    let mut walker = Walker::new(&difference, task);
    let mut samples = FIRST_SAMPLES;
    while samples <= MAX_SAMPLES {
        task.check()?;
        let step = half / f64::from(samples);
        walker.probe.refer_to(0);
        let least = (0..samples)
            .map(|k| {
                let place = Complex64::new(sigma, (f64::from(k) + 0.5) * step);
                let jet = walker.probe.jet(place);
                modulus(jet.value) - jet.value_error
            })
            .fold(f64::INFINITY, f64::min);
        let bound = least - SAMPLE_SPACING * step * lipschitz;
        if bound > KEPT * least {
            return Ok(height(h, sigma, bound));
        }
        samples *= 4;
    }
    Ok(None)
}

/// The radius beyond which `bound` |s|ⁿ exceeds all lower powers right of Re s = `sigma`.
fn height(h: &QuasiPolynomial, sigma: f64, bound: f64) -> Option<f64> {
    let first = h.delays().first().copied().unwrap_or(0.0);
    let mut lower = vec![0.0; h.degree()];
    for (row, delay) in h.terms() {
        // Right of the line each exponential is at most that on it.
        let weight = exp_above(-(delay - first) * sigma) * ENLARGED;
        for (sum, c) in lower.iter_mut().zip(row) {
            *sum += weight * c.abs();
        }
    }
    let radius = cauchy_radius(bound, &lower);
    radius.is_finite().then_some(radius)
}

/// The rectangle in the upper half plane that holds all roots right of Re s = `sigma`, with their
/// number.
pub(crate) fn cell_right_of(
    walker: &mut Walker<'_>,
    sigma: f64,
    task: &Task,
) -> Result<Option<Cell>, Error> {
    let h = walker.probe.function();
    let Some(height) = height_by_period(h, sigma, task)? else {
        return Ok(None);
    };
    // A margin keeps roots off the edge itself; the height is positive even if all roots are at 0.
    let height = EDGE_MARGIN * height.max(LEAST_RADIUS);
    let right = right_edge(h, height).max(sigma + height);
    Cell::new(walker, (sigma, right), (0.0, height), true).map(Some)
}
