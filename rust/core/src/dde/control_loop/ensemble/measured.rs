//! Metrics of the loops of a block, from the lines of their responses.

use crate::dde::control_loop::metrics::{Criteria, Levels, Metrics, Record};
use crate::simd::{Mask, Real, Simd};

use super::block::{Block, Column, SETS};
use super::each::judged;
use super::sets::Outcome;
use super::through::{Visitor, through};
use super::walk::{Line, Sink, load, store};

/// Metrics of the first `goals.len()` loops. A goal is the steady state, NaN for the last output.
pub(super) fn metrics(
    block: &Block,
    goals: &[f64],
    span: f64,
    criteria: &Criteria,
) -> Vec<(Metrics, Outcome)> {
    let mut steady = [0.0; SETS];
    let mut is_known = true;
    for (place, goal) in steady.iter_mut().zip(goals) {
        *place = *goal;
        is_known &= !goal.is_nan();
    }
    if !is_known {
        let last = through(block, span, LastOutput([0.0; SETS]));
        for (place, last) in steady.iter_mut().zip(last) {
            if place.is_nan() {
                *place = last;
            }
        }
    }
    let levels = steady.map(|steady| Levels::new(0.0, steady, criteria));
    let found = through(block, span, Measured::new(&levels));
    let sets = levels.iter().enumerate().take(goals.len());
    sets.map(|(lane, levels)| {
        let ahead = block.ahead[lane];
        let at = |[value, time]: [&Column; 2]| (value[lane], (time[lane] - ahead).max(0.0));
        if found.lost[lane] != 0.0 {
            return (Metrics::UNKNOWN, Outcome::Diverged);
        }
        let [
            top,
            top_time,
            bottom,
            bottom_time,
            begun,
            risen,
            least,
            most,
            since,
            unsettled,
        ] = &found.parts;
        let record = Record {
            top: at([top, top_time]),
            bottom: at([bottom, bottom_time]),
            risen: (begun[lane] - ahead, risen[lane] - ahead),
            after: (least[lane], most[lane]),
            inside_since: if since[lane] > ahead {
                since[lane] - ahead
            } else {
                0.0 * since[lane]
            },
            unsettled_until: unsettled[lane] - ahead,
        };
        let wait = block.sample_time[lane] * (block.samples + 2) as f64;
        judged(record.metrics(levels), record.stays_settled(span, wait))
    })
    .collect()
}

/// The last output of each loop.
struct LastOutput(Column);

struct Last<S: Simd> {
    end: Real<S>,
    value: Real<S>,
}

impl<S: Simd> Sink<S> for Last<S> {
    #[inline(always)]
    fn line(&mut self, line: Line<S>) {
        let running = line.begin.lt(self.end);
        self.value = running.select(line.until(self.end).last, self.value);
    }
}

impl Visitor for LastOutput {
    type Kept = Column;

    type Sink<S: Simd> = Last<S>;

    #[inline(always)]
    fn begin<S: Simd>(&mut self, simd: S, _: usize, end: Real<S>) -> Last<S> {
        Last {
            end,
            value: Real::splat(simd, 0.0),
        }
    }

    #[inline(always)]
    fn finish<S: Simd>(&mut self, pair: usize, sink: Last<S>, _: Real<S>) {
        store(&mut self.0, pair, sink.value);
    }

    fn kept(self) -> Column {
        self.0
    }
}

/// Records of all loops, in columns.
struct Measured {
    sign: Column,
    steady: Column,
    begun: Column,
    risen: Column,
    band: Column,
    quiet_band: Column,
    /// Maximum and minimum, each with its time; begin and end of the rise; extremes after it; since
    /// when inside the band; until when unsettled.
    parts: [Column; 10],
    lost: Column,
}

impl Measured {
    fn new(levels: &[Levels; SETS]) -> Self {
        Self {
            sign: levels.map(|level| level.sign),
            steady: levels.map(|level| level.sign * level.steady),
            begun: levels.map(|level| level.rise.0),
            risen: levels.map(|level| level.rise.1),
            band: levels.map(|level| level.band),
            quiet_band: levels.map(|level| level.quiet_band),
            parts: [[0.0; SETS]; 10],
            lost: [0.0; SETS],
        }
    }
}

