//! How far and how long an output is off a level, measured during the run, polynomial by polynomial.
//!
//! Between the zeros of a polynomial the integral of its modulus is a difference of its antiderivative,
//! so that integrals are exact to rounding and depend on no grid of times.

use super::level_crossings::{corners, crossings, last_entry};
use super::requested_output::Measure;
use super::series::Series;
use super::step_metrics::part_within;

/// What is measured of the deviation of an output from a level, over a time.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Deviation {
    /// The largest modulus.
    pub peak: f64,
    /// Its time from the start, s.
    pub peak_time: f64,
    /// Integral of the modulus.
    pub iae: f64,
    /// Integral.
    pub ie: f64,
    /// Time from the start after which the modulus stays within a share of the peak, s; NaN where it
    /// does not.
    pub recovery_time: f64,
    /// The last time from the start at which the output was off its rest by more than a share of the
    /// peak, or its command at a bound.
    pub loud_until: f64,
}

/// When a run without a given end is over.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ending {
    /// Not before this time, s.
    pub(crate) least: f64,
    /// The output must rest for this share of the run, and for this time.
    pub(crate) quiet: (f64, f64),
    /// The integral of the deviation from the rest, where it is known, and its relative error.
    pub(crate) integral: (f64, f64),
    /// Growth of the peak over a doubling of the time, and how many times in a row, that give a run up.
    pub(crate) growth: (f64, u32),
}

/// How a run without a given end goes on.
#[derive(Debug, Clone, Copy, Default)]
struct Progress {
    /// The time at which the peak is compared next.
    mark: f64,
    /// The peak at the mark before.
    peak: f64,
    growths: u32,
    is_settled: bool,
    is_lost: bool,
    /// The time reached.
    time: f64,
}

/// Measures a deviation between two times.
#[derive(Debug, Clone)]
pub(crate) struct DeviationMetrics {
    start: f64,
    end: f64,
    level: f64,
    /// The output at rest.
    rest: f64,
    /// Half widths of the bands around level and rest, as shares of the peak.
    bands: (f64, f64),
    ending: Option<Ending>,
    progress: Progress,
    found: Deviation,
    zeros: Vec<f64>,
}

impl DeviationMetrics {
    /// From `start` to `end`, of the deviation from `level` of an output that rests at `rest`. `bands`
    /// are the shares of the peak within which an output has recovered, and rests.
    pub(crate) fn new(
        (start, end): (f64, f64),
        (level, rest): (f64, f64),
        bands: (f64, f64),
        ending: Option<Ending>,
    ) -> Self {
        Self {
            start,
            end,
            level,
            rest,
            bands,
            ending,
            progress: Progress {
                mark: ending.map_or(0.0, |ending| ending.least),
                ..Progress::default()
            },
            found: Deviation::default(),
            zeros: Vec::new(),
        }
    }

    /// What was measured.
    pub(crate) fn found(&self) -> Deviation {
        self.found
    }

    /// The time reached, and whether the output came to rest before the end.
    pub(crate) fn settled(&self) -> (f64, bool) {
        (self.progress.time, self.progress.is_settled)
    }

    /// Is the run over at this time?
    fn judge(&mut self, ending: &Ending, time: f64) {
        let (found, progress) = (&self.found, &mut self.progress);
        progress.time = time;
        if time < progress.mark && progress.mark <= ending.least {
            return;
        }
        let quiet = time - found.loud_until;
        let off_rest = found.ie - (self.rest - self.level) * time;
        let (known, error) = ending.integral;
        let agrees = known.is_nan() || (off_rest - known).abs() <= error * found.iae;
        let is_quiet = quiet >= ending.quiet.0 * time && quiet >= ending.quiet.1;
        progress.is_settled |= is_quiet && agrees && found.peak > 0.0;
        if time >= progress.mark {
            let has_grown = progress.peak > 0.0 && found.peak > ending.growth.0 * progress.peak;
            progress.growths = if has_grown { progress.growths + 1 } else { 0 };
            progress.is_lost |= progress.growths == ending.growth.1;
            (progress.peak, progress.mark) = (found.peak, 2.0 * time);
        }
    }
}

