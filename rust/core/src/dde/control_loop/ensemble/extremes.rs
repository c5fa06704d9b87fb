//! Extrema of the outputs: at corners, inside of parts, and after the rise.

use crate::simd::{Mask, Real, Simd};

use super::search::{Hit, Search};

impl<S: Simd> Search<'_, S> {
    /// Extremes at corners, and the end of unrest.
    #[inline(always)]
    pub(super) fn corners(&mut self) {
        let counts = self.measured.counts;
        let zero = self.view.loops.zero;
        let nan = zero.constant(f64::NAN);
        for is_top in [true, false] {
            let (chunk, value) = if is_top {
                (self.spots.top, self.spots.most)
            } else {
                (self.spots.bottom, self.spots.least)
            };
            let wanted = counts & chunk.ge(0.0);
            if !wanted.any() {
                continue;
            }
            let range = self.chunks(chunk, chunk);
            let hit = self.seek::<false>(
                wanted,
                range,
                #[inline(always)]
                |_, [_, last, _]| last.eq(value),
            );
            let time = hit.here.select(self.view.times(hit.part + 1.0), nan);
            let extreme = if is_top {
                &mut self.measured.top
            } else {
                &mut self.measured.bottom
            };
            extreme.0 = wanted.select(value, extreme.0);
            extreme.1 = wanted.select(time, extreme.1);
        }
        let chunk = self.spots.restless;
        let wanted = counts & chunk.ge(0.0);
        if wanted.any() {
            let range = (zero, self.chunks(chunk, chunk).1);
            let hit = self.seek_strayed(wanted, range, self.measured.quiet_band);
            let time = self.view.times(hit.part + 1.0);
            self.measured.unsettled_until = hit.here.select(time, self.measured.unsettled_until);
        }
    }

    /// Extremes inside of parts.
    #[inline(always)]
    pub(super) fn extremes(&mut self) {
        let counts = self.measured.counts;
        let one = self.view.loops.zero.constant(1.0);
        for is_top in [true, false] {
            let (first, last) = if is_top {
                self.spots.may_top
            } else {
                self.spots.may_bottom
            };
            let mut wanted = counts & first.le(last);
            let (mut begin, end) = self.chunks(first, last);
            while wanted.any() {
                let (sign, most) = if is_top {
                    (one, self.measured.top.0)
                } else {
                    (-one, -self.measured.bottom.0)
                };
                let bar = most + self.spots.tolerance;
                let hit = self.seek_beyond(wanted, (begin, end), (sign, bar));
                wanted = hit.here;
                if !wanted.any() {
                    break;
                }
                begin = hit.part + 1.0;
                let shown = self.shown(hit.part, wanted, (one.lt(0.0), one));
                let until = self.until(hit.part);
                self.take(hit.part, shown.at, shown.extremum(wanted, until));
                for (at, output) in self.others(&shown, wanted, until) {
                    self.take(hit.part, at, output);
                }
            }
        }
    }

    /// Take up extrema at `sigma` of parts; NaN where there is none.
    #[inline(always)]
    fn take(&mut self, part: Real<S>, sigma: Real<S>, output: Real<S>) {
        let (top, bottom) = (self.measured.top, self.measured.bottom);
        let (higher, lower) = (output.gt(top.0), output.lt(bottom.0));
        if !(higher | lower).any() {
            return;
        }
        let time = self.time_in(part, sigma);
        self.measured.top = (higher.select(output, top.0), higher.select(time, top.1));
        self.measured.bottom = (lower.select(output, bottom.0), lower.select(time, bottom.1));
    }

    /// The least corner after the end of the rise in a part, with an output there.
    #[inline(always)]
    pub(super) fn after_rise(&mut self, hit: &Hit<S>, done: Mask<S>, value: Real<S>) {
        if !done.any() {
            return;
        }
        let parts = self.spots.parts;
        let chunk = self.spots.rise[1];
        let end = self.chunks(chunk, chunk).1;
        // The chunks after the one in which the level may be reached first are known together.
        let is_there = hit.part.lt(end);
        let (mut least, sign) = (value, self.measured.sign);
        self.seek::<false>(
            done,
            (hit.part, is_there.select(end, parts)),
            #[inline(always)]
            |inside, [_, last, _]| {
                least = inside.select(least.smaller(last * sign), least);
                done & !done
            },
        );
        let dip = is_there.select(least.smaller(self.spots.dip), least);
        self.measured.dip = done.select(dip, self.measured.dip);
        self.spots.dip_from = done.select(hit.part + 1.0, self.spots.dip_from);
    }

    /// Outputs after the rise that are less than at all corners.
    #[inline(always)]
    pub(super) fn dips(&mut self) {
        let risen = self.measured.risen[1];
        let mut begin = self.spots.dip_from;
        let (sign, parts) = (self.measured.sign, self.spots.parts);
        let mut wanted = self.measured.counts & risen.eq(risen) & begin.lt(parts);
        while wanted.any() {
            let bar = self.measured.dip - self.spots.tolerance;
            let (from, to) = self.next_dip(begin, bar);
            let (from, to) = (from.larger(begin), to.smaller(parts));
            let hit = self.seek_beyond(wanted, (from, to), (-sign, -bar));
            begin = hit.here.select(hit.part + 1.0, to);
            wanted = wanted & begin.lt(parts);
            if !hit.here.any() {
                continue;
            }
            let shown = self.shown(hit.part, hit.here, (sign.lt(-2.0), sign));
            let until = self.until(hit.part);
            let mut dip = (shown.extremum(hit.here, until) * sign).smaller(self.measured.dip);
            for (_, output) in self.others(&shown, hit.here, until) {
                dip = (output * sign).smaller(dip);
            }
            self.measured.dip = dip;
        }
    }

    /// The parts of the first chunk with parts at or after `begin` whose outputs may be below a bar;
    /// none and the end of the trace, where there is no such chunk.
    #[inline(always)]
    fn next_dip(&self, begin: Real<S>, bar: Real<S>) -> (Real<S>, Real<S>) {
        let trace = self.view.trace;
        let per_chunk = self.view.per_chunk() as f64;
        let sign = self.measured.sign;
        let mut next = begin.constant(trace.chunks.len() as f64);
        for (number, chunk) in trace.chunks.iter().enumerate().rev() {
            let number = number as f64;
            let worst = (chunk.most * sign).min(chunk.least * sign) - chunk.bulge;
            let is_after = begin.lt((number + 1.0) * per_chunk);
            next = (worst.lt(bar) & is_after).select(number, next);
        }
        self.chunks(next, next)
    }
}
