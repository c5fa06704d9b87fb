//! Vertical lines with a known number of roots to their right, in search of the rightmost roots.
//!
//! Newton's iteration from the points where a line comes closest to a root determines the next
//! line: just left of the roots wanted. Where it finds nothing, the lines move to the left, by
//! growing steps that never reach the chains of a neutral equation or a line that could not be
//! counted, and back by bisection. A first line that cannot be counted is moved to the right.
//! One search with one state: its steps are not used elsewhere, so they share a file.

use std::f64::consts::PI;

use num_complex::Complex64;

use super::all_roots::locate;
use super::isolate::{Search, Seek};
use super::starts::tropical_roots;
use crate::order::sort_down;
use crate::quasipoly::QuasiPolynomial;
use crate::roots::counting::{Cell, MAX_EVALUATIONS, Walker, close, dominance, half_plane};
use crate::roots::disc::Disc;
use crate::roots::region::Region;
use crate::{Error, Task};

/// Upper limit on the lines tried.
const MAX_LINES: usize = 400;

/// Upper limit on the lines abandoned because a cluster reaches across them.
const MAX_EVASIONS: u32 = 20;

/// Distance from the chains, in units of one over the longest delay, below which a line counts as
/// being on them. A smaller one finds roots closer to the chains and costs more.
const CHAIN_MARGIN: f64 = 1e-4;

/// Distance from the chains, in the same unit, below which roots are not distinguished from them.
/// If no line this close could be counted, the result is an error.
const NEAR_CHAINS: f64 = 1e-3;

/// Distance from the chains, in the margin, below which no line is put beside a root.
const ON_CHAINS: f64 = 0.1;

/// Evaluations after which the first line is abandoned, because lines very close to the chains cost
/// without bound. Each later line may cost half as much, but at least the second number.
const EVALUATIONS_PER_LINE: u64 = 2_000_000;
const LEAST_PER_LINE: u64 = 100_000;

/// Least shift of a first line on which a root lies, as a share of one over the longest delay. A
/// line right beside the root would cost more evaluations.
const ASIDE: f64 = 1e-3;

/// Largest shift, in the same unit. A line that has to be moved further meets something other than
/// a root.
const MOST_ASIDE: f64 = 1e6;

/// Shifts of a line before double-double arithmetic is used on it.
const IN_DOUBLES: u32 = 4;

/// Upper limit on the shifts of a line.
const MAX_ASIDE: u32 = 20;

/// Lines abandoned before the search ends with what it has: next to chains nothing more can be
/// known; without chains a root must still be found.
const MAX_GIVEN_UP: [u32; 2] = [3, 8];

/// Upper limit on moves to the right of a first line that cannot be counted.
const MAX_MOVES: u32 = 6;

/// Newton iterations started from a line, in addition to two for every root wanted.
const MORE_STARTS: usize = 12;

/// Share of the distance to the chains, or to an abandoned line, that the next line keeps.
const APPROACH: f64 = 0.2;

/// The same without chains, where a root may be anywhere in between.
const SLOW_APPROACH: f64 = 0.7;

/// Position of a line between a root and the chains, or the next root, as a share of the distance.
const CLEARANCE: f64 = 0.3;

/// Relative distance of two lines at which the search between them ends.
const CLOSE_LINES: f64 = 1e-3;

/// A line is accepted with at most this many times the wanted roots, plus the second number.
const ENOUGH: [u64; 2] = [4, 16];

/// Factor on the clearance for every abandoned line.
const CLOSER: f64 = 0.1;

/// Least shift of a line relative to its real part.
const LEAST_MOVE: f64 = 1e-12;

/// The distance from the chains at which the search ends. `step` is one over the longest delay.
pub(crate) fn chain_margin(step: f64) -> f64 {
    CHAIN_MARGIN * step
}

/// Is the line Re s = `sigma` so close to the chains that roots in between are not distinguished
/// from them? `step` is one over the longest delay.
pub(crate) fn is_beside_chains(sigma: f64, chain: f64, step: f64) -> bool {
    sigma - chain <= NEAR_CHAINS * step
}

