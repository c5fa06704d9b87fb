//! A block of cells of a map, in one or two directions, judged together.
//!
//! Each cell represents the part of the ranges that is closer to it than to its neighbours, so that
//! the parts of neighbours touch. A block is halved, between cells, until no member of a part has a
//! root on the edge of the specification (`prove`), or the part is one cell. Parts without such
//! roots that touch have one count, since roots change sides only through the edge: one cell of
//! each connected set of parts is counted. The remaining single cells along the boundaries are
//! judged alone. A cell that is counted by its part is at least half the distance to its neighbour
//! away from a boundary, except at an end of an axis.

use crate::stability::boxes::{BoxExpansion, Claim, Examined, Range, Reduced, Stretch, examine};
use crate::stability::cell::{Cell, ENDLESS, judge};
use crate::status::CellStatus;
use crate::{Error, Task};

/// Cells from `start` on, up to `end`, in each direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Block<const D: usize> {
    pub(crate) start: [usize; D],
    pub(crate) end: [usize; D],
}

impl<const D: usize> Block<D> {
    fn length(&self, direction: usize) -> usize {
        self.end[direction] - self.start[direction]
    }

    pub(crate) fn cells(&self) -> usize {
        (0..D).map(|direction| self.length(direction)).product()
    }

    fn middle(&self) -> [usize; D] {
        std::array::from_fn(|i| self.start[i] + self.length(i) / 2)
    }

    /// Two halves, along `direction` if the block has several cells in it, otherwise along the
    /// longest side.
    fn halves(&self, direction: Option<usize>) -> Option<[Self; 2]> {
        let direction = direction
            .filter(|direction| self.length(*direction) > 1)
            .or_else(|| (0..D).max_by_key(|direction| self.length(*direction)))?;
        if self.length(direction) < 2 {
            return None;
        }
        let (mut low, mut high) = (*self, *self);
        low.end[direction] = self.middle()[direction];
        high.start[direction] = low.end[direction];
        Some([low, high])
    }

    /// Indices of its cells in an array of the cells of `whole`, which contains the block.
    fn places(&self, whole: &Self) -> impl Iterator<Item = usize> + use<D> {
        let own = *self;
        let whole = *whole;
        (0..own.cells()).map(move |index| {
            let (mut rest, mut place, mut stride) = (index, 0, 1);
            for i in (0..D).rev() {
                let offset = own.start[i] - whole.start[i] + rest % own.length(i);
                rest /= own.length(i);
                place += offset * stride;
                stride *= whole.length(i);
            }
            place
        })
    }
}

/// A family over a grid.
pub(crate) struct Grid<'a, const D: usize> {
    pub(crate) reduced: Reduced<'a, D>,
    /// Points of each axis, in order.
    pub(crate) points: [&'a [f64]; D],
}

/// Cells of a block with the same finding.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Part<const D: usize> {
    pub(crate) block: Block<D>,
    pub(crate) finding: Finding,
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Finding {
    /// No member has a root on the edge.
    Clear,
    /// Infinitely many roots violate the specification.
    Endless,
    /// One cell, with the part of the edge for which nothing is proved.
    Open(Option<Vec<Stretch>>),
}

