//! The rightmost roots of a row: followed from cell to cell, and proved to be the rightmost.
//!
//! A few roots of each cell, with discs, are known from their `branch`es. Counts on vertical lines
//! prove that no root lies further right: the crossings of one line give the counts of the whole
//! row at once (`row`). If the count right of a line equals the number of followed roots there,
//! which must be at least one, these are all the roots, and the largest real part is the abscissa.
//! A line can be used until a root that is not followed crosses it. Where no line can be used, the
//! cell is searched alone, which also finds the roots to follow from there.
//!
//! Along a delay the crossings of a line off the imaginary axis are not known for the whole row. There
//! the roots right of a line are counted in one cell, and the proof that no root crosses it (`boxes`)
//! carries the count on to as many cells as it can.
//!
//! The chains of a neutral equation are the abscissa if no root lies right of a line as close to
//! them as the search in a single cell would go. Roots closer than a few times that distance are
//! left to that search.

use super::branch::{Branches, Root, are_apart};
use super::held;
use super::plane::{DelayOf, Plane};
use crate::memory::reserved;
use crate::order::sort_down;
use crate::quasipoly::QuasiPolynomial;
use crate::roots::{Region, chain_abscissa, chain_margin, rightmost, roots};
use crate::stability::cell::{Cell, judge, with_abscissa};
use crate::stability::crossings::{Delay, Members, Row, Span};
use crate::stability::hold::Hold;
use crate::stability::specification::Specification;
use crate::{Error, Task};

/// Distance behind the first root, in units of one over the longest delay, up to which roots are
/// followed.
const NEARBY: f64 = 1.5;

/// Upper limit on the lines of a row; then its cells are searched alone.
const MAX_LINES: usize = 64;

/// Number of cells on either side that also have to lie left of the chains.
const BESIDE: usize = 2;

/// Roots closer to the chains than this many margins are left to the search in a single cell.
const CLOSE_TO_CHAINS: f64 = 10.0;

/// Least gap between roots, in units of the scale, into which a line is put.
const LEAST_GAP: f64 = 1e-3;

/// Cells for which one proof is tried along a delay: at first, and at most.
const AHEAD: (usize, usize) = (8, 256);

/// Distance of lines, in units of the scale, below which they are the same.
const SAME_LINE: f64 = 1e-6;

/// The counts of a row right of one line.
struct Line {
    sigma: f64,
    row: Row,
}

/// What is known about the rightmost root.
enum Known {
    /// Its real part.
    Isolated(f64),
    /// All roots are left of the chains or approach them.
    Chains,
    Nothing,
}

/// The leading roots of a row, cell after cell.
struct Leading<'a> {
    members: &'a Members<'a>,
    task: &'a Task,
    plane: Plane,
    chain: f64,
    margin: f64,
    /// A length over which roots differ, 1/s.
    scale: f64,
    lines: Vec<Line>,
    /// Index of the line that was used last.
    last: usize,
    branches: Branches,
    /// The roots of the cell, the rightmost first.
    roots: Vec<Root>,
    /// Had the last cell that was searched alone no root right of its chains?
    chains_led: bool,
    /// Cells to try at once along a delay.
    ahead: usize,
}

impl Members<'_> {
    /// All cells of the row with their abscissa; `axis` holds their counts.
    ///
    /// # Errors
    /// [`Error::Interrupted`] alone.
    pub(crate) fn abscissas(&self, axis: &Row, task: &Task) -> Result<Row, Error> {
        let counted = axis
            .spans
            .iter()
            .flat_map(|span| (span.start..span.end).map(|_| span.cell));
        let mut leading = self
            .parts
            .as_ref()
            .and_then(|(a, b)| Leading::new(self, a, b, task));
        let mut cells = reserved("a row of the map", self.points.len())?;
        for (index, cell) in counted.enumerate() {
            task.check()?;
            let known = match &mut leading {
                Some(leading) if leading.lines.len() < MAX_LINES => leading.look(index)?,
                _ => Known::Nothing,
            };
            let chain = leading
                .as_ref()
                .map_or(f64::NEG_INFINITY, |leading| leading.chain);
            cells.push(match known {
                Known::Isolated(abscissa) => with_abscissa(cell, abscissa, chain),
                Known::Chains => with_abscissa(cell, f64::NEG_INFINITY, chain),
                Known::Nothing => match ((self.member)(index), self.hold) {
                    (Some(h), None) => judge(&h, self.specification, true, task)?,
                    (Some(h), Some(hold)) => held::with_abscissa(cell, &h, hold, task)?,
                    (None, _) => Cell::UNDECIDED,
                },
            });
        }
        Row::of(&cells)
    }
}

