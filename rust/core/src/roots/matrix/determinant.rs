//! Counts, roots, rightmost roots and stability of det M.

use super::leading::{Found, from_guesses};
use super::local_enclosure::check_regular;
use super::outer::Leading;
use super::prepared::{LEAST_RADIUS, Prepared};
use super::system::CharacteristicMatrix;
use super::walker::{MAX_EVALUATIONS, MatrixWalker};
use crate::quasipoly::QuasiPolynomial;
use crate::roots::counting::{Cell, Closed, EDGE_MARGIN};
use crate::roots::locating::{
    all_discs, balances, first, half_plane_discs, is_none, leading, leads_right, rightmost_first,
};
use crate::roots::region::Region;
use crate::roots::root_set::RootSet;
use crate::{Error, Task};

/// Upper limit on the roots that can be requested.
const MAX_WANTED: usize = 1000;

/// Factorisations along the axis before a root right of it is searched for.
const AT_A_GLANCE: u64 = 2_000;

/// The region in the upper half plane, as far as symmetry allows, with its open sides closed.
///
/// # Errors
/// [`Error::Argument`] where an open side cannot be closed, or the determinant is zero.
fn close(
    system: &CharacteristicMatrix,
    region: &Region,
    task: &Task,
) -> Result<Option<Closed>, Error> {
    region.check()?;
    check_regular(system)?;
    let mirrored = region.im.1 + region.im.0 < 0.0;
    let Region { mut re, mut im } = if mirrored { region.mirrored() } else { *region };
    let open = [re.0, re.1, im.0, im.1].iter().any(|x| x.is_infinite());
    if open {
        refuse_if!(
            re.0.is_infinite() && system.longest() > 0.0,
            "the real part is open to the left: close it, far enough left delays make \
             infinitely many roots"
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
///
/// ```
/// use deadtime::{Task, roots::{Region, matrix::{CharacteristicMatrix, count}}};
/// let unit = vec![vec![1.0, 0.0], vec![0.0, 1.0]];
/// let late = vec![(1.0, vec![vec![-1.0, 0.0], vec![0.0, -1.0]])];
/// let system = CharacteristicMatrix::new(unit, vec![], late)?;
/// let region = Region::new((-12.0, 2.0), (0.0, 100.0))?;
/// assert_eq!(count(&system, &region, &Task::new())?, 2 * 16);
/// # Ok::<(), deadtime::Error>(())
/// ```
pub fn count(system: &CharacteristicMatrix, region: &Region, task: &Task) -> Result<u64, Error> {
    let Some(closed) = close(system, region, task)? else {
        return Ok(0);
    };
    if closed.half {
        // The discs tell which roots are real.
        return Ok(roots(system, region, task)?.counted);
    }
    let mut walker = MatrixWalker::new(system, task, MAX_EVALUATIONS);
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
///
/// ```
/// use deadtime::{Task, roots::{Region, matrix::{CharacteristicMatrix, roots}}};
/// let system = CharacteristicMatrix::new(
///     vec![vec![1.0]], vec![], vec![(1.0, vec![vec![-1.0]])],
/// )?;
/// let set = roots(&system, &Region::new((-3.0, 2.0), (0.0, 20.0))?, &Task::new())?;
/// assert_eq!(set.counted, 3);
/// assert!((set.roots[0].re + 0.318_131_505_204_764_1).abs() <= set.radii[0]);
/// # Ok::<(), deadtime::Error>(())
/// ```
pub fn roots(
    system: &CharacteristicMatrix,
    region: &Region,
    task: &Task,
) -> Result<RootSet, Error> {
    let discs = match close(system, region, task)? {
        Some(closed) => all_discs(
            &mut MatrixWalker::new(system, task, MAX_EVALUATIONS),
            &closed,
        )?,
        None => Vec::new(),
    };
    Ok(RootSet::new(discs, *region))
}

/// The number of roots of det M right of the line Re s = `sigma`.
///
/// # Errors
/// As [`count`].
pub fn count_right_of(
    system: &CharacteristicMatrix,
    sigma: f64,
    task: &Task,
) -> Result<u64, Error> {
    count(system, &Region::right_of(sigma), task)
}

/// The `n` rightmost roots, not counting those with Im < 0, together with their mirror images.
///
/// As [`rightmost`](crate::roots::rightmost) of one function; right of the chains only.
///
/// # Errors
/// [`Error::Argument`] for n = 0 or an E that cannot be inverted; those of [`roots`].
pub fn rightmost(system: &CharacteristicMatrix, n: usize, task: &Task) -> Result<RootSet, Error> {
    refuse_if!(
        n == 0 || n > MAX_WANTED,
        "n={n}: ask for at least 1 and at most {MAX_WANTED} rightmost roots of a matrix"
    );
    check_regular(system)?;
    let prepared = Prepared::new(system)?;
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
        Found::Open(line) => leading(&prepared, n, line, chain, task, |discs, _| discs),
    }
}

/// [`rightmost`] for a system with delays but without delayed derivatives, as far as guesses lead
/// to simple roots other than 0 and one line proves that these are the rightmost: `None` where they
/// do not, and another form of the determinant may do better.
///
/// # Errors
/// [`Error::Interrupted`].
pub fn rightmost_from_guesses(
    system: &CharacteristicMatrix,
    n: usize,
    task: &Task,
) -> Result<Option<RootSet>, Error> {
    if n == 0 || n > MAX_WANTED || system.longest() == 0.0 || system.is_neutral() {
        return Ok(None);
    }
    let Ok(prepared) = Prepared::new(system) else {
        return Ok(None);
    };
    let Found::Proved(set) = from_guesses(&prepared, n, f64::NEG_INFINITY, task)? else {
        return Ok(None);
    };
    let mut discs = set.roots.iter().zip(&set.radii);
    let apart = discs.all(|(root, radius)| root.norm() > *radius);
    Ok((apart && set.roots.len() >= n).then_some(set))
}

/// The largest real part of a root, or the upper bound of the chains if that is larger.
///
/// # Errors
/// As [`rightmost`]; [`Error::Argument`] where no root was found.
pub fn spectral_abscissa(system: &CharacteristicMatrix, task: &Task) -> Result<f64, Error> {
    let set = rightmost(system, 1, task)?;
    let isolated = set.roots.first().map_or(f64::NEG_INFINITY, |root| root.re);
    let abscissa = isolated.max(chain_abscissa(system, task)?.1);
    refuse_if!(
        abscissa == f64::NEG_INFINITY,
        "no line that could be counted has a root to its right: the numbers of this system \
         differ too much in size for double precision; choose another unit of time"
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
///
/// ```
/// use deadtime::{Task, roots::matrix::{CharacteristicMatrix, chain_abscissa}};
/// let one = || vec![vec![1.0]];
/// let system = CharacteristicMatrix::new(one(), vec![(0.36, vec![vec![0.3]])], vec![(0.0, one())])?;
/// let (low, high) = chain_abscissa(&system, &Task::new())?;
/// let exact = 0.3f64.ln() / 0.36;
/// assert!(low <= exact && exact <= high && high - low < 1e-6);
/// # Ok::<(), deadtime::Error>(())
/// ```
pub fn chain_abscissa(system: &CharacteristicMatrix, task: &Task) -> Result<(f64, f64), Error> {
    if !system.is_neutral() {
        return Ok((f64::NEG_INFINITY, f64::NEG_INFINITY));
    }
    Leading::new(system)?.difference.enclosure(task)
}

/// Can the inverse of E be verified? Half planes and chains need it.
pub fn is_invertible(system: &CharacteristicMatrix) -> bool {
    Leading::new(system).is_ok()
}

/// Is every root proved to lie left of the imaginary axis, and stay there when delays change by
/// arbitrarily little? The answer is also `false` where a root lies on the axis or too close to it
/// to decide.
///
/// # Errors
/// [`Error::Argument`] for an E that cannot be inverted; [`Error::TooMuch`];
/// [`Error::Interrupted`].
pub fn is_stable(system: &CharacteristicMatrix, task: &Task) -> Result<bool, Error> {
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
            let mut walker = MatrixWalker::new(system, task, MAX_EVALUATIONS);
            if leads_right(&mut walker, &starts)? {
                return Ok(false);
            }
            count_right_of(system, 0.0, task)
        }
    };
    is_none(number)
}

/// A function whose coefficients are the norms of the matrices. Its roots have about the size of
/// those of det M.
fn by_norms(system: &CharacteristicMatrix) -> Result<QuasiPolynomial, Error> {
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
