//! Counts, roots, rightmost roots and stability of det M for one block.

use num_complex::Complex64;

use super::leading::{Found, from_guesses};
use super::local_enclosure::check_regular;
use super::outer::Leading;
use super::prepared::{EVALUATIONS_BESIDE_CLUSTERS, EVALUATIONS_PER_LINE, LEAST_RADIUS, Prepared};
use super::starts::starts;
use super::system::Irreducible;
use super::walker::{MAX_EVALUATIONS, MOST_WITH_CLUSTERS, MatrixWalker};
use crate::quasipoly::{QuasiPolynomial, modulus};
use crate::roots::counting::{Cell, Closed, EDGE_MARGIN};
use crate::roots::locating::{
    Seek, Spectrum, all_discs, balances, first, half_plane_discs, is_none, leading, leads_right,
    rightmost_first,
};
use crate::roots::region::Region;
use crate::roots::root_set::RootSet;
use crate::{Error, Task};

/// Upper limit on the roots that can be requested.
const MAX_WANTED: usize = 1000;

/// Half of the largest square whose roots are said to be too close together, in units of the distance
/// from 0 and the rate of the system. Larger: roots apart from one another are blamed; smaller:
/// clusters are not named.
const CLOSE_TOGETHER: f64 = 0.3;

/// Factorisations along the axis before a root right of it is searched for.
const AT_A_GLANCE: u64 = 2_000;

/// The region in the upper half plane, as far as symmetry allows, with its open sides closed.
///
/// # Errors
/// [`Error::Argument`] where an open side cannot be closed, or the determinant is zero.
fn close(system: &Irreducible, region: &Region, task: &Task) -> Result<Option<Closed>, Error> {
    region.check()?;
    check_regular(system)?;
    let mirrored = region.im.1 + region.im.0 < 0.0;
    let Region { mut re, mut im } = if mirrored { region.mirrored() } else { *region };
    let open = [re.0, re.1, im.0, im.1].iter().any(|x| x.is_infinite());
    if open {
        refuse_if!(
            re.0.is_infinite() && system.longest() > 0.0,
            "the region is open to the left, where delays make infinitely many roots: close the \
             region"
        );
        let least = LEAST_RADIUS * system.rate();
        let radius = EDGE_MARGIN * Leading::new(system)?.radius(re.0, task)?.max(least);
        re = (re.0.max(-radius), re.1.min(radius));
        im = (im.0.max(-radius), im.1.min(radius));
    }
    Ok(Closed::of(re, im, mirrored))
}

/// The number of roots of det M in a region, with multiplicity.
///
/// Open sides are closed by norms, which needs an invertible E. If the lower or upper edge of the
/// region is the real axis, roots on that axis belong to the region.
///
/// # Errors
/// [`Error::Argument`] for a bad region, one that cannot be shown to hold finitely many roots, or a
/// determinant that is zero everywhere; [`Error::Contour`] where a root lies on the edge, or so
/// close to it that its side cannot be decided; [`Error::TooMuch`]; [`Error::Interrupted`].
pub(super) fn count(system: &Irreducible, region: &Region, task: &Task) -> Result<u64, Error> {
    let Some(closed) = close(system, region, task)? else {
        return Ok(0);
    };
    if closed.half {
        // The discs tell which roots are real.
        return Ok(roots(system, region, task)?.counted);
    }
    counted(&closed, MatrixWalker::new(system, task, MAX_EVALUATIONS))
}

/// The number of roots in a closed region.
fn counted(closed: &Closed, mut walker: MatrixWalker<'_>) -> Result<u64, Error> {
    let mut total = 0;
    if let Some(height) = closed.symmetric {
        total += Cell::new(&mut walker, closed.re, (0.0, height), true)?.count;
    }
    if let Some(im) = closed.above {
        total += Cell::new(&mut walker, closed.re, im, false)?.count;
    }
    Ok(total)
}

