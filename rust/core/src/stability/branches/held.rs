//! The rightmost root of one loop with a hold.
//!
//! Starts are the rightmost roots of the same function with s in place of σ, of which there are few
//! however long the delay is; where they do not lead to a proof, the eigenvalues of a transition
//! matrix. A root is proved to be the rightmost if the roots with discs right of a line number as
//! many as are counted there.

use num_complex::Complex64;

use super::branch::{Branches, Root, are_apart};
use super::plane::Plane;
use crate::dde::control_loop::sampled::eigenvalues;
use crate::order::sort_down;
use crate::quasipoly::{QuasiPolynomial, modulus};
use crate::roots::{self, Region};
use crate::stability::cell::Cell;
use crate::stability::crossings::count;
use crate::stability::hold::Hold;
use crate::stability::specification::Specification;
use crate::status::CellStatus;
use crate::{Error, Task};

/// Least number of samples in the delay with which the roots of a continuous loop are tried as
/// starts: with fewer the eigenvalues cost less.
const LONG: f64 = 10.0;

/// Upper limit on the side of the transition matrix (bounds the time).
const MOST_STATES: usize = 2000;

/// Distance behind the first root up to which roots of the continuous loop are starts, in units of
/// one over the delay.
const NEARBY: f64 = 1.5;

/// Upper limit on Newton's steps from a start.
const MAX_STEPS: u32 = 12;

/// Relative distance below which two roots are the same, and steps are the last ones.
const SAME: f64 = 1e-9;

/// Roots right of the line in whose widest gap it is put.
const ROOTS: usize = 4;

/// The rightmost roots.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Rightmost {
    /// The largest real part: −∞ if every z is 0, `None` where none was found.
    pub(crate) abscissa: Option<f64>,
    pub(crate) is_proved: bool,
    /// In the upper half plane, the rightmost first.
    pub(crate) roots: Vec<Complex64>,
}

/// The rightmost roots of h.
///
/// # Errors
/// [`Error::Interrupted`] alone.
pub(crate) fn rightmost(h: &QuasiPolynomial, hold: Hold, task: &Task) -> Result<Rightmost, Error> {
    let delay = h.delays().last().copied().unwrap_or(0.0);
    let samples = delay / hold.sample_time;
    if samples > LONG {
        let starts = continuous(h, delay, task)?;
        let roots = refined(h, hold, &starts);
        if let Some(abscissa) = proved(h, hold, &roots, task)? {
            return Ok(Rightmost {
                abscissa: Some(abscissa),
                is_proved: true,
                roots,
            });
        }
    }
    let Some(roots) = by_eigenvalues(h, hold, samples) else {
        return Ok(Rightmost {
            abscissa: None,
            is_proved: false,
            roots: Vec::new(),
        });
    };
    let sure = proved(h, hold, &roots, task)?;
    let first = roots.first().map_or(f64::NEG_INFINITY, |root| root.re);
    Ok(Rightmost {
        abscissa: Some(sure.unwrap_or(first)),
        is_proved: sure.is_some(),
        roots,
    })
}

/// A counted cell with the abscissa of h, proved or not.
///
/// # Errors
/// [`Error::Interrupted`] alone.
pub(crate) fn with_abscissa(
    cell: Cell,
    h: &QuasiPolynomial,
    hold: Hold,
    task: &Task,
) -> Result<Cell, Error> {
    Ok(match rightmost(h, hold, task)?.abscissa {
        Some(abscissa) => Cell { abscissa, ..cell },
        None => Cell {
            status: match cell.status {
                CellStatus::Ok => CellStatus::Undecided,
                known => known,
            },
            ..cell
        },
    })
}

/// The rightmost roots of the function with s in place of σ.
fn continuous(h: &QuasiPolynomial, delay: f64, task: &Task) -> Result<Vec<Complex64>, Error> {
    let ends = |error: &Error| error.ends_all();
    let first = match roots::rightmost(h, 1, task) {
        Ok(found) => found.roots.first().copied(),
        Err(error) if ends(&error) => return Err(error),
        Err(_) => None,
    };
    let Some(first) = first else {
        return Ok(Vec::new());
    };
    let behind = Region::right_of(first.re - NEARBY / delay);
    match roots::roots(h, &behind, task) {
        Ok(found) => Ok(found.roots),
        Err(error) if ends(&error) => Err(error),
        Err(_) => Ok(vec![first]),
    }
}

/// The roots that Newton's method finds from these starts, each once, the rightmost first.
fn refined(h: &QuasiPolynomial, hold: Hold, starts: &[Complex64]) -> Vec<Complex64> {
    let mut roots: Vec<Complex64> = Vec::with_capacity(starts.len());
    for start in starts.iter().filter(|start| start.im >= 0.0) {
        let mut s = *start;
        let mut last = f64::INFINITY;
        for _ in 0..MAX_STEPS {
            let (value, slope) = jet(h, hold, s);
            let step = value / slope;
            s -= step;
            last = modulus(step);
            if last <= SAME * modulus(s) || last.is_nan() {
                break;
            }
        }
        let within = s.im >= 0.0 && s.im <= hold.top() && last <= SAME * modulus(s);
        let known = roots
            .iter()
            .any(|root| modulus(root - s) <= SAME.sqrt() * modulus(s));
        if within && !known {
            roots.push(s);
        }
    }
    sort_down(&mut roots, |root| root.re);
    roots
}

