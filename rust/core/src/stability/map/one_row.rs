//! A row of a map whose family need not be affine in its parameter, divided as a `block` of one
//! direction.

use super::axes::Axis;
use super::block::{Block, Grid};
use crate::stability::boxes::{BoxExpansion, Claim, Examined, Range, Reduced, examine};
use crate::stability::crossings::{Row, Span};
use crate::stability::family::Family;
use crate::stability::specification::Specification;
use crate::{Error, Task};

impl<'a> Grid<'a, 1> {
    /// The members along one axis, `values` holding the other parameters.
    pub(crate) fn row(
        family: &'a Family,
        values: &[f64],
        axis: Axis<'a>,
        specification: Specification,
    ) -> Self {
        let reduced = Reduced::new(family, values, &[axis.parameter]);
        let mut row = Self {
            reduced: reduced.with_specification(specification),
            points: [axis.points],
        };
        row.refer_to_middle(&row.whole());
        row
    }

    pub(crate) fn whole(&self) -> Block<1> {
        Block {
            start: [0],
            end: [self.points[0].len()],
        }
    }

    /// The counts of all cells.
    ///
    /// # Errors
    /// [`Error::Interrupted`] alone.
    pub(crate) fn counts(&self, task: &Task) -> Result<Row, Error> {
        let cells = self.cells(self.whole(), task)?;
        let mut spans: Vec<Span> = cells
            .into_iter()
            .map(|(block, cell)| Span {
                start: block.start[0],
                end: block.end[0],
                cell,
            })
            .collect();
        spans.sort_unstable_by_key(|span| span.start);
        Ok(Row {
            spans,
            ..Row::default()
        })
    }

    /// Is it proved that no member from that of one cell to that of another has a root on the edge?
    ///
    /// # Errors
    /// [`Error::Interrupted`] alone.
    pub(crate) fn is_clear(&self, cells: [usize; 2], task: &Task) -> Result<bool, Error> {
        let [low, high] = cells.map(|cell| self.point(&[cell]));
        let claim = Claim {
            range: Range { low, high },
            stretches: None,
        };
        let mut expansion = BoxExpansion::new(&self.reduced);
        let found = examine(&self.reduced, &claim, &mut expansion, task)?;
        Ok(matches!(found, Examined::Clear))
    }
}
