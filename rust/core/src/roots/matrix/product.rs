//! Questions about det M, answered block by block: its roots are those of all blocks.
//!
//! Discs of different blocks that meet become one disc with the roots of both.

use num_complex::Complex64;

use super::blocks::{CharacteristicMatrix, Part};
use super::determinant;
use super::system::Irreducible;
use crate::order::sort_up;
use crate::roots::chains;
use crate::roots::counting::exact_chain_abscissa;
use crate::roots::disc::Disc;
use crate::roots::locating::{self, Edge, count_with_edge, first, roots_with_edge};
use crate::roots::region::Region;
use crate::roots::root_set::RootSet;
use crate::{Error, Task};

/// Covers the rounding errors of distances between centres.
const ROUNDED: f64 = 1.0 + 1e-12;

/// The number of roots of det M in a region, with multiplicity.
///
/// Open sides are closed by norms, which needs an invertible E. If the lower or upper edge of the
/// region is the real axis, roots on that axis belong to the region. `edge` is kept where the root
/// on an edge belongs to a block of one state; otherwise that is an error.
///
/// # Errors
/// [`Error::Argument`] for a bad region, one that cannot be shown to hold finitely many roots, or a
/// determinant that is zero everywhere; [`Error::Contour`] where a root lies on the edge, or so
/// close to it that its side cannot be decided; [`Error::TooMuch`]; [`Error::Interrupted`].
///
/// ```
/// use deadtime::{Task, roots::{Edge, Region, matrix::{CharacteristicMatrix, count}}};
/// let unit = vec![vec![1.0, 0.0], vec![0.0, 1.0]];
/// let late = vec![(1.0, vec![vec![-1.0, 0.0], vec![0.0, -1.0]])];
/// let system = CharacteristicMatrix::new(unit, vec![], late)?;
/// let region = Region::new((-12.0, 2.0), (0.0, 100.0))?;
/// assert_eq!(count(&system, &region, Edge::Refused, &Task::new())?, 2 * 16);
/// # Ok::<(), deadtime::Error>(())
/// ```
pub fn count(
    system: &CharacteristicMatrix,
    region: &Region,
    edge: Edge,
    task: &Task,
) -> Result<u64, Error> {
    region.check()?;
    let mut total = 0;
    for (part, times) in system.parts() {
        let own = match part {
            Part::Scalar(h) => count_with_edge(h, region, edge, task)?,
            Part::Matrix(block) => determinant::count(block, region, task)?,
        };
        total += own * u64::from(*times);
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
/// use deadtime::{Task, roots::{Edge, Region, matrix::{CharacteristicMatrix, roots}}};
/// // x′ = −x(t − 1), twice.
/// let unit = vec![vec![1.0, 0.0], vec![0.0, 1.0]];
/// let late = vec![(1.0, vec![vec![-1.0, 0.0], vec![0.0, -1.0]])];
/// let system = CharacteristicMatrix::new(unit, vec![], late)?;
/// let region = Region::new((-3.0, 2.0), (0.0, 20.0))?;
/// let set = roots(&system, &region, Edge::Refused, &Task::new())?;
/// assert_eq!((set.counted, set.multiplicities[0]), (6, 2));
/// assert!((set.roots[0].re + 0.318_131_505_204_764_1).abs() <= set.radii[0]);
/// # Ok::<(), deadtime::Error>(())
/// ```
pub fn roots(
    system: &CharacteristicMatrix,
    region: &Region,
    edge: Edge,
    task: &Task,
) -> Result<RootSet, Error> {
    region.check()?;
    let mut discs = Vec::new();
    for (part, times) in system.parts() {
        let set = match part {
            Part::Scalar(h) => roots_with_edge(h, region, edge, task)?,
            Part::Matrix(block) => determinant::roots(block, region, task)?,
        };
        discs.extend(discs_of(&set, *times));
    }
    if system.parts().len() > 1 {
        discs = apart(discs);
    }
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
    count(system, &Region::right_of(sigma), Edge::Refused, task)
}

/// The `n` rightmost roots, not counting those with Im < 0, together with their mirror images.
///
/// As [`rightmost`](crate::roots::rightmost) of one function; right of the chains only.
///
/// # Errors
/// [`Error::Argument`] for n = 0 or an E that cannot be inverted; those of [`roots`].
pub fn rightmost(system: &CharacteristicMatrix, n: usize, task: &Task) -> Result<RootSet, Error> {
    let mut sigma = f64::NEG_INFINITY;
    let mut discs = Vec::new();
    let mut sets = system.parts().iter().map(|(part, times)| {
        let set = match part {
            Part::Scalar(h) => locating::rightmost(h, n, task),
            Part::Matrix(block) => determinant::rightmost(block, n, task),
        };
        set.map(|set| (set, *times))
    });
    sets.try_for_each(|found| {
        let (set, times) = found?;
        sigma = set.region.re.0.max(sigma);
        discs.extend(discs_of(&set, times));
        Ok::<_, Error>(())
    })?;
    let mut discs = apart(discs);
    // A disc on the line of another block is not listed, nor what lies left of its right end.
    for _ in 0..discs.len() {
        let on_line = |disc: &&Disc| (disc.center.re - sigma).abs() <= disc.radius;
        match discs.iter().find(on_line) {
            Some(disc) => sigma = disc.center.re + disc.radius * ROUNDED,
            None => break,
        }
    }
    discs.retain(|disc| disc.center.re - disc.radius > sigma && disc.center.im >= 0.0);
    Ok(first(discs, n, sigma))
}

/// The largest real part of a root, or the upper bound of the chains if that is larger. Without
/// `strong` the delays of blocks of one state are taken as exact.
///
/// # Errors
/// As [`rightmost`]; [`Error::Argument`] where no root was found, or where a larger block would
/// have to be judged with exact delays.
pub fn spectral_abscissa(
    system: &CharacteristicMatrix,
    strong: bool,
    task: &Task,
) -> Result<f64, Error> {
    let mut largest = f64::NEG_INFINITY;
    for (part, _) in system.parts() {
        largest = largest.max(match part {
            Part::Scalar(h) => locating::spectral_abscissa(h, strong, task)?,
            Part::Matrix(block) => {
                let found = determinant::spectral_abscissa(block, task)?;
                let chain = determinant::chain_abscissa(block, task)?.1;
                judged_exactly(strong || found > chain, found)?;
                found
            }
        });
    }
    refuse_if!(
        system.parts().is_empty(),
        "no equation has a derivative or a delay, so the system has no poles and no spectral \
         abscissa"
    );
    Ok(largest)
}

fn judged_exactly(known: bool, strong: f64) -> Result<(), Error> {
    refuse_if!(
        !known,
        "strong=False takes the delays as exact. For a neutral system of coupled states this \
         needs an expanded determinant, which this system does not have. Its strong abscissa is \
         {strong:.6} 1/s"
    );
    Ok(())
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
/// let (low, high) = chain_abscissa(&system, true, &Task::new())?;
/// let exact = 0.3f64.ln() / 0.36;
/// assert!(low <= exact && exact <= high && high - low < 1e-6);
/// # Ok::<(), deadtime::Error>(())
/// ```
pub fn chain_abscissa(
    system: &CharacteristicMatrix,
    strong: bool,
    task: &Task,
) -> Result<(f64, f64), Error> {
    let mut bounds = (f64::NEG_INFINITY, f64::NEG_INFINITY);
    for (part, _) in system.parts() {
        let own = match part {
            Part::Scalar(h) => {
                let chain = chains::chain_abscissa(h);
                let exact = if strong {
                    None
                } else {
                    exact_chain_abscissa(h, task)?
                };
                let end = exact.unwrap_or(chain);
                if end.is_finite() {
                    let rounding = 4.0 * f64::EPSILON * end.abs();
                    (end - rounding, end + rounding)
                } else {
                    (end, end)
                }
            }
            Part::Matrix(block) => {
                let own = determinant::chain_abscissa(block, task)?;
                judged_exactly(strong || own.1 == f64::NEG_INFINITY, own.1)?;
                own
            }
        };
        bounds = (bounds.0.max(own.0), bounds.1.max(own.1));
    }
    Ok(bounds)
}

/// Can the inverse of E be verified? Half planes and chains need it.
pub fn is_invertible(system: &CharacteristicMatrix) -> bool {
    system.parts().iter().all(|(part, _)| match part {
        Part::Scalar(_) => true,
        Part::Matrix(block) => determinant::is_invertible(block),
    })
}

/// Is every root proved to lie left of the imaginary axis, and with `strong` stay there when delays
/// change by arbitrarily little? The answer is also `false` where a root lies on the axis or too
/// close to it to decide.
///
/// # Errors
/// As [`spectral_abscissa`]; [`Error::TooMuch`]; [`Error::Interrupted`].
pub fn is_stable(system: &CharacteristicMatrix, strong: bool, task: &Task) -> Result<bool, Error> {
    let mut undecided = None;
    for (part, _) in system.parts() {
        let stable = match part {
            Part::Scalar(h) => locating::is_stable(h, strong, task),
            Part::Matrix(block) => block_is_stable(block, strong, task),
        };
        match stable {
            Ok(true) => {}
            Ok(false) => return Ok(false),
            Err(error) if error.ends_all() => return Err(error),
            Err(error) => undecided = Some(error),
        }
    }
    undecided.map_or(Ok(true), Err)
}

fn block_is_stable(block: &Irreducible, strong: bool, task: &Task) -> Result<bool, Error> {
    let stable = determinant::is_stable(block, task)?;
    if !stable && !strong {
        let chain = determinant::chain_abscissa(block, task)?.1;
        judged_exactly(chain < 0.0, chain)?;
    }
    Ok(stable)
}

/// The discs of a set, with the multiplicity of as many equal blocks.
fn discs_of(set: &RootSet, times: u32) -> impl Iterator<Item = Disc> {
    let parts = set.roots.iter().zip(&set.radii).zip(&set.multiplicities);
    parts.map(move |((center, radius), multiplicity)| Disc {
        center: *center,
        radius: *radius,
        isolation: *radius,
        multiplicity: multiplicity.saturating_mul(times),
    })
}

/// Discs that do not meet, which hold the same roots.
fn apart(mut discs: Vec<Disc>) -> Vec<Disc> {
    sort_up(&mut discs, |disc| disc.center.im);
    let mut widest = discs.iter().fold(0.0f64, |a, disc| a.max(disc.radius));
    let mut found: Vec<Disc> = Vec::with_capacity(discs.len());
    for mut disc in discs {
        loop {
            let reach = widest + disc.radius;
            let from = found.partition_point(|other| other.center.im < disc.center.im - reach);
            let near = found.iter().enumerate().skip(from);
            let meets = near
                .take_while(|(_, other)| other.center.im <= disc.center.im + reach)
                .find(|(_, other)| meet(&disc, other))
                .map(|(index, _)| index);
            let Some(index) = meets else {
                break;
            };
            disc = around(disc, found.remove(index));
            widest = widest.max(disc.radius);
        }
        let place = found.partition_point(|other| other.center.im < disc.center.im);
        found.insert(place, disc);
    }
    found
}

fn meet(a: &Disc, b: &Disc) -> bool {
    (a.center - b.center).norm() <= (a.radius + b.radius) * ROUNDED
}

/// The smallest disc around two, about the real axis if it reaches it.
fn around(a: Disc, b: Disc) -> Disc {
    // The same bits for the mirror images, which come in the other order.
    let (a, b) = if (a.center.re, a.center.im.abs()) < (b.center.re, b.center.im.abs()) {
        (a, b)
    } else {
        (b, a)
    };
    let distance = (a.center - b.center).norm();
    let (center, radius) = if distance + b.radius <= a.radius {
        (a.center, a.radius)
    } else if distance + a.radius <= b.radius {
        (b.center, b.radius)
    } else {
        let radius = 0.5 * (distance + a.radius + b.radius);
        let share = (radius - a.radius) / distance;
        (a.center + (b.center - a.center) * share, radius)
    };
    let mut radius = radius * ROUNDED + 4.0 * f64::EPSILON * center.norm();
    let mut center = center;
    if center.im.abs() <= radius {
        radius += center.im.abs();
        center = Complex64::new(center.re, 0.0);
    }
    Disc {
        center,
        radius,
        isolation: radius,
        multiplicity: a.multiplicity.saturating_add(b.multiplicity),
    }
}
