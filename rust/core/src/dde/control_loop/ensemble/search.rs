//! The search of one trace for what counts in one loop: extrema, the rise, the last entry in the band.
//!
//! The search goes from stage to stage, and stops wherever it needs the polynomial of a part.

use crate::dde::control_loop::level_crossings::crossings;
use crate::dde::control_loop::metrics::Levels;
use crate::dde::control_loop::series::Series;
use crate::simd::{Real, Simd};

use super::measured::{Measured, Stage, Wanted};
use super::piece::{Extrema, Piece, turns};
use super::spots::{Range, Spots};
use super::trace::of;
use super::view::View;

/// What the polynomials of a round show.
pub(super) struct Found<'a, S: Simd> {
    pub(super) piece: &'a Piece<S>,
    pub(super) extrema: &'a Extrema<S>,
    /// NaN where the polynomial has to be examined further.
    pub(super) sigma: Real<S>,
}

impl<S: Simd> Found<'_, S> {
    /// Extrema of a lane: times within the part, and outputs.
    pub(super) fn extrema(&self, lane: usize, mut each: impl FnMut(f64, f64)) {
        if of(&self.extrema.has_one, lane) > 0.0 {
            each(of(&self.extrema.at, lane), of(&self.extrema.output, lane));
        } else if of(&self.extrema.is_unknown, lane) > 0.0 {
            let series = self.piece.series(lane);
            for sigma in turns(&series) {
                each(sigma, series.at(sigma));
            }
        }
    }

    pub(super) fn series(&self, lane: usize) -> Series {
        self.piece.series(lane)
    }
}

/// One loop of a view.
pub(super) struct One<'a, S: Simd, const P: usize> {
    pub(super) view: &'a View<'a, S, P>,
    pub(super) spots: &'a Spots,
    pub(super) lane: usize,
}

