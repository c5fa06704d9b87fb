//! One row of a map: a gain k varies, or a delay T (`one_delay`), everything else is fixed.
//!
//! Where the members A + k B have the same leading terms for all k, their violating roots lie
//! within one radius, and their number changes only at crossings of the edge (`crossing`). One
//! proved count is made for each run of cells between crossings whose effect is not known; the
//! other counts follow by addition. Cells within the interval of a crossing, or closer to it than
//! MARGIN, are judged alone, as are all cells of a row for which none of this holds.

use std::ops::Range;

use super::counts::{ROW, Row, Span};
use super::crossing::{Crossing, Varied, crossings};
use super::held;
use super::one_delay::crossings_of_delay;
use super::pencil::{Factor, Pencil, united};
use crate::quasipoly::{Kind, QuasiPolynomial};
use crate::roots::{chain_abscissa, radius_right_of};
use crate::stability::cell::{Cell, UNKNOWN, by_chain, judge};
use crate::stability::hold::Hold;
use crate::stability::specification::Specification;
use crate::status::CellStatus;
use crate::{Error, Task, memory};

/// Cells closer to a crossing than this, relative to the largest |k| of the row, are judged alone,
/// because a separate count of such a cell may be undecided where the crossing decides.
const MARGIN: f64 = 1e-9;

/// How a row depends on a delay.
#[derive(Clone, Copy)]
pub(crate) struct Delay<'a> {
    /// σ > 0.
    pub(crate) slope: f64,
    /// What divides the row where its crossings are not known.
    pub(crate) by_parts: &'a dyn ByParts,
}

/// A row that is divided until no member of a part has a root on the edge.
pub(crate) trait ByParts {
    /// The counts.
    ///
    /// # Errors
    /// [`Error::Interrupted`] alone.
    fn counts(&self) -> Result<Row, Error>;

    /// The crossings.
    ///
    /// # Errors
    /// [`Error::Interrupted`] alone.
    fn crossings(&self) -> Result<Vec<Crossing>, Error>;

    /// Is it proved that no member has a root on a vertical line, for any T from that of the first to
    /// that of the second cell?
    ///
    /// # Errors
    /// [`Error::Interrupted`] alone.
    fn is_clear(&self, line: f64, cells: [usize; 2]) -> Result<bool, Error>;
}

/// A row of members A + k B, or A + e^(−s σ (T − T₀)) B.
#[derive(Clone, Copy)]
pub(crate) struct Members<'a> {
    /// A and B; `None` where a coefficient overflows.
    pub(crate) parts: Option<&'a (QuasiPolynomial, QuasiPolynomial)>,
    /// Given where a delay T varies; T₀ is the first point.
    pub(crate) delay: Option<Delay<'a>>,
    /// The values of k, or of T, increasing.
    pub(crate) points: &'a [f64],
    /// The member of a cell; `None` where it cannot be formed.
    pub(crate) member: &'a dyn Fn(usize) -> Option<QuasiPolynomial>,
    /// The specification whose violating roots are counted.
    pub(crate) specification: Specification,
    /// The index of a cell whose count is already known, and that cell.
    pub(crate) anchor: Option<(usize, Cell)>,
    /// The hold whose variable the polynomials are in, if there is one.
    pub(crate) hold: Option<Hold>,
}

