//! The counts of a row: equal ones side by side are one span.

use crate::stability::cell::Cell;
use crate::status::CellStatus;
use crate::{Error, memory};

/// What memory is requested for, in errors.
pub(super) const ROW: &str = "a row of the map";

/// Cells with a common count and status.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Span {
    pub(crate) start: usize,
    pub(crate) end: usize,
    pub(crate) cell: Cell,
}

/// Result for a row.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Row {
    /// All cells, in order.
    pub(crate) spans: Vec<Span>,
    /// The abscissa of each cell, where requested.
    pub(crate) abscissas: Vec<f64>,
}

impl Row {
    /// The row of these cells with their abscissas.
    pub(crate) fn of(cells: &[Cell]) -> Result<Self, Error> {
        let mut spans: Vec<Span> = Vec::new();
        let abscissas = cells.iter().map(|cell| cell.abscissa);
        let abscissas = memory::collected(ROW, abscissas)?;
        for (index, cell) in cells.iter().enumerate() {
            let same = |span: &&mut Span| {
                (span.cell.unstable, span.cell.status) == (cell.unstable, cell.status)
            };
            match spans.last_mut().filter(same) {
                Some(span) => span.end = index + 1,
                None => {
                    let span = Span {
                        start: index,
                        end: index + 1,
                        cell: *cell,
                    };
                    memory::push(ROW, &mut spans, span)?;
                }
            }
        }
        Ok(Self { spans, abscissas })
    }

    /// A cell whose count is proved.
    pub(crate) fn cell(&self, index: usize) -> Option<Cell> {
        let place = self.spans.partition_point(|span| span.end <= index);
        let span = self.spans.get(place)?;
        (span.start <= index && span.cell.status == CellStatus::Ok).then_some(span.cell)
    }
}
