//! The roots that decide stability: the rightmost ones, with a proved count of the half plane
//! that holds them.
//!
//! A line Re s = σ is sought with at least the wanted number of roots to its right, but not many
//! more (`lines`). If the known discs add up to the count of a line, all roots to its right are
//! known; otherwise the half plane is searched cell by cell. Right of the chains of a neutral
//! equation there may be fewer roots than wanted, or none at all. The chains are then the rightmost
//! part of the spectrum, and the set holds the roots there are. The statement that there is none
//! needs a line next to the chains; if only a line further right could be counted, the result is an
//! error.

use super::all_roots::add_zeros;
use super::exact_abscissa::exact_abscissa;
use super::lines::{Line, Lines, Spectrum, between_lines, half_plane_discs, is_beside_chains};
use crate::order::sort_down;
use crate::quasipoly::{Kind, QuasiPolynomial};
use crate::roots::chains::chain_abscissa;
use crate::roots::counting::{Prepared, TimeScaling, Walker, count_right_of, half_plane};
use crate::roots::disc::{Disc, with_mirror_image};
use crate::roots::region::Region;
use crate::roots::root_set::RootSet;
use crate::{Error, Task};

/// Upper limit on the roots that can be requested.
const MAX_WANTED: usize = 10_000;

/// The `n` rightmost roots, not counting those with Im < 0, together with their mirror images.
///
/// More than `n` where the real parts of the next ones cannot be told apart, fewer where there are
/// no more roots or no more right of the chains of a neutral equation. `region` is the half plane
/// in which the roots listed are all there are.
///
/// # Errors
/// [`Error::Argument`] for n = 0, the zero function or an advanced equation;
/// [`Error::CountMismatch`] where double precision does not tell the roots apart;
/// [`Error::TooMuch`]; [`Error::Interrupted`].
///
/// ```
/// use deadtime::{Task, quasipoly::QuasiPolynomial, roots::rightmost};
/// let h = QuasiPolynomial::new(vec![vec![0.0, 1.0], vec![2.0, 0.3]], vec![0.0, 0.36])?;
/// let set = rightmost(&h, 1, &Task::new())?;
/// assert!((set.roots[0].re + 3.316_780_322_147_385).abs() <= set.radii[0]);
/// # Ok::<(), deadtime::Error>(())
/// ```
pub fn rightmost(h: &QuasiPolynomial, n: usize, task: &Task) -> Result<RootSet, Error> {
    refuse_if!(
        n == 0 || n > MAX_WANTED,
        "n={n}: give a number of roots from 1 to {MAX_WANTED}"
    );
    refuse_if!(
        h.kind() == Kind::Advanced,
        "an advanced equation has roots arbitrarily far to the right, so no root is the \
         rightmost. The term with the highest power of s must not have a longer delay than others"
    );
    match TimeScaling::of(h) {
        None => search(&Prepared::new(h)?, n, None, task),
        Some(scaling) => search(&Prepared::new(&scaling.h)?, n, None, task)
            .map(|set| scaling.returned(set, None))
            .map_err(|error| scaling.explained(error)),
    }
}

/// The number of roots right of the imaginary axis and the rightmost root, with one pass along the
/// axis for both.
///
/// The first is that of [`count_right_of`] at 0, the second that of
/// [`rightmost`] for one root.
///
/// # Errors
/// As for these two. The pair holds one result each, because one may be known where the other is
/// not.
pub fn unstable_and_rightmost(
    h: &QuasiPolynomial,
    task: &Task,
) -> (Result<u64, Error>, Result<RootSet, Error>) {
    let prepared = match Prepared::new(h) {
        Ok(prepared)
            if prepared.zeros == 0
                && h.kind() != Kind::Advanced
                && TimeScaling::of(h).is_none() =>
        {
            prepared
        }
        _ => return (count_right_of(h, 0.0, task), rightmost(h, 1, task)),
    };
    let mut walker = Walker::new(&prepared.rest, task);
    match half_plane(&mut walker, 0.0) {
        Ok(count) => {
            let line = Line {
                sigma: 0.0,
                count,
                hints: walker.hints,
            };
            (Ok(count), search(&prepared, 1, Some(line), task))
        }
        Err(error) if error.ends_all() => (Err(error.clone()), Err(error)),
        Err(error) => (Err(error), search(&prepared, 1, None, task)),
    }
}

/// [`rightmost`] for equations that are not advanced. `axis` is what is already known of the right
/// half plane.
fn search(
    prepared: &Prepared,
    n: usize,
    axis: Option<Line>,
    task: &Task,
) -> Result<RootSet, Error> {
    let Prepared { rest: h, zeros, .. } = prepared;
    let zeros = *zeros;
    let chain = chain_abscissa(h);
    let listed = |mut discs: Vec<Disc>, sigma: f64| {
        add_zeros(&mut discs, if sigma < 0.0 { zeros } else { 0 });
        discs
    };
    match h.kind() {
        Kind::Polynomial => {
            let everywhere = f64::NEG_INFINITY;
            let discs = half_plane_discs(h, everywhere, task)?;
            return Ok(first(listed(discs, everywhere), n, everywhere));
        }
        // Right of its chains a difference equation has no roots.
        Kind::Difference => return Ok(first(listed(Vec::new(), chain), n, chain)),
        Kind::Retarded | Kind::Neutral | Kind::Advanced => {}
    }
    leading(h, n, axis, chain, task, listed)
}