/// The error for the case that no root lies right of `sigma`, but that line is not close to the
/// chains.
pub(crate) fn between_lines(sigma: f64, chain: f64) -> Error {
    Error::TooMuch {
        what: "the search for the rightmost root",
        limit: EVALUATIONS_PER_LINE,
        unit: "evaluations on a line",
        advice: format!(
            "no root lies right of Re s = {sigma:.6}. The roots between this line and the chains \
             at Re s = {chain:.6} could not be counted. Use count with both ends of im, or make \
             almost equal delays equal"
        ),
    }
}

/// Limits on the work for one line.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Effort {
    /// Evaluations after which the line is abandoned.
    pub(crate) limit: u64,
    /// Is double-double arithmetic used where double precision does not separate a value from zero?
    /// A line meets such points only next to roots, and usually another line can be taken.
    pub(crate) double_double: bool,
}

/// The operations on a function that the search for rightmost roots needs.
pub(crate) trait Spectrum {
    type Walker<'a>: Seek
    where
        Self: 'a;

    /// A walker that returns an error after `limit` evaluations.
    fn walker<'a>(&'a self, task: &'a Task, limit: u64) -> Self::Walker<'a>;

    /// The number of roots right of Re s = `sigma` and the hints found along that line, within the
    /// limits of `effort`.
    fn line(&self, sigma: f64, effort: Effort, task: &Task)
    -> Result<(u64, Vec<Complex64>), Error>;

    /// Points near which roots may lie that no line comes close to.
    fn far_starts(&self) -> Vec<Complex64>;

    /// The upper half of a rectangle with all roots right of Re s = `sigma`, if there are any.
    fn cell_right_of<'a>(
        &'a self,
        walker: &mut Self::Walker<'a>,
        sigma: f64,
    ) -> Result<Option<Cell>, Error>;
}

impl Spectrum for QuasiPolynomial {
    type Walker<'a> = Walker<'a>;

    fn walker<'a>(&'a self, task: &'a Task, limit: u64) -> Walker<'a> {
        Walker::with_limit(self, task, limit)
    }

    fn line(
        &self,
        sigma: f64,
        effort: Effort,
        task: &Task,
    ) -> Result<(u64, Vec<Complex64>), Error> {
        let mut walker = self.walker(task, effort.limit);
        if !effort.double_double {
            walker.keep_to_doubles();
        }
        let count = half_plane(&mut walker, sigma)?;
        Ok((count, walker.hints))
    }

    fn far_starts(&self) -> Vec<Complex64> {
        let degree = self.degree();
        let leading = self.coefficients().iter();
        leading
            .filter(|row| row.len() > degree)
            .flat_map(|row| tropical_roots(row))
            .collect()
    }

    fn cell_right_of<'a>(
        &'a self,
        walker: &mut Walker<'a>,
        sigma: f64,
    ) -> Result<Option<Cell>, Error> {
        let Some(closed) = close(self, &Region::right_of(sigma), dominance)? else {
            return Ok(None);
        };
        let height = closed.symmetric.unwrap_or(0.0);
        Cell::new(walker, closed.re, (0.0, height), true).map(Some)
    }
}

/// A line with the number of roots to its right.
#[derive(Debug, Clone)]
pub(crate) struct Line {
    pub(crate) sigma: f64,
    pub(crate) count: u64,
    pub(crate) hints: Vec<Complex64>,
}

/// The search state: lines whose count is known.
pub(crate) struct Lines<'a, S: Spectrum> {
    spectrum: &'a S,
    task: &'a Task,
    /// Discs found from the hints of all lines, in no order.
    known: Vec<Disc>,
    chain: f64,
    /// The chains, or the rightmost line that could not be counted.
    barrier: f64,
    given_up: u32,
    /// How often the first line was moved to the right, and the error that was the first reason.
    moved: u32,
    refused: Option<Error>,
    /// Upper limit on the evaluations of the next line.
    limit: u64,
    /// Least distance to the barrier.
    margin: f64,
    /// One over the longest delay.
    first_step: f64,
    step: f64,
    start: f64,
    evasions: u32,
    /// The leftmost line with too few roots.
    few: Option<Line>,
    /// The rightmost line with enough of them.
    enough: Option<Line>,
}

