//! What is known of the responses of two vectors while their traces are searched.

use crate::dde::control_loop::metrics::{Levels, Record};
use crate::simd::{Mask, Real, Simd};

use super::sets::SETS;
use super::trace::of;

/// What is known of responses.
pub(super) struct Measured<S: Simd> {
    /// The responses that count.
    pub(super) counts: Mask<S>,
    pub(super) sign: Real<S>,
    pub(super) steady: Real<S>,
    pub(super) band: Real<S>,
    pub(super) quiet_band: Real<S>,
    /// Levels of the rise, in the direction of the step.
    pub(super) levels: [Real<S>; 2],
    /// The fields of [`Record`].
    pub(super) top: (Real<S>, Real<S>),
    pub(super) bottom: (Real<S>, Real<S>),
    pub(super) risen: [Real<S>; 2],
    pub(super) inside_since: Real<S>,
    pub(super) unsettled_until: Real<S>,
    /// Least output after the rise, times the sign of the step.
    pub(super) dip: Real<S>,
}

impl<S: Simd> Measured<S> {
    /// Nothing yet, of responses that begin at `first`, of which the first `count` ones count.
    #[inline(always)]
    pub(super) fn new(levels: &[Levels; SETS], first: Real<S>, count: usize) -> Self {
        let zero = first.constant(0.0);
        let nan = zero.constant(f64::NAN);
        let mut out = Self {
            counts: zero.lt(0.0),
            sign: zero,
            steady: zero,
            band: zero,
            quiet_band: zero,
            levels: [zero; 2],
            top: (first, zero),
            bottom: (first, zero),
            risen: [nan; 2],
            inside_since: nan,
            unsettled_until: zero,
            dip: nan,
        };
        let mut counts = zero;
        for (lane, level) in levels.iter().enumerate().take(zero.numbers().len()) {
            out.sign.numbers_mut()[lane] = level.sign;
            out.steady.numbers_mut()[lane] = level.steady;
            out.band.numbers_mut()[lane] = level.band;
            out.quiet_band.numbers_mut()[lane] = level.quiet_band;
            out.levels[0].numbers_mut()[lane] = level.rise.0;
            out.levels[1].numbers_mut()[lane] = level.rise.1;
            counts.numbers_mut()[lane] = f64::from(u8::from(lane < count));
        }
        out.counts = counts.gt(0.0);
        let is_inside = (first - out.steady).abs().le(out.band);
        out.inside_since = is_inside.select(0.0, nan);
        out
    }

    /// The outputs that are outside the band.
    #[inline(always)]
    pub(super) fn are_outside(&self, y: Real<S>) -> Mask<S> {
        (y - self.steady).abs().gt(self.band)
    }

    /// The record of a response in the end.
    pub(super) fn record(&self, lane: usize) -> Record {
        let (top, bottom) = (of(&self.top.0, lane), of(&self.bottom.0, lane));
        let dip = of(&self.dip, lane);
        Record {
            top: (top, of(&self.top.1, lane)),
            bottom: (bottom, of(&self.bottom.1, lane)),
            risen: (of(&self.risen[0], lane), of(&self.risen[1], lane)),
            after: if of(&self.sign, lane) > 0.0 {
                (dip, top)
            } else {
                (bottom, -dip)
            },
            inside_since: of(&self.inside_since, lane),
            limited_until: 0.0,
            unsettled_until: of(&self.unsettled_until, lane),
        }
    }
}