/// The record of each lane during a run.
struct Growing<S: Simd> {
    end: Real<S>,
    sign: Real<S>,
    steady: Real<S>,
    band: Real<S>,
    quiet_band: Real<S>,
    level: [Real<S>; 2],
    top: [Real<S>; 2],
    bottom: [Real<S>; 2],
    /// When the levels were reached; NaN where they have not been.
    reached: [Real<S>; 2],
    pending: [Mask<S>; 2],
    after: [Real<S>; 2],
    since: Real<S>,
    outside: Mask<S>,
    unsettled: Real<S>,
}

impl<S: Simd> Sink<S> for Growing<S> {
    #[inline(always)]
    fn line(&mut self, line: Line<S>) {
        let running = line.begin.lt(self.end);
        let line = line.until(self.end);
        let (last, end) = (line.last, line.end);

        let higher = running & last.gt(self.top[0]);
        self.top = [
            higher.select(last, self.top[0]),
            higher.select(end, self.top[1]),
        ];
        let lower = running & last.lt(self.bottom[0]);
        self.bottom = [
            lower.select(last, self.bottom[0]),
            lower.select(end, self.bottom[1]),
        ];

        // After multiplication by the sign, every step goes up.
        let up = Line {
            first: line.first * self.sign,
            last: last * self.sign,
            ..line
        };
        let risen = !self.pending[1];
        for i in 0..2 {
            let crosses = running & self.pending[i] & up.last.ge(self.level[i]);
            if crosses.any() {
                let starts = up.first.ge(self.level[i]);
                let time = starts.select(up.begin, up.time_of(self.level[i]));
                self.reached[i] = crosses.select(time, self.reached[i]);
                self.pending[i] = self.pending[i] & !crosses;
                if i == 1 {
                    let value = self.level[1] * self.sign;
                    self.after = [
                        crosses.select(value.smaller(last), self.after[0]),
                        crosses.select(value.larger(last), self.after[1]),
                    ];
                }
            }
        }
        let (least, most) = (
            risen & running & last.lt(self.after[0]),
            risen & running & last.gt(self.after[1]),
        );
        self.after = [
            least.select(last, self.after[0]),
            most.select(last, self.after[1]),
        ];

        let away = (up.last - self.steady).abs();
        let inside = away.le(self.band);
        let enters = running & inside & self.outside;
        if enters.any() {
            let from_above = up.first.gt(self.steady);
            let edge = from_above.select(self.steady + self.band, self.steady - self.band);
            self.since = enters.select(up.time_of(edge), self.since);
        }
        self.outside = (running & !inside) | (!running & self.outside);
        let unsettled = running & away.gt(self.quiet_band);
        self.unsettled = unsettled.select(end, self.unsettled);
    }
}

impl Visitor for Measured {
    type Kept = Self;

    type Sink<S: Simd> = Growing<S>;

    #[inline(always)]
    fn begin<S: Simd>(&mut self, simd: S, pair: usize, end: Real<S>) -> Growing<S> {
        let zero = Real::splat(simd, 0.0);
        let unknown = Real::splat(simd, f64::NAN);
        let steady = load(simd, &self.steady, pair);
        let band = load(simd, &self.band, pair);
        let everywhere = zero.le(0.0);
        Growing {
            end,
            sign: load(simd, &self.sign, pair),
            steady,
            band,
            quiet_band: load(simd, &self.quiet_band, pair),
            level: [load(simd, &self.begun, pair), load(simd, &self.risen, pair)],
            top: [zero; 2],
            bottom: [zero; 2],
            reached: [unknown; 2],
            pending: [everywhere; 2],
            after: [unknown; 2],
            since: zero,
            outside: !steady.abs().le(band),
            unsettled: zero,
        }
    }

    #[inline(always)]
    fn finish<S: Simd>(&mut self, pair: usize, sink: Growing<S>, lost: Real<S>) {
        let unknown = lost.constant(f64::NAN);
        let values = [
            sink.top[0],
            sink.top[1],
            sink.bottom[0],
            sink.bottom[1],
            sink.reached[0],
            sink.reached[1],
            sink.after[0],
            sink.after[1],
            sink.outside.select(unknown, sink.since),
            sink.unsettled,
        ];
        for (column, value) in self.parts.iter_mut().zip(values) {
            store(column, pair, value);
        }
        store(&mut self.lost, pair, lost);
    }

    fn kept(self) -> Self {
        self
    }
}
