//! Crossings and counts of a loop with a hold.
//!
//! With n states and m whole samples in the delay, h(s) = a(σ) − e^(−s d) b(σ), d = (m + 1) Ts, a
//! monic of degree n and b of degree n at most: z^(m+1) h is a polynomial of degree n + m + 1 in z.
//! In z the edge of the specification, with its mirror image, is one closed curve around 0. On its
//! upper half the argument of z grows by π, that of h by some multiple of π, and by the argument
//! principle the roots within number that multiple plus m + 1: those beyond the edge are n less
//! the multiple.
//!
//! The multiple is found by adding a constant k to h: with k beyond the largest |h| on the edge it
//! is 0 and n roots violate the specification. From there to k = 0 the count changes at `crossings`
//! only. They are proved and isolated, so that a root on the edge to working precision shows as a
//! crossing whose interval holds 0.

use super::crossing::{self, Crossing, Varied};
use super::pencil::{Factor, Pencil};
use crate::quasipoly::QuasiPolynomial;
use crate::stability::cell::{Cell, UNKNOWN};
use crate::stability::hold::Hold;
use crate::stability::specification::Specification;
use crate::status::CellStatus;
use crate::{Error, Task};

/// A constant beyond every |h|.
const FAR: f64 = 1e200;

/// All crossings of the edge by A + k B with k in `range`; `None` where they do not decide.
///
/// # Errors
/// [`Error::Interrupted`] alone.
pub(crate) fn crossings(
    a: &QuasiPolynomial,
    b: &QuasiPolynomial,
    specification: Specification,
    hold: Hold,
    range: (f64, f64),
    task: &Task,
) -> Result<Option<Vec<Crossing>>, Error> {
    let mut all = Vec::new();
    for part in specification.pieces_below(hold.top()) {
        let Some(pencil) = Pencil::new(a, b, part.piece, Factor::Gain, Some(hold)) else {
            return Ok(None);
        };
        let length = part.piece.length;
        match crossing::crossings(&pencil, part.from_axis, length, Varied::Gain(range), task)? {
            Some(found) => all.extend(found.into_iter().map(|crossing| Crossing {
                jump: crossing.jump.map(|jump| jump * part.sign),
                ..crossing
            })),
            None => return Ok(None),
        }
    }
    Ok(Some(all))
}

/// The number of roots that violate the specification.
///
/// # Errors
/// [`Error::Interrupted`] alone.
pub(crate) fn count(
    h: &QuasiPolynomial,
    specification: Specification,
    hold: Hold,
    task: &Task,
) -> Result<Cell, Error> {
    let one = QuasiPolynomial::new(vec![vec![1.0]], vec![0.0])?;
    let found = crossings(h, &one, specification, hold, (-FAR, FAR), task)?;
    Ok(found.map_or(Cell::UNDECIDED, |crossings| counted(h, &crossings)))
}

/// The count of h from the crossings of h + k.
fn counted(h: &QuasiPolynomial, crossings: &[Crossing]) -> Cell {
    let cell = |unstable, status| Cell {
        unstable,
        abscissa: f64::NAN,
        status,
    };
    if crossings.iter().any(|at| at.low <= 0.0 && at.high >= 0.0) {
        return cell(UNKNOWN, CellStatus::Boundary);
    }
    let states = h.coefficients().first().map_or(0, |row| row.len() - 1) as i32;
    let jumps = |above: bool| {
        let side = crossings.iter().filter(|at| (at.gain > 0.0) == above);
        side.map(|at| at.jump).sum::<Option<i32>>()
    };
    let counts = [
        jumps(true).map(|sum| states - sum),
        jumps(false).map(|sum| states + sum),
    ];
    match counts {
        [Some(above), Some(below)] if above != below => Cell::UNDECIDED,
        [Some(number), _] | [_, Some(number)] if number >= 0 => cell(number, CellStatus::Ok),
        _ => Cell::UNDECIDED,
    }
}
