//! Stability over two parameters of a family.
//!
//! Counts: if the family is affine in one of the two, every value of the other makes a row, whose
//! crossings of the line give all its cells (`row`); the cost grows with the number of rows and of crossings, not
//! of cells. Otherwise, and with `Proof::Cells`, every cell is counted alone. Either way a cell
//! equals [`judge`] of the family's member there, and results have the same bits for any number of threads.
//! What cannot be formed (an overflow of a coefficient) is an undecided cell; delays that become negative
//! are refused before any work is done.

use rayon::prelude::*;

use super::cell::{Cell, judge};
use super::crossing::Crossing;
use super::curves::{Vertex, join};
use super::demand::Demand;
use super::family::Family;
use super::row::{Members, Row};
use crate::status::CellStatus;
use crate::{Error, Task};

/// More cells than anyone can look at.
const MAX_CELLS: usize = 50_000_000;

/// Lines of a chart filled together, so that strided columns stay in the cache.
const BLOCK: usize = 32;

/// One axis of a map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Axis<'a> {
    /// Index of the parameter.
    pub parameter: usize,
    /// Its values, increasing.
    pub points: &'a [f64],
}

/// How the count of a cell is proved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Proof {
    /// By all crossings of its row, and one count for every run of them.
    #[default]
    Curves,
    /// By a count of its own.
    Cells,
}

/// What is asked of a map.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Question {
    /// Roots that offend against this are counted.
    pub demand: Demand,
    /// Is the spectral abscissa asked for too?
    pub abscissa: bool,
    /// How counts are proved.
    pub proof: Proof,
}

/// A stability map: row-major arrays, the first axis running slowest.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Chart {
    /// See [`Cell::unstable`].
    pub unstable: Vec<i32>,
    /// See [`Cell::abscissa`]; empty if not asked for.
    pub abscissa: Vec<f64>,
    /// See [`Cell::status`].
    pub status: Vec<CellStatus>,
}

impl Chart {
    /// Nothing unstable; zeros cost nothing until they are written to.
    fn stable(cells: usize) -> Self {
        Self {
            unstable: vec![0; cells],
            abscissa: Vec::new(),
            status: vec![CellStatus::Ok; cells],
        }
    }
}

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
    question.demand.check()?;
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
    if question.proof == Proof::Cells {
        return map.cell_by_cell();
    }
    match Rows::of(&map) {
        Some(rows) => rows.chart(),
        None => map.cell_by_cell(),
    }
}

/// The boundaries of a map: see [`Vertex`].
#[derive(Debug, Clone, PartialEq)]
pub struct Boundaries {
    /// Which of the two axes runs along the rows, whose values are the gains of the vertices.
    pub along: usize,
    /// Each curve with its points in order.
    pub curves: Vec<Vec<Vertex>>,
}

/// The curves on which roots lie on the edge of what is demanded; `None` where the family is affine in neither parameter.
///
/// # Errors
/// As for [`map`].
pub fn boundaries(
    family: &Family,
    values: &[f64],
    axes: [Axis<'_>; 2],
    demand: Demand,
    task: &Task,
) -> Result<Option<Boundaries>, Error> {
    demand.check()?;
    check(family, values, axes)?;
    let map = Map {
        family,
        values,
        axes,
        question: Question {
            demand,
            ..Question::default()
        },
        task,
    };
    let Some(rows) = Rows::of(&map) else {
        return Ok(None);
    };
    let points = rows.axis().points;
    let (Some(low), Some(high)) = (points.first(), points.last()) else {
        return Ok(None);
    };
    let crossings = rows.crossings()?;
    Ok(Some(Boundaries {
        along: rows.along,
        curves: join(&crossings, (*low, *high)),
    }))
}

struct Map<'a> {
    family: &'a Family,
    values: &'a [f64],
    axes: [Axis<'a>; 2],
    question: Question,
    task: &'a Task,
}

impl Map<'_> {
    fn cell_by_cell(&self) -> Result<Chart, Error> {
        let Question {
            demand, abscissa, ..
        } = self.question;
        let [first, second] = self.axes;
        let width = second.points.len();
        let cells = first.points.len() * width;
        let mut chart = Chart::stable(cells);
        chart.abscissa = vec![f64::NAN; if abscissa { cells } else { 0 }];
        let judged = |values: &mut Vec<f64>, index: usize| {
            self.task.check()?;
            put(values, first, index / width);
            put(values, second, index % width);
            let cell = match self.family.at(values) {
                Ok(h) => judge(&h, demand, abscissa, self.task)?,
                Err(_) => Cell::UNDECIDED,
            };
            self.task.advance(1);
            Ok(cell)
        };
        let start = || self.values.to_vec();
        let both = chart
            .unstable
            .par_iter_mut()
            .zip(&mut chart.status)
            .enumerate();
        if abscissa {
            both.zip(&mut chart.abscissa).try_for_each_init(
                start,
                |values, ((index, (unstable, status)), alpha)| {
                    let cell = judged(values, index)?;
                    (*unstable, *alpha, *status) = (cell.unstable, cell.abscissa, cell.status);
                    Ok(())
                },
            )?;
        } else {
            both.try_for_each_init(start, |values, (index, (unstable, status))| {
                let cell = judged(values, index)?;
                (*unstable, *status) = (cell.unstable, cell.status);
                Ok(())
            })?;
        }
        Ok(chart)
    }
}