/// Every root of det M in a region, each in a disc proved to hold its multiplicity.
///
/// # Errors
/// As [`count`]; [`Error::CountMismatch`] where double precision does not suffice to locate what
/// was counted.
pub(super) fn roots(system: &Irreducible, region: &Region, task: &Task) -> Result<RootSet, Error> {
    let discs = match close(system, region, task)? {
        Some(closed) => {
            let mut walker = MatrixWalker::new(system, task, MAX_EVALUATIONS);
            all_discs(&mut walker, &closed).map_err(|error| {
                // Lines take the shortest steps, and are given up, next to such roots.
                let last = || walker.balanced.as_ref().map(|scaling| scaling.place);
                let place = walker.stalled.first().copied().or_else(last);
                explained(system, place, error, task)
            })?
        }
        None => Vec::new(),
    };
    Ok(RootSet::new(discs, *region))
}

/// The `n` rightmost roots, not counting those with Im < 0, together with their mirror images.
///
/// As [`rightmost`](crate::roots::rightmost) of one function; right of the chains only.
///
/// # Errors
/// [`Error::Argument`] for n = 0 or an E that cannot be inverted; those of [`roots`].
pub(super) fn rightmost(system: &Irreducible, n: usize, task: &Task) -> Result<RootSet, Error> {
    refuse_if!(
        n == 0 || n > MAX_WANTED,
        "n={n}: for a matrix, the number of roots has to be from 1 to {MAX_WANTED}"
    );
    check_regular(system)?;
    let mut prepared = Prepared::new(system)?;
    if system.longest() == 0.0 {
        let everywhere = f64::NEG_INFINITY;
        return Ok(first(
            half_plane_discs(&prepared, everywhere, task)?,
            n,
            everywhere,
        ));
    }
    let (_, chain) = prepared.leading.difference.enclosure(task)?;
    match from_guesses(&prepared, n, chain, task)? {
        Found::Proved(set) => Ok(set),
        Found::Open(line, stalled) => {
            if stalled.is_some() {
                prepared.limit = EVALUATIONS_BESIDE_CLUSTERS;
            }
            let guess = || {
                let mut walker = prepared.walker(task, EVALUATIONS_BESIDE_CLUSTERS);
                starts(system, &mut walker).first().copied()
            };
            leading(&prepared, n, line, chain, task, |discs, _| discs)
                .map_err(|error| explained(system, stalled.or_else(guess), error, task))
        }
    }
}

/// The error of a search that has met roots too close together to be enclosed, next to `place` if
/// there are any: it says how many there are.
fn explained(system: &Irreducible, place: Option<Complex64>, error: Error, task: &Task) -> Error {
    let Some(place) = place.filter(|_| !error.ends_all()) else {
        return error;
    };
    let mut walker = MatrixWalker::new(system, task, MOST_WITH_CLUSTERS);
    match walker.cluster(place, CLOSE_TOGETHER * (modulus(place) + system.rate())) {
        Ok(Some(disc)) if disc.multiplicity > 1 => Error::CountMismatch {
            counted: disc.multiplicity.into(),
            found: Vec::new(),
            advice: format!(
                "the roots within {:.1e} of {:.6} are too close together for double precision, \
                 because rounding the matrices moves these roots as far. Use is_stable() or \
                 count(), which do not need each root",
                disc.radius, disc.center
            ),
        },
        Err(other) if other.ends_all() => other,
        _ => error,
    }
}

/// The largest real part of a root, or the upper bound of the chains if that is larger.
///
/// # Errors
/// As [`rightmost`]; [`Error::Argument`] where no root was found.
pub(super) fn spectral_abscissa(system: &Irreducible, task: &Task) -> Result<f64, Error> {
    let set = rightmost(system, 1, task)?;
    let isolated = set.roots.first().map_or(f64::NEG_INFINITY, |root| root.re);
    let abscissa = isolated.max(chain_abscissa(system, task)?.1);
    refuse_if!(
        abscissa == f64::NEG_INFINITY,
        "the rightmost root was not found, because the sizes of the coefficients differ too much \
         for double precision. Choose another unit of time"
    );
    Ok(abscissa)
}

