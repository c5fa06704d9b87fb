//! Stability over two parameters of a family.
//!
//! Counts: if the family is affine in one of the two, or has it as the delay of some terms, every
//! value of the other makes a row, whose crossings of the edge give all its cells (`row`); the cost
//! grows with the number of rows and of crossings, not of cells. Otherwise blocks of cells are
//! divided along the boundaries (`blocks`). With `Proof::Cells`, and for the abscissa of a family
//! without such rows, every cell is judged alone. In each case a cell equals [`judge`] of the
//! family's member there, and results have the same bits for any number of threads. A member that
//! cannot be formed, because a coefficient overflows, is an undecided cell; delays that become
//! negative are refused before any work is done.

use super::axes::{Axis, Map, Proof, Question, check_parameters, put};
use super::blocks;
use super::chart::Chart;
use super::curves::{Lines, Vertex, join_both};
use super::rows::{Rows, Wanted};
use crate::parallel;
use crate::roots::chain_abscissa;
use crate::stability::cell::{Cell, judge};
use crate::stability::family::Family;
use crate::stability::specification::Specification;
use crate::{Error, Task, memory};

/// Upper limit on the number of cells (bounds memory and time).
const MAX_CELLS: usize = 50_000_000;

/// Least number of cells that a thread takes together, and most groups of these.
const TOGETHER: usize = 16;
const GROUPS: usize = 1 << 16;

