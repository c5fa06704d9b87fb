//! Places and parts of a trace in terms of time and numbers.
//!
//! Place 0 is the begin of the trace and place i the end of part i − 1, so that part p lies between
//! places p and p + 1.

#![expect(
    clippy::needless_range_loop,
    reason = "indices as in the formulas; closures would not be compiled for the vectors"
)]

use crate::dde::limits::slack;
use crate::simd::{Mask, Outlined, Real, Simd, flat, outlined};

use super::loops::Plants;
use super::piece::Piece;
use super::trace::{CHUNK, Trace, of};
use super::transition::row;
use super::window::shared;

/// A trace with its loops.
pub(super) struct View<'a, S: Simd, const P: usize> {
    pub(super) loops: &'a Plants<S, P>,
    pub(super) trace: &'a Trace<S>,
}

impl<S: Simd, const P: usize> View<'_, S, P> {
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
        let offset = self.loops.parts.get(number);
        self.time(
            lane,
            (self.trace.first + sample) as f64,
            offset.map_or(0.0, |part| of(&part.offset, lane)),
        )
    }

    /// [`Plants::time`] of a lane.
    #[inline]
    fn time(&self, lane: usize, sample: f64, offset: f64) -> f64 {
        let sample_time = of(&self.loops.sample_time, lane);
        let time = sample_time * sample;
        match &self.loops.share {
            Some(share) if sample == 1.0 => time + offset * of(share, lane),
            Some(share) if sample > 1.0 => {
                time - (sample_time - sample_time * of(share, lane)) + offset
            }
            _ => time + offset,
        }
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
        let made = PieceOf {
            view: self,
            parts: wanted.select(parts, parts.constant(-1.0)),
            piece,
        };
        outlined(self.loops.d.simd(), made);
    }

    /// The part of a time, and σ in it; none if it is not in the trace.
    pub(super) fn find(&self, lane: usize, time: f64) -> Option<(usize, f64)> {
        let sample_time = of(&self.loops.sample_time, lane);
        // A time at which a part begins, but for rounding errors, is in that part.
        let reached = time + slack(time, sample_time);
        // What the second sample lacks of a whole one.
        let lacks = 2.0 * sample_time - self.time(lane, 2.0, 0.0);
        let mut sample = ((reached + lacks) / sample_time).floor();
        // The quotient may be rounded to the next whole number, or down from it, and belongs to the
        // sample before if that is the first one.
        if self.time(lane, sample, 0.0) > reached {
            sample -= 1.0;
        } else if self.time(lane, sample + 1.0, 0.0) <= reached {
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

/// See [`View::piece`].
struct PieceOf<'a, S: Simd, const P: usize> {
    view: &'a View<'a, S, P>,
    /// Negative where none is wanted.
    parts: Real<S>,
    piece: &'a mut Piece<S>,
}

impl<S: Simd, const P: usize> PieceOf<'_, S, P> {
    /// The states and commands of sampled loops, and the numbers of the parts within their samples.
    #[inline(always)]
    fn gather(&self, x: &mut [Real<S>; P], [before, after, numbers]: [&mut Real<S>; 3]) {
        let trace = self.view.trace;
        for (lane, &part) in self.parts.numbers().iter().enumerate() {
            if part < 0.0 {
                continue;
            }
            let (sample, number) = trace.split(part as usize);
            let states = trace.states.get(sample * P..(sample + 1) * P);
            let states = states.unwrap_or_default();
            for (x, state) in x.iter_mut().zip(states) {
                x.numbers_mut()[lane] = of(state, lane);
            }
            if let Some([one, two]) = trace.commands.get(sample..sample + 2) {
                before.numbers_mut()[lane] = of(one, lane);
                after.numbers_mut()[lane] = of(two, lane);
            }
            numbers.numbers_mut()[lane] = number as f64;
        }
    }

    /// The polynomials that continuous loops leave in their trace.
    #[inline(always)]
    fn stored(self) {
        let piece = self.piece;
        for (lane, &part) in self.parts.numbers().iter().enumerate() {
            if part < 0.0 {
                continue;
            }
            let part = part as usize;
            let stored = self.view.trace.polynomial(part, piece.degree + 1);
            let numbers = flat::<S>(stored)
                .iter()
                .skip(lane)
                .step_by(Trace::<S>::WIDTH);
            for (term, &number) in piece.terms.iter_mut().zip(numbers) {
                if let Some(place) = term.numbers_mut().get_mut(lane) {
                    *place = number;
                }
            }
        }
    }
}

impl<S: Simd, const P: usize> Outlined for PieceOf<'_, S, P> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let (view, loops) = (self.view, self.view.loops);
        let zero = loops.zero;
        self.piece.degree = loops.degree;
        if loops.is_continuous {
            self.stored();
            return;
        }
        let wanted = self.parts.ge(0.0);
        let (mut x, mut before, mut after, mut numbers) = ([zero; P], zero, zero, zero);
        // Neighbours often have the same part.
        if let Some(part) = shared(self.parts, wanted) {
            let (sample, number) = view.trace.split(part as usize);
            let states = view.trace.states.get(sample * P..(sample + 1) * P);
            if let (Some(states), Some(&[one, two])) =
                (states, view.trace.commands.get(sample..sample + 2))
            {
                x.copy_from_slice(states);
                (before, after) = (one, two);
            }
            numbers = zero.constant(number as f64);
        } else {
            self.gather(&mut x, [&mut before, &mut after, &mut numbers]);
        }
        let sample = x;
        let (mut w, mut h) = (before, zero);
        for (number, part) in loops.parts.iter().enumerate() {
            let here = numbers.eq(number as f64);
            if !here.any() {
                continue;
            }
            h = here.select(part.length, h);
            if part.is_after {
                w = here.select(after, w);
            }
            if number > 0 {
                let start = part.start.apply(&sample, before, after);
                for (x, start) in x.iter_mut().zip(start) {
                    *x = here.select(start, *x);
                }
            }
        }
        let piece = self.piece;
        piece.terms[0] = row(&loops.c, &x, loops.d * w);
        let mut v = x;
        for i in 0..P {
            v[i] = row(&loops.a[i], &x, loops.b[i].mul_add(w, loops.e[i])) * h;
        }
        piece.terms[1] = loops.seen(&v);
        for j in 2..=piece.degree {
            let factor = h * (1.0 / j as f64);
            let old = v;
            for i in 0..P {
                v[i] = row(&loops.a[i], &old, zero) * factor;
            }
            piece.terms[j] = loops.seen(&v);
        }
    }
}
