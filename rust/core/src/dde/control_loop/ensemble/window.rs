//! The parts of a trace in which something may happen, looked for in all loops at once.
//!
//! Each loop has a range of parts of its own. Some parts of all ranges are read side by side, and a
//! test is made of them without a branch.

use crate::simd::{Lanes, Mask, Real, Simd, flat, flat_mut};

use super::trace::{Trace, WINDOW};

/// Consecutive parts, from another one on in each loop.
pub(super) struct Window<S: Simd> {
    /// The first part.
    from: Real<S>,
    /// Outputs at the begin and at the end of each part.
    outputs: [Lanes<S>; WINDOW + 1],
    bulges: [Lanes<S>; WINDOW],
}

impl<S: Simd> Window<S> {
    /// Nothing read yet.
    #[inline(always)]
    pub(super) fn new(zero: Real<S>) -> Self {
        Self {
            from: zero.constant(f64::INFINITY),
            outputs: [zero.lanes(); WINDOW + 1],
            bulges: [zero.lanes(); WINDOW],
        }
    }

    /// Read the parts of each loop in `open` from `from` on.
    #[inline(always)]
    fn read(&mut self, trace: &Trace<S>, open: Mask<S>, from: Real<S>) {
        let last = trace.outputs.len().saturating_sub(WINDOW + 1);
        let from = open.select(from, from.constant(-1.0));
        // Neighbours often have the same parts.
        if let Some(part) = shared(from, open) {
            let part = (part as usize).min(last);
            self.from = from.constant(part as f64);
            self.outputs
                .copy_from_slice(&trace.outputs[part..=part + WINDOW]);
            if trace.is_curved {
                for (number, bulge) in self.bulges.iter_mut().enumerate() {
                    let place = trace.bulge_of(part + number);
                    *bulge = place
                        .and_then(|place| trace.bulges.get(place))
                        .copied()
                        .unwrap_or(from.constant(0.0).lanes());
                }
            }
            return;
        }
        let width = Trace::<S>::WIDTH;
        let (outputs, bulges) = (flat::<S>(&trace.outputs), flat::<S>(&trace.bulges));
        self.from = from;
        for lane in 0..width {
            let begin = &mut self.from.numbers_mut()[lane];
            let part = (*begin as usize).min(last);
            *begin = part as f64;
            let (into, from) = (flat_mut::<S>(&mut self.outputs), &outputs[part * width..]);
            for place in 0..=WINDOW {
                into[place * width + lane] = from[place * width + lane];
            }
            if !trace.is_curved {
                continue;
            }
            let into = flat_mut::<S>(&mut self.bulges);
            for number in 0..WINDOW {
                let place = trace.bulge_of(part + number);
                let bulge = place.and_then(|place| bulges.get(place * width + lane));
                into[number * width + lane] = bulge.copied().unwrap_or(0.0);
            }
        }
    }
}

/// The number that all lanes in `here` have in common.
#[inline(always)]
pub(super) fn shared<S: Simd>(numbers: Real<S>, here: Mask<S>) -> Option<f64> {
    let lanes = here.select(numbers, numbers.constant(f64::NAN));
    let first = *lanes.numbers().iter().find(|number| !number.is_nan())?;
    let others = here & !numbers.eq(first);
    (!others.any()).then_some(first)
}

/// A question about a part.
pub(super) trait Test<S: Simd> {
    /// Its answers, given the outputs at the begin and end of the parts and how far they may be
    /// exceeded between.
    fn holds(&self, first: Real<S>, last: Real<S>, bulge: Real<S>) -> Mask<S>;
}

/// Does the part end at this output?
pub(super) struct EndsAt<S: Simd>(pub(super) Real<S>);

impl<S: Simd> Test<S> for EndsAt<S> {
    #[inline(always)]
    fn holds(&self, _: Real<S>, last: Real<S>, _: Real<S>) -> Mask<S> {
        last.eq(self.0)
    }
}

/// May the output, multiplied by a sign, exceed this one inside of the part?
pub(super) struct Exceeds<S: Simd> {
    pub(super) sign: Real<S>,
    pub(super) bar: Real<S>,
    /// The output has no extremum in a part on which it changes by more than so many bulges.
    pub(super) most_change: f64,
}