impl Members<'_> {
    /// Counts of all cells.
    ///
    /// # Errors
    /// [`Error::Interrupted`] alone.
    pub(crate) fn count(&self, task: &Task) -> Result<Row, Error> {
        let Some((a, b)) = self.parts else {
            return self.alone(task);
        };
        if b.is_zero() {
            // All members are the same.
            let cell = self.judge(0, task)?;
            return Ok(self.uniform(cell));
        }
        let affine = self.hold.is_none() && self.delay.is_none();
        let chains = affine.then(|| self.hull(a, b)).flatten();
        if let Some(cell) = chains.and_then(|hull| self.led_by_chains(&hull)) {
            return Ok(self.uniform(cell));
        }
        match (self.crossings(a, b, task)?, self.delay) {
            (Some(crossings), _) => self.between(&crossings, task),
            // Next to chains boundaries are denser than cells.
            (None, Some(delay)) if matches!(a.kind(), Kind::Polynomial | Kind::Retarded) => {
                delay.by_parts.counts()
            }
            (None, _) => self.alone(task),
        }
    }

    /// All cells with the same result.
    fn uniform(&self, cell: Cell) -> Row {
        let end = self.points.len();
        Row {
            spans: vec![Span {
                start: 0,
                end,
                cell,
            }],
            ..Row::default()
        }
    }

    /// Every member has the chains of the hull, whose leading terms it shares. If these chains
    /// decide, they decide for all members.
    fn led_by_chains(&self, hull: &QuasiPolynomial) -> Option<Cell> {
        let (unstable, status) =
            by_chain(hull, chain_abscissa(hull), self.specification.leftmost())?;
        Some(Cell {
            unstable,
            abscissa: f64::NAN,
            status,
        })
    }

    /// The same members, with the roots right of `line` counted.
    pub(crate) fn right_of(self, line: f64) -> Self {
        Self {
            specification: Specification::left_of(line),
            anchor: None,
            ..self
        }
    }

    /// The counts as far as crossings give them; no spans where they do not.
    ///
    /// # Errors
    /// [`Error::Interrupted`] alone.
    pub(crate) fn crossed(&self, task: &Task) -> Result<Row, Error> {
        match self.found(task)? {
            Some(crossings) => self.between(&crossings, task),
            None => Ok(Row::default()),
        }
    }

    fn range(&self) -> Option<(f64, f64)> {
        self.points
            .first()
            .copied()
            .zip(self.points.last().copied())
    }

    /// [`hull`] of the members.
    pub(crate) fn hull(&self, a: &QuasiPolynomial, b: &QuasiPolynomial) -> Option<QuasiPolynomial> {
        hull(a, b, self.range()?)
    }

    /// Every cell judged alone.
    pub(crate) fn alone(&self, task: &Task) -> Result<Row, Error> {
        let mut row = Row::default();
        self.judge_all(0..self.points.len(), &mut row.spans, task)?;
        Ok(row)
    }

    /// All crossings of the row by ω; `None` where they do not decide.
    ///
    /// # Errors
    /// [`Error::Interrupted`] alone.
    pub(crate) fn found(&self, task: &Task) -> Result<Option<Vec<Crossing>>, Error> {
        match self.parts {
            Some((a, b)) => self.crossings(a, b, task),
            None => Ok(None),
        }
    }

    /// The same as [`found`](Self::found), for known A and B.
    fn crossings(
        &self,
        a: &QuasiPolynomial,
        b: &QuasiPolynomial,
        task: &Task,
    ) -> Result<Option<Vec<Crossing>>, Error> {
        if let Some((range, hold)) = self.range().zip(self.hold) {
            return held::crossings(a, b, self.specification, hold, range, task);
        }
        if let Some((range, delay)) = self.range().zip(self.delay) {
            let on_axis = self.specification == Specification::default();
            return if on_axis {
                crossings_of_delay(a, b, delay.slope, range, task)
            } else {
                Ok(None)
            };
        }
        let Some((range, hull)) = self.range().zip(self.hull(a, b)) else {
            return Ok(None);
        };
        // Where chains are rightmost, or may be, every cell is judged alone.
        let leftmost = self.specification.leftmost();
        if chain_abscissa(&hull) >= leftmost {
            return Ok(None);
        }
        let Some(radius) = radius_right_of(&hull, leftmost).filter(|radius| *radius > 0.0) else {
            return Ok(None);
        };
        let mut all = Vec::new();
        for (index, piece) in self.specification.pieces().into_iter().enumerate() {
            let length = piece.length.min(piece.within(radius));
            if length <= 0.0 {
                break;
            }
            let Some(pencil) = Pencil::new(a, b, piece, Factor::Gain, None) else {
                return Ok(None);
            };
            match crossings(&pencil, index == 0, length, Varied::Gain(range), task)? {
                Some(found) => all.extend(found),
                None => return Ok(None),
            }
        }
        Ok(Some(all))
    }

    /// Cells from the crossings between them.
    fn between(&self, crossings: &[Crossing], task: &Task) -> Result<Row, Error> {
        let windows = self.windows(crossings);
        // The cells between the windows, and the jump to the next window.
        let mut free: Vec<(usize, usize, Option<i32>)> = Vec::with_capacity(windows.len() + 1);
        let mut start = 0;
        for window in &windows {
            free.push((start, window.from, window.jump));
            start = window.to;
        }
        free.push((start, self.points.len(), None));
        let mut spans = Vec::with_capacity(2 * free.len());
        let mut rest = free.as_slice();
        let mut gaps = windows.iter();
        while !rest.is_empty() {
            let linked = rest
                .iter()
                .take_while(|(_, _, jump)| jump.is_some())
                .count();
            let (run, others) = rest.split_at((linked + 1).min(rest.len()));
            rest = others;
            let cells = self.anchored(run, task)?;
            for (part, cell) in run.iter().zip(cells) {
                let (start, end, _) = *part;
                match cell {
                    Some(cell) if end > start => spans.push(Span { start, end, cell }),
                    _ => self.judge_all(start..end, &mut spans, task)?,
                }
                let Some(window) = gaps.next() else {
                    continue;
                };
                for start in window.from..window.to {
                    task.check()?;
                    let known = cell.and_then(|cell| self.beside_zero(window, cell, start));
                    let cell = known.map_or_else(|| self.judge(start, task), Ok)?;
                    let end = start + 1;
                    memory::push(ROW, &mut spans, Span { start, end, cell })?;
                }
            }
        }
        Ok(Row {
            spans,
            ..Row::default()
        })
    }

    /// A cell next to a crossing of s = 0, by the sign of h(0): as h(0)/B(0) = k − k₀ grows past
    /// zero, the count changes by the jump. `below` is the cell before.
    fn beside_zero(&self, window: &Window, below: Cell, index: usize) -> Option<Cell> {
        // With a hold the constants are sums that carry rounding.
        let exact = window.rises_at_zero.is_some() && self.hold.is_none();
        let jump = window.jump.filter(|_| exact)?;
        let h = (self.member)(index)?;
        let constants = h.coefficients().iter().filter_map(|row| row.first());
        let mut constants = constants.filter(|c| **c != 0.0);
        let sum =
            constants.next().copied().unwrap_or(0.0) + constants.next().copied().unwrap_or(0.0);
        // The rounded sum of two numbers has the sign of their sum; the rounded sum of more numbers
        // may not.
        if constants.next().is_some() {
            return None;
        }
        if sum == 0.0 {
            return Some(Cell {
                unstable: UNKNOWN,
                status: CellStatus::Boundary,
                ..below
            });
        }
        let above = (sum > 0.0) == window.rises_at_zero?;
        Some(Cell {
            unstable: below.unstable + if above { jump } else { 0 },
            ..below
        })
    }

    /// Cells too close to a crossing to be separated from it; windows without a cell between them
    /// are merged.
    fn windows(&self, crossings: &[Crossing]) -> Vec<Window> {
        let largest = self.points.iter().fold(0.0, |most, k| k.abs().max(most));
        let margin = MARGIN * largest;
        let mut windows: Vec<Window> = crossings
            .iter()
            .map(|crossing| Window {
                from: self.points.partition_point(|k| *k < crossing.low - margin),
                to: self
                    .points
                    .partition_point(|k| *k <= crossing.high + margin),
                jump: crossing.jump,
                rises_at_zero: crossing.slope_at_zero.map(|slope| slope > 0.0),
            })
            .collect();
        windows.sort_unstable_by_key(|window| (window.from, window.to));
        windows.dedup_by(|next, last| {
            let merge = next.from <= last.to;
            if merge {
                last.to = last.to.max(next.to);
                last.jump = last.jump.zip(next.jump).map(|(a, b)| a + b);
                last.rises_at_zero = None;
            }
            merge
        });
        windows
    }

    /// The cell of each part of a run whose jumps are known, from one count in the longest part.
    fn anchored(
        &self,
        run: &[(usize, usize, Option<i32>)],
        task: &Task,
    ) -> Result<Vec<Option<Cell>>, Error> {
        let longest = run
            .iter()
            .enumerate()
            .max_by_key(|(_, (start, end, _))| end - start);
        let Some((place, (start, end, _))) = longest.filter(|(_, (start, end, _))| end > start)
        else {
            return Ok(vec![None; run.len()]);
        };
        let within = |(index, _): &(usize, Cell)| {
            run.iter()
                .position(|(start, end, _)| (*start..*end).contains(index))
        };
        let known = self
            .anchor
            .and_then(|known| within(&known).zip(Some(known.1)));
        let (place, anchor) = match known {
            Some(known) => known,
            None => (place, self.judge(start + (end - start) / 2, task)?),
        };
        if anchor.status != CellStatus::Ok {
            return Ok(vec![None; run.len()]);
        }
        let jump = |part: &(usize, usize, Option<i32>)| part.2.unwrap_or(0);
        let before: i32 = run.iter().take(place).map(jump).sum();
        let mut unstable = anchor.unstable - before;
        let cells = run.iter().map(|part| {
            let cell = Cell { unstable, ..anchor };
            unstable += jump(part);
            // A negative count would contradict the proofs: such cells are counted one by one.
            (cell.unstable >= 0).then_some(cell)
        });
        Ok(cells.collect())
    }

    fn judge(&self, index: usize, task: &Task) -> Result<Cell, Error> {
        match (self.member)(index) {
            Some(h) => match self.hold {
                None => judge(&h, self.specification, false, task),
                Some(hold) => held::count(&h, self.specification, hold, task),
            },
            None => Ok(Cell::UNDECIDED),
        }
    }

    fn judge_all(
        &self,
        cells: Range<usize>,
        spans: &mut Vec<Span>,
        task: &Task,
    ) -> Result<(), Error> {
        for start in cells {
            task.check()?;
            let cell = self.judge(start, task)?;
            let end = start + 1;
            memory::push(ROW, spans, Span { start, end, cell })?;
        }
        Ok(())
    }
}

