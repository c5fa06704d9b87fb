//! The spectral abscissa where delays are exact multiples of one base.

use super::all_roots::locate;
use super::lines::{between_lines, is_beside_chains};
use crate::quasipoly::{Kind, QuasiPolynomial};
use crate::roots::chains::chain_abscissa;
use crate::roots::counting::{Walker, cell_right_of, exact_chain_abscissa};
use crate::{Error, Task};

/// Lines between the chains of exact delays and those of free ones, as shares of the distance,
/// tried in this order.
const LINES: [f64; 7] = [0.5, 0.2, 0.05, 0.02, 5e-3, 1e-3, 1e-4];

/// The largest real part of a root, or of the chains if that is larger, for delays taken as exact
/// multiples of their base, when no root is known right of C_D. `None` where there is no base.
///
/// # Errors
/// Those of counting and locating roots; [`Error::TooMuch`] where no line next to the chains can be
/// counted.
pub(crate) fn exact_abscissa(h: &QuasiPolynomial, task: &Task) -> Result<Option<f64>, Error> {
    let Some(chain) = exact_chain_abscissa(h, task)? else {
        return Ok(None);
    };
    if h.kind() == Kind::Difference {
        return Ok(Some(chain));
    }
    let distance = chain_abscissa(h) - chain;
    let delays = h.delays();
    let span = delays.last().unwrap_or(&0.0) - delays.first().unwrap_or(&0.0);
    // No root lies right of this line.
    let mut clear = chain + distance;
    for share in LINES {
        let sigma = chain + share * distance;
        let mut walker = Walker::new(h, task);
        match cell_right_of(&mut walker, sigma, task) {
            Ok(Some(cell)) if cell.count > 0 => {
                let discs = locate(&mut walker, cell)?;
                let right = discs
                    .iter()
                    .map(|disc| disc.center.re)
                    .fold(chain, f64::max);
                return Ok(Some(right));
            }
            Ok(Some(_)) => clear = sigma,
            // A root lies on the line. It lies right of the next one.
            Err(Error::Contour { .. }) => {}
            // Too close to the chains to count.
            Ok(None) | Err(Error::TooMuch { .. }) => break,
            Err(error) => return Err(error),
        }
    }
    if is_beside_chains(clear, chain, distance.max(1.0 / span)) {
        Ok(Some(chain))
    } else {
        Err(between_lines(clear, chain))
    }
}