impl<S: Simd, const P: usize> One<'_, S, P> {
    #[inline]
    fn y(&self, place: usize) -> f64 {
        self.view.trace.output(self.lane, place)
    }

    #[inline]
    fn time(&self, place: usize) -> f64 {
        self.view.time(self.lane, place)
    }

    #[inline]
    fn bulge(&self, part: usize) -> f64 {
        self.view.bulge(self.lane, part)
    }

    /// Number of parts.
    #[inline]
    fn parts(&self) -> usize {
        self.spots.parts[self.lane]
    }

    /// Parts of a chunk.
    #[inline]
    fn of_chunk(&self, chunk: usize) -> std::ops::Range<usize> {
        let per_chunk = self.view.per_chunk();
        chunk * per_chunk..((chunk + 1) * per_chunk).min(self.parts())
    }

    /// A bound below the outputs of a chunk, times the sign of the step.
    fn worst(&self, chunk: usize, sign: f64) -> f64 {
        let Some(chunk) = self.view.trace.chunks.get(chunk) else {
            return f64::NEG_INFINITY;
        };
        let (most, least) = (of(&chunk.most, self.lane), of(&chunk.least, self.lane));
        (sign * most).min(sign * least) - of(&chunk.bulge, self.lane)
    }

    /// Time of a part at σ.
    fn time_in(&self, part: usize, sigma: f64) -> f64 {
        let begin = self.time(part);
        let time = self.view.length(self.lane, part).mul_add(sigma, begin);
        time.max(begin).min(self.time(part + 1))
    }

    /// σ at the end of a part, inside of which the run may end.
    pub(super) fn until(&self, part: usize) -> f64 {
        if part + 1 < self.parts() {
            return 1.0;
        }
        let length = self.view.length(self.lane, part);
        ((self.time(part + 1) - self.time(part)) / length).min(1.0)
    }

    /// Extremes at corners, the end of unrest, and the first stage.
    pub(super) fn corners(&self, measured: &mut Measured) {
        // The run ended in an earlier trace: the chunks of this one repeat its last whole corner,
        // and after that the output may have entered its band.
        if self.parts() == 0 {
            measured.stage = Stage::Done;
            return;
        }
        let lane = self.lane;
        let record = &mut measured.record;
        for (chunk, value, extreme) in [
            (
                self.spots.top.of(lane),
                self.spots.most[lane],
                &mut record.top,
            ),
            (
                self.spots.bottom.of(lane),
                self.spots.least[lane],
                &mut record.bottom,
            ),
        ] {
            if let Some(chunk) = chunk {
                let part = self.of_chunk(chunk).find(|&part| self.y(part + 1) == value);
                *extreme = (value, part.map_or(f64::NAN, |part| self.time(part + 1)));
            }
        }
        if let Some(chunk) = self.spots.quiet.of(lane) {
            let steady = measured.levels.steady;
            let away = |place: usize| (self.y(place) - steady).abs();
            let mut parts = self.of_chunk(chunk);
            // Otherwise it is the corner before the chunk that is outside.
            let begin = parts.start.min(self.parts());
            let part =
                parts.rfind(|&part| away(part + 1) + self.bulge(part) > measured.levels.quiet_band);
            measured.record.unsettled_until = self.time(part.map_or(begin, |part| part + 1));
        }
        let is_curved = self.view.loops.is_curved;
        self.enter(
            measured,
            if is_curved {
                Stage::Top
            } else {
                Stage::Rise(false)
            },
        );
    }

    /// Go to the begin of a stage.
    fn enter(&self, measured: &mut Measured, stage: Stage) {
        let lane = self.lane;
        measured.stage = stage;
        let per_chunk = self.view.per_chunk();
        let begin = |chunk: Option<usize>| chunk.map_or(usize::MAX, |chunk| chunk * per_chunk);
        measured.at = match stage {
            Stage::Top => begin(self.spots.may_top.0.of(lane)),
            Stage::Bottom => begin(self.spots.may_bottom.0.of(lane)),
            Stage::Rise(false) => begin(self.spots.rise[0].of(lane)),
            Stage::Rise(true) => begin(self.spots.rise[1].of(lane)),
            // Set by the end of the rise; of a rise in an earlier trace, all places count.
            Stage::Dip | Stage::Done => 0,
            Stage::Band => match self.spots.outside.of(lane) {
                Some(chunk) => self.of_chunk(chunk).end,
                None => usize::MAX,
            },
        };
    }

    /// The next part that has to be known, and what of it; none if there is none.
    pub(super) fn next(&self, measured: &mut Measured) -> Option<(usize, Wanted)> {
        let lane = self.lane;
        let last_of = |range: &Range| range.1.of(lane).map_or(0, |last| self.of_chunk(last).end);
        let size = self.spots.tolerance[lane];
        loop {
            match measured.stage {
                Stage::Done => return None,
                Stage::Top => {
                    let end = last_of(&self.spots.may_top);
                    while measured.at < end {
                        let part = measured.at;
                        measured.at += 1;
                        let high = self.y(part).max(self.y(part + 1)) + self.bulge(part);
                        if high > measured.record.top.0 + size && self.bulge(part) > 0.0 {
                            return Some((part, Wanted::Extremum));
                        }
                    }
                    self.enter(measured, Stage::Bottom);
                }
                Stage::Bottom => {
                    let end = last_of(&self.spots.may_bottom);
                    while measured.at < end {
                        let part = measured.at;
                        measured.at += 1;
                        let low = self.y(part).min(self.y(part + 1)) - self.bulge(part);
                        if low < measured.record.bottom.0 - size && self.bulge(part) > 0.0 {
                            return Some((part, Wanted::Extremum));
                        }
                    }
                    self.enter(measured, Stage::Rise(false));
                }
                Stage::Rise(is_end) => {
                    if let Some(wanted) = self.rise(measured, is_end) {
                        return Some(wanted);
                    }
                }
                Stage::Dip => {
                    let sign = measured.levels.sign;
                    let end = last_of(&self.spots.may_dip);
                    let per_chunk = self.view.per_chunk();
                    while measured.at < end {
                        let part = measured.at;
                        if part.is_multiple_of(per_chunk)
                            && self.worst(part / per_chunk, sign) >= measured.dip
                        {
                            measured.at += per_chunk;
                            continue;
                        }
                        measured.at += 1;
                        let (one, other) = (sign * self.y(part), sign * self.y(part + 1));
                        let bulge = self.bulge(part);
                        let asks = one.min(other) - bulge < measured.dip - size && bulge > 0.0;
                        measured.dip = measured.dip.min(other);
                        if asks {
                            return Some((part, Wanted::Extremum));
                        }
                    }
                    self.enter(measured, Stage::Band);
                }
                Stage::Band => {
                    if let Some(wanted) = self.band(measured) {
                        return Some(wanted);
                    }
                }
            }
        }
    }

    /// Look for the part in which a level of the rise is reached.
    fn rise(&self, measured: &mut Measured, is_end: bool) -> Option<(usize, Wanted)> {
        let (sign, level) = (measured.levels.sign, measured.level(is_end));
        let reached = if is_end {
            measured.record.risen.1
        } else {
            measured.record.risen.0
        };
        while reached.is_nan() && measured.at < self.parts() {
            let part = measured.at;
            measured.at += 1;
            let (first, last) = (sign * self.y(part), sign * self.y(part + 1));
            let bulge = self.bulge(part);
            if first >= level {
                self.risen(measured, is_end, part, self.time(part), first);
                return None;
            }
            if last >= level {
                if bulge > 0.0 {
                    return Some((part, Wanted::Crossing(sign * level)));
                }
                let share = (level - first) / (last - first);
                let (begin, end) = (self.time(part), self.time(part + 1));
                let time = (end - begin).mul_add(share, begin);
                // A jump passes over the level.
                let is_jump = self.view.length(self.lane, part) == 0.0;
                self.risen(
                    measured,
                    is_end,
                    part,
                    time,
                    if is_jump { last } else { level },
                );
                return None;
            }
            if first.max(last) + bulge >= level && bulge > 0.0 {
                return Some((part, Wanted::Extremum));
            }
        }
        self.leave_rise(measured, is_end);
        None
    }

    /// A level of the rise is reached in a part.
    fn risen(&self, measured: &mut Measured, is_end: bool, part: usize, time: f64, value: f64) {
        if is_end {
            measured.record.risen.1 = time;
            measured.dip = value.min(measured.levels.sign * self.y(part + 1));
            measured.stage = Stage::Dip;
            measured.at = part + 1;
        } else {
            measured.record.risen.0 = time;
            self.enter(measured, Stage::Rise(true));
        }
    }

    fn leave_rise(&self, measured: &mut Measured, is_end: bool) {
        if !is_end {
            self.enter(measured, Stage::Rise(true));
        } else if measured.record.risen.1.is_nan() {
            self.enter(measured, Stage::Band);
        } else {
            self.enter(measured, Stage::Dip);
        }
    }

    /// Look for the last part in which the output enters its band.
    fn band(&self, measured: &mut Measured) -> Option<(usize, Wanted)> {
        if measured.at == usize::MAX {
            measured.stage = Stage::Done;
            return None;
        }
        let levels = measured.levels;
        loop {
            let place = measured.at;
            let y = self.y(place);
            if measured.is_outside(y) {
                measured.stage = Stage::Done;
                if place >= self.parts() {
                    measured.record.inside_since = f64::NAN;
                    return None;
                }
                let edge = if y > levels.steady {
                    levels.steady + levels.band
                } else {
                    levels.steady - levels.band
                };
                if self.bulge(place) > 0.0 {
                    measured.at = place;
                    measured.stage = Stage::Band;
                    return Some((place, Wanted::Crossing(edge)));
                }
                let last = self.y(place + 1);
                let (begin, end) = (self.time(place), self.time(place + 1));
                let share = (edge - y) / (last - y);
                measured.record.inside_since = (end - begin).mul_add(share, begin);
                return None;
            }
            let Some(part) = place.checked_sub(1) else {
                measured.stage = Stage::Done;
                return None;
            };
            measured.at = part;
            let away = (y - levels.steady)
                .abs()
                .max((self.y(part) - levels.steady).abs());
            let bulge = self.bulge(part);
            // Where the part begins outside, its end inside is found next.
            if bulge > 0.0 && away + bulge > levels.band && !measured.is_outside(self.y(part)) {
                return Some((part, Wanted::Extremum));
            }
        }
    }

    /// Take up what the polynomials show.
    pub(super) fn accept(
        &self,
        measured: &mut Measured,
        part: usize,
        wanted: Wanted,
        found: &Found<'_, S>,
    ) {
        let levels = measured.levels;
        let lane = self.lane;
        let until = self.until(part);
        match (measured.stage, wanted) {
            (Stage::Top | Stage::Bottom, _) => found.extrema(lane, |sigma, value| {
                let record = &mut measured.record;
                if sigma <= until && value > record.top.0 {
                    record.top = (value, self.time_in(part, sigma));
                }
                if sigma <= until && value < record.bottom.0 {
                    record.bottom = (value, self.time_in(part, sigma));
                }
            }),
            (Stage::Dip, _) => found.extrema(lane, |sigma, value| {
                if sigma <= until {
                    measured.dip = measured.dip.min(levels.sign * value);
                }
            }),
            (Stage::Rise(is_end), Wanted::Crossing(level)) => {
                let mut sigma = of(&found.sigma, lane);
                if sigma.is_nan() {
                    sigma = first_crossing(&found.series(lane), level).unwrap_or(until);
                }
                let time = self.time_in(part, sigma);
                self.risen(measured, is_end, part, time, levels.sign * level);
            }
            (Stage::Rise(is_end), Wanted::Extremum) => {
                let level = measured.level(is_end);
                let mut reaches = false;
                found.extrema(lane, |sigma, value| {
                    reaches |= sigma <= until && levels.sign * value >= level;
                });
                if reaches {
                    let sigma = first_crossing(&found.series(lane), levels.sign * level);
                    let time = self.time_in(part, sigma.unwrap_or(until));
                    self.risen(measured, is_end, part, time, level);
                }
            }
            (Stage::Band, Wanted::Crossing(_)) => {
                let mut sigma = of(&found.sigma, lane);
                if sigma.is_nan() {
                    sigma = last_entry(&found.series(lane), &levels, until).unwrap_or(until);
                }
                measured.record.inside_since = self.time_in(part, sigma);
                measured.stage = Stage::Done;
            }
            (Stage::Band, Wanted::Extremum) => {
                let mut leaves = false;
                found.extrema(lane, |sigma, value| {
                    leaves |= sigma <= until && (value - levels.steady).abs() > levels.band;
                });
                if leaves {
                    let sigma = last_entry(&found.series(lane), &levels, until);
                    measured.record.inside_since = self.time_in(part, sigma.unwrap_or(until));
                    measured.stage = Stage::Done;
                }
            }
            (Stage::Done, _) => {}
        }
    }
}

/// Where the polynomial first passes through a level.
fn first_crossing(y: &Series, level: f64) -> Option<f64> {
    let mut zeros = Vec::new();
    crossings(y, level, &mut zeros);
    zeros.into_iter().reduce(f64::min)
}

/// Where the polynomial last enters the band before `until`.
fn last_entry(y: &Series, levels: &Levels, until: f64) -> Option<f64> {
    let mut zeros = Vec::new();
    crossings(y, levels.steady - levels.band, &mut zeros);
    crossings(y, levels.steady + levels.band, &mut zeros);
    let before = zeros.into_iter().filter(|&sigma| sigma <= until);
    before.reduce(f64::max)
}