impl<'a, S: Spectrum> Lines<'a, S> {
    pub(crate) fn new(spectrum: &'a S, chain: f64, task: &'a Task) -> Self {
        let step = 1.0 / spectrum.walker(task, MAX_EVALUATIONS).delay_span();
        let start = if chain < 0.0 { 0.0 } else { chain + step };
        Self {
            spectrum,
            task,
            known: Vec::new(),
            chain,
            barrier: chain,
            given_up: 0,
            moved: 0,
            refused: None,
            limit: EVALUATIONS_PER_LINE,
            margin: chain_margin(step),
            first_step: step,
            step,
            start,
            evasions: 0,
            few: None,
            enough: None,
        }
    }

    /// One over the longest delay.
    pub(crate) fn step_of_delays(&self) -> f64 {
        self.first_step
    }

    pub(crate) fn sort_in(&mut self, line: Line, wanted: u64) {
        if line.count < wanted {
            self.few = Some(line);
        } else {
            self.enough = Some(line);
        }
    }

    /// Was the line moved at least as far right as one that is known to have too few roots?
    fn is_behind(&self, line: &Line, wanted: u64) -> bool {
        let known = self.few.as_ref();
        line.count < wanted && known.is_some_and(|few| few.sigma <= line.sigma)
    }

    /// Discard `line` and continue with one further left. `false` when that was done too often or
    /// would lead onto the chains.
    pub(crate) fn evade(&mut self, line: &Line, distance: f64) -> bool {
        self.evasions += 1;
        self.start = line.sigma - 2.0 * distance * f64::from(self.evasions);
        self.few = None;
        self.enough = None;
        self.start > self.chain && self.evasions < MAX_EVASIONS
    }

    /// A line with at least `wanted` roots to its right, and not many more if that is cheap. With
    /// fewer roots, and `true`, where no line further left can be counted.
    pub(crate) fn find(&mut self, wanted: u64) -> Result<(Line, bool), Error> {
        if let Some(line) = self.enough.take_if(|line| line.count < wanted) {
            self.few = Some(line);
        }
        for _ in 0..MAX_LINES {
            self.task.check()?;
            let sigma = match (&self.few, &self.enough) {
                (None, None) => self.start,
                (Some(few), None) => {
                    let few = few.clone();
                    let [beside_chains, without] = MAX_GIVEN_UP;
                    let free = self.chain == f64::NEG_INFINITY;
                    let most = if free { without } else { beside_chains };
                    if few.sigma - self.barrier <= self.margin || self.given_up >= most {
                        return Ok((few, true));
                    }
                    let ahead = few.sigma - self.step;
                    match self.beyond_known_roots(&few, wanted)? {
                        // Further left there may be many roots for which there is no hint.
                        Some(sigma) if sigma >= ahead => sigma,
                        _ => {
                            self.step *= 1.5;
                            // The line never moves onto the barrier, only most of the way. The cost
                            // of a line is inversely proportional to its distance, so that halving
                            // the distance would double it.
                            let share = if free { SLOW_APPROACH } else { APPROACH };
                            let kept = share * (few.sigma - self.barrier);
                            ahead.max(self.barrier + kept.max(0.99 * self.margin))
                        }
                    }
                }
                (few, Some(enough)) => {
                    let right = few.as_ref().map_or(f64::INFINITY, |few| few.sigma);
                    let gap = right - enough.sigma;
                    if enough.count <= ENOUGH[0] * wanted + ENOUGH[1]
                        || gap <= CLOSE_LINES * enough.sigma.abs()
                    {
                        return Ok((enough.clone(), false));
                    }
                    let step = self.step.min(0.5 * gap);
                    self.step *= if gap.is_finite() { 1.0 } else { 2.0 };
                    enough.sigma + step
                }
            };
            match self.counted(sigma) {
                Ok(line) if self.is_behind(&line, wanted) => {
                    self.given_up += 1;
                    self.barrier = self.barrier.max(sigma);
                }
                Ok(line) => self.sort_in(line, wanted),
                // The line is too close to the chains, or too far left for double precision.
                Err(error @ (Error::TooMuch { .. } | Error::Argument(_)))
                    if self.enough.is_none() =>
                {
                    if matches!(error, Error::TooMuch { .. }) {
                        self.limit = (self.limit / 2).max(LEAST_PER_LINE);
                    }
                    if self.few.is_some() {
                        self.given_up += 1;
                    } else if self.moved < MAX_MOVES {
                        // Further right the delayed terms are smaller.
                        self.start = sigma + self.first_step * f64::from(1u32 << (2 * self.moved));
                        self.moved += 1;
                        self.refused.get_or_insert(error);
                    } else {
                        return Err(error);
                    }
                    self.barrier = self.barrier.max(sigma);
                }
                Err(error) => return Err(error),
            }
        }
        // The error of the first line is more informative than the number of lines tried.
        Err(self.refused.take().unwrap_or(Error::TooMuch {
            what: "the search for a line right of which the rightmost roots lie",
            limit: MAX_LINES as u64,
            unit: "lines",
            advice: "give a smaller number of roots, or a region".into(),
        }))
    }