/// A map whose family is affine in the parameter along its rows.
struct Rows<'a> {
    map: &'a Map<'a>,
    /// Index of the axis along the rows.
    along: usize,
    constant: Family,
    slope: Family,
}

impl<'a> Rows<'a> {
    /// `None` where the family is affine in neither parameter, or points are in disorder.
    ///
    /// Leading terms that do not vary along a row keep its roots within bounds; with a term without s in
    /// B, a root at 0 crosses within rows, not between them; more cells a row cost less.
    fn of(map: &'a Map<'a>) -> Option<Self> {
        let candidates = map.axes.iter().enumerate().filter_map(|(along, axis)| {
            let (constant, slope) = map.family.split(axis.parameter)?;
            if !axis.points.is_sorted() {
                return None;
            }
            let rank = (
                slope.degree() < constant.degree(),
                slope.has_constant(),
                axis.points.len(),
                along,
            );
            Some((
                rank,
                Self {
                    map,
                    along,
                    constant,
                    slope,
                },
            ))
        });
        candidates
            .max_by_key(|(rank, _)| *rank)
            .map(|(_, rows)| rows)
    }

    fn axis(&self) -> Axis<'a> {
        let [first, second] = self.map.axes;
        if self.along == 0 { first } else { second }
    }

    fn across(&self) -> Axis<'a> {
        let [first, second] = self.map.axes;
        if self.along == 0 { second } else { first }
    }

    fn rows(&self) -> Result<Vec<Row>, Error> {
        self.each(|members| {
            let mut row = members.count(self.map.task)?;
            if self.map.question.abscissa {
                row.cells = members.abscissas(&row, self.map.task)?;
            }
            self.map.task.advance(members.points.len() as u64);
            Ok(row)
        })
    }

    fn crossings(&self) -> Result<Vec<Vec<Crossing>>, Error> {
        self.each(|members| Ok(members.found(self.map.task)?.unwrap_or_default()))
    }

    /// Do the same for all rows.
    fn each<T: Send>(
        &self,
        work: impl Fn(Members<'_>) -> Result<T, Error> + Sync,
    ) -> Result<Vec<T>, Error> {
        let (axis, across) = (self.axis(), self.across());
        let rows = (0..across.points.len()).into_par_iter().map(|index| {
            self.map.task.check()?;
            let mut values = self.map.values.to_vec();
            put(&mut values, across, index);
            let member = |cell: usize| {
                let mut values = values.clone();
                put(&mut values, axis, cell);
                self.map.family.at(&values).ok()
            };
            let mut bare = values.clone();
            put_value(&mut bare, axis.parameter, 0.0);
            let parts = self.constant.at(&bare).ok().zip(self.slope.at(&bare).ok());
            work(Members {
                parts: parts.as_ref(),
                points: axis.points,
                member: &member,
                demand: self.map.question.demand,
            })
        });
        rows.collect()
    }

    fn chart(&self) -> Result<Chart, Error> {
        let rows = self.rows()?;
        let [first, second] = self.map.axes;
        let width = second.points.len();
        let mut chart = Chart::stable(first.points.len() * width);
        if self.map.question.abscissa {
            self.fill_cells(&rows, &mut chart, width);
            return Ok(chart);
        }
        let blocks = chart
            .unstable
            .par_chunks_mut(BLOCK * width)
            .zip(chart.status.par_chunks_mut(BLOCK * width));
        blocks.enumerate().for_each(|(block, (unstable, status))| {
            let top = block * BLOCK;
            let lines = unstable.len() / width;
            if self.along == 1 {
                for (line, row) in rows.iter().skip(top).take(lines).enumerate() {
                    for span in &row.spans {
                        let cells = line * width + span.start..line * width + span.end;
                        if span.cell.unstable != 0
                            && let Some(part) = unstable.get_mut(cells.clone())
                        {
                            part.fill(span.cell.unstable);
                        }
                        if span.cell.status != CellStatus::Ok
                            && let Some(part) = status.get_mut(cells)
                        {
                            part.fill(span.cell.status);
                        }
                    }
                }
                return;
            }
            for (column, row) in rows.iter().enumerate() {
                let from = row.spans.partition_point(|span| span.end <= top);
                for span in row.spans.iter().skip(from) {
                    if span.start >= top + lines {
                        break;
                    }
                    let cells = span.start.max(top) - top..span.end.min(top + lines) - top;
                    let places = cells.map(|line| line * width + column);
                    if span.cell.unstable != 0 {
                        for place in places.clone() {
                            if let Some(cell) = unstable.get_mut(place) {
                                *cell = span.cell.unstable;
                            }
                        }
                    }
                    if span.cell.status != CellStatus::Ok {
                        for place in places {
                            if let Some(cell) = status.get_mut(place) {
                                *cell = span.cell.status;
                            }
                        }
                    }
                }
            }
        });
        Ok(chart)
    }
}

