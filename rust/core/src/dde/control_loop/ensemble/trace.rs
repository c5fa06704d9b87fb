//! What a run leaves of some hundred samples: outputs where parts meet, and where they may be
//! exceeded.

use crate::simd::{Lanes, Mask, Real, Simd, flat, flat_mut};

/// Samples in a chunk, whose extremes are known without reading its outputs.
pub(super) const CHUNK: usize = 4;

/// Most samples in a trace: enough for most runs, and few enough for the cache of a core.
pub(super) const SAMPLES: usize = 256;

/// Parts in a trace of continuous loops, if a chunk has no more: enough for most runs, and few
/// enough for the cache of a core.
const PARTS: usize = 128;

/// Delays in a trace of continuous loops, each of which has so many parts: whole chunks.
pub(super) fn delays(parts: usize) -> usize {
    (PARTS / parts).next_multiple_of(CHUNK).max(CHUNK)
}

/// Greatest and least output at the corners of a chunk and at the corner before it.
#[derive(Clone, Copy)]
pub(super) struct Summary<S: Simd> {
    pub(super) most: Real<S>,
    pub(super) least: Real<S>,
    /// By how much the output may be outside of these between corners.
    pub(super) bulge: Real<S>,
}

/// The trace of consecutive samples.
///
/// A corner is the end of a part. Only the first `count` corners of a loop belong to its run; where
/// the run ends inside a part, the output there is stored as the last corner.
pub(super) struct Trace<S: Simd> {
    /// Number of the first sample.
    pub(super) first: usize,
    /// Samples in the trace.
    pub(super) samples: usize,
    /// Corners of one sample.
    pub(super) per_sample: usize,
    /// The number, within a sample, of the part that is the jump of the output; of no part if there
    /// is none.
    pub(super) jump: usize,
    /// Is the output not a line on every part?
    pub(super) is_curved: bool,
    pub(super) is_continuous: bool,
    /// The output before the first corner, and those at all corners.
    pub(super) outputs: Vec<Lanes<S>>,
    /// States of the plant at samples, one after the other, if the output is curved.
    pub(super) states: Vec<Real<S>>,
    /// How far the output may exceed its corners, by samples; by parts of continuous loops.
    pub(super) bulges: Vec<Lanes<S>>,
    /// Commands by sample, from the first one that matters; of continuous loops, the polynomials of
    /// the command on the parts of the latest delay.
    pub(super) commands: Vec<Real<S>>,
    /// Polynomials of the output by parts, of continuous loops.
    pub(super) pieces: Vec<Lanes<S>>,
    pub(super) chunks: Vec<Summary<S>>,
    /// Complete corners of each loop.
    pub(super) count: Real<S>,
    /// The loops whose run ends inside the part after these.
    pub(super) is_cut: Mask<S>,
}

impl<S: Simd> Trace<S> {
    /// Lanes of two vectors.
    pub(super) const WIDTH: usize = 2 * S::F64_LANES;

    pub(super) fn new(zero: Real<S>) -> Self {
        Self {
            first: 0,
            samples: 0,
            per_sample: 1,
            jump: usize::MAX,
            is_curved: false,
            is_continuous: false,
            outputs: vec![zero.lanes()],
            states: Vec::new(),
            bulges: Vec::new(),
            commands: Vec::new(),
            pieces: Vec::new(),
            chunks: Vec::new(),
            count: zero,
            is_cut: zero.lt(0.0),
        }
    }

    /// Forget what the trace holds, to begin with sample number `first` after an output.
    #[inline(always)]
    pub(super) fn restart(&mut self, first: usize, begin: Real<S>) {
        self.chunks.clear();
        (self.first, self.samples) = (first, 0);
        if let Some(place) = self.outputs.first_mut() {
            *place = begin.lanes();
        }
        self.count = begin.constant(0.0);
        self.is_cut = self.count.lt(0.0);
    }

    /// The sample of a part, and its number within the sample.
    #[inline]
    pub(super) fn split(&self, part: usize) -> (usize, usize) {
        match self.per_sample {
            1 => (part, 0),
            2 => (part / 2, part % 2),
            corners => (part / corners, part % corners),
        }
    }

    /// The place of the bulge of a part; none of a jump.
    #[inline]
    pub(super) fn bulge_of(&self, part: usize) -> Option<usize> {
        if self.is_continuous {
            return Some(part);
        }
        let (sample, number) = self.split(part);
        (number != self.jump).then_some(sample)
    }

    /// Parts of the runs in the trace.
    #[inline(always)]
    pub(super) fn parts(&self) -> Real<S> {
        self.count + self.is_cut.select(1.0, self.count.constant(0.0))
    }

    /// The outputs at the ends of the runs in the trace; `before` where it holds none.
    #[inline(always)]
    pub(super) fn last(&self, before: Real<S>) -> Real<S> {
        let (parts, mut last) = (self.parts(), before);
        for (lane, place) in last.numbers_mut().iter_mut().enumerate() {
            let parts = of(&parts, lane) as usize;
            if parts > 0 {
                *place = self.output(lane, parts);
            }
        }
        last
    }

    /// Store the output at the end of a run that ends inside a part.
    pub(super) fn set_last(&mut self, lane: usize, output: f64) {
        let part = of(&self.count, lane) as usize;
        let chunk = part / (CHUNK * self.per_sample);
        let put = |numbers: &mut Real<S>, new: &dyn Fn(f64) -> f64| {
            if let Some(number) = numbers.numbers_mut().get_mut(lane) {
                *number = new(*number);
            }
        };
        let place = (part + 1) * Self::WIDTH + lane;
        if let Some(place) = flat_mut::<S>(&mut self.outputs).get_mut(place) {
            *place = output;
        }
        if let Some(summary) = self.chunks.get_mut(chunk) {
            put(&mut summary.most, &|most| most.max(output));
            put(&mut summary.least, &|least| least.min(output));
        }
    }

    /// The output of `lane` before (0) or at the end of a part (from 1 on).
    #[inline]
    pub(super) fn output(&self, lane: usize, place: usize) -> f64 {
        let outputs = flat::<S>(&self.outputs);
        let output = outputs.get(place * Self::WIDTH + lane);
        output.copied().unwrap_or(f64::NAN)
    }

    /// The polynomial of a part that has so many terms.
    #[inline]
    pub(super) fn polynomial(&self, part: usize, terms: usize) -> &[Lanes<S>] {
        let terms = self.pieces.get(part * terms..(part + 1) * terms);
        terms.unwrap_or_default()
    }
}

/// The number of a lane.
#[inline]
pub(super) fn of<S: Simd>(numbers: &Real<S>, lane: usize) -> f64 {
    numbers.numbers().get(lane).copied().unwrap_or(f64::NAN)
}