    /// A line just left of the `wanted` rightmost roots, as far as the hints of a line show them:
    /// right of the next root and of the barrier, and left of `line` itself.
    fn beyond_known_roots(&mut self, line: &Line, wanted: u64) -> Result<Option<f64>, Error> {
        let mut starts = line.hints.clone();
        sort_down(&mut starts, |start| start.re);
        starts.truncate(
            usize::try_from(2 * wanted)
                .unwrap_or(0)
                .saturating_add(MORE_STARTS),
        );
        self.learn(&starts, u64::MAX, f64::NEG_INFINITY)?;
        if self.given_up > 0 {
            self.learn(&self.low_starts(line.sigma), u64::MAX, f64::NEG_INFINITY)?;
        }
        sort_down(&mut self.known, |disc| disc.center.re);
        let mut total = 0;
        let mut places = self.known.iter().skip_while(|disc| {
            total += disc.weight();
            total < wanted
        });
        let Some(last) = places.next() else {
            return Ok(None);
        };
        let edge = last.center.re - last.radius;
        // Roots with the same real part, such as a pair that is listed twice, do not count as next.
        let next = places
            .map(|disc| disc.center.re + disc.radius)
            .find(|right| *right < edge)
            .unwrap_or(f64::NEG_INFINITY);
        let free = edge - next.max(self.barrier);
        // The more lines were abandoned, the closer to the root the next one is.
        let share = (0..self.given_up).fold(CLEARANCE, |share, _| CLOSER * share);
        let sigma = edge - (share * free).min(self.step);
        let further = line.sigma - sigma > CLOSE_LINES * self.margin;
        // A line on the chains would cost without bound, and a root further right may be unknown.
        let free_of_chains = sigma - self.chain > ON_CHAINS * self.margin;
        Ok((sigma > self.barrier && free_of_chains && further).then_some(sigma))
    }

    /// Points near the lower end of a line, for which there may be no hints: where one row
    /// dominates, the line is not followed in short steps, and only the first hints, those at large
    /// |Im s|, are kept.
    fn low_starts(&self, sigma: f64) -> Vec<Complex64> {
        let spacing = 0.5 * PI * self.first_step;
        (0..MORE_STARTS)
            .map(|k| Complex64::new(sigma, k as f64 * spacing))
            .collect()
    }

    /// Apply Newton's iteration to the hints until the discs right of `sigma` add up to `count`.
    fn learn(&mut self, hints: &[Complex64], count: u64, sigma: f64) -> Result<(), Error> {
        let mut walker = self.spectrum.walker(self.task, MAX_EVALUATIONS);
        let mut search = Search::with(&mut walker, std::mem::take(&mut self.known));
        for hint in hints {
            if search.weight_right_of(sigma) >= count {
                break;
            }
            if search.knows(*hint) {
                continue;
            }
            search.iterate_from(&[*hint], |s| s.is_finite())?;
        }
        self.known = search.found().to_vec();
        Ok(())
    }