/// Lower and upper bound of C_D in 1/s, the supremum of the real parts of chains when the delays
/// may vary. Both are −∞ without delayed derivatives.
///
/// With more than four delayed derivatives the upper bound is that of their norms.
///
/// # Errors
/// [`Error::Argument`] for an E that cannot be inverted; [`Error::Interrupted`].
pub(super) fn chain_abscissa(system: &Irreducible, task: &Task) -> Result<(f64, f64), Error> {
    if !system.is_neutral() {
        return Ok((f64::NEG_INFINITY, f64::NEG_INFINITY));
    }
    Leading::new(system)?.difference.enclosure(task)
}

/// Can the inverse of E be verified? Half planes and chains need it.
pub(super) fn is_invertible(system: &Irreducible) -> bool {
    Leading::new(system).is_ok()
}

/// Is every root proved to lie left of the imaginary axis, and stay there when delays change by
/// arbitrarily little? The answer is also `false` where a root lies on the axis or too close to it
/// to decide.
///
/// # Errors
/// [`Error::Argument`] for an E that cannot be inverted; [`Error::TooMuch`];
/// [`Error::Interrupted`].
pub(super) fn is_stable(system: &Irreducible, task: &Task) -> Result<bool, Error> {
    if chain_abscissa(system, task)?.1 >= 0.0 {
        return Ok(false);
    }
    let mut glance = MatrixWalker::new(system, task, AT_A_GLANCE);
    let cell = close(system, &Region::right_of(0.0), task).and_then(|closed| {
        let upper = closed.and_then(|closed| Some((closed.re, closed.symmetric?)));
        upper
            .map(|(re, height)| Cell::new(&mut glance, re, (0.0, height), true))
            .transpose()
    });
    let number = match cell {
        Ok(cell) => Ok(cell.map_or(0, |cell| cell.count)),
        Err(error @ (Error::Contour { .. } | Error::Interrupted)) => Err(error),
        Err(_) => {
            let mut starts = rightmost_first(glance.hints);
            starts.extend(balances(&by_norms(system)?));
            let mut walker = MatrixWalker::new(system, task, MOST_WITH_CLUSTERS);
            match leads_right(&mut walker, &starts) {
                Ok(true) => return Ok(false),
                Err(error) if error.ends_all() => return Err(error),
                _ => {}
            }
            if system.is_neutral() {
                // A line beside chains takes many steps wherever it lies.
                return is_none(count(system, &Region::right_of(0.0), task));
            }
            // Next to a cluster a line takes very short steps; discs of all its roots do without.
            match rightmost(system, 1, task) {
                Ok(set) => return Ok(is_left(&set)),
                Err(error) if error.ends_all() => return Err(error),
                Err(error @ Error::CountMismatch { .. }) => return Err(error),
                Err(_) => close(system, &Region::right_of(0.0), task)?.map_or(Ok(0), |closed| {
                    counted(
                        &closed,
                        MatrixWalker::new(system, task, EVALUATIONS_PER_LINE),
                    )
                }),
            }
        }
    };
    is_none(number)
}

/// Does the set show that no root lies right of the axis, or on it?
fn is_left(set: &RootSet) -> bool {
    let mut discs = set.roots.iter().zip(&set.radii);
    set.region.re.0 <= 0.0 && discs.all(|(root, radius)| root.re + radius < 0.0)
}

/// A function whose coefficients are the norms of the matrices. Its roots have about the size of
/// those of det M.
fn by_norms(system: &Irreducible) -> Result<QuasiPolynomial, Error> {
    let norm = |matrix: &[Vec<f64>]| {
        let sums = matrix.iter().map(|row| row.iter().map(|x| x.abs()).sum());
        sums.fold(0.0, f64::max)
    };
    let rows = (0..system.delays().len()).map(|delay| {
        let (slopes, values) = system.dense(delay);
        vec![norm(&values), norm(&slopes)]
    });
    QuasiPolynomial::new(rows.collect(), system.delays().to_vec())
}
