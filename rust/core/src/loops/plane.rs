//! Maps of a sampled loop over two of its numbers.

use crate::stability::{Boundaries, Chart, Question, Specification, held_boundaries, held_map};
use crate::{Error, Task};

use super::control_loop::{ControlLoop, Place};
use super::held::{HeldRows, Polynomials};

/// A sampled loop of which two numbers vary, in rows that are built once.
#[derive(Debug, Clone)]
pub struct HeldPlane {
    /// The axis along the rows; none where neither is a gain.
    along: Option<usize>,
    rows: HeldRows,
    /// The loops of the middle of all rows, where the number across them is a gain too.
    column: Option<HeldRows>,
    /// The other way round, in that case.
    columns: Option<HeldRows>,
}

impl HeldPlane {
    /// Of a loop over the points of two numbers; `given` finds the polynomials of a plant that is given
    /// by them.
    ///
    /// # Errors
    /// As [`ControlLoop::held_rows`].
    pub fn new(
        of: &ControlLoop,
        axes: [(Place, &[f64]); 2],
        given: &mut Polynomials<'_>,
    ) -> Result<Self, Error> {
        let along = of.along(axes.map(|(place, points)| (place, points.len())));
        let Some(index) = along else {
            let [(first, xs), (second, ys)] = axes;
            let outer: Vec<f64> = xs.iter().flat_map(|x| ys.iter().map(|_| *x)).collect();
            let inner: Vec<f64> = xs.iter().flat_map(|_| ys.iter().copied()).collect();
            let rows = of.held_rows(&[(first, &outer), (second, &inner)], None, given)?;
            return Ok(Self {
                along,
                rows,
                column: None,
                columns: None,
            });
        };
        let (row, across) = (axes[index], axes[1 - index]);
        let rows = of.held_rows(&[across], Some(row), given)?;
        let (column, columns) = if of.is_gain(across.0) {
            let middle = row.1.len() / 2;
            let middle = row.1.get(middle..=middle).unwrap_or_default();
            (
                Some(of.held_rows(&[(row.0, middle)], Some(across), given)?),
                Some(of.held_rows(&[row], Some(across), given)?),
            )
        } else {
            (None, None)
        };
        Ok(Self {
            along,
            rows,
            column,
            columns,
        })
    }

    /// Counts, and abscissas where they are asked for, of all cells.
    ///
    /// # Errors
    /// As [`held_map`].
    pub fn cells(&self, question: Question, task: &Task) -> Result<Chart, Error> {
        let column = self.column.as_ref().map(HeldRows::view);
        let is_first = self.along == Some(0);
        held_map(&self.rows.view(), column.as_ref(), question, is_first, task)
    }

    /// The curves on which poles lie on the edge, along each gain of the axes.
    ///
    /// # Errors
    /// [`Error::Argument`] where neither axis is a gain; as [`held_boundaries`].
    pub fn boundaries(
        &self,
        specification: Specification,
        task: &Task,
    ) -> Result<[Boundaries; 2], Error> {
        let Some(along) = self.along else {
            refuse!(
                "neither axis is a gain, but crossings of a sampled loop can be found only along \
                 a gain of its controller or plant: give a gain as one axis"
            );
        };
        let columns = self.columns.as_ref().map(HeldRows::view);
        let [curves, others] =
            held_boundaries(&self.rows.view(), columns.as_ref(), specification, task)?;
        let of = |along, curves| Boundaries { along, curves };
        Ok([of(along, curves), of(1 - along, others)])
    }
}
