//! All rows of a map: a gain in which the family is affine varies along each, the other parameter from one to
//! the next.

use rayon::prelude::*;

use super::cell::Cell;
use super::crossing::Crossing;
use super::family::Family;
use super::grid::{Axis, Chart, Map, put, put_value};
use super::row::{Members, Row};
use crate::Error;
use crate::status::CellStatus;

/// Lines of a chart filled together, so that strided columns stay in the cache.
const BLOCK: usize = 32;

/// A map whose family is affine in the parameter along its rows.
pub(super) struct Rows<'a> {
    map: &'a Map<'a>,
    /// Index of the axis along the rows.
    pub(super) along: usize,
    constant: Family,
    slope: Family,
}

impl<'a> Rows<'a> {
    /// `None` where the family is affine in neither parameter, or points are in disorder.
    ///
    /// Leading terms that do not vary along a row keep its roots within bounds; with a term without s in
    /// B, a root at 0 crosses within rows, not between them; more cells a row cost less.
    pub(super) fn of(map: &'a Map<'a>) -> Option<Self> {
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

    pub(super) fn axis(&self) -> Axis<'a> {
        let [first, second] = self.map.axes;
        if self.along == 0 { first } else { second }
    }

    fn across(&self) -> Axis<'a> {
        let [first, second] = self.map.axes;
        if self.along == 0 { second } else { first }
    }

    fn rows(&self) -> Result<Vec<Row>, Error> {
        let transect = self.transect()?;
        self.each(|index, members| {
            let members = Members {
                anchor: transect
                    .as_ref()
                    .and_then(|(column, row)| Some((*column, row.cell(index)?))),
                ..members
            };
            let mut row = members.count(self.map.task)?;
            if self.map.question.abscissa {
                row.cells = members.abscissas(&row, self.map.task)?;
            }
            self.map.task.advance(members.points.len() as u64);
            Ok(row)
        })
    }

    pub(super) fn crossings(&self) -> Result<Vec<Vec<Crossing>>, Error> {
        self.each(|_, members| Ok(members.found(self.map.task)?.unwrap_or_default()))
    }

    /// The counts along one column, the middle one, where the family is affine in the other parameter as well: they
    /// anchor all rows.
    fn transect(&self) -> Result<Option<(usize, Row)>, Error> {
        let (axis, across) = (self.axis(), self.across());
        let column = axis.points.len() / 2;
        let Some((constant, slope)) = self.map.family.split(across.parameter) else {
            return Ok(None);
        };
        let mut values = self.map.values.to_vec();
        put(&mut values, axis, column);
        let member = |index: usize| {
            let mut values = values.clone();
            put(&mut values, across, index);
            self.map.family.at(&values).ok()
        };
        let mut bare = values.clone();
        put_value(&mut bare, across.parameter, 0.0);
        let parts = constant.at(&bare).ok().zip(slope.at(&bare).ok());
        let members = Members {
            parts: parts.as_ref().filter(|(_, b)| !b.is_zero()),
            points: across.points,
            member: &member,
            demand: self.map.question.demand,
            anchor: None,
        };
        let sorted = across.points.is_sorted();
        let row = if sorted {
            members.crossed(self.map.task)?
        } else {
            Row::default()
        };
        Ok(Some((column, row)))
    }

    /// Do the same for all rows.
    fn each<T: Send>(
        &self,
        work: impl Fn(usize, Members<'_>) -> Result<T, Error> + Sync,
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
            let members = Members {
                parts: parts.as_ref(),
                points: axis.points,
                member: &member,
                demand: self.map.question.demand,
                anchor: None,
            };
            work(index, members)
        });
        rows.collect()
    }

    pub(super) fn chart(&self) -> Result<Chart, Error> {
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
