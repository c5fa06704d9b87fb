//! When the outputs reach the levels of the rise, and when they enter their band for the last time.

use crate::dde::control_loop::level_crossings::last_entry;
use crate::simd::Simd;

use super::search::Search;
use super::trace::of;

impl<S: Simd> Search<'_, S> {
    /// When a level of the rise is reached.
    #[inline(always)]
    pub(super) fn rise(&mut self, is_end: bool) {
        let place = usize::from(is_end);
        let zero = self.view.loops.zero;
        let (sign, level) = (self.measured.sign, self.measured.levels[place]);
        let risen = self.measured.risen[place];
        let earlier = self.measured.counts & risen.eq(risen);
        let chunk = self.spots.rise[place];
        let mut wanted = self.measured.counts & !risen.eq(risen) & chunk.ge(0.0);
        let mut begin = self.chunks(chunk, chunk).0;
        while wanted.any() {
            let hit = self.seek::<false>(
                wanted,
                (begin, self.spots.parts),
                #[inline(always)]
                |_, [first, last, bulge]| ((first * sign).max(last * sign) + bulge).ge(level),
            );
            wanted = hit.here;
            if !wanted.any() {
                break;
            }
            begin = hit.part + 1.0;
            let (first, last) = (hit.first * sign, hit.last * sign);
            let at_once = wanted & first.ge(level);
            let crosses = wanted & !at_once & last.ge(level);
            let is_line = crosses & hit.bulge.le(0.0);
            let share = (level - first) / (last - first);
            let time = self.time_on_line(hit.part, share);
            let mut time = at_once.select(self.view.times(hit.part), time);
            let mut value = at_once.select(first, level);
            // A jump passes over the level.
            let is_jump = is_line & self.view.lengths(hit.part).eq(0.0);
            value = is_jump.select(last, value);
            let mut done = at_once | is_line;
            let curved = wanted & !done;
            if curved.any() {
                let until = self.until(hit.part);
                let crosses = crosses & curved;
                let shown = self.shown(hit.part, curved, (crosses, level * sign));
                let reaches = self.passes(
                    &shown,
                    curved & !crosses,
                    until,
                    #[inline(always)]
                    |output| (output * sign).ge(level),
                );
                let sigma = self.crossing(&shown, crosses | reaches, until, level * sign);
                done = done | crosses | reaches;
                time = curved.select(self.time_in(hit.part, sigma), time);
            }
            self.measured.risen[place] = done.select(time, self.measured.risen[place]);
            if is_end {
                self.after_rise(&hit, done, value);
            }
            wanted = wanted & !done;
        }
        if is_end && earlier.any() {
            // Of a rise in an earlier trace, all corners count.
            let dip = self.measured.dip;
            self.measured.dip = earlier.select(dip.smaller(self.spots.dip), dip);
            self.spots.dip_from = earlier.select(zero, self.spots.dip_from);
        }
    }

    /// The last entry in the band.
    #[inline(always)]
    pub(super) fn entry(&mut self) {
        let chunk = self.spots.outside;
        let mut wanted = self.measured.counts & chunk.ge(0.0);
        if !wanted.any() {
            return;
        }
        let zero = self.view.loops.zero;
        let nan = zero.constant(f64::NAN);
        let (steady, band) = (self.measured.steady, self.measured.band);
        let mut end = self.chunks(chunk, chunk).1;
        // The run ends outside of the band.
        let is_end = wanted & end.ge(self.spots.parts);
        let outside = is_end & self.measured.are_outside(self.spots.last);
        self.measured.inside_since = outside.select(nan, self.measured.inside_since);
        wanted = wanted & !outside;
        while wanted.any() {
            let hit = self.seek_strayed(wanted, (zero, end), band);
            wanted = hit.here;
            if !wanted.any() {
                break;
            }
            end = hit.part;
            let enters = wanted & self.measured.are_outside(hit.first);
            let edge = hit.first.gt(steady).select(steady + band, steady - band);
            let mut done = enters & hit.bulge.le(0.0);
            let share = (edge - hit.first) / (hit.last - hit.first);
            let mut time = self.time_on_line(hit.part, share);
            let curved = wanted & !done;
            if curved.any() {
                let until = self.until(hit.part);
                let enters = enters & curved;
                let shown = self.shown(hit.part, curved, (enters, edge));
                let leaves = self.passes(
                    &shown,
                    curved & !enters,
                    until,
                    #[inline(always)]
                    |output| (output - steady).abs().gt(band),
                );
                let mut sigma = shown.crossing;
                done = done | enters | leaves;
                let unknown = (enters | leaves) & !sigma.eq(sigma);
                if unknown.any() {
                    for lane in unknown.lanes() {
                        let until = of(&until, lane);
                        let bounds = (of(&(steady - band), lane), of(&(steady + band), lane));
                        let last = last_entry(&self.series(lane), bounds, (0.0, until));
                        sigma.numbers_mut()[lane] = last.unwrap_or(until);
                    }
                }
                time = curved.select(self.time_in(hit.part, sigma), time);
            }
            self.measured.inside_since = done.select(time, self.measured.inside_since);
            wanted = wanted & !done;
        }
    }
}
