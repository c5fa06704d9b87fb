//! All roots of a region.

use num_complex::Complex64;

use super::isolate::{Search, Seek};
use crate::quasipoly::QuasiPolynomial;
use crate::roots::counting::{Cell, Closed, Prepared, TimeScaling, Walker, close, dominance};
use crate::roots::disc::{Disc, with_mirror_image};
use crate::roots::region::Region;
use crate::roots::root_set::RootSet;
use crate::{Error, Task};

/// Upper limit on the number of roots in a list (bounds memory and time).
const MAX_ROOTS: u64 = 1_000_000;

/// Number of roots from which on chains are followed.
const MANY: u64 = 64;

/// Add exact roots at 0, to the disc that contains 0 or as a disc of their own.
pub(crate) fn add_zeros(discs: &mut Vec<Disc>, zeros: u32) {
    if zeros == 0 {
        return;
    }
    if let Some(disc) = discs
        .iter_mut()
        .find(|disc| disc.center.norm() <= disc.radius)
    {
        disc.multiplicity = disc.multiplicity.saturating_add(zeros);
        return;
    }
    discs.push(Disc {
        center: Complex64::ZERO,
        radius: 0.0,
        isolation: 0.0,
        multiplicity: zeros,
    });
}

/// Every root in a region.
///
/// Open sides are closed by proved bounds. If the lower or upper edge of the region is the real
/// axis, roots on that axis belong to the region. A disc that meets that edge counts with all its
/// roots.
///
/// # Errors
/// As [`count`](crate::roots::count); [`Error::CountMismatch`] where double precision does not
/// suffice to locate what was counted.
///
/// ```
/// use deadtime::{Task, quasipoly::QuasiPolynomial, roots::{Region, roots}};
/// let h = QuasiPolynomial::new(vec![vec![0.0, 1.0], vec![1.0]], vec![0.0, 1.0])?;
/// let set = roots(&h, &Region::new((-10.0, 2.0), (0.0, 30.0))?, &Task::new())?;
/// assert_eq!(set.counted, 5);
/// assert!((set.roots[0].re + 0.318_131_505_204_764_1).abs() <= set.radii[0]);
/// # Ok::<(), deadtime::Error>(())
/// ```
pub fn roots(h: &QuasiPolynomial, region: &Region, task: &Task) -> Result<RootSet, Error> {
    match TimeScaling::within(h, region) {
        None => roots_as_given(h, region, task),
        Some(scaling) => roots_as_given(&scaling.h, &scaling.region(region), task)
            .map(|set| scaling.returned(set, Some(*region)))
            .map_err(|error| scaling.explained(error)),
    }
}

fn roots_as_given(h: &QuasiPolynomial, region: &Region, task: &Task) -> Result<RootSet, Error> {
    let prepared = Prepared::new(h)?;
    let h = &prepared.rest;
    region.check()?;
    let zeros = prepared.zeros_in(region)?;
    let mut discs = Vec::new();
    let Some(closed) = close(h, region, dominance)? else {
        add_zeros(&mut discs, zeros);
        return Ok(RootSet::new(discs, *region));
    };
    discs = all_discs(&mut Walker::new(h, task), &closed)?;
    add_zeros(&mut discs, zeros);
    Ok(RootSet::new(discs, *region))
}

/// Discs that hold all the roots of a closed region.
pub(crate) fn all_discs(walker: &mut impl Seek, closed: &Closed) -> Result<Vec<Disc>, Error> {
    let mut discs = Vec::new();
    let Closed { re, .. } = *closed;
    let lower = closed
        .symmetric
        .map(|height| Cell::new(walker, re, (0.0, height), true));
    let upper = closed.above.map(|im| Cell::new(walker, re, im, false));
    let (lower, upper) = (lower.transpose()?, upper.transpose()?);
    for cell in [lower, upper].into_iter().flatten() {
        let located = locate(walker, cell)?;
        if cell.symmetric && !closed.half {
            discs.reserve(2 * located.len());
            discs.extend(located.into_iter().flat_map(with_mirror_image));
        } else if discs.is_empty() {
            discs = located;
        } else {
            discs.extend(located);
        }
    }
    if closed.mirrored {
        for disc in &mut discs {
            disc.center = disc.center.conj();
        }
    }
    Ok(discs)
}

/// Discs, Im ≥ 0, that hold the roots of a cell: disjoint, inside the cell, and with multiplicities
/// that add up to its count.
pub(crate) fn locate(walker: &mut impl Seek, cell: Cell) -> Result<Vec<Disc>, Error> {
    if cell.count > MAX_ROOTS {
        return Err(Error::TooMuch {
            what: "the list of all roots",
            limit: MAX_ROOTS,
            unit: "roots",
            advice: "give a smaller region".into(),
        });
    }
    let mut search = if cell.count > MANY {
        Search::after_chains(walker, &cell)?
    } else {
        Search::new(walker)
    };
    search.locate_all(cell)?;
    let mut within = search.into_found();
    within.retain(|disc| cell.holds(disc.center));
    for disc in &within {
        let Disc { center, radius, .. } = *disc;
        let clear_below = cell.symmetric || center.im - radius > cell.im.0;
        let inside = center.re - radius > cell.re.0
            && center.re + radius < cell.re.1
            && center.im + radius < cell.im.1
            && clear_below;
        if !inside {
            return Err(Error::contour(center, 2.0 * radius));
        }
    }
    Ok(within)
}
