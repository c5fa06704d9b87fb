//! Stability: is every root proved to lie left of the imaginary axis?
//!
//! Where the undelayed leading coefficient outweighs the delayed ones, a count of the right half
//! plane decides. A neutral equation for which it does not is not strongly stable. With delays
//! taken as exact it may still be stable if these are whole multiples of one base: the difference
//! part D is then periodic along Re s = 0. If D does not wind about 0 over a period, it has no
//! zeros right of the line, and |1/D| takes its maximum on the line (maximum principle), where
//! samples and a Lipschitz constant bound it. |D| ≥ δ in the half plane gives a radius beyond
//! which δ |s|ⁿ exceeds all lower powers: no root there, and a rectangle remains to be counted.

use std::f64::consts::PI;

use num_complex::Complex64;

use super::bounds::{cauchy_radius, dominance, right_edge};
use super::cell::Cell;
use super::count::{Prepared, half_plane};
use super::neutral::chain_abscissa;
use super::winding::Walker;
use crate::quasipoly::{Kind, QuasiPolynomial, modulus};
use crate::{Error, Task};

/// Ratios of delays are looked for among fractions with denominators up to this.
const MAX_DENOMINATOR: u32 = 64;

/// Most samples of a period.
const MAX_SAMPLES: u32 = 1 << 20;

/// Is every root proved to lie left of the imaginary axis?
///
/// With `strong`, also under arbitrarily small changes of the delays; without, delays that are
/// whole multiples of a common one, to rounding, are taken as exactly that. `false` also where a
/// root lies on the axis or too close to it to tell, and for an advanced equation.
///
/// # Errors
/// [`Error::Argument`] for the zero function; [`Error::TooMuch`]; [`Error::Interrupted`].
///
/// ```
/// use deadtime::{Task, quasipoly::QuasiPolynomial, roots::is_stable};
/// let h = QuasiPolynomial::new(vec![vec![0.0, 1.0], vec![4.0]], vec![0.0, 0.36])?;
/// assert!(is_stable(&h, true, &Task::new())?);
/// # Ok::<(), deadtime::Error>(())
/// ```
pub fn is_stable(h: &QuasiPolynomial, strong: bool, task: &Task) -> Result<bool, Error> {
    let Prepared { rest: h, zeros, .. } = Prepared::new(h)?;
    if zeros > 0 || h.kind() == Kind::Advanced || strong && chain_abscissa(&h) >= 0.0 {
        return Ok(false);
    }
    let mut walker = Walker::new(&h, task);
    let number = if dominance(&h, (0.0, f64::INFINITY)).is_some() {
        half_plane(&mut walker, 0.0)
    } else {
        let Some(height) = height_by_period(&h, task)? else {
            return Ok(false);
        };
        // A little beyond, so that the edge itself is clear; at least something to walk along.
        let height = 1.01 * height.max(1e-100);
        let re = (0.0, right_edge(&h, height));
        Cell::new(&mut walker, re, (0.0, height), true).map(|cell| cell.count)
    };
    match number {
        Ok(number) => Ok(number == 0),
        Err(Error::Contour { .. }) => Ok(false),
        Err(error) => Err(error),
    }
}

