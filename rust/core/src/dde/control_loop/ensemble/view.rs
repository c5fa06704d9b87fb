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
use super::piece::{LONG, Piece};
use super::trace::{CHUNK, Trace, of};
use super::transition::row;

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

    /// The sample of a part, and its number within the sample.
    #[inline]
    fn split(&self, part: usize) -> (usize, usize) {
        match self.trace.per_sample {
            1 => (part, 0),
            2 => (part / 2, part % 2),
            corners => (part / corners, part % corners),
        }
    }

    /// Time of a place.
    #[inline]
    pub(super) fn time(&self, lane: usize, place: usize) -> f64 {
        let end = of(&self.loops.end, lane);
        self.begin(lane, place).min(end)
    }

    /// Time at which a part begins.
    #[inline]
    fn begin(&self, lane: usize, part: usize) -> f64 {
        let (sample, number) = self.split(part);
        let sample = (self.trace.first + sample) as f64;
        let offset = self.loops.parts.get(number);
        of(&self.loops.sample_time, lane) * sample
            + offset.map_or(0.0, |part| of(&part.offset, lane))
    }

    /// Length of a part; zero for a jump.
    #[inline]
    pub(super) fn length(&self, lane: usize, part: usize) -> f64 {
        let (_, number) = self.split(part);
        let part = self.loops.parts.get(number);
        part.map_or(0.0, |part| of(&part.length, lane))
    }

    /// By how much the output may exceed its values at both ends of a part.
    #[inline]
    pub(super) fn bulge(&self, lane: usize, part: usize) -> f64 {
        if !self.loops.is_curved {
            return 0.0;
        }
        let (sample, number) = self.split(part);
        if self
            .loops
            .parts
            .get(number)
            .is_some_and(|part| part.is_jump)
        {
            return 0.0;
        }
        let is_continuous = self.loops.is_continuous;
        self.trace
            .bulge(lane, if is_continuous { part } else { sample })
    }

    /// The output on one part of each loop, zero where none is asked for.
    pub(super) fn piece(&self, parts: &[Option<usize>]) -> Piece<S> {
        outlined(self.loops.d.simd(), PieceOf { view: self, parts })
    }

    /// The part of a time, and σ in it; none if it is not in the trace.
    pub(super) fn find(&self, lane: usize, time: f64) -> Option<(usize, f64)> {
        let sample_time = of(&self.loops.sample_time, lane);
        // A time at which a part begins, but for rounding errors, is in that part.
        let reached = time + slack(time, sample_time);
        let mut sample = (reached / sample_time).floor();
        // The quotient may be rounded to the next whole number, or down from it.
        if sample * sample_time > reached {
            sample -= 1.0;
        } else if (sample + 1.0) * sample_time <= reached {
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

    /// The outputs at the ends of the runs that end inside a part, and the lanes of these.
    #[inline(always)]
    pub(super) fn cut(&self) -> (Real<S>, Mask<S>) {
        let zero = self.loops.d.constant(0.0);
        let is_cut = self.trace.is_cut;
        let (mut first, mut last, mut into) = (zero, zero, zero);
        let mut parts = vec![None; zero.numbers().len()];
        let marks = is_cut.select(1.0, zero);
        for (lane, place) in parts.iter_mut().enumerate() {
            if of(&marks, lane) == 0.0 {
                continue;
            }
            let part = of(&self.trace.count, lane) as usize;
            let length = self.length(lane, part);
            let share = (of(&self.loops.end, lane) - self.begin(lane, part)) / length;
            *place = Some(part);
            first.numbers_mut()[lane] = self.trace.output(lane, part);
            last.numbers_mut()[lane] = self.trace.output(lane, part + 1);
            into.numbers_mut()[lane] = share.clamp(0.0, 1.0);
        }
        let output = if self.loops.is_curved {
            self.piece(&parts).at(into)
        } else {
            (last - first).mul_add(into, first)
        };
        (output, is_cut)
    }
}

/// See [`View::piece`].
struct PieceOf<'a, S: Simd, const P: usize> {
    view: &'a View<'a, S, P>,
    parts: &'a [Option<usize>],
}

impl<S: Simd, const P: usize> PieceOf<'_, S, P> {
    /// The polynomials that continuous loops leave in their trace.
    #[inline(always)]
    fn stored(&self, zero: Real<S>) -> Piece<S> {
        let mut piece = Piece {
            terms: [zero; LONG + 1],
            degree: self.view.loops.degree,
        };
        for (lane, &part) in self.parts.iter().enumerate() {
            let Some(part) = part else {
                continue;
            };
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
        piece
    }
}

impl<S: Simd, const P: usize> Outlined for PieceOf<'_, S, P> {
    type Output = Piece<S>;

    #[inline(always)]
    fn run(self) -> Piece<S> {
        let (view, loops) = (self.view, self.view.loops);
        let zero = loops.d.constant(0.0);
        if loops.is_continuous {
            return self.stored(zero);
        }
        let (mut x, mut before, mut after, mut numbers) = ([zero; P], zero, zero, zero);
        for (lane, &part) in self.parts.iter().enumerate() {
            let Some(part) = part else {
                continue;
            };
            let (sample, number) = view.split(part);
            let put = |into: &mut Real<S>, number: f64| {
                if let Some(place) = into.numbers_mut().get_mut(lane) {
                    *place = number;
                }
            };
            let states = view.trace.states.get(sample * P..(sample + 1) * P);
            for (x, from) in x.iter_mut().zip(states.unwrap_or_default()) {
                put(x, of(from, lane));
            }
            if let Some([one, two]) = view.trace.commands.get(sample..sample + 2) {
                put(&mut before, of(one, lane));
                put(&mut after, of(two, lane));
            }
            put(&mut numbers, number as f64);
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
        let mut piece = Piece {
            terms: [zero; LONG + 1],
            degree: loops.degree,
        };
        piece.terms[0] = row(&loops.c, &x, loops.d * w);
        let mut v = x;
        for i in 0..P {
            v[i] = row(&loops.a[i], &x, loops.b[i].mul_add(w, loops.e[i])) * h;
        }
        piece.terms[1] = row(&loops.c, &v, zero);
        for j in 2..=piece.degree {
            let factor = h * (1.0 / j as f64);
            let old = v;
            for i in 0..P {
                v[i] = row(&loops.a[i], &old, zero) * factor;
            }
            piece.terms[j] = row(&loops.c, &v, zero);
        }
        piece
    }
}
