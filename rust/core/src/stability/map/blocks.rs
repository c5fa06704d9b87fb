//! Counts and boundaries of a map whose family is affine in neither of its parameters.
//!
//! The map is cut into blocks of a fixed size, so that results do not depend on the number of
//! threads; each is divided as far as its boundaries require (`block`). The cost grows with the
//! length of the boundaries and with the number of blocks, not of cells. Boundaries are the
//! crossings of its rows (`row_search`), joined as those of any map.

use super::axes::{Axis, Map, put};
use super::block::{Block, Grid};
use super::chart::Chart;
use crate::parallel;
use crate::stability::boxes::Reduced;
use crate::stability::crossings::Crossing;
use crate::status::CellStatus;
use crate::{Error, Task};

/// Cells along one side of a block. Larger blocks prove more cells at once and give fewer tasks for
/// the threads.
const SIDE: usize = 64;

/// The family of a map over its grid; `None` where points are not in order, or a root stays on the
/// edge.
pub(crate) fn grid<'a>(map: &Map<'a>) -> Option<Grid<'a, 2>> {
    if IS_PAGE {
        return None;
    }
    let [first, second] = map.axes;
    let places = [first.parameter, second.parameter];
    let specification = map.question.specification;
    let reduced = Reduced::new(map.family, map.values, &places).with_specification(specification);
    let stays = specification.decay == 0.0 && reduced.refuse_root_at_zero().is_err();
    let sorted = |axis: Axis<'_>| axis.points.is_sorted();
    (sorted(first) && sorted(second) && !stays).then_some(Grid {
        reduced,
        points: [first.points, second.points],
    })
}

/// A page maps no family that needs blocks, and does without them to stay small.
const IS_PAGE: bool = cfg!(target_family = "wasm");

/// The index of the axis along the rows, and the crossings of each.
pub(crate) type Crossed = (usize, Vec<Vec<Crossing>>);

/// The crossings of the edge along every row, and the index of the axis along the rows: of these
/// axes that with more points.
///
/// # Errors
/// [`Error::Interrupted`] alone.
pub(crate) fn crossings(map: &Map<'_>, axes: &[usize]) -> Result<Option<Crossed>, Error> {
    if IS_PAGE || grid(map).is_none() {
        return Ok(None);
    }
    let [first, second] = map.axes;
    let is_first = first.points.len() > second.points.len() || !axes.contains(&1);
    let (along, axis, across) = if is_first && axes.contains(&0) {
        (0, first, second)
    } else {
        (1, second, first)
    };
    let count = across.points.len();
    let rows = parallel::results(
        "the list of rows of the map",
        count,
        || (),
        |(), index| {
            let mut values = map.values.to_vec();
            put(&mut values, across, index);
            let row = Grid::row(map.family, &values, axis, map.question.specification);
            let found = row.crossings(map.task)?;
            map.task.advance(axis.points.len() as u64);
            Ok(found)
        },
    )?;
    Ok(Some((along, rows)))
}

impl Grid<'_, 2> {
    /// The counts of all cells.
    ///
    /// # Errors
    /// [`Error::Interrupted`] alone.
    pub(crate) fn chart(&self, task: &Task) -> Result<Chart, Error> {
        let (height, width) = (self.points[0].len(), self.points[1].len());
        let mut chart = Chart::stable(height * width)?;
        let bands = chart
            .unstable
            .chunks_mut(SIDE * width)
            .zip(chart.status.chunks_mut(SIDE * width));
        parallel::each("the map", bands, |band, (unstable, status)| {
            let top = band * SIDE;
            let bottom = top + unstable.len() / width;
            let count = width.div_ceil(SIDE);
            let found = parallel::results(
                "the map",
                count,
                || (),
                |(), index| {
                    let left = index * SIDE;
                    let block = Block {
                        start: [top, left],
                        end: [bottom, (left + SIDE).min(width)],
                    };
                    let mut own = Grid {
                        reduced: self.reduced.clone(),
                        points: self.points,
                    };
                    own.refer_to_middle(&block);
                    let cells = own.cells(block, task)?;
                    task.advance(block.cells() as u64);
                    Ok(cells)
                },
            )?;
            for (block, cell) in found.into_iter().flatten() {
                for line in block.start[0] - top..block.end[0] - top {
                    let places = line * width + block.start[1]..line * width + block.end[1];
                    if cell.unstable != 0
                        && let Some(places) = unstable.get_mut(places.clone())
                    {
                        places.fill(cell.unstable);
                    }
                    if cell.status != CellStatus::Ok
                        && let Some(places) = status.get_mut(places)
                    {
                        places.fill(cell.status);
                    }
                }
            }
            Ok(())
        })?;
        Ok(chart)
    }
}