/// Above this modulus there is no root with Re s ≥ 0; `None` where the difference part has zeros
/// there, or delays without a common base.
fn height_by_period(h: &QuasiPolynomial, task: &Task) -> Result<Option<f64>, Error> {
    let degree = h.degree();
    let chain = h
        .terms()
        .filter_map(|(row, delay)| row.get(degree).map(|c| (vec![*c], delay)));
    let (rows, delays): (Vec<Vec<f64>>, Vec<f64>) = chain.unzip();
    let first = delays.first().copied().unwrap_or(0.0);
    let delays: Vec<f64> = delays.iter().map(|delay| delay - first).collect();
    let Some(base) = common_base(&delays) else {
        return Ok(None);
    };
    let lipschitz: f64 = rows
        .iter()
        .flatten()
        .zip(&delays)
        .map(|(c, d)| c.abs() * d)
        .sum();
    let difference = QuasiPolynomial::new(rows, delays)?;
    // D(s̄) is the conjugate of D(s): half a period is enough, its ends are real.
    let half = PI / base;
    let mut walker = Walker::new(&difference, task);
    match walker.walk(Complex64::ZERO, Complex64::new(0.0, half)) {
        Ok(turn) if turn.angle.abs() + turn.slack < 0.5 * PI => {}
        Ok(_) | Err(Error::Contour { .. }) => return Ok(None),
        Err(error) => return Err(error),
    }
    let mut samples = 256;
    while samples <= MAX_SAMPLES {
        task.check()?;
        let step = half / f64::from(samples);
        walker.probe.refer_to(0);
        let least = (0..samples)
            .map(|k| {
                let jet = walker
                    .probe
                    .jet(Complex64::new(0.0, (f64::from(k) + 0.5) * step));
                modulus(jet.value) - jet.value_error
            })
            .fold(f64::INFINITY, f64::min);
        let bound = least - 0.51 * step * lipschitz;
        if bound > 0.5 * least {
            let mut lower = vec![0.0; degree];
            for row in h.coefficients() {
                for (sum, c) in lower.iter_mut().zip(row) {
                    *sum += c.abs();
                }
            }
            let radius = cauchy_radius(bound, &lower);
            return Ok(radius.is_finite().then_some(radius));
        }
        samples *= 4;
    }
    Ok(None)
}

/// The largest number of which all `delays`, the first of them 0, are whole multiples to
/// rounding.
fn common_base(delays: &[f64]) -> Option<f64> {
    let least = delays.get(1).copied()?;
    (1..=MAX_DENOMINATOR)
        .map(|q| least / f64::from(q))
        .find(|base| {
            delays.iter().all(|delay| {
                let multiple = delay / base;
                (multiple - multiple.round()).abs() <= 8.0 * f64::EPSILON * multiple
            })
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stable(rows: &[&[f64]], delays: &[f64], strong: bool) -> Result<bool, Error> {
        let rows = rows.iter().map(|r| r.to_vec()).collect();
        is_stable(
            &QuasiPolynomial::new(rows, delays.to_vec())?,
            strong,
            &Task::new(),
        )
    }

    #[test]
    fn exact_delays_can_be_stable_where_perturbed_ones_are_not() {
        // Michiels and Niculescu: D = 1 − 0.75 z + 0.5 z² has |z| = √2, but 0.75 + 0.5 > 1.
        let rows: &[&[f64]] = &[&[-0.25, 1.0], &[1.0 / 3.0, -0.75], &[0.0, 0.5]];
        assert_eq!(stable(rows, &[0.0, 1.0, 2.0], true), Ok(false));
        assert_eq!(stable(rows, &[0.0, 1.0, 2.0], false), Ok(true));
        assert_eq!(stable(rows, &[1.0, 2.0, 3.0], false), Ok(true));
        assert_eq!(stable(rows, &[0.0, 1.0, 2.05], false), Ok(false));
        assert_eq!(stable(rows, &[0.0, 1.0, 2f64.sqrt()], false), Ok(false));
    }

    #[test]
    fn difference_equations() {
        assert_eq!(
            stable(&[&[1.0], &[-0.75], &[0.5]], &[0.0, 1.0, 2.0], false),
            Ok(true)
        );
        assert_eq!(
            stable(&[&[1.0], &[-0.75], &[0.5]], &[0.0, 1.0, 2.0], true),
            Ok(false)
        );
        assert_eq!(
            stable(&[&[1.0], &[-1.75], &[0.5]], &[0.0, 1.0, 2.0], false),
            Ok(false)
        );
        assert_eq!(stable(&[&[1.0], &[1.0]], &[0.0, 1.0], false), Ok(false));
    }

    #[test]
    fn bases_of_delays() {
        assert_eq!(common_base(&[0.0, 0.3, 0.9]), Some(0.3));
        assert!(common_base(&[0.0, 1.0, 2.05]).is_some_and(|b| (b - 0.05).abs() < 1e-15));
        assert_eq!(common_base(&[0.0, 1.0, 2f64.sqrt()]), None);
    }
}
