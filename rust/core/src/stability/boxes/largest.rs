//! One large stable box of parameters.
//!
//! The stable boxes of a tree are drawn on a grid of cells; the largest box of full cells (that
//! holds a point, if one is given) is found by trying all ranges of the first axes and, of the
//! cells full in all of them, the longest run along the last. It is proved again as a whole. Then
//! its faces are moved outwards in turn, with a proof for each slab that is added, until no face
//! moves by more than the tolerance. The result is proved to be stable; it is not proved to be the
//! largest such box.

use std::ops::Range as Indices;

use super::box_expansion::{BoxExpansion, Range};
use super::division::{Boxes, Limits, check, proved_boxes, reduce};
use super::prove::{Finding, find_unstable};
use super::reduced::Reduced;
use crate::stability::cell::judge;
use crate::stability::family::Family;
use crate::stability::specification::Specification;
use crate::{Error, Task};

/// Cells along each axis and share of the ranges left undecided, for one, two and three parameters.
/// More cells find a larger first box and take more time.
const GRIDS: [(usize, f64); 3] = [(4096, 1e-4), (256, 2e-3), (32, 2e-2)];

/// Upper limits on the boxes of the tree, of the proof of the first box and of the proof of a slab
/// (bound the time).
const TREE: usize = 300_000;
const WHOLE: usize = 100_000;
const SLAB: usize = 1000;

/// A stable box within `ranges`, as large as could be found; `None` where there is none.
///
/// With `around`, one value for each parameter, the box contains that point. `tol` is the smallest
/// move of a face, as a share of the ranges.
///
/// # Errors
/// As [`proved_boxes`]; [`Error::Argument`] also for a point outside the ranges.
pub fn largest_stable_box(
    family: &Family,
    ranges: &[(f64, f64)],
    around: Option<&[f64]>,
    tol: f64,
    task: &Task,
) -> Result<Option<Vec<(f64, f64)>>, Error> {
    let varying = check(family, ranges)?;
    if let Some(point) = around {
        let inside = |((low, high), value): (&(f64, f64), &f64)| low <= value && value <= high;
        refuse_if!(
            point.len() != ranges.len() || !ranges.iter().zip(point).all(inside),
            "the point that the box has to contain is outside of the ranges"
        );
    }
    match varying.len() {
        0 | 1 => search::<1>(family, ranges, &varying, around, tol, task),
        2 => search::<2>(family, ranges, &varying, around, tol, task),
        _ => search::<3>(family, ranges, &varying, around, tol, task),
    }
}