impl<'a> Leading<'a> {
    /// `None` where the row has no crossings from which to count.
    fn new(
        members: &'a Members<'a>,
        a: &QuasiPolynomial,
        b: &QuasiPolynomial,
        task: &'a Task,
    ) -> Option<Self> {
        // A loop with a hold has no chains, and a delay of lower terms does not change them.
        let hull = match (members.hold, members.delay) {
            (None, None) => Some(members.hull(a, b)?),
            (None, Some(_)) => Some((b.degree() < a.degree()).then(|| a.clone())?),
            (Some(_), _) => None,
        };
        let range = members.points.first().zip(members.points.last());
        let delay = members
            .delay
            .zip(range)
            .map(|(delay, (low, high))| DelayOf {
                slope: delay.slope,
                origin: *low,
                longest: delay.slope * (high - low),
            });
        let span = |h: &QuasiPolynomial| h.delays().last().copied().unwrap_or(0.0);
        let longest = span(a).max(span(b))
            - a.delays()
                .iter()
                .chain(b.delays())
                .copied()
                .fold(f64::INFINITY, f64::min)
            + delay.map_or(0.0, |delay| delay.longest);
        if hull.as_ref().is_some_and(|hull| hull.degree() == 0) || b.is_zero() {
            return None;
        }
        let scale = if longest > 0.0 { 1.0 / longest } else { 1.0 };
        Some(Self {
            members,
            task,
            plane: Plane::new(a, b, members.hold, delay),
            chain: hull.map_or(f64::NEG_INFINITY, |hull| chain_abscissa(&hull)),
            margin: chain_margin(scale),
            scale,
            lines: Vec::new(),
            last: 0,
            branches: Branches::none(),
            roots: Vec::new(),
            chains_led: false,
            ahead: AHEAD.0,
        })
    }

    /// The rightmost root of a cell.
    fn look(&mut self, index: usize) -> Result<Known, Error> {
        let points = self.members.points.get(index..).unwrap_or_default();
        let Some(k) = points.first().copied() else {
            return Ok(Known::Nothing);
        };
        let mut roots = std::mem::take(&mut self.roots);
        // Without the root that is lost the others may lie far to the left, where lines are long.
        let mut known = None;
        if self.branches.advance(&self.plane, points, &mut roots) {
            sort_down(&mut roots, |root| root.s.re);
            known = self.by_lines(index, &roots)?;
        }
        self.roots = roots;
        known.map_or_else(|| self.search(index, k), Ok)
    }

    /// What the lines prove for the cell, if one can be used.
    fn by_lines(&mut self, index: usize, roots: &[Root]) -> Result<Option<Known>, Error> {
        let close = CLOSE_TO_CHAINS * self.margin;
        let Some(first) = roots.first().filter(|root| root.s.re > self.chain - close) else {
            // A line next to the chains is costly: it is counted only where a search has found no
            // root.
            return if self.chains_led {
                self.by_chains(index)
            } else {
                Ok(None)
            };
        };
        if first.s.re < self.chain + close {
            return Ok(Some(Known::Nothing));
        }
        if !are_apart(roots) {
            return Ok(None);
        }
        let known = || Some(Known::Isolated(first.s.re));
        let count = self.lines.len();
        for offset in 0..count {
            let place = (self.last + offset) % count;
            if self.fits(place, index, roots) {
                self.last = place;
                return Ok(known());
            }
        }
        if self.members.delay.is_some() {
            self.lines.clear();
        }
        let Some(sigma) = self.next_line(roots) else {
            return Ok(None);
        };
        match self.members.delay {
            None => self.lay(sigma)?,
            Some(delay) => self.lay_ahead(sigma, index, delay)?,
        }
        let place = self.lines.len() - 1;
        if self.fits(place, index, roots) {
            self.last = place;
            return Ok(known());
        }
        Ok(None)
    }

    /// Are there no roots right of the chains?
    fn by_chains(&mut self, index: usize) -> Result<Option<Known>, Error> {
        if self.chain == f64::NEG_INFINITY || self.members.delay.is_some() {
            return Ok(None);
        }
        let sigma = self.chain + self.margin;
        let place = match self.lines.iter().position(|line| line.sigma == sigma) {
            Some(place) => place,
            None => {
                self.lay(sigma)?;
                self.lines.len() - 1
            }
        };
        // A root between the line and the chains is found by a search in a single cell. It appears
        // or disappears within a few cells.
        let around = index.saturating_sub(BESIDE)
            ..=index
                .saturating_add(BESIDE)
                .min(self.members.points.len() - 1);
        let clear = around
            .into_iter()
            .all(|cell| self.count(place, cell) == Some(0));
        Ok(clear.then_some(Known::Chains))
    }

    fn lay(&mut self, sigma: f64) -> Result<(), Error> {
        let row = self.members.right_of(sigma).crossed(self.task)?;
        self.lines.push(Line { sigma, row });
        Ok(())
    }

