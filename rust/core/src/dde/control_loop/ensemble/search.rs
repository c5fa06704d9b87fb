//! What the stages of the search of a trace have in common.
//!
//! All loops go through the same stages together. A stage looks for the next part of each loop in
//! which something may happen (`window`), and where that depends on the inside of the part, asks its
//! polynomial (`piece`), until no loop has such a part.

use crate::dde::control_loop::level_crossings::crossings;
use crate::dde::control_loop::series::Series;
use crate::simd::{Mask, Real, Simd, outlined};

use super::measured::Measured;
use super::piece::{Asked, Piece, Shown, turns};
use super::spots::Spots;
use super::trace::of;
use super::view::View;
use super::window::{Hit, Test, Window};

/// The search of a trace.
pub(super) struct Search<'a, S: Simd> {
    pub(super) view: &'a View<'a, S>,
    pub(super) spots: &'a mut Spots<S>,
    pub(super) window: &'a mut Window<S>,
    /// The outputs on the parts that are examined, and polynomials whose zeros are sought.
    pub(super) pieces: &'a mut Option<[Piece<S>; 2]>,
    pub(super) measured: &'a mut Measured<S>,
}

impl<S: Simd> Search<'_, S> {
    /// The first part of a range that passes a test.
    #[inline(always)]
    pub(super) fn seek<const BACK: bool>(
        &mut self,
        wanted: Mask<S>,
        range: (Real<S>, Real<S>),
        test: &impl Test<S>,
    ) -> Hit<S> {
        let (trace, window) = (self.view.trace, &mut *self.window);
        outlined(
            range.0.simd(),
            #[inline(always)]
            || window.seek::<BACK>(trace, wanted, range, test),
        )
    }

    /// See [`Exceeds::most_change`].
    #[inline(always)]
    pub(super) fn most_change(&self) -> f64 {
        if self.view.loops.is_continuous {
            // Their bulges are no bounds on y″.
            f64::INFINITY
        } else {
            // By |y″| ≤ 8 bulge/h², y′ is within 4 bulge/h of its mean; and rounding.
            4.0 + 1e-9
        }
    }

    /// The parts from the begin of one chunk to the end of another.
    #[inline(always)]
    pub(super) fn chunks(&self, first: Real<S>, last: Real<S>) -> (Real<S>, Real<S>) {
        let per_chunk = self.view.per_chunk() as f64;
        let end = (last + 1.0) * per_chunk;
        (first * per_chunk, end.smaller(self.spots.parts))
    }

    /// What the polynomials of a part of each loop in `is_open` show: where they cross `level` in
    /// the loops in `crosses`, and their extremum in the others.
    #[inline(always)]
    pub(super) fn shown(
        &mut self,
        part: Real<S>,
        is_open: Mask<S>,
        (crosses, level): (Mask<S>, Real<S>),
    ) -> Shown<S> {
        let high = self.until(part);
        let zero = self.view.loops.zero;
        let [piece, sought] = self
            .pieces
            .get_or_insert_with(|| [Piece::new(zero), Piece::new(zero)]);
        self.view.piece(part, is_open, piece);
        let asked = Asked {
            is_open,
            crosses,
            level,
            high,
        };
        outlined(
            part.simd(),
            #[inline(always)]
            || piece.shown(sought, &asked),
        )
    }

    /// The polynomial of a loop.
    pub(super) fn series(&self, lane: usize) -> Series {
        match &*self.pieces {
            Some([piece, _]) => piece.series(lane),
            None => Series::constant(0.0),
        }
    }

    /// σ at the end of a part, inside of which the run may end.
    #[inline(always)]
    pub(super) fn until(&self, part: Real<S>) -> Real<S> {
        let one = part.constant(1.0);
        let is_last = (part + 1.0).ge(self.spots.parts);
        if !is_last.any() {
            return one;
        }
        is_last.select(self.view.until(part), one)
    }

    /// Time of a part at σ.
    #[inline(always)]
    pub(super) fn time_in(&self, part: Real<S>, sigma: Real<S>) -> Real<S> {
        let begin = self.view.times(part);
        let time = self.view.lengths(part).mul_add(sigma, begin);
        time.larger(begin).smaller(self.view.times(part + 1.0))
    }

    /// Where a line from the begin of a part to its end passes through a level.
    #[inline(always)]
    pub(super) fn time_on_line(&self, part: Real<S>, share: Real<S>) -> Real<S> {
        let (begin, end) = (self.view.times(part), self.view.times(part + 1.0));
        (end - begin).mul_add(share, begin)
    }

    /// The loops in `wanted` with an extremum inside of a part that passes a test, which NaN does not.
    #[inline(always)]
    pub(super) fn passes(
        &self,
        shown: &Shown<S>,
        wanted: Mask<S>,
        until: Real<S>,
        passing: &impl Passing<S>,
    ) -> Mask<S> {
        let mut passes = passing.holds(shown.extremum(wanted, until));
        for (_, output) in self.others(shown, wanted, until) {
            passes = passes | passing.holds(output);
        }
        passes
    }

    /// σ and output of the extrema of the loops in `wanted` that are not known otherwise, one after
    /// the other; NaN in all other lanes.
    #[inline(always)]
    pub(super) fn others(
        &self,
        shown: &Shown<S>,
        wanted: Mask<S>,
        until: Real<S>,
    ) -> Vec<(Real<S>, Real<S>)> {
        let mut found = Vec::new();
        let unknown = wanted & shown.is_unknown;
        if !unknown.any() {
            return found;
        }
        for lane in unknown.lanes() {
            let series = self.series(lane);
            for sigma in turns(&series) {
                if sigma <= of(&until, lane) {
                    let mut output = until.constant(f64::NAN);
                    output.numbers_mut()[lane] = series.at(sigma);
                    found.push((until.constant(sigma), output));
                }
            }
        }
        found
    }

    /// Where the pieces of the loops in `wanted` first cross a level.
    #[inline(always)]
    pub(super) fn crossing(
        &self,
        shown: &Shown<S>,
        wanted: Mask<S>,
        until: Real<S>,
        level: Real<S>,
    ) -> Real<S> {
        let mut sigma = shown.crossing;
        let unknown = wanted & !sigma.eq(sigma);
        if unknown.any() {
            for lane in unknown.lanes() {
                let first = first_crossing(&self.series(lane), of(&level, lane));
                sigma.numbers_mut()[lane] = first.unwrap_or(of(&until, lane));
            }
        }
        sigma
    }
}

/// A question about extrema.
pub(super) trait Passing<S: Simd> {
    fn holds(&self, output: Real<S>) -> Mask<S>;
}

/// Where the polynomial first passes through a level.
fn first_crossing(y: &Series, level: f64) -> Option<f64> {
    let mut zeros = Vec::new();
    crossings(y, level, &mut zeros);
    zeros.into_iter().reduce(f64::min)
}
