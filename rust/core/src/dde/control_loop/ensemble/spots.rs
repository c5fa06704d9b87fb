//! The chunks of a trace in which something that counts may happen, in all loops at once.

use crate::simd::{Real, Simd};

use super::measured::Measured;
use super::trace::{CHUNK, Trace};

/// An extremum counts if it may exceed the one known by this share of the step: rounding errors of
/// a settled output are below it.
const ROUNDING: f64 = 1e-13;

/// The first and the last of several chunks: the first one is the greater where there are none.
pub(super) type Range<S> = (Real<S>, Real<S>);

/// Chunks of the trace of each loop in which its output may change the record, negative for none.
pub(super) struct Spots<S: Simd> {
    /// Parts of each run.
    pub(super) parts: Real<S>,
    /// Greatest corner, and its chunk if it is greater than all before.
    pub(super) most: Real<S>,
    pub(super) top: Real<S>,
    pub(super) least: Real<S>,
    pub(super) bottom: Real<S>,
    /// First chunks in which the levels of the rise may be reached.
    pub(super) rise: [Real<S>; 2],
    /// Last chunks in which the output may be outside of the band, and of the quiet band.
    pub(super) outside: Real<S>,
    pub(super) restless: Real<S>,
    /// Chunks in which the output may exceed its corners.
    pub(super) may_top: Range<S>,
    pub(super) may_bottom: Range<S>,
    /// Least corner after the first chunk in which the rise may end, or after a rise in an earlier
    /// trace, times the sign of the step, and the part from which the output may be less.
    pub(super) dip: Real<S>,
    pub(super) dip_from: Real<S>,
    /// Differences of outputs that do not count.
    pub(super) tolerance: Real<S>,
    /// The output at the end of the trace of each loop.
    pub(super) last: Real<S>,
}

impl<S: Simd> Spots<S> {
    /// Those of a trace.
    #[inline(always)]
    pub(super) fn new(trace: &Trace<S>, measured: &Measured<S>) -> Self {
        let Measured {
            sign,
            steady,
            band,
            quiet_band,
            levels,
            ..
        } = *measured;
        let zero = sign.constant(0.0);
        let has_risen = measured.risen[1].ge(0.0);
        let parts = trace.parts();
        let per_chunk = (CHUNK * trace.per_sample) as f64;
        let (mut most, mut least) = (measured.top.0, measured.bottom.0);
        let (none, never) = (zero.constant(-1.0), zero.constant(f64::INFINITY));
        let (mut top, mut bottom, mut outside, mut restless) = (none, none, none, none);
        // How many chunks end below the levels of the rise, and the best output of all of them.
        let (mut rise, mut best) = ([zero; 2], -never);
        let (mut is_risen, mut dip) = (has_risen, never);
        for (number, chunk) in trace.chunks.iter().enumerate() {
            let number = number as f64;
            let (higher, lower) = (chunk.most.gt(most), chunk.least.lt(least));
            most = higher.select(chunk.most, most);
            least = lower.select(chunk.least, least);
            top = higher.select(number, top);
            bottom = lower.select(number, bottom);
            // After the end of a run, chunks repeat its last whole corner, and their bulges are those
            // of what follows.
            let runs = parts.gt(number * per_chunk);
            let far = (chunk.most - steady).max(steady - chunk.least) + chunk.bulge;
            outside = (runs & far.gt(band)).select(number, outside);
            restless = (runs & far.gt(quiet_band)).select(number, restless);
            let (one, other) = (chunk.most * sign, chunk.least * sign);
            dip = (runs & is_risen).select(dip.min(one.min(other)), dip);
            best = best.max(one.max(other) + chunk.bulge);
            for (rise, level) in rise.iter_mut().zip(&levels) {
                *rise = best.lt(*level).select(*rise + 1.0, *rise);
            }
            is_risen = has_risen | best.ge(levels[1]);
        }
        let count = trace.chunks.len() as f64;
        for rise in &mut rise {
            *rise = rise.lt(count).select(*rise, none);
        }
        let size = most.abs().max(least.abs()).max(steady.abs()) * ROUNDING;
        let mut extremes = [(never, none); 2];
        if trace.is_curved {
            for (number, chunk) in trace.chunks.iter().enumerate() {
                let here = zero.constant(number as f64);
                let may = [
                    (chunk.most + chunk.bulge).gt(most + size),
                    (chunk.least - chunk.bulge).lt(least - size),
                ];
                for ((first, last), may) in extremes.iter_mut().zip(may) {
                    *first = may.select(here, never).min(*first);
                    *last = may.select(here, *last);
                }
            }
        }
        let [may_top, may_bottom] = extremes;
        Self {
            parts,
            most,
            top,
            least,
            bottom,
            rise,
            outside,
            restless,
            may_top,
            may_bottom,
            dip,
            dip_from: never,
            tolerance: size,
            last: trace.last(zero),
        }
    }
}
