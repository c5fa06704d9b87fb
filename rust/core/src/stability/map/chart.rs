//! The arrays of a map, and how its rows fill them.

use crate::parallel;
use crate::stability::crossings::Row;
use crate::status::CellStatus;
use crate::{Error, memory};

/// Lines filled together, so that strided columns stay in the cache.
const BLOCK: usize = 32;

/// A stability map: row-major arrays, the first axis running slowest.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Chart {
    /// See [`Cell::unstable`](crate::stability::Cell::unstable).
    pub unstable: Vec<i32>,
    /// See [`Cell::abscissa`](crate::stability::Cell::abscissa); empty if not asked for.
    pub abscissa: Vec<f64>,
    /// See [`Cell::status`](crate::stability::Cell::status).
    pub status: Vec<CellStatus>,
}

impl Chart {
    /// A map with all counts zero.
    pub(crate) fn stable(cells: usize) -> Result<Self, Error> {
        Ok(Self {
            unstable: memory::filled("the map", 0, cells)?,
            abscissa: Vec::new(),
            status: memory::filled("the map", CellStatus::Ok, cells)?,
        })
    }

    /// Write the results of the rows into lines of the given width, or into columns.
    pub(crate) fn fill(&mut self, rows: &[Row], width: usize, columns: bool) -> Result<(), Error> {
        let blocks = self
            .unstable
            .chunks_mut(BLOCK * width)
            .zip(self.status.chunks_mut(BLOCK * width));
        parallel::each("the map", blocks, |block, (unstable, status)| {
            let top = block * BLOCK;
            let lines = unstable.len() / width;
            // The cells of the row that lie in the block, and where they are in it.
            let shown = if columns {
                rows
            } else {
                rows.get(top..top + lines).unwrap_or_default()
            };
            for (index, row) in shown.iter().enumerate() {
                let (cells, first, stride) = if columns {
                    (top..top + lines, index, width)
                } else {
                    (0..width, index * width, 1)
                };
                let from = row.spans.partition_point(|span| span.end <= cells.start);
                for span in row.spans.iter().skip(from) {
                    if span.start >= cells.end {
                        break;
                    }
                    let part = span.start.max(cells.start)..span.end.min(cells.end);
                    let start = first + (part.start - cells.start) * stride;
                    if span.cell.unstable != 0 {
                        spread(unstable, start, stride, part.len(), span.cell.unstable);
                    }
                    if span.cell.status != CellStatus::Ok {
                        spread(status, start, stride, part.len(), span.cell.status);
                    }
                }
            }
            Ok(())
        })?;
        if rows.iter().any(|row| !row.abscissas.is_empty()) {
            self.fill_abscissas(rows, width, columns)?;
        }
        Ok(())
    }

    fn fill_abscissas(&mut self, rows: &[Row], width: usize, columns: bool) -> Result<(), Error> {
        self.abscissa = memory::filled("the map", f64::NAN, self.unstable.len())?;
        let blocks = self.abscissa.chunks_mut(BLOCK * width);
        parallel::each("the map", blocks, |block, abscissa| {
            let top = block * BLOCK;
            if columns {
                let lines = abscissa.len() / width;
                for (column, row) in rows.iter().enumerate() {
                    let part = row.abscissas.get(top..top + lines).unwrap_or_default();
                    let places = abscissa.iter_mut().skip(column).step_by(width);
                    for (place, value) in places.zip(part) {
                        *place = *value;
                    }
                }
            } else {
                for (line, row) in abscissa.chunks_mut(width).zip(rows.iter().skip(top)) {
                    for (place, value) in line.iter_mut().zip(&row.abscissas) {
                        *place = *value;
                    }
                }
            }
            Ok(())
        })
    }
}

/// The same value in `count` places, `stride` apart.
fn spread<T: Copy>(array: &mut [T], start: usize, stride: usize, count: usize, value: T) {
    let places = array.iter_mut().skip(start).step_by(stride);
    places.take(count).for_each(|place| *place = value);
}
