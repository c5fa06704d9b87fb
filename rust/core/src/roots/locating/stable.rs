//! Stability: is every root proved to lie left of the imaginary axis?
//!
//! Where the undelayed leading coefficient outweighs the delayed ones, a count of the right half
//! plane decides. Where the count takes long or fails, one root proved to lie right of the axis
//! decides as well (`unstable`). A neutral equation whose undelayed leading coefficient does not
//! outweigh the delayed ones is not strongly stable. With delays taken as exact it may still be
//! stable if these are whole multiples of one base (`counting::exact_delays`).

use super::unstable::has_unstable_root;
use crate::quasipoly::{Kind, QuasiPolynomial};
use crate::roots::chains::chain_abscissa;
use crate::roots::counting::{Prepared, Walker, cell_right_of, dominance, half_plane};
use crate::{Error, Task};

/// Evaluations along the axis before a root right of it is searched for.
const AT_A_GLANCE: u64 = 5_000;

/// Is every root proved to lie left of the imaginary axis?
///
/// With `strong`, also under arbitrarily small changes of the delays; without, delays that are
/// whole multiples of a common one, to rounding, are taken as exactly that. The answer is also
/// `false` where a root lies on the axis or too close to it to decide, and for an advanced
/// equation.
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
    let dominated = dominance(&h, (0.0, f64::INFINITY)).is_some();
    let mut glance = Walker::with_limit(&h, task, AT_A_GLANCE);
    let at_first = if dominated {
        half_plane(&mut glance, 0.0).map(Some)
    } else {
        Ok(None)
    };
    match at_first {
        Ok(Some(number)) => return Ok(number == 0),
        Err(Error::Contour { .. }) => return Ok(false),
        Err(error) if error.ends_all() => return Err(error),
        Ok(None) | Err(_) => {}
    }
    if has_unstable_root(&h, glance.hints, task)? {
        return Ok(false);
    }
    let mut walker = Walker::new(&h, task);
    let number = if dominated {
        half_plane(&mut walker, 0.0)
    } else {
        match cell_right_of(&mut walker, 0.0, task) {
            Ok(None) => return Ok(false),
            Ok(Some(cell)) => Ok(cell.count),
            Err(error) => Err(error),
        }
    };
    is_none(number)
}

/// Does the closed right half plane hold none of the roots counted in it? One on its edge is one.
pub(crate) fn is_none(number: Result<u64, Error>) -> Result<bool, Error> {
    match number {
        Ok(number) => Ok(number == 0),
        Err(Error::Contour { .. }) => Ok(false),
        Err(error) => Err(error),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quasipoly::make;

    fn stable(rows: &[&[f64]], delays: &[f64], strong: bool) -> Result<bool, Error> {
        is_stable(&make(rows, delays), strong, &Task::new())
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
        let of =
            |middle: f64, strong| stable(&[&[1.0], &[middle], &[0.5]], &[0.0, 1.0, 2.0], strong);
        assert_eq!(of(-0.75, false), Ok(true));
        assert_eq!(of(-0.75, true), Ok(false));
        assert_eq!(of(-1.75, false), Ok(false));
        assert_eq!(stable(&[&[1.0], &[1.0]], &[0.0, 1.0], false), Ok(false));
    }
}
