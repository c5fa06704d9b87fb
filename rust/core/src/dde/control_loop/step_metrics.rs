//! Metrics of a response, measured during the run, polynomial by polynomial.
//!
//! The extrema of a polynomial are the zeros of its derivative, its crossings of a level the zeros
//! after the level is subtracted. Both are isolated by sign changes in the Bernstein basis and
//! bisected to the last bit. Nothing between output times is missed, and no metric depends on a
//! grid of times. A polynomial whose range, bounded by its coefficients, cannot change any metric
//! is skipped.

use super::level_crossings::{corners, last_entry};
use super::metrics::{Criteria, Levels, Metrics, Record};
use super::requested_output::Measure;
use super::series::Series;
use crate::dde::limits::slack;

/// Measures one response between two times.
#[derive(Debug, Clone)]
pub(crate) struct StepMetrics {
    start: f64,
    end: f64,
    criteria: Criteria,
    steady: f64,
    /// None until the response begins.
    levels: Option<Levels>,
    record: Record,
    zeros: Vec<f64>,
}

impl StepMetrics {
    /// For a response from `start` to `end` whose steady state is `steady`.
    pub(crate) fn new(start: f64, end: f64, steady: f64, criteria: Criteria) -> Self {
        let unknown = (f64::NAN, f64::NAN);
        Self {
            start,
            end,
            criteria,
            steady,
            levels: None,
            record: Record {
                top: unknown,
                bottom: unknown,
                risen: unknown,
                after: unknown,
                inside_since: f64::NAN,
                unsettled_until: 0.0,
                limited_until: 0.0,
            },
            zeros: Vec::new(),
        }
    }

    pub(crate) fn metrics(&self) -> Metrics {
        self.levels
            .map_or(Metrics::UNKNOWN, |levels| self.record.metrics(&levels))
    }

    /// What is known of the response.
    pub(crate) fn record(&self) -> &Record {
        &self.record
    }

    /// Can an output between `low` and `high` change the record?
    fn concerns(&self, levels: &Levels, low: f64, high: f64) -> bool {
        let record = &self.record;
        let best = if levels.sign > 0.0 { high } else { -low };
        high > record.top.0
            || low < record.bottom.0
            || high > record.after.1
            || low < record.after.0
            || (record.risen.1.is_nan() && best >= levels.rise.0)
    }

    /// The first time at which each level of the rise is reached. `places` divide the response into
    /// monotone parts.
    fn rise(&mut self, levels: &Levels, y: &Series, places: &[f64], time: impl Fn(f64) -> f64) {
        let reached = |sigma: f64, level: f64| levels.sign * y.at(sigma) >= level;
        let first = |level: f64| -> Option<f64> {
            let place = places.iter().position(|&sigma| reached(sigma, level))?;
            let right = *places.get(place)?;
            let Some(mut left) = place.checked_sub(1).and_then(|p| places.get(p)).copied() else {
                return Some(right);
            };
            let mut right = right;
            loop {
                let mid = 0.5 * (left + right);
                if mid <= left || mid >= right || right - left < 0.5 * f64::EPSILON {
                    return Some(right);
                }
                if reached(mid, level) {
                    right = mid;
                } else {
                    left = mid;
                }
            }
        };
        if self.record.risen.0.is_nan()
            && let Some(sigma) = first(levels.rise.0)
        {
            self.record.risen.0 = time(sigma).max(0.0);
        }
        if self.record.risen.1.is_nan()
            && let Some(sigma) = first(levels.rise.1)
        {
            self.record.risen.1 = time(sigma).max(0.0);
            let value = y.at(sigma);
            self.record.after = (value, value);
        }
    }
}

impl Measure for StepMetrics {
    fn limited(&mut self, start: f64, end: f64) {
        if start <= self.end {
            self.record.limited_until = self.record.limited_until.max(end.min(self.end));
        }
    }