/// h and h′.
fn jet(h: &QuasiPolynomial, hold: Hold, s: Complex64) -> (Complex64, Complex64) {
    let (sigma, z) = hold.at(s);
    let (mut value, mut slope) = (Complex64::ZERO, Complex64::ZERO);
    for (row, delay) in h.terms() {
        let (mut p, mut p1) = (Complex64::ZERO, Complex64::ZERO);
        for c in row.iter().rev() {
            p1 = p1 * sigma + p;
            p = p * sigma + c;
        }
        let turn = (-s * delay).exp();
        value += p * turn;
        slope += (p1 * z - p * delay) * turn;
    }
    (value, slope)
}

/// The poles by the eigenvalues of a transition matrix with the polynomials of h: `None` where it
/// is too large or the eigenvalues are not found.
///
/// u = (b/a) w and w the command m + 1 samples before, with the states of the controllable canonical
/// form in σ. With balancing its eigenvalues are as good as those of the loop's own matrix.
fn by_eigenvalues(h: &QuasiPolynomial, hold: Hold, samples: f64) -> Option<Vec<Complex64>> {
    let rows = h.coefficients();
    let (a, others) = rows.split_first()?;
    let empty = Vec::new();
    let b = others.first().unwrap_or(&empty);
    let states = a.len() - 1;
    let lag = samples.round().max(1.0) as usize;
    let side = states + lag;
    if side > MOST_STATES {
        return None;
    }
    let leading = a.last().copied()?;
    let mut matrix = vec![0.0; side * side];
    let oldest = side - 1;
    let direct = -b.get(states).copied().unwrap_or(0.0) / leading;
    for (i, line) in matrix.chunks_exact_mut(side).enumerate() {
        if i < states {
            line[i] += 1.0;
            if i + 1 < states {
                line[i + 1] += hold.sample_time;
            } else {
                for (entry, c) in line.iter_mut().zip(&a[..states]) {
                    *entry -= hold.sample_time * c / leading;
                }
                line[oldest] += hold.sample_time;
            }
        } else if i == states {
            for (j, entry) in line.iter_mut().take(states).enumerate() {
                let c = -b.get(j).copied().unwrap_or(0.0) / leading;
                *entry = c - direct * a[j] / leading;
            }
            line[oldest] += direct;
        } else {
            line[i - 1] = 1.0;
        }
    }
    let found = eigenvalues(matrix, states, side).ok()?;
    let mut roots: Vec<Complex64> = found
        .into_iter()
        .filter(|z| z.im >= 0.0 && *z != Complex64::ZERO)
        .map(|z| {
            let angle = if z.im == 0.0 && z.re < 0.0 {
                hold.top()
            } else {
                z.arg() / hold.sample_time
            };
            Complex64::new(z.norm().ln() / hold.sample_time, angle)
        })
        .collect();
    sort_down(&mut roots, |root| root.re);
    Some(roots)
}

/// The abscissa, if the first of these roots is proved to be the rightmost.
fn proved(
    h: &QuasiPolynomial,
    hold: Hold,
    starts: &[Complex64],
    task: &Task,
) -> Result<Option<f64>, Error> {
    let one = QuasiPolynomial::new(vec![vec![1.0]], vec![0.0])?;
    let plane = Plane::new(h, &one, Some(hold), None);
    let mut branches = Branches::none();
    branches.start(&plane, starts.iter().copied().take(ROOTS), 0.0);
    let mut roots = branches.started();
    sort_down(&mut roots, |root| root.s.re);
    let Some(first) = roots.first().map(|root| root.s.re) else {
        return Ok(None);
    };
    if !are_apart(&roots) {
        return Ok(None);
    }
    let line = line_behind(&roots, plane.pace());
    let mut weight = 0;
    for root in roots.iter().filter(|root| root.s.re + root.radius > line) {
        match root
            .weight(plane.top())
            .filter(|_| root.s.re - root.radius > line)
        {
            Some(own) => weight += own,
            None => return Ok(None),
        }
    }
    let there = count(h, Specification::left_of(line), hold, task)?;
    Ok((there.status == CellStatus::Ok && there.unstable == weight).then_some(first))
}

/// A line in the widest gap between the roots, or somewhat left of a single one.
fn line_behind(roots: &[Root], pace: f64) -> f64 {
    let gaps = roots.windows(2).filter_map(|pair| match pair {
        [right, left] => Some((right.s.re - left.s.re, 0.5 * (right.s.re + left.s.re))),
        _ => None,
    });
    let widest = gaps.max_by(|p, q| p.0.total_cmp(&q.0));
    let first = roots.first().map_or(0.0, |root| root.s.re);
    match widest {
        Some((gap, middle)) if gap > 1e-3 * pace => middle,
        _ => first - 0.1 * pace,
    }
}