impl Rows<'_> {
    /// Counts, abscissas and statuses of rows that know every cell.
    fn fill_cells(&self, rows: &[Row], chart: &mut Chart, width: usize) {
        chart.abscissa = vec![f64::NAN; chart.unstable.len()];
        let lines = chart
            .unstable
            .par_chunks_mut(BLOCK * width)
            .zip(chart.abscissa.par_chunks_mut(BLOCK * width))
            .zip(chart.status.par_chunks_mut(BLOCK * width));
        lines
            .enumerate()
            .for_each(|(block, ((unstable, abscissa), status))| {
                let top = block * BLOCK;
                let height = unstable.len() / width;
                let columns = if self.along == 1 { height } else { width };
                for outer in 0..columns {
                    let (row, cells) = if self.along == 1 {
                        (rows.get(top + outer), 0..width)
                    } else {
                        (rows.get(outer), top..top + height)
                    };
                    for index in cells {
                        let place = if self.along == 1 {
                            outer * width + index
                        } else {
                            (index - top) * width + outer
                        };
                        let cell = row
                            .and_then(|row| row.cells.get(index))
                            .copied()
                            .unwrap_or(Cell::UNDECIDED);
                        if let (Some(a), Some(b), Some(c)) = (
                            unstable.get_mut(place),
                            abscissa.get_mut(place),
                            status.get_mut(place),
                        ) {
                            (*a, *b, *c) = (cell.unstable, cell.abscissa, cell.status);
                        }
                    }
                }
            });
    }
}

fn put(values: &mut [f64], axis: Axis<'_>, index: usize) {
    if let Some(value) = axis.points.get(index) {
        put_value(values, axis.parameter, *value);
    }
}

fn put_value(values: &mut [f64], parameter: usize, value: f64) {
    if let Some(place) = values.get_mut(parameter) {
        *place = value;
    }
}
/// The number of cells, if the arguments make sense.
fn check(family: &Family, values: &[f64], axes: [Axis<'_>; 2]) -> Result<usize, Error> {
    let count = family.names().len();
    let [first, second] = axes;
    if first.parameter == second.parameter || first.parameter.max(second.parameter) >= count {
        return Err(Error::argument(format!(
            "axes along parameters {} and {} of {count}: a map needs two different ones",
            first.parameter, second.parameter
        )));
    }
    let cells = first.points.len().saturating_mul(second.points.len());
    if cells > MAX_CELLS {
        return Err(Error::TooMuch {
            what: "the map",
            limit: MAX_CELLS as u64,
            unit: "cells",
            advice: format!(
                "{} by {} is more than a picture holds: take fewer points, or several maps of \
                 smaller ranges",
                first.points.len(),
                second.points.len()
            ),
        });
    }
    let mut ranges: Vec<(f64, f64)> = values.iter().map(|value| (*value, *value)).collect();
    for Axis { parameter, points } in axes {
        if let Some(point) = points.iter().find(|point| !point.is_finite()) {
            return Err(Error::argument(format!(
                "{point} on an axis: its points must be finite"
            )));
        }
        let low = points.iter().copied().fold(f64::INFINITY, f64::min);
        let high = points.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if let (false, Some(range)) = (points.is_empty(), ranges.get_mut(parameter)) {
            *range = (low, high);
        }
    }
    if cells > 0 {
        family.check_delays(&ranges)?;
    }
    Ok(cells)
}