    /// Discs, Im ≥ 0, that hold all the roots right of a line: the given one, or one further right
    /// with at least `n` discs where not all roots of the given one are found.
    pub(crate) fn discs_right_of(
        &mut self,
        line: &Line,
        n: usize,
    ) -> Result<(Vec<Disc>, f64), Error> {
        let (right, left): (Vec<_>, Vec<_>) = line
            .hints
            .iter()
            .copied()
            .partition(|hint| hint.re > line.sigma);
        let (low, far) = (self.low_starts(line.sigma), self.spectrum.far_starts());
        for starts in [right, left, low, far] {
            self.learn(&starts, line.count, line.sigma)?;
            if let Some(discs) = self.known_right_of(line) {
                return Ok((discs, line.sigma));
            }
        }
        if let Some(sigma) = self.beside_the_first(n).filter(|sigma| *sigma > line.sigma)
            && let Ok(nearer) = self.counted(sigma)
            && let Some(discs) = self.known_right_of(&nearer)
            && discs.len() >= n
        {
            return Ok((discs, nearer.sigma));
        }
        let discs = half_plane_discs(self.spectrum, line.sigma, self.task)?;
        self.known.clone_from(&discs);
        Ok((discs, line.sigma))
    }

    /// The known discs right of a line, if they hold all the roots there.
    fn known_right_of(&self, line: &Line) -> Option<Vec<Disc>> {
        let right = |disc: &&Disc| disc.center.re - disc.radius > line.sigma;
        let discs: Vec<Disc> = self.known.iter().filter(right).copied().collect();
        (discs.iter().map(Disc::weight).sum::<u64>() == line.count).then_some(discs)
    }

    /// A line left of the first `n` known discs and right of the next one.
    fn beside_the_first(&mut self, n: usize) -> Option<f64> {
        sort_down(&mut self.known, |disc| disc.center.re);
        let edge = self
            .known
            .get(..n)?
            .iter()
            .map(|disc| disc.center.re - disc.radius)
            .fold(f64::INFINITY, f64::min);
        let next = self
            .known
            .iter()
            .map(|disc| disc.center.re + disc.radius)
            .filter(|right| *right < edge)
            .fold(self.barrier, f64::max);
        Some(edge - (CLEARANCE * (edge - next)).min(self.first_step))
    }

    /// Count right of `sigma`, or of a nearby line where a root lies on it: further left at first,
    /// so that this root is counted.
    fn counted(&self, sigma: f64) -> Result<Line, Error> {
        let mut at = sigma;
        // A line between known roots has to stay between them; the first line may be anywhere
        // nearby.
        let free = self.few.is_none() && self.enough.is_none();
        let least = if free { ASIDE * self.first_step } else { 0.0 };
        let mut aside = -1.0;
        let mut attempt = 0;
        loop {
            let effort = Effort {
                limit: self.limit,
                double_double: !free || attempt >= IN_DOUBLES,
            };
            match self.spectrum.line(at, effort, self.task) {
                Ok((count, hints)) => {
                    return Ok(Line {
                        sigma: at,
                        count,
                        hints,
                    });
                }
                Err(error @ Error::Contour { distance, .. }) => {
                    let distance = distance.max(LEAST_MOVE * sigma.abs()).max(least);
                    let moved = sigma + aside * distance;
                    at = if moved > self.chain {
                        moved
                    } else {
                        sigma + f64::abs(aside) * distance
                    };
                    refuse_if!(
                        distance > MOST_ASIDE * self.first_step,
                        "the roots right of Re s = {sigma} cannot be counted, because the sizes \
                         of the coefficients differ too much for double precision: choose another \
                         unit of time"
                    );
                    if attempt >= MAX_ASIDE {
                        return Err(error);
                    }
                    aside *= -3.0;
                    attempt += 1;
                }
                Err(error) => return Err(error),
            }
        }
    }
}

/// Discs, Im ≥ 0, that hold all the roots right of a line, found cell by cell.
pub(crate) fn half_plane_discs<S: Spectrum>(
    spectrum: &S,
    sigma: f64,
    task: &Task,
) -> Result<Vec<Disc>, Error> {
    let mut walker = spectrum.walker(task, MAX_EVALUATIONS);
    match spectrum.cell_right_of(&mut walker, sigma)? {
        Some(cell) => locate(&mut walker, cell),
        None => Ok(Vec::new()),
    }
}