/// The `n` rightmost roots right of the chains. `listed` completes the list of discs right of a
/// line.
pub(crate) fn leading<S: Spectrum>(
    spectrum: &S,
    n: usize,
    axis: Option<Line>,
    chain: f64,
    task: &Task,
    listed: impl Fn(Vec<Disc>, f64) -> Vec<Disc>,
) -> Result<RootSet, Error> {
    let mut lines = Lines::new(spectrum, chain, task);
    if let Some(line) = axis {
        lines.sort_in(line, n as u64);
    }
    let mut wanted = n as u64;
    loop {
        let (line, last) = lines.find(wanted)?;
        let (discs, sigma) = match lines.discs_right_of(&line, n) {
            Ok(discs) => discs,
            // A cluster reaches across the line.
            Err(Error::Contour { distance, .. }) if lines.evade(&line, distance) => continue,
            Err(error) => return Err(error),
        };
        let discs = listed(discs, sigma);
        if discs.len() >= n || last {
            // Right of its chains a neutral equation may have no root; a retarded one always has
            // roots.
            return if !discs.is_empty() || is_beside_chains(sigma, chain, lines.step_of_delays()) {
                Ok(first(discs, n, sigma))
            } else if chain == f64::NEG_INFINITY {
                Err(beyond_reach())
            } else {
                Err(between_lines(sigma, chain))
            };
        }
        // A pair counts twice in the half plane and once in the list.
        wanted = line.count + n as u64 - discs.len() as u64;
    }
}

/// The largest real part of a root, or the abscissa of the chains if that is larger.
///
/// Roots between the chains and a line right beside them (the `region` of [`rightmost`]) are not
/// distinguished from the chains. Where no line that close could be counted and no root was found,
/// the result is an error. With `strong` the chains are those that arbitrarily small changes of the
/// delays can bring about; without, delays with a common base are taken as exact.
///
/// # Errors
/// As [`rightmost`]; [`Error::Argument`] where there is no root.
pub fn spectral_abscissa(h: &QuasiPolynomial, strong: bool, task: &Task) -> Result<f64, Error> {
    let set = rightmost(h, 1, task)?;
    let isolated = set.roots.first().map_or(f64::NEG_INFINITY, |root| root.re);
    abscissa_with(h, isolated, strong, task)
}

/// [`spectral_abscissa`], the real part of the rightmost root being known: −∞ where none was found.
///
/// # Errors
/// As [`spectral_abscissa`].
pub(crate) fn abscissa_with(
    h: &QuasiPolynomial,
    isolated: f64,
    strong: bool,
    task: &Task,
) -> Result<f64, Error> {
    let chain = chain_abscissa(h);
    if !strong && isolated < chain {
        let Prepared { rest, zeros, .. } = Prepared::new(h)?;
        if let Some(abscissa) = exact_abscissa(&rest, task)? {
            return Ok(if zeros > 0 {
                abscissa.max(0.0)
            } else {
                abscissa
            });
        }
    }
    let abscissa = isolated.max(chain);
    if abscissa == f64::NEG_INFINITY {
        return Err(if h.degree() == 0 && h.delays().len() < 2 {
            Error::argument("the function is constant, so it has no roots and no spectral abscissa")
        } else {
            beyond_reach()
        });
    }
    Ok(abscissa)
}

/// The error for a rightmost root that exists but was not found.
fn beyond_reach() -> Error {
    Error::argument(
        "the rightmost root was not found, because the sizes of the coefficients differ too much \
         for double precision. Leave out time constants close to zero, or choose another unit of \
         time",
    )
}

/// The first `n` of all discs right of `sigma`, and more where the next ones cannot be ordered
/// after them.
pub(crate) fn first(mut discs: Vec<Disc>, n: usize, sigma: f64) -> RootSet {
    sort_down(&mut discs, |disc| disc.center.re);
    let left = |disc: &Disc| disc.center.re - disc.radius;
    let right = |disc: &Disc| disc.center.re + disc.radius;
    let mut edge = f64::INFINITY;
    let mut listed = 0;
    for disc in &discs {
        if listed >= n && right(disc) < edge {
            break;
        }
        edge = edge.min(left(disc));
        listed += 1;
    }
    let next = discs.iter().skip(listed).map(right).fold(sigma, f64::max);
    let line = if listed < discs.len() {
        0.5 * (edge + next)
    } else {
        sigma
    };
    discs.truncate(listed);
    RootSet::new(
        discs.into_iter().flat_map(with_mirror_image).collect(),
        Region::right_of(line),
    )
}