impl Measure for DeviationMetrics {
    fn limited(&mut self, start: f64, end: f64) {
        if start <= self.end {
            let until = end.min(self.end) - self.start;
            self.found.loud_until = self.found.loud_until.max(until);
        }
    }

    fn segment(&mut self, start: f64, length: f64, end: f64, y: &Series) {
        let Some((from, to)) = part_within((self.start, self.end), (start, length, end)) else {
            return;
        };
        let mut off = *y;
        off.coefficients[0] -= self.level;
        let first = self.start;
        let time = |sigma: f64| (start + sigma * length - first).max(0.0);
        let (low, high) = off.range();
        let found = &mut self.found;

        let mut zeros = std::mem::take(&mut self.zeros);
        corners(&off, (from, to), high.max(-low) > found.peak, &mut zeros);
        for sigma in zeros.drain(..) {
            let size = off.at(sigma).abs();
            if size > found.peak {
                (found.peak, found.peak_time) = (size, time(sigma));
            }
        }

        let area = Area::of(&off, length);
        let mut at = from;
        if low < 0.0 && high > 0.0 {
            crossings(&off, 0.0, &mut zeros);
            zeros.retain(|sigma| *sigma > from && *sigma < to);
            zeros.sort_by(f64::total_cmp);
        }
        for sigma in zeros.drain(..).chain([to]) {
            let part = area.between(at, sigma);
            found.ie += part;
            found.iae += part.abs();
            at = sigma;
        }

        let band = self.bands.0 * found.peak;
        if off.at(to).abs() > band {
            found.recovery_time = f64::NAN;
        } else {
            if found.recovery_time.is_nan() || off.at(from).abs() > band {
                found.recovery_time = time(from);
            }
            if let Some(entry) = last_entry(&off, (-band, band), (from, to)) {
                found.recovery_time = time(entry);
            }
        }
        let rest = self.rest - self.level;
        if (high - rest).max(rest - low) > self.bands.1 * found.peak {
            found.loud_until = found.loud_until.max(time(to));
        }
        self.zeros = zeros;
        if let Some(ending) = self.ending {
            self.judge(&ending, time(to));
        }
    }

    fn is_enough(&self) -> bool {
        self.progress.is_settled || self.progress.is_lost
    }
}

/// The integral of a polynomial.
struct Area<'a> {
    y: &'a Series,
    length: f64,
}

impl<'a> Area<'a> {
    fn of(y: &'a Series, length: f64) -> Self {
        Self { y, length }
    }

    /// From one σ to another.
    fn between(&self, from: f64, to: f64) -> f64 {
        let primitive = |sigma: f64| {
            let terms = self.y.terms().iter().enumerate().rev();
            terms.fold(0.0, |sum, (j, c)| sum * sigma + c / (j + 1) as f64) * sigma
        };
        self.length * (primitive(to) - primitive(from))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_and_a_line_are_integrated_exactly() {
        // 4 t (1 − t/2) over 2 s, then −t over 1 s and back.
        let mut metrics = DeviationMetrics::new((0.0, 4.0), (0.0, 0.0), (0.02, 1e-6), None);
        metrics.segment(0.0, 2.0, 1.0, &Series::of(&[0.0, 8.0, -8.0]));
        metrics.segment(2.0, 2.0, 1.0, &Series::of(&[0.0, -4.0, 4.0]));
        let found = metrics.found();
        let close = |a: f64, b: f64| (a - b).abs() < 1e-14;
        assert!(close(found.peak, 2.0) && close(found.peak_time, 1.0));
        assert!(close(found.iae, 4.0) && close(found.ie, 4.0 / 3.0));
        // −4 σ (1 − σ) is within 0.04 from σ = (1 + √0.96)/2 on.
        assert!(close(found.recovery_time, 2.0 + 1.0 + 0.96_f64.sqrt()));
    }
}