/// Cells whose count is not known from the crossings, and the change of the count across all of
/// them.
struct Window {
    from: usize,
    to: usize,
    jump: Option<i32>,
    /// If the only crossing is a root at s = 0: does h(0) grow with k?
    rises_at_zero: Option<bool>,
}

/// A quasi-polynomial whose coefficients are in modulus the largest of all members, those of the
/// leading term the smallest; `None` where the members do not share their leading terms.
fn hull(a: &QuasiPolynomial, b: &QuasiPolynomial, range: (f64, f64)) -> Option<QuasiPolynomial> {
    let degree = a.degree();
    let rows = united(a, b);
    let first = rows.first().map_or(0.0, |row| row.0);
    let (mut delays, mut sizes) = (Vec::new(), Vec::new());
    for (delay, a, b) in rows {
        let length = a.len().max(b.len());
        let mut row = Vec::with_capacity(length);
        for power in 0..length {
            let at = |row: &[f64]| row.get(power).copied().unwrap_or(0.0);
            let (constant, slope) = (at(&a), at(&b));
            let ends = [range.0, range.1].map(|k| constant + k * slope);
            let largest = ends[0].abs().max(ends[1].abs());
            if power < degree {
                // Each end has three rounding errors.
                row.push(
                    largest * (1.0 + 4.0 * f64::EPSILON) + 4.0 * f64::EPSILON * constant.abs(),
                );
            } else if slope == 0.0 {
                row.push(constant.abs());
            } else if delay == first && power == degree && ends[0] * ends[1] > 0.0 {
                row.push(
                    ends[0].abs().min(ends[1].abs()) * (1.0 - 4.0 * f64::EPSILON)
                        - 4.0 * f64::EPSILON * constant.abs(),
                );
            } else {
                return None;
            }
        }
        delays.push(delay);
        sizes.push(row);
    }
    let hull = QuasiPolynomial::new(sizes, delays).ok()?;
    let leads = hull.degree() == degree && !matches!(hull.kind(), Kind::Advanced);
    // If a leading term varies, the equation must be retarded for all members.
    let varies = b.degree() >= degree;
    (leads && !(varies && hull.kind() != Kind::Retarded && hull.kind() != Kind::Polynomial))
        .then_some(hull)
}
