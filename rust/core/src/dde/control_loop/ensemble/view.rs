//! Places and parts of a trace in terms of time and numbers.
//!
//! Place 0 is the begin of the trace and place i the end of part i − 1, so that part p lies between
//! places p and p + 1.

use crate::dde::limits::slack;
use crate::simd::{Mask, Real, Simd};

use super::loops::Runs;
use super::piece::Piece;
use super::trace::{CHUNK, Trace, of};
use super::walk::Run;

/// A trace with its loops.
pub(super) struct View<'a, S: Simd> {
    pub(super) loops: &'a Runs<S>,
    pub(super) run: &'a dyn Run<S>,
    pub(super) trace: &'a Trace<S>,
}

impl<S: Simd> View<'_, S> {
    /// Parts of a chunk.
    #[inline]
    pub(super) fn per_chunk(&self) -> usize {
        CHUNK * self.trace.per_sample
    }

    /// The samples of parts, and their numbers within these.
    #[inline(always)]
    fn split(&self, parts: Real<S>) -> (Real<S>, Real<S>) {
        let corners = self.trace.per_sample as f64;
        if self.trace.per_sample == 1 {
            return (parts, parts.constant(0.0));
        }
        // The quotient of the middle of the part is far from whole numbers beside its error.
        let samples = ((parts + 0.5) * (1.0 / corners) - 0.5).nearest();
        (samples, parts - samples * corners)
    }

    /// Times of places.
    #[inline(always)]
    pub(super) fn times(&self, places: Real<S>) -> Real<S> {
        let (samples, numbers) = self.split(places);
        let mut offset = places.constant(0.0);
        for (number, part) in self.loops.parts.iter().enumerate().skip(1) {
            offset = numbers.eq(number as f64).select(part.offset, offset);
        }
        let time = self.loops.time(samples + self.trace.first as f64, offset);
        time.smaller(self.loops.end)
    }

    /// Lengths of parts; zero for jumps.
    #[inline(always)]
    pub(super) fn lengths(&self, parts: Real<S>) -> Real<S> {
        let (samples, numbers) = self.split(parts);
        let mut length = parts.constant(0.0);
        for (number, part) in self.loops.parts.iter().enumerate() {
            length = numbers.eq(number as f64).select(part.length, length);
        }
        let sample = samples + self.trace.first as f64;
        self.loops.length(sample, length)
    }

    /// Time at which a part begins.
    #[inline]
    fn begin(&self, lane: usize, part: usize) -> f64 {
        let (sample, number) = self.trace.split(part);
        let sample = (self.trace.first + sample) as f64;
        self.time(lane, sample, self.loops.parts[number].offset)
    }

    /// [`Runs::time`] of a lane.
    #[inline]
    fn time(&self, lane: usize, sample: f64, offset: Real<S>) -> f64 {
        of(&self.loops.time(offset.constant(sample), offset), lane)
    }

    /// σ at the ends of parts, inside of which the runs may end.
    #[inline(always)]
    pub(super) fn until(&self, parts: Real<S>) -> Real<S> {
        let time = self.times(parts + 1.0) - self.times(parts);
        (time / self.lengths(parts)).smaller(1.0)
    }

    /// The outputs at `sigma` of a part of each loop in `wanted`.
    #[inline(always)]
    pub(super) fn outputs(
        &self,
        (parts, sigma): (Real<S>, Real<S>),
        wanted: Mask<S>,
        piece: &mut Piece<S>,
    ) -> Real<S> {
        if self.loops.is_curved {
            self.piece(parts, wanted, piece);
            return piece.at(sigma);
        }
        let (mut first, mut last) = (sigma, sigma);
        for lane in wanted.lanes() {
            let part = of(&parts, lane) as usize;
            first.numbers_mut()[lane] = self.trace.output(lane, part);
            last.numbers_mut()[lane] = self.trace.output(lane, part + 1);
        }
        (last - first).mul_add(sigma, first)
    }

    /// Make `piece` the output on one part of each loop in `wanted`, any polynomial of the others.
    pub(super) fn piece(&self, parts: Real<S>, wanted: Mask<S>, piece: &mut Piece<S>) {
        piece.degree = self.loops.degree;
        let parts = wanted.select(parts, parts.constant(-1.0));
        self.run.piece(self.trace, parts, piece);
    }

    /// The part of a time, and σ in it; none if it is not in the trace.
    pub(super) fn find(&self, lane: usize, time: f64) -> Option<(usize, f64)> {
        let sample_time = of(&self.loops.sample_time, lane);
        let zero = self.loops.zero;
        // A time at which a part begins, but for rounding errors, is in that part.
        let reached = time + slack(time, sample_time);
        // What the second sample lacks of a whole one.
        let lacks = 2.0 * sample_time - self.time(lane, 2.0, zero);
        let mut sample = ((reached + lacks) / sample_time).floor();
        // The quotient may be rounded to the next whole number, or down from it, and belongs to the
        // sample before if that is the first one.
        if self.time(lane, sample, zero) > reached {
            sample -= 1.0;
        } else if self.time(lane, sample + 1.0, zero) <= reached {
            sample += 1.0;
        }
        let sample = (sample as usize).checked_sub(self.trace.first)?;
        if sample >= self.trace.samples {
            return None;
        }
        let first = sample * self.trace.per_sample;
        // The last part that begins at or before the time.
        let mut part = first;
        for later in first + 1..first + self.trace.per_sample {
            if self.begin(lane, later) > reached {
                break;
            }
            part = later;
        }
        let begin = self.begin(lane, part);
        let end = self.begin(lane, part + 1);
        let share = if end > begin {
            ((time - begin) / (end - begin)).clamp(0.0, 1.0)
        } else {
            1.0
        };
        Some((part, share))
    }

    /// The outputs at the ends of the runs that end inside a part.
    #[inline(always)]
    pub(super) fn cut(&self) -> Real<S> {
        let parts = self.trace.count;
        let place = (parts, self.until(parts));
        self.outputs(place, self.trace.is_cut, &mut Piece::new(parts))
    }
}