impl<S: Simd> Test<S> for Exceeds<S> {
    #[inline(always)]
    fn holds(&self, first: Real<S>, last: Real<S>, bulge: Real<S>) -> Mask<S> {
        let most = (first * self.sign).max(last * self.sign) + bulge;
        let may_turn = (last - first).abs().le(bulge * self.most_change);
        most.gt(self.bar) & may_turn & bulge.gt(0.0)
    }
}

/// May the output, multiplied by a sign, reach this level?
pub(super) struct Reaches<S: Simd> {
    pub(super) sign: Real<S>,
    pub(super) level: Real<S>,
}

impl<S: Simd> Test<S> for Reaches<S> {
    #[inline(always)]
    fn holds(&self, first: Real<S>, last: Real<S>, bulge: Real<S>) -> Mask<S> {
        let most = (first * self.sign).max(last * self.sign) + bulge;
        most.ge(self.level)
    }
}

/// May the output be farther than this from the steady state in the part or at its ends?
pub(super) struct Strays<S: Simd> {
    pub(super) steady: Real<S>,
    pub(super) band: Real<S>,
}

impl<S: Simd> Test<S> for Strays<S> {
    #[inline(always)]
    fn holds(&self, first: Real<S>, last: Real<S>, bulge: Real<S>) -> Mask<S> {
        let (first, last) = ((first - self.steady).abs(), (last - self.steady).abs());
        (first.max(last) + bulge).gt(self.band)
    }
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

impl<S: Simd> Window<S> {
    /// The first or, if `BACK`, the last part of a range of each wanted loop that passes a test.
    #[inline(always)]
    pub(super) fn seek<const BACK: bool>(
        &mut self,
        trace: &Trace<S>,
        wanted: Mask<S>,
        (mut begin, mut end): (Real<S>, Real<S>),
        test: &impl Test<S>,
    ) -> Hit<S> {
        let zero = begin.constant(0.0);
        let simd = zero.simd();
        let mut hit = Hit {
            here: zero.lt(0.0),
            part: zero,
            first: zero,
            last: zero,
            bulge: zero,
        };
        let mut open = wanted & begin.lt(end);
        while open.any() {
            let (from, to) = if BACK {
                (begin.larger(end - WINDOW as f64), end)
            } else {
                (begin, end.smaller(begin + WINDOW as f64))
            };
            let is_read = from.ge(self.from) & to.le(self.from + WINDOW as f64);
            if (open & !is_read).any() {
                self.read(trace, open, from);
            }
            for step in 0..WINDOW {
                // The part found last counts.
                let number = if BACK { step } else { WINDOW - 1 - step };
                let part = self.from + number as f64;
                let first = Real::new(simd, self.outputs[number]);
                let last = Real::new(simd, self.outputs[number + 1]);
                let bulge = Real::new(simd, self.bulges[number]);
                let holds = test.holds(first, last, bulge);
                let holds = open & holds & part.ge(from) & part.lt(to);
                hit.here = hit.here | holds;
                hit.part = holds.select(part, hit.part);
                hit.first = holds.select(first, hit.first);
                hit.last = holds.select(last, hit.last);
                hit.bulge = holds.select(bulge, hit.bulge);
            }
            if BACK {
                end = from;
            } else {
                begin = to;
            }
            open = open & !hit.here & begin.lt(end);
        }
        hit
    }

    /// The least output, multiplied by a sign, at the ends of the parts of a range of each wanted loop.
    #[inline(always)]
    pub(super) fn least(
        &mut self,
        trace: &Trace<S>,
        wanted: Mask<S>,
        (mut begin, end): (Real<S>, Real<S>),
        sign: Real<S>,
    ) -> Real<S> {
        let zero = begin.constant(0.0);
        let mut least = zero.constant(f64::INFINITY);
        let mut open = wanted & begin.lt(end);
        while open.any() {
            let to = end.smaller(begin + WINDOW as f64);
            let is_read = begin.ge(self.from) & to.le(self.from + WINDOW as f64);
            if (open & !is_read).any() {
                self.read(trace, open, begin);
            }
            for number in 0..WINDOW {
                let part = self.from + number as f64;
                let last = Real::new(zero.simd(), self.outputs[number + 1]) * sign;
                let counts = open & part.ge(begin) & part.lt(to);
                least = counts.select(least.min(last), least);
            }
            begin = to;
            open = open & begin.lt(end);
        }
        least
    }
}