/// Judge the members of `family` over two of its parameters; `values` holds the others.
///
/// # Errors
/// [`Error::Argument`] where the axes do not name two parameters, a value is not finite or a delay
/// becomes negative; [`Error::TooMuch`] beyond 50 million cells; [`Error::Interrupted`].
pub fn map(
    family: &Family,
    values: &[f64],
    axes: [Axis<'_>; 2],
    question: Question,
    task: &Task,
) -> Result<Chart, Error> {
    question.specification.check()?;
    let cells = check(family, values, axes)?;
    let map = Map {
        family,
        values,
        axes,
        question,
        task,
    };
    if cells == 0 {
        return Ok(Chart::default());
    }
    // The memory is reserved before the work: a count and a status for each cell, and an abscissa.
    memory::require::<[u8; 5]>("the map", cells)?;
    memory::require::<f64>("the map", if question.abscissa { cells } else { 0 })?;
    if question.proof == Proof::Cells {
        return map.cell_by_cell();
    }
    let wanted = if question.abscissa {
        Wanted::Abscissas
    } else {
        Wanted::Counts
    };
    match Rows::of(&map, wanted) {
        Some(rows) => rows.chart(),
        None => match blocks::grid(&map).filter(|_| !question.abscissa) {
            Some(grid) => grid.chart(task),
            None => map.cell_by_cell(),
        },
    }
}

/// Boundaries of a map: see [`Vertex`].
#[derive(Debug, Clone, PartialEq)]
pub struct Boundaries {
    /// Which of the two axes runs along the lines, whose values are the gains of the vertices.
    pub along: usize,
    /// Each curve with its points in order.
    pub curves: Vec<Vec<Vertex>>,
}

/// The curves on which roots lie on the edge of the specification: first those along the rows, then
/// those that run along them and are found by the columns. `None` where the family is affine in
/// neither parameter and a root of all members stays at 0, or where points are not in order.
///
/// # Errors
/// As for [`map`].
pub fn boundaries(
    family: &Family,
    values: &[f64],
    axes: [Axis<'_>; 2],
    specification: Specification,
    task: &Task,
) -> Result<Option<[Boundaries; 2]>, Error> {
    specification.check()?;
    check(family, values, axes)?;
    let map = Map {
        family,
        values,
        axes,
        question: Question {
            specification,
            ..Question::default()
        },
        task,
    };
    let Some((along, rows)) = map.lines(&[0, 1])? else {
        return Ok(None);
    };
    let columns = map.lines(&[1 - along])?.map(|(_, columns)| columns);
    let [curves, others] = join_both(&rows, columns.as_ref());
    let of = |along, curves| Boundaries { along, curves };
    Ok(Some([of(along, curves), of(1 - along, others)]))
}

/// The abscissa of the chains of every member, row-major: −∞ where there are none, NaN where it
/// cannot be formed.
///
/// # Errors
/// As for [`map`].
pub fn chains(
    family: &Family,
    values: &[f64],
    axes: [Axis<'_>; 2],
    task: &Task,
) -> Result<Vec<f64>, Error> {
    let cells = check(family, values, axes)?;
    let [first, second] = axes;
    let width = second.points.len();
    let cell = |values: &mut Vec<f64>, index: usize| {
        task.check()?;
        put(values, first, index / width);
        put(values, second, index % width);
        Ok(family.at(values).map_or(f64::NAN, |h| chain_abscissa(&h)))
    };
    parallel::results("the map", cells, || values.to_vec(), cell)
}

impl<'a> Map<'a> {
    /// The crossings of all lines along one of these axes, and the index of that axis.
    fn lines(&self, axes: &[usize]) -> Result<Option<(usize, Lines<'a>)>, Error> {
        let found = match Rows::along(self, Wanted::Boundaries, axes) {
            Some(rows) if rows.has_boundaries() => Some((rows.along, rows.crossings()?)),
            Some(_) => None,
            None => blocks::crossings(self, axes)?,
        };
        Ok(found.and_then(|(along, crossings)| {
            let points = self.axes.get(along)?.points;
            (!points.is_empty()).then_some((along, Lines { crossings, points }))
        }))
    }

    fn cell_by_cell(&self) -> Result<Chart, Error> {
        let Question {
            specification,
            abscissa,
            ..
        } = self.question;
        let [first, second] = self.axes;
        let width = second.points.len();
        let cells = first.points.len() * width;
        let mut chart = Chart::stable(cells)?;
        chart.abscissa = memory::filled("the map", f64::NAN, if abscissa { cells } else { 0 })?;
        let judged = |values: &mut Vec<f64>, index: usize| {
            self.task.check()?;
            put(values, first, index / width);
            put(values, second, index % width);
            let cell = match self.family.at(values) {
                Ok(h) => judge(&h, specification, abscissa, self.task)?,
                Err(_) => Cell::UNDECIDED,
            };
            self.task.advance(1);
            Ok(cell)
        };
        let together = cells.div_ceil(GROUPS).max(TOGETHER);
        let places = chart.unstable.chunks_mut(together);
        let places = places.zip(chart.status.chunks_mut(together));
        let mut abscissas: Vec<&mut [f64]> = chart.abscissa.chunks_mut(together).collect();
        abscissas.resize_with(places.len(), Default::default);
        let places = places.zip(abscissas);
        parallel::each(
            "the map",
            places,
            |group, ((unstable, status), abscissas)| {
                let mut values = self.values.to_vec();
                for (place, (unstable, status)) in unstable.iter_mut().zip(status).enumerate() {
                    let cell = judged(&mut values, group * together + place)?;
                    (*unstable, *status) = (cell.unstable, cell.status);
                    if let Some(abscissa) = abscissas.get_mut(place) {
                        *abscissa = cell.abscissa;
                    }
                }
                Ok(())
            },
        )?;
        Ok(chart)
    }
}

/// The number of cells, after a check of the arguments.
fn check(family: &Family, values: &[f64], axes: [Axis<'_>; 2]) -> Result<usize, Error> {
    check_parameters(family, axes)?;
    let [first, second] = axes;
    let cells = first.points.len().saturating_mul(second.points.len());
    if cells > MAX_CELLS {
        return Err(Error::TooMuch {
            what: "the map",
            limit: MAX_CELLS as u64,
            unit: "cells",
            advice: format!(
                "{} by {} points are too many for a map: give fewer points, or make several maps \
                 of smaller ranges",
                first.points.len(),
                second.points.len()
            ),
        });
    }
    let mut ranges: Vec<(f64, f64)> = values.iter().map(|value| (*value, *value)).collect();
    for axis in axes {
        if let (Some(ends), Some(range)) = (axis.range()?, ranges.get_mut(axis.parameter)) {
            *range = ends;
        }
    }
    if cells > 0 {
        family.check_delays(&ranges)?;
    }
    Ok(cells)
}