    /// Count the roots right of a line in one cell, and prove the same for cells after it.
    fn lay_ahead(&mut self, sigma: f64, index: usize, delay: Delay<'_>) -> Result<(), Error> {
        let mut row = Row::default();
        if let Some(h) = (self.members.member)(index) {
            let cell = judge(&h, Specification::left_of(sigma), false, self.task)?;
            let rest = self.members.points.len() - 1 - index;
            let mut more = self.ahead.min(rest);
            while more > 0 && !delay.by_parts.is_clear(sigma, [index, index + more])? {
                more /= 2;
            }
            self.ahead = (2 * more).clamp(1, AHEAD.1);
            row.spans.push(Span {
                start: index,
                end: index + more + 1,
                cell,
            });
        }
        self.lines.push(Line { sigma, row });
        Ok(())
    }

    fn count(&self, place: usize, index: usize) -> Option<i32> {
        let cell = self.lines.get(place)?.row.cell(index)?;
        Some(cell.unstable)
    }

    /// Are the roots right of a line all there are, and at least one?
    fn fits(&self, place: usize, index: usize, roots: &[Root]) -> bool {
        let Some(sigma) = self.lines.get(place).map(|line| line.sigma) else {
            return false;
        };
        let mut weight = 0;
        for root in roots {
            if root.s.re - root.radius > sigma {
                match root.weight(self.plane.top()) {
                    Some(own) => weight += own,
                    None => return false,
                }
            } else if root.s.re + root.radius >= sigma {
                return false;
            }
        }
        weight > 0 && self.count(place, index) == Some(weight)
    }

    /// A line in the widest gap between the followed roots, left of the first.
    fn next_line(&self, roots: &[Root]) -> Option<f64> {
        let first = roots.first()?.s.re;
        let floor = self.chain + self.margin;
        let mut best: Option<(f64, f64)> = None;
        for pair in roots.windows(2) {
            if let [right, left] = pair {
                let gap = right.s.re - left.s.re;
                if best.is_none_or(|(widest, _)| gap > widest) {
                    best = Some((gap, 0.5 * (right.s.re + left.s.re)));
                }
            }
        }
        let sigma = match best {
            Some((gap, middle)) if gap > LEAST_GAP * self.scale => middle,
            _ => first - 0.5 * self.scale,
        };
        // The further left a line is, the longer it is up to where no root can cross it.
        let sigma = sigma
            .max(0.5 * (floor + first))
            .max(first - NEARBY * self.scale);
        (sigma < first
            && self
                .lines
                .iter()
                .all(|line| (line.sigma - sigma).abs() > SAME_LINE * self.scale))
        .then_some(sigma)
    }

    /// Search the cell alone, and follow the roots that are found.
    fn search(&mut self, index: usize, k: f64) -> Result<Known, Error> {
        self.branches.clear();
        let Some(h) = (self.members.member)(index) else {
            return Ok(Known::Nothing);
        };
        if let Some(hold) = self.members.hold {
            return self.search_held(&h, hold, k);
        }
        let found = match rightmost(&h, 1, self.task) {
            Ok(found) => found,
            Err(error) if error.ends_all() => return Err(error),
            Err(_) => return Ok(Known::Nothing),
        };
        self.chains_led = found.roots.is_empty() && self.chain > f64::NEG_INFINITY;
        let Some(first) = found.roots.first() else {
            return Ok(if self.chains_led {
                Known::Chains
            } else {
                Known::Nothing
            });
        };
        // Roots close behind are followed too, but not the next ones at any distance: next to the
        // chains the search for them does not end.
        let behind = (first.re - NEARBY * self.scale).max(0.5 * (self.chain + first.re));
        let others = match roots(&h, &Region::right_of(behind), self.task) {
            Ok(others) => others,
            Err(error) if error.ends_all() => return Err(error),
            Err(_) => found.clone(),
        };
        let upper = others.roots.iter().filter(|root| root.im >= 0.0);
        // All of them or none: the roots behind a multiple root prove nothing without it.
        self.branches.start(&self.plane, upper.copied(), k);
        Ok(Known::Isolated(first.re))
    }
}

impl Leading<'_> {
    /// The same for a loop with a hold.
    fn search_held(&mut self, h: &QuasiPolynomial, hold: Hold, k: f64) -> Result<Known, Error> {
        let found = held::rightmost(h, hold, self.task)?;
        let Some(first) = found.abscissa.filter(|_| found.is_proved) else {
            return Ok(Known::Nothing);
        };
        let behind = first - NEARBY * self.scale;
        let near = found.roots.iter().take_while(|root| root.re >= behind);
        self.branches.start(&self.plane, near.copied(), k);
        Ok(Known::Isolated(first))
    }
}
