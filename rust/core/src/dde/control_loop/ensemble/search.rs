//! What the stages of the search of a trace have in common.
//!
//! All loops go through the same stages together. A stage looks for the next part of each loop in
//! which something may happen, and where that depends on the inside of the part, asks its
//! polynomial (`piece`), until no loop has such a part.

use crate::dde::control_loop::level_crossings::in_order;
use crate::dde::control_loop::series::Series;
use crate::simd::{Mask, Real, Simd, outlined};

use super::measured::Measured;
use super::piece::{Asked, Piece, Shown};
use super::spots::Spots;
use super::trace::{Trace, of};
use super::view::View;

/// The search of a trace.
pub(super) struct Search<'a, S: Simd> {
    pub(super) view: &'a View<'a, S>,
    pub(super) spots: &'a mut Spots<S>,
    /// The outputs on the parts that are examined, and polynomials whose zeros are sought.
    pub(super) pieces: &'a mut Option<[Piece<S>; 2]>,
    pub(super) measured: &'a mut Measured<S>,
}

/// A part of each loop.
pub(super) struct Hit<S: Simd> {
    /// The loops that have one.
    pub(super) here: Mask<S>,
    pub(super) part: Real<S>,
    /// The outputs at its begin and end, and how far they may be exceeded between.
    pub(super) first: Real<S>,
    pub(super) last: Real<S>,
    pub(super) bulge: Real<S>,
}

impl<S: Simd> Trace<S> {
    /// The first or, if `BACK`, the last part of a range of each wanted loop that passes a test of the
    /// outputs at its begin and end and of how far they may be exceeded between. The test also receives
    /// the loops in whose ranges the part is.
    #[inline(always)]
    fn seek<const BACK: bool>(
        &self,
        wanted: Mask<S>,
        (begin, end): (Real<S>, Real<S>),
        mut test: impl FnMut(Mask<S>, [Real<S>; 3]) -> Mask<S>,
    ) -> Hit<S> {
        let zero = begin.constant(0.0);
        let here = zero.lt(0.0);
        let mut hit = Hit {
            here,
            part: zero,
            first: zero,
            last: zero,
            bulge: zero,
        };
        let mut open = wanted & begin.lt(end);
        let ranges = || open.lanes().map(|lane| (of(&begin, lane), of(&end, lane)));
        let least = ranges().fold(f64::INFINITY, |least, (begin, _)| least.min(begin)) as usize;
        let most = ranges().fold(0.0, |most: f64, (_, end)| most.max(end)) as usize;
        for number in least..most.max(least) {
            let part = if BACK {
                least + most - 1 - number
            } else {
                number
            };
            let place = zero.constant(part as f64);
            let inside = open & place.ge(begin) & place.lt(end);
            if !inside.any() {
                continue;
            }
            let [first, last, bulge] = self.part(zero, part);
            let holds = inside & test(inside, [first, last, bulge]);
            hit.here = hit.here | holds;
            hit.part = holds.select(place, hit.part);
            hit.first = holds.select(first, hit.first);
            hit.last = holds.select(last, hit.last);
            hit.bulge = holds.select(bulge, hit.bulge);
            open = open & !holds;
            if !open.any() {
                break;
            }
        }
        hit
    }

    /// The outputs at the begin and end of a part, and how far they may be exceeded between.
    #[inline(always)]
    fn part(&self, zero: Real<S>, part: usize) -> [Real<S>; 3] {
        let bulge = self.bulge_of(part).filter(|_| self.is_curved);
        let bulge = bulge.and_then(|place| self.bulges.get(place));
        let mut found = [zero; 3];
        let stored = [self.outputs.get(part), self.outputs.get(part + 1), bulge];
        for (found, lanes) in found.iter_mut().zip(stored) {
            if let Some(lanes) = lanes {
                *found = Real::new(zero.simd(), *lanes);
            }
        }
        found
    }
}

impl<S: Simd> Search<'_, S> {
    /// See [`Trace::seek`].
    #[inline(always)]
    pub(super) fn seek<const BACK: bool>(
        &self,
        wanted: Mask<S>,
        range: (Real<S>, Real<S>),
        test: impl FnMut(Mask<S>, [Real<S>; 3]) -> Mask<S>,
    ) -> Hit<S> {
        outlined(
            range.0.simd(),
            #[inline(always)]
            || self.view.trace.seek::<BACK>(wanted, range, test),
        )
    }

    /// The first part inside of which the output, multiplied by a sign, may exceed a bar.
    #[inline(always)]
    pub(super) fn seek_beyond(
        &self,
        wanted: Mask<S>,
        range: (Real<S>, Real<S>),
        (sign, bar): (Real<S>, Real<S>),
    ) -> Hit<S> {
        let most_change = self.most_change();
        self.seek::<false>(
            wanted,
            range,
            #[inline(always)]
            |_, [first, last, bulge]| {
                let most = (first * sign).max(last * sign) + bulge;
                let may_turn = (last - first).abs().le(bulge * most_change);
                most.gt(bar) & may_turn & bulge.gt(0.0)
            },
        )
    }

    /// The last part in which or at whose ends the output may be farther than a band from the steady
    /// state.
    #[inline(always)]
    pub(super) fn seek_strayed(
        &self,
        wanted: Mask<S>,
        range: (Real<S>, Real<S>),
        band: Real<S>,
    ) -> Hit<S> {
        let steady = self.measured.steady;
        self.seek::<true>(
            wanted,
            range,
            #[inline(always)]
            |_, [first, last, bulge]| {
                let (first, last) = ((first - steady).abs(), (last - steady).abs());
                (first.max(last) + bulge).gt(band)
            },
        )
    }

    /// The output has no extremum in a part on which it changes by more than so many bulges.
    #[inline(always)]
    fn most_change(&self) -> f64 {
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
        test: impl Fn(Real<S>) -> Mask<S>,
    ) -> Mask<S> {
        let mut passes = test(shown.extremum(wanted, until));
        for (_, output) in self.others(shown, wanted, until) {
            passes = passes | test(output);
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
            for sigma in in_order(&series.derivative(), [0.0], Vec::new()) {
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
                let zeros = in_order(&self.series(lane), [of(&level, lane)], Vec::new());
                let first = zeros.first().copied();
                sigma.numbers_mut()[lane] = first.unwrap_or(of(&until, lane));
            }
        }
        sigma
    }
}
