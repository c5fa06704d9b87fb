//! The chunks of a trace in which something that counts may happen, in all loops at once.

use crate::simd::{Mask, Outlined, Real, Simd, outlined};

use super::block::{Column, SETS};
use super::measured::Measured;
use super::trace::Trace;
use super::view::View;

/// A chunk for each loop, negative where nothing happens.
#[derive(Clone, Copy)]
pub(super) struct Chunks(Column);

impl Chunks {
    /// The chunk of a loop.
    #[inline]
    pub(super) fn of(&self, lane: usize) -> Option<usize> {
        let chunk = self.0.get(lane).copied().unwrap_or(-1.0);
        (chunk >= 0.0).then_some(chunk as usize)
    }
}

/// The first and the last of several chunks.
pub(super) type Range = (Chunks, Chunks);

/// Chunks of the trace of each loop in which its output may change the record.
pub(super) struct Spots {
    /// Parts of each run.
    pub(super) parts: [usize; SETS],
    /// Greatest corner, if it is greater than all before, and its chunk.
    pub(super) most: Column,
    pub(super) top: Chunks,
    pub(super) least: Column,
    pub(super) bottom: Chunks,
    /// First chunks in which the levels of the rise may be reached.
    pub(super) rise: [Chunks; 2],
    /// Last chunks in which the output may be outside of the band, and of the quiet band.
    pub(super) outside: Chunks,
    pub(super) quiet: Chunks,
    /// Chunks in which the output may exceed its corners.
    pub(super) may_top: Range,
    pub(super) may_bottom: Range,
    pub(super) may_dip: Range,
    /// Differences of outputs that do not count.
    pub(super) tolerance: Column,
}

/// A number of a chunk in each lane, −1 for none.
struct Place<S: Simd>(Real<S>);

impl<S: Simd> Place<S> {
    fn none(like: Real<S>) -> Self {
        Self(like.constant(-1.0))
    }

    /// The chunk where `here` is true, in the place of earlier ones.
    #[inline(always)]
    fn last(&mut self, here: Mask<S>, chunk: f64) {
        self.0 = here.select(chunk, self.0);
    }

    /// The first chunk where `here` is true.
    #[inline(always)]
    fn first(&mut self, here: Mask<S>, chunk: f64) {
        self.0 = (here & self.0.lt(0.0)).select(chunk, self.0);
    }

    #[inline(always)]
    fn listed(&self) -> Chunks {
        Chunks(numbers(self.0))
    }
}

pub(super) fn spots<S: Simd, const P: usize>(
    view: &View<'_, S, P>,
    lanes: &[Measured],
    rounding: f64,
) -> Spots {
    let look = Look {
        zero: view.loops.d.constant(0.0),
        trace: view.trace,
        jumps: view.loops.is_direct,
        lanes,
        rounding,
    };
    outlined(look.zero.simd(), look)
}

/// See [`spots`].
struct Look<'a, S: Simd> {
    zero: Real<S>,
    trace: &'a Trace<S>,
    /// May the output jump over the end of the rise?
    jumps: bool,
    lanes: &'a [Measured],
    rounding: f64,
}

impl<S: Simd> Outlined for Look<'_, S> {
    type Output = Spots;

    #[inline(always)]
    fn run(self) -> Spots {
        let Self {
            zero,
            trace,
            jumps,
            lanes,
            rounding,
        } = self;
        let sign = column(zero, lanes, |m| m.levels.sign);
        let steady = column(zero, lanes, |m| m.levels.steady);
        let (band, quiet_band) = (
            column(zero, lanes, |m| m.levels.band),
            column(zero, lanes, |m| m.levels.quiet_band),
        );
        let levels = [
            column(zero, lanes, |m| m.levels.rise.0),
            column(zero, lanes, |m| m.levels.rise.1),
        ];
        let has_risen = column(zero, lanes, |m| m.record.risen.1).ge(0.0);
        let (mut most, mut least) = (
            column(zero, lanes, |m| m.record.top.0),
            column(zero, lanes, |m| m.record.bottom.0),
        );
        let none = || Place::none(zero);
        let (mut top, mut bottom, mut outside, mut quiet) = (none(), none(), none(), none());
        let mut rise = [none(), none()];
        let chunks = || trace.chunks.iter().enumerate();
        for (number, chunk) in chunks() {
            let number = number as f64;
            let (higher, lower) = (chunk.most.gt(most), chunk.least.lt(least));
            most = higher.select(chunk.most, most);
            least = lower.select(chunk.least, least);
            top.last(higher, number);
            bottom.last(lower, number);
            let far = (chunk.most - steady).max(steady - chunk.least) + chunk.bulge;
            outside.last(far.gt(band), number);
            quiet.last(far.gt(quiet_band), number);
            let best = (chunk.most * sign).max(chunk.least * sign) + chunk.bulge;
            for (rise, level) in rise.iter_mut().zip(&levels) {
                rise.first(best.ge(*level), number);
            }
        }
        let size = most.abs().max(least.abs()).max(steady.abs()) * rounding;
        let mut extremes = [(none(), none()), (none(), none()), (none(), none())];
        let risen_to = if jumps {
            zero.constant(f64::INFINITY)
        } else {
            levels[1]
        };
        let dip = has_risen.select(column(zero, lanes, Measured::dip), risen_to);
        let begin = has_risen.select(0.0, rise[1].0);
        for (number, chunk) in chunks() {
            let number = number as f64;
            let worst = (chunk.most * sign).min(chunk.least * sign) - chunk.bulge;
            let may = [
                (chunk.most + chunk.bulge).gt(most + size),
                (chunk.least - chunk.bulge).lt(least - size),
                worst.lt(dip) & begin.ge(0.0) & begin.le(number),
            ];
            for ((first, last), may) in extremes.iter_mut().zip(may) {
                first.first(may, number);
                last.last(may, number);
            }
        }
        let [tops, bottoms, dips] = &extremes;
        Spots {
            parts: std::array::from_fn(|lane| trace.parts(lane)),
            most: numbers(most),
            top: top.listed(),
            least: numbers(least),
            bottom: bottom.listed(),
            rise: [rise[0].listed(), rise[1].listed()],
            outside: outside.listed(),
            quiet: quiet.listed(),
            may_top: (tops.0.listed(), tops.1.listed()),
            may_bottom: (bottoms.0.listed(), bottoms.1.listed()),
            may_dip: (dips.0.listed(), dips.1.listed()),
            tolerance: numbers(size),
        }
    }
}

/// A number of each lane.
#[inline(always)]
fn column<S: Simd>(zero: Real<S>, lanes: &[Measured], number: fn(&Measured) -> f64) -> Real<S> {
    let mut column = zero;
    for (place, measured) in column.numbers_mut().iter_mut().zip(lanes) {
        *place = number(measured);
    }
    column
}

/// The lanes as a column.
#[inline(always)]
fn numbers<S: Simd>(lanes: Real<S>) -> Column {
    let mut column = [-1.0; SETS];
    for (place, number) in column.iter_mut().zip(lanes.numbers()) {
        *place = *number;
    }
    column
}
