//! One cell of a stability map: is this quasi-polynomial stable, and by how much?
//!
//! The number of roots with Re s > 0 is proved by [`count_right_of`]. Chains of a neutral equation
//! decide first: right of the axis they make infinitely many roots unstable. "Right of the axis" is
//! meant as in [`chain_abscissa`], hence robustly: under arbitrarily small changes of the delays.
//! The abscissa is the larger of the rightmost root's real part and the abscissa of the chains.
//! What double precision cannot decide is reported as such.

use num_complex::Complex64;

use super::specification::Specification;
use crate::quasipoly::{Kind, QuasiPolynomial};
use crate::roots::{
    Region, chain_abscissa, count_right_of, rightmost, roots, unstable_and_rightmost,
};
use crate::status::CellStatus;
use crate::{Error, Task};

/// Count of a cell with infinitely many unstable roots.
pub const ENDLESS: i32 = -1;

/// Count of a cell where it is unknown: a root on the axis, or undecided.
pub const UNKNOWN: i32 = -2;

/// Chains closer to the line than this, in units of one over the longest delay, count as lying on
/// it: rounding errors of the coefficients move them as far.
const ON_THE_LINE: f64 = 16.0 * f64::EPSILON;

/// Result for one cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cell {
    /// Number of roots with Re s > 0, [`ENDLESS`] or [`UNKNOWN`].
    pub unstable: i32,
    /// Spectral abscissa, 1/s; NaN where it was not asked for or could not be computed.
    pub abscissa: f64,
    /// What is proved of count and abscissa.
    pub status: CellStatus,
}

impl Cell {
    /// Nothing is known.
    pub(super) const UNDECIDED: Self = Self {
        unstable: UNKNOWN,
        abscissa: f64::NAN,
        status: CellStatus::Undecided,
    };
}

/// Judge the stability of h: how many of its roots violate `specification`? With `abscissa`, also
/// the spectral abscissa.
///
/// * `Ok`: count (and abscissa) hold.
/// * `Boundary`: a root, or a chain of them, lies on the line to working precision.
/// * `Chain`: the chains lie further right than every root right of them, so the abscissa is
///   theirs. Reported only with `abscissa`.
/// * `Infinite`: infinitely many unstable roots, or an advanced equation.
/// * `Undecided`: the zero function, or the work or precision needed exceeds the limits. If only
///   the abscissa is missing, the count is still proved.
///
/// The abscissa is also NaN where it could not be computed in a cell that is not `Ok`.
///
/// # Errors
/// [`Error::Interrupted`] alone.
///
/// ```
/// use deadtime::{Task, quasipoly::QuasiPolynomial, stability::{Specification, judge}, status::CellStatus};
/// let h = QuasiPolynomial::new(vec![vec![0.0, 1.0], vec![5.0]], vec![0.0, 0.36])?;
/// let cell = judge(&h, Specification::default(), true, &Task::new())?;
/// assert_eq!((cell.unstable, cell.status), (2, CellStatus::Ok));
/// # Ok::<(), deadtime::Error>(())
/// ```
pub fn judge(
    h: &QuasiPolynomial,
    specification: Specification,
    abscissa: bool,
    task: &Task,
) -> Result<Cell, Error> {
    if h.is_zero() {
        return Ok(Cell::UNDECIDED);
    }
    if h.kind() == Kind::Advanced {
        return Ok(Cell {
            unstable: ENDLESS,
            abscissa: if abscissa { f64::INFINITY } else { f64::NAN },
            status: CellStatus::Infinite,
        });
    }
    let chain = chain_abscissa(h);
    if !abscissa {
        let (unstable, status) = match by_chain(h, chain, specification.leftmost()) {
            Some(known) => known,
            None => by_count(violating(h, specification, task))?,
        };
        return Ok(Cell {
            unstable,
            abscissa: f64::NAN,
            status,
        });
    }
    let ((unstable, status), set) = match by_chain(h, chain, specification.leftmost()) {
        Some(known) => (known, rightmost(h, 1, task)),
        None if specification == Specification::default() => {
            let (number, set) = unstable_and_rightmost(h, task);
            (by_count(number)?, set)
        }
        None => (
            by_count(violating(h, specification, task))?,
            rightmost(h, 1, task),
        ),
    };
    // −∞ where no root lies right of the chains.
    let isolated = set.map(|set| set.roots.first().map_or(f64::NEG_INFINITY, |root| root.re));
    let cell = Cell {
        unstable,
        abscissa: f64::NAN,
        status,
    };
    match isolated {
        Ok(isolated) => Ok(with_abscissa(cell, isolated, chain)),
        Err(error) if error.ends_all() => Err(error),
        Err(_) => Ok(Cell {
            status: match status {
                CellStatus::Ok => CellStatus::Undecided,
                known => known,
            },
            ..cell
        }),
    }
}

/// A cell whose count is known, with its rightmost root and its chains.
pub(super) fn with_abscissa(cell: Cell, isolated: f64, chain: f64) -> Cell {
    Cell {
        abscissa: isolated.max(chain),
        status: match cell.status {
            CellStatus::Ok if chain > isolated => CellStatus::Chain,
            known => known,
        },
        ..cell
    }
}

/// The number of violating roots: counted, or sorted one by one where the edge is not a single
/// line.
fn violating(h: &QuasiPolynomial, specification: Specification, task: &Task) -> Result<u64, Error> {
    let line = specification.leftmost();
    if specification.damping.is_none() {
        return count_right_of(h, line, task);
    }
    let set = match roots(h, &Region::right_of(line), task) {
        // A well damped root there violates nothing: use a line further left.
        Err(Error::Contour { .. }) => roots(h, &Region::right_of(1.01 * line), task)?,
        set => set?,
    };
    specification
        .violating(&set)
        .ok_or(Error::contour(Complex64::new(line, 0.0), 0.0))
}

/// Count and status where the chains alone decide.
pub(super) fn by_chain(h: &QuasiPolynomial, chain: f64, line: f64) -> Option<(i32, CellStatus)> {
    let longest = h.delays().last().zip(h.delays().first());
    let longest = longest.map_or(0.0, |(last, first)| last - first);
    // Rounding errors of the coefficients move chains as much as an error of log |b/a| = C_D d.
    let off = (chain - line) * longest;
    if off.abs() <= ON_THE_LINE * (1.0 + (line * longest).abs()) {
        return Some((UNKNOWN, CellStatus::Boundary));
    }
    (chain > line).then_some((ENDLESS, CellStatus::Infinite))
}

fn by_count(number: Result<u64, Error>) -> Result<(i32, CellStatus), Error> {
    match number {
        Ok(number) => Ok(match i32::try_from(number) {
            Ok(number) => (number, CellStatus::Ok),
            Err(_) => (UNKNOWN, CellStatus::Undecided),
        }),
        Err(error) if error.ends_all() => Err(error),
        Err(Error::Contour { .. }) => Ok((UNKNOWN, CellStatus::Boundary)),
        Err(_) => Ok((UNKNOWN, CellStatus::Undecided)),
    }
}
