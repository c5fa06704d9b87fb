//! What holds over intervals of some parameters, for each point of two others.
//!
//! A cell is stable if every member with its two values and the others in their intervals is
//! stable, which is proved by boxes of those others. It is not stable as soon as one unstable
//! member is found; members at both ends and in the middle are tried first.

use super::axes::{Axis, check_parameters};
use crate::parallel;
use crate::stability::boxes::{BoxExpansion, Finding, Reduced, check, find_unstable, reduce};
use crate::stability::cell::{ENDLESS, UNKNOWN, judge};
use crate::stability::family::Family;
use crate::stability::specification::Specification;
use crate::{Error, Task};

/// Judge the cells over `axes`: 0 where all members are stable, the largest number of unstable
/// roots found, −1 for infinitely many, −2 where undecided. `ranges` holds intervals and values of
/// the others.
///
/// # Errors
/// [`Error::Argument`] for axes that do not name two parameters, ranges that are not finite or
/// reversed, more than three intervals, or a delay that becomes negative; [`Error::Interrupted`].
pub fn robust_map(
    family: &Family,
    ranges: &[(f64, f64)],
    axes: [Axis<'_>; 2],
    boxes: usize,
    task: &Task,
) -> Result<Vec<i32>, Error> {
    let [first, second] = axes;
    check_parameters(family, axes)?;
    let mut corners = ranges.to_vec();
    for axis in axes {
        let Some(ends) = axis.range()? else {
            return Ok(Vec::new());
        };
        if let Some(range) = corners.get_mut(axis.parameter) {
            *range = ends;
        }
    }
    family.check_delays(&corners)?;
    let mut cell = corners.clone();
    for Axis { parameter, .. } in axes {
        if let Some(range) = cell.get_mut(parameter) {
            range.1 = range.0;
        }
    }
    check(family, &cell)?;
    let width = second.points.len();
    let judged = |cell: &mut Vec<(f64, f64)>, index: usize| {
        task.check()?;
        for (axis, index) in [(first, index / width), (second, index % width)] {
            let point = axis.points.get(index);
            if let (Some(range), Some(point)) = (cell.get_mut(axis.parameter), point) {
                *range = (*point, *point);
            }
        }
        let judged = judge_cell(family, cell, boxes, task);
        task.advance(1);
        judged
    };
    let cells = first.points.len().saturating_mul(width);
    parallel::results("the map", cells, || cell.clone(), judged)
}

/// A point of an interval.
type End = fn(&(f64, f64)) -> f64;

fn judge_cell(
    family: &Family,
    ranges: &[(f64, f64)],
    boxes: usize,
    task: &Task,
) -> Result<i32, Error> {
    let ends: [End; 3] = [|r| r.0, |r| r.1, |r| r.0 + 0.5 * (r.1 - r.0)];
    let mut most = 0;
    let mut unknown = false;
    for end in ends {
        let values: Vec<f64> = ranges.iter().map(end).collect();
        let count = match family.at(&values) {
            Ok(h) => judge(&h, Specification::default(), false, task)?.unstable,
            Err(_) => UNKNOWN,
        };
        match count {
            ENDLESS => return Ok(ENDLESS),
            UNKNOWN => unknown = true,
            count => most = most.max(count),
        }
    }
    if most > 0 || unknown {
        return Ok(if most > 0 { most } else { UNKNOWN });
    }
    let varying = check(family, ranges)?;
    let found = match varying.len() {
        0 => return Ok(0),
        1 => search::<1>(family, ranges, &varying, boxes, task),
        2 => search::<2>(family, ranges, &varying, boxes, task),
        _ => search::<3>(family, ranges, &varying, boxes, task),
    };
    match found {
        Ok(Finding::Stable) => Ok(0),
        Ok(Finding::Unstable(count)) => Ok(count),
        Err(error) if error.ends_all() => Err(error),
        Ok(Finding::Unknown) | Err(_) => Ok(UNKNOWN),
    }
}

fn search<const D: usize>(
    family: &Family,
    ranges: &[(f64, f64)],
    varying: &[usize],
    boxes: usize,
    task: &Task,
) -> Result<Finding, Error> {
    let (reduced, whole): (Reduced<'_, D>, _) = reduce(family, ranges, varying)?;
    find_unstable(
        &reduced,
        whole,
        boxes,
        &mut BoxExpansion::new(&reduced),
        task,
    )
}