    fn segment(&mut self, start: f64, length: f64, end: f64, y: &Series) {
        let Some((from, to)) = part_within((self.start, self.end), (start, length, end)) else {
            return;
        };
        let since = self.start;
        let time = |sigma: f64| start + sigma * length - since;
        let (begin, begins_at) = (y.at(from), time(from).max(0.0));
        let (last, ends_at) = (y.at(to), time(to));
        let levels = *self.levels.get_or_insert_with(|| {
            self.record.top = (begin, begins_at);
            self.record.bottom = (begin, begins_at);
            Levels::new(begin, self.steady, &self.criteria)
        });
        let (low, high) = y.range();
        let mut zeros = std::mem::take(&mut self.zeros);

        // The points at which the output may be greatest or least, in order.
        let matters = self.concerns(&levels, low, high);
        corners(y, (from, to), matters, &mut zeros);
        self.rise(&levels, y, &zeros, time);
        for &sigma in &zeros {
            let (value, at) = (y.at(sigma), time(sigma).max(0.0));
            if value > self.record.top.0 {
                self.record.top = (value, at);
            }
            if value < self.record.bottom.0 {
                self.record.bottom = (value, at);
            }
            if at >= self.record.risen.1 {
                self.record.after.0 = self.record.after.0.min(value);
                self.record.after.1 = self.record.after.1.max(value);
            }
        }

        // The band: from the last entry on, if the output ends inside.
        let outside = |y: f64| (y - levels.steady).abs() > levels.band;
        if outside(last) {
            self.record.inside_since = f64::NAN;
        } else {
            if self.record.inside_since.is_nan() || outside(begin) {
                self.record.inside_since = begins_at;
            }
            let band = (levels.steady - levels.band, levels.steady + levels.band);
            if let Some(entry) = last_entry(y, band, (from, to)) {
                self.record.inside_since = time(entry).min(ends_at);
            }
        }
        if (high - levels.steady).max(levels.steady - low) > levels.quiet_band {
            self.record.unsettled_until = ends_at;
        }
        self.zeros = zeros;
    }
}

/// The part of a polynomial of (t − `start`)/`length`, from 0 to `end`, that lies within a time.
pub(crate) fn part_within(
    (first, last): (f64, f64),
    (start, length, end): (f64, f64, f64),
) -> Option<(f64, f64)> {
    // A polynomial that ends at the first time may end in a jump there.
    if start + end * length <= first + slack(first, first) {
        return None;
    }
    let from = ((first - start) / length).max(0.0);
    let mut to = ((last - start) / length).min(end);
    // A polynomial that begins at the last time may begin with a jump.
    if start <= last + slack(last, last) {
        to = to.max(0.0);
    }
    (from <= to).then_some((from, to))
}

#[cfg(test)]
mod tests {
    use super::*;

    const CRITERIA: Criteria = Criteria {
        rise: (0.1, 0.9),
        settling: 0.02,
    };

    #[test]
    fn a_parabola_and_a_line_are_measured_exactly() {
        // y = 4 t (1 − t/2) to t = 2 … back at zero, then up to one in a line.
        for sign in [1.0, -1.0] {
            let mut metrics = StepMetrics::new(0.0, 3.0, sign, CRITERIA);
            metrics.segment(0.0, 2.0, 1.0, &Series::of(&[0.0, 8.0 * sign, -8.0 * sign]));
            metrics.segment(2.0, 1.0, 1.0, &Series::of(&[0.0, sign]));
            let found = metrics.metrics();
            let close = |a: f64, b: f64| (a - b).abs() < 1e-14;
            assert!(close(found.peak, 2.0) && close(found.peak_time, 1.0));
            assert!(close(found.overshoot, 100.0) && close(found.undershoot, 0.0));
            // 4 t − 2 t² = p at t = 1 − √(1 − p/2).
            let at = |p: f64| 1.0 - (1.0 - p / 2.0).sqrt();
            assert!(close(found.rise_time, at(0.9) - at(0.1)));
            assert!(close(found.settling_time, 2.98));
            let (least, most) = if sign > 0.0 { (0.0, 2.0) } else { (-2.0, 0.0) };
            assert!(close(found.settling_min, least) && close(found.settling_max, most));
        }
    }

    #[test]
    fn what_lies_outside_the_window_does_not_count() {
        let mut metrics = StepMetrics::new(1.0, 2.0, 1.0, CRITERIA);
        metrics.segment(0.0, 4.0, 1.0, &Series::of(&[5.0, -8.0, 4.0]));
        // 5 − 2 t + t²/4 on [1, 2]: from 3.25 down to 2.
        let found = metrics.metrics();
        assert_eq!((found.peak, found.peak_time), (3.25, 0.0));
        assert!(found.settling_time.is_nan() && found.rise_time.is_nan());
    }
}