impl<const D: usize> Grid<'_, D> {
    /// The ranges that the cells of a block represent.
    pub(crate) fn range(&self, block: &Block<D>) -> Range<D> {
        let border = |i: usize, index: usize| {
            let at = |index: usize| self.points[i].get(index).copied();
            let before = index.checked_sub(1).and_then(at);
            match (before, at(index)) {
                (Some(before), Some(after)) => before + 0.5 * (after - before),
                (None, Some(end)) | (Some(end), None) => end,
                (None, None) => f64::NAN,
            }
        };
        Range {
            low: std::array::from_fn(|i| border(i, block.start[i])),
            high: std::array::from_fn(|i| border(i, block.end[i])),
        }
    }

    /// Take delays relative to the one that is the smallest at the middle of the block.
    pub(crate) fn refer_to_middle(&mut self, block: &Block<D>) {
        let centre = self.range(block).centre();
        self.reduced.refer_to_first(&centre);
    }

    /// The values of the varying parameters in a cell.
    pub(crate) fn point(&self, cell: &[usize; D]) -> [f64; D] {
        std::array::from_fn(|i| self.points[i].get(cell[i]).copied().unwrap_or(f64::NAN))
    }

    /// Judge a cell alone.
    ///
    /// # Errors
    /// [`Error::Interrupted`] alone.
    fn judge(&self, cell: &[usize; D], task: &Task) -> Result<Cell, Error> {
        self.judge_at(self.point(cell), task)
    }

    /// The member at some values of the varying parameters.
    ///
    /// # Errors
    /// [`Error::Interrupted`] alone.
    pub(crate) fn judge_at(&self, point: [f64; D], task: &Task) -> Result<Cell, Error> {
        task.check()?;
        let values = self.reduced.values_at(&point);
        match self.reduced.family.at(&values) {
            Ok(h) => judge(&h, self.reduced.specification, false, task),
            Err(_) => Ok(Cell::UNDECIDED),
        }
    }

    /// Divide a block into parts.
    ///
    /// # Errors
    /// [`Error::Interrupted`] alone.
    pub(crate) fn divide(&self, whole: Block<D>, task: &Task) -> Result<Vec<Part<D>>, Error> {
        let mut expansion = BoxExpansion::new(&self.reduced);
        let mut parts = Vec::new();
        let mut waiting = vec![(whole, None)];
        while let Some((block, stretches)) = waiting.pop() {
            let claim = Claim {
                range: self.range(&block),
                stretches,
            };
            let finding = match examine(&self.reduced, &claim, &mut expansion, task)? {
                Examined::Clear => Finding::Clear,
                Examined::Endless => Finding::Endless,
                Examined::Open(direction, left) => {
                    if let Some([low, high]) = block.halves(direction) {
                        waiting.push((high, left.clone()));
                        waiting.push((low, left));
                        continue;
                    }
                    Finding::Open(left)
                }
            };
            parts.push(Part { block, finding });
        }
        Ok(parts)
    }

    /// Judge the cells of a block, by parts with the same finding.
    ///
    /// # Errors
    /// [`Error::Interrupted`] alone.
    pub(crate) fn cells(
        &self,
        whole: Block<D>,
        task: &Task,
    ) -> Result<Vec<(Block<D>, Cell)>, Error> {
        let parts = self.divide(whole, task)?;
        let sets = connected(&parts, &whole);
        let mut anchors: Vec<Option<Cell>> = vec![None; parts.len()];
        let mut cells = Vec::with_capacity(parts.len());
        // The largest part of a set comes first and is counted.
        for (part, set) in parts.iter().zip(&sets) {
            let known = match (&part.finding, anchors.get_mut(*set)) {
                (Finding::Endless, _) => Some(Cell {
                    unstable: ENDLESS,
                    abscissa: f64::NAN,
                    status: CellStatus::Infinite,
                }),
                (Finding::Clear, Some(anchor)) => {
                    if anchor.is_none() {
                        let middle = parts.get(*set).map_or(part.block, |part| part.block);
                        *anchor = Some(self.judge(&middle.middle(), task)?);
                    }
                    anchor.filter(|anchor| anchor.status == CellStatus::Ok)
                }
                _ => None,
            };
            match known {
                Some(cell) => cells.push((part.block, cell)),
                None => self.alone(&part.block, &mut cells, task)?,
            }
        }
        Ok(cells)
    }

    /// Judge every cell of a part alone.
    fn alone(
        &self,
        block: &Block<D>,
        cells: &mut Vec<(Block<D>, Cell)>,
        task: &Task,
    ) -> Result<(), Error> {
        let mut waiting = vec![*block];
        while let Some(block) = waiting.pop() {
            match block.halves(None) {
                Some([low, high]) => waiting.extend([high, low]),
                None => cells.push((block, self.judge(&block.start, task)?)),
            }
        }
        Ok(())
    }
}

/// For every part the index of the largest part that is connected to it by clear parts.
fn connected<const D: usize>(parts: &[Part<D>], whole: &Block<D>) -> Vec<usize> {
    let mut sets: Vec<usize> = (0..parts.len()).collect();
    let is_clear = |index: usize| {
        let part = parts.get(index);
        part.is_some_and(|part| part.finding == Finding::Clear)
    };
    let mut owners = vec![0; whole.cells()];
    for (index, part) in parts.iter().enumerate() {
        for place in part.block.places(whole) {
            if let Some(owner) = owners.get_mut(place) {
                *owner = index;
            }
        }
    }
    let size = |index: usize| parts.get(index).map_or(0, |part| part.block.cells());
    let mut stride = 1;
    for direction in (0..D).rev() {
        let length = whole.length(direction);
        for (place, owner) in owners.iter().enumerate() {
            if place / stride % length + 1 == length {
                continue;
            }
            let Some(next) = owners.get(place + stride).filter(|next| *next != owner) else {
                continue;
            };
            if !(is_clear(*owner) && is_clear(*next)) {
                continue;
            }
            let (one, other) = (root(&mut sets, *owner), root(&mut sets, *next));
            // Of parts of equal size the first is taken, so that the answer is unique.
            let keep = (size(one), other) >= (size(other), one);
            let (large, small) = if keep { (one, other) } else { (other, one) };
            if let Some(set) = sets.get_mut(small) {
                *set = large;
            }
        }
        stride *= length;
    }
    (0..parts.len())
        .map(|index| root(&mut sets, index))
        .collect()
}

/// The representative of a set; paths are shortened on the way.
fn root(sets: &mut [usize], mut index: usize) -> usize {
    while let Some(next) = sets.get(index).copied().filter(|next| *next != index) {
        let beyond = sets.get(next).copied().unwrap_or(next);
        if let Some(set) = sets.get_mut(index) {
            *set = beyond;
        }
        index = next;
    }
    index
}