fn search<const D: usize>(
    family: &Family,
    ranges: &[(f64, f64)],
    varying: &[usize],
    around: Option<&[f64]>,
    tol: f64,
    task: &Task,
) -> Result<Option<Vec<(f64, f64)>>, Error> {
    let (reduced, whole): (Reduced<'_, D>, Range<D>) = reduce(family, ranges, varying)?;
    let Some((side, undecided)) = GRIDS.get(D - 1).copied() else {
        return Ok(None);
    };
    let limits = Limits {
        undecided,
        boxes: TREE,
    };
    let boxes = proved_boxes(family, ranges, limits, task)?;
    let place = |values: &[f64]| -> [f64; D] {
        let mut place = whole.low;
        for (slot, index) in place.iter_mut().zip(varying) {
            *slot = values.get(*index).copied().unwrap_or(*slot);
        }
        place
    };
    let point = around.map(place);
    let mut expansion = BoxExpansion::new(&reduced);
    let full = drawn(&boxes, family.names().len(), &whole, side, place);
    let unit = |x: f64, i: usize| {
        let width = whole.high[i] - whole.low[i];
        if width > 0.0 {
            (x - whole.low[i]) / width
        } else {
            0.0
        }
    };
    let held = point.map(|point| -> Vec<usize> {
        let cell = |i: usize| ((unit(point[i], i) * side as f64) as usize).min(side - 1);
        (0..D).map(cell).collect()
    });
    let found = best(&full, &[side; D], held.as_deref());
    let mut start = found.map(|(_, cells)| {
        let end = |i: usize, index: usize| {
            if index == side {
                whole.high[i]
            } else {
                whole.low[i] + index as f64 / side as f64 * (whole.high[i] - whole.low[i])
            }
        };
        let cells = |i: usize| cells.get(i).cloned().unwrap_or(0..0);
        Range {
            low: std::array::from_fn(|i| end(i, cells(i).start)),
            high: std::array::from_fn(|i| end(i, cells(i).end)),
        }
    });
    if let Some(range) = start
        && find_unstable(&reduced, range, WHOLE, &mut expansion, task)? != Finding::Stable
    {
        start = None;
    }
    let start = match (start, point) {
        (Some(range), _) => range,
        (None, Some(point)) => {
            // No cell of the grid is full: start from the point itself.
            if judge(
                &family.at(&reduced.values_at(&point))?,
                Specification::default(),
                false,
                task,
            )?
            .unstable
                != 0
            {
                return Ok(None);
            }
            Range {
                low: point,
                high: point,
            }
        }
        (None, None) => return Ok(None),
    };
    let steps = std::array::from_fn(|i| 2.0 * (whole.high[i] - whole.low[i]) / side as f64);
    let grown = grow(&reduced, start, &whole, steps, tol, &mut expansion, task)?;
    let (low, high) = (
        reduced.values_at(&grown.low),
        reduced.values_at(&grown.high),
    );
    Ok(Some(low.into_iter().zip(high).collect()))
}

/// Which cells of the grid lie wholly in stable boxes?
fn drawn<const D: usize>(
    boxes: &Boxes,
    count: usize,
    whole: &Range<D>,
    side: usize,
    place: impl Fn(&[f64]) -> [f64; D],
) -> Vec<bool> {
    let mut filled = vec![0.0; side.pow(D as u32)];
    let corners = boxes.low.chunks(count).zip(boxes.high.chunks(count));
    for ((low, high), unstable) in corners.zip(&boxes.unstable) {
        if *unstable != 0 {
            continue;
        }
        let (low, high) = (place(low), place(high));
        // Along each axis: the cells, and the covered part of each.
        let parts: [Vec<(usize, f64)>; D] = std::array::from_fn(|i| {
            let width = whole.high[i] - whole.low[i];
            if width == 0.0 {
                return (0..side).map(|cell| (cell, 1.0)).collect();
            }
            let from = (low[i] - whole.low[i]) / width * side as f64;
            let to = (high[i] - whole.low[i]) / width * side as f64;
            let cells = from as usize..(to.ceil() as usize).min(side);
            cells
                .map(|cell| (cell, to.min(cell as f64 + 1.0) - from.max(cell as f64)))
                .collect()
        });
        let mut covered = vec![(0, 1.0)];
        for part in &parts {
            let deeper = covered.iter().flat_map(|(index, share)| {
                part.iter()
                    .map(move |(cell, covered)| (index * side + cell, share * covered))
            });
            covered = deeper.collect();
        }
        for (index, share) in covered {
            if let Some(total) = filled.get_mut(index) {
                *total += share;
            }
        }
    }
    filled.into_iter().map(|share| share > 1.0 - 1e-9).collect()
}

type Found = Option<(usize, Vec<Indices<usize>>)>;

/// The largest box of full cells, with the number of its cells.
fn best(full: &[bool], shape: &[usize], held: Option<&[usize]>) -> Found {
    let (&length, rest) = shape.split_first()?;
    let own = held.and_then(|held| held.first().copied());
    if rest.is_empty() {
        return longest_run(full, own);
    }
    let deeper = held.and_then(|held| held.get(1..));
    let plane: usize = rest.iter().product();
    let mut champion: Found = None;
    for first in 0..own.map_or(length, |own| own + 1) {
        let mut common = vec![true; plane];
        for (last, layer) in full.chunks(plane).enumerate().skip(first) {
            let mut any = false;
            for (cell, other) in common.iter_mut().zip(layer) {
                *cell &= other;
                any |= *cell;
            }
            if !any {
                break;
            }
            if own.is_some_and(|own| last < own) {
                continue;
            }
            if let Some((cells, ranges)) = best(&common, rest, deeper) {
                let total = cells * (last + 1 - first);
                if champion.as_ref().is_none_or(|known| total > known.0) {
                    let ranges = std::iter::once(first..last + 1).chain(ranges).collect();
                    champion = Some((total, ranges));
                }
            }
        }
    }
    champion
}

fn longest_run(full: &[bool], held: Option<usize>) -> Found {
    let mut longest: Option<Indices<usize>> = None;
    let mut start = 0;
    for (index, is_full) in full.iter().chain([&false]).enumerate() {
        if *is_full {
            continue;
        }
        let run = start..index;
        start = index + 1;
        let counts = held.is_none_or(|held| run.contains(&held));
        if counts && run.len() > longest.as_ref().map_or(0, Indices::len) {
            longest = Some(run);
        }
    }
    longest.map(|run| (run.len(), vec![run]))
}

/// Move the faces of a stable box outwards.
fn grow<const D: usize>(
    reduced: &Reduced<'_, D>,
    mut range: Range<D>,
    whole: &Range<D>,
    steps: [f64; D],
    tol: f64,
    expansion: &mut BoxExpansion<D>,
    task: &Task,
) -> Result<Range<D>, Error> {
    let mut faces: Vec<(usize, bool, f64)> = steps
        .iter()
        .enumerate()
        .flat_map(|(i, step)| [(i, false, *step), (i, true, *step)])
        .collect();
    while !faces.is_empty() {
        let mut going = Vec::with_capacity(faces.len());
        for (i, upper, step) in faces {
            let mut slab = range;
            let next = if upper {
                let next = (range.high[i] + step).min(whole.high[i]);
                (slab.low[i], slab.high[i]) = (range.high[i], next);
                next
            } else {
                let next = (range.low[i] - step).max(whole.low[i]);
                (slab.low[i], slab.high[i]) = (next, range.low[i]);
                next
            };
            if slab.low[i] >= slab.high[i] {
                continue;
            }
            let stable = find_unstable(reduced, slab, SLAB, expansion, task)? == Finding::Stable;
            if stable && upper {
                range.high[i] = next;
            } else if stable {
                range.low[i] = next;
            }
            let step = if stable { 2.0 * step } else { 0.5 * step };
            if step >= tol * (whole.high[i] - whole.low[i]) {
                going.push((i, upper, step));
            }
        }
        faces = going;
    }
    Ok(range)
}
