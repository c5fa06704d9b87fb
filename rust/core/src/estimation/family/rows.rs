//! The rows of a record as the family uses them: which count, and where the command is known.

use std::sync::Arc;

use super::aside::{Aside, Signal};
use super::cause::CauseKind;
use super::shape::Shape;
use super::smoothing::Smoothing;
use super::tolerances::{REST, SEARCH};
use crate::Error;

/// Share of the changes of a command that another follows in the next row, up to which it jumps: more
/// takes ramps of a row or two for jumps.
const JUMPS: f64 = 0.1;

/// The same share up to which its values rest between changes: more takes ramps for held values.
const RESTS: f64 = 0.5;

/// One record.
#[derive(Debug, Clone)]
pub struct Record {
    /// Times of the rows, s.
    pub time: Vec<f64>,
    /// The command at each row, or of each time in `sent`.
    pub command: Vec<f64>,
    /// Times of the commands, s, where they are not those of the rows.
    pub sent: Option<Vec<f64>>,
    /// For how long the controller holds each command, s; 0 where that is not known. A straight
    /// command is known for so long of each row.
    pub hold: f64,
    /// The output, NaN where it is missing.
    pub output: Vec<f64>,
    /// Rows at the start that are used as input only.
    pub earlier: usize,
}

impl Record {
    /// Checked.
    ///
    /// # Errors
    /// [`Error::Argument`] for lengths that differ, times that do not increase, a command that is not
    /// finite, an infinite output, or too few rows.
    pub fn checked(self) -> Result<Self, Error> {
        let count = self.time.len();
        let sent = self.sent();
        refuse_if!(
            self.command.len() != sent.len() || self.output.len() != count || sent.is_empty(),
            "{count} times, {} commands and {} outputs are given: give one of each for every row",
            self.command.len(),
            self.output.len()
        );
        check_times(&self.time)?;
        check_times(sent)?;
        refuse_if!(
            !(self.hold >= 0.0 && self.hold.is_finite()),
            "commands are held for {} s: give 0 or more",
            self.hold
        );
        if let Some(at) = (0..sent.len()).find(|at| !self.command[*at].is_finite()) {
            refuse!(
                "the command in row {at} is {}, but commands must be finite",
                self.command[at]
            );
        }
        if let Some(at) = (0..count).find(|at| self.output[*at].is_infinite()) {
            refuse!(
                "the output in row {at} is {}, but outputs must be finite, or NaN where they are \
                 missing",
                self.output[at]
            );
        }
        refuse_if!(
            self.earlier >= count,
            "{} of {count} rows are earlier rows: leave some rows to fit",
            self.earlier
        );
        Ok(self)
    }

    /// Times of the commands, s.
    pub(super) fn sent(&self) -> &[f64] {
        self.sent.as_deref().unwrap_or(&self.time)
    }

    /// Time from the first to the last row, s.
    pub(super) fn span(&self) -> f64 {
        self.time.last().copied().unwrap_or(0.0) - self.time.first().copied().unwrap_or(0.0)
    }

    /// The median distance of rows, s.
    pub(super) fn row(&self) -> f64 {
        let mut steps: Vec<f64> = self.time.windows(2).map(|pair| pair[1] - pair[0]).collect();
        steps.sort_by(f64::total_cmp);
        steps.get(steps.len() / 2).copied().unwrap_or(1.0)
    }

    /// Does the command jump from one held value to the next? A straight one would need rows to get there.
    pub(super) fn jumps(&self) -> bool {
        self.followed().is_some_and(|share| share <= JUMPS)
    }

    /// Do values of the command rest between its changes?
    pub(super) fn rests(&self) -> bool {
        self.followed().is_some_and(|share| share <= RESTS)
    }

    /// Share of the changes of the command that another follows in the next row; None without a change.
    fn followed(&self) -> Option<f64> {
        let pairs = self.command.windows(2);
        let changes: Vec<bool> = pairs.map(|pair| pair[1] != pair[0]).collect();
        let count = changes.iter().filter(|is| **is).count();
        let both = changes.windows(2).filter(|pair| pair[0] && pair[1]);
        (count > 0).then(|| both.count() as f64 / count as f64)
    }

    /// Does the record begin with rows in which neither the command nor the output moves?
    pub(super) fn begins_at_rest(&self) -> bool {
        let sent = self.sent();
        let change = self.command.iter().position(|u| *u != self.command[0]);
        let moves = change.map(|at| self.time.partition_point(|t| *t < sent[at]));
        let known = |rows: std::ops::Range<usize>| {
            let pairs = rows.map(|at| (self.time[at] - self.time[0], self.output[at]));
            pairs.filter(|(_, y)| y.is_finite()).collect::<Vec<_>>()
        };
        let before = known(0..moves.unwrap_or(0));
        let all = known(0..self.time.len());
        let low = all.iter().fold(f64::INFINITY, |low, (_, y)| low.min(*y));
        let high = all
            .iter()
            .fold(f64::NEG_INFINITY, |high, (_, y)| high.max(*y));
        if before.len() < REST.rows {
            return false;
        }
        let (slope, error) = slope(&before);
        let length = before[before.len() - 1].0 - before[0].0;
        slope.abs() <= REST.slope * error + f64::MIN_POSITIVE
            && (slope.abs() + error) * length <= REST.share * (high - low)
    }
}

fn check_times(time: &[f64]) -> Result<(), Error> {
    if let Some(at) = (1..time.len()).find(|at| time[*at] <= time[at - 1]) {
        refuse!(
            "time {} s in row {at} follows {} s, but times must increase",
            time[at],
            time[at - 1]
        );
    }
    if let Some(at) = (0..time.len()).find(|at| !time[*at].is_finite()) {
        refuse!("the time in row {at} is {}: give finite times", time[at]);
    }
    Ok(())
}

/// The slope of points and its standard error.
fn slope(points: &[(f64, f64)]) -> (f64, f64) {
    let count = points.len() as f64;
    let mean_t = points.iter().map(|(t, _)| t).sum::<f64>() / count;
    let mean_y = points.iter().map(|(_, y)| y).sum::<f64>() / count;
    let square: f64 = points
        .iter()
        .map(|(t, _)| (t - mean_t) * (t - mean_t))
        .sum();
    let product: f64 = points
        .iter()
        .map(|(t, y)| (t - mean_t) * (y - mean_y))
        .sum();
    let slope = product / square;
    let left: f64 = points
        .iter()
        .map(|(t, y)| y - mean_y - slope * (t - mean_t))
        .map(|off| off * off)
        .sum();
    (slope, (left / (count - 2.0) / square).sqrt())
}

/// What is known of the plant at the first row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Start {
    /// At rest: no free state, and the command before was that of the first row.
    Rest,
    /// The command before was that of the first row; the state is free.
    Held,
    /// Nothing: rows up to the largest delay do not count.
    Unknown,
}

/// Rows that count of one record, with the whole command.
#[derive(Debug, Clone)]
pub(super) struct Part {
    pub(super) time: Vec<f64>,
    /// Times of the commands, and the commands less the first one.
    pub(super) sent: Vec<f64>,
    pub(super) command: Vec<f64>,
    /// The first command.
    pub(super) base: f64,
    /// For how long the controller holds a command, s.
    pub(super) hold: f64,
    pub(super) straight: bool,
    /// Median distance of rows and length of the record, s.
    pub(super) row: f64,
    pub(super) span: f64,
    /// Indices of the rows that count, and the distance of each from the one before, in rows.
    pub(super) used: Vec<usize>,
    pub(super) gaps: Vec<usize>,
    /// The output there less its mean, and that mean.
    pub(super) output: Vec<f64>,
    pub(super) mean: f64,
    /// Residuals are never taken for smaller than this: rounding of the output.
    pub(super) rounding: f64,
    pub(super) start: Start,
    /// What each cause of the rows adds here.
    pub(super) asides: Vec<Option<Aside>>,
    /// The command before anything that passes it.
    pub(super) given: Option<Arc<Signal>>,
    /// The largest slope of the output of the plant's lag, in units of the command a second, where one is limited.
    pub(super) slope: Option<f64>,
    /// The mean that the record is of the output.
    pub(super) smoothing: Option<Smoothing>,
}

impl Part {
    fn new(record: &Record, start: Start, largest_delay: f64, straight: bool) -> Self {
        let from = match start {
            Start::Unknown => record.sent()[0] + largest_delay,
            Start::Rest | Start::Held => record.time[0],
        };
        let counts = |at: &usize| {
            *at >= record.earlier && record.time[*at] >= from && record.output[*at].is_finite()
        };
        let first = record.command[0];
        let mut out = Self {
            time: record.time.clone(),
            sent: record.sent().to_vec(),
            hold: record.hold,
            command: record.command.iter().map(|u| u - first).collect(),
            base: first,
            straight,
            row: record.row(),
            span: record.span(),
            used: (0..record.time.len()).filter(counts).collect(),
            gaps: Vec::new(),
            output: Vec::new(),
            mean: 0.0,
            rounding: 0.0,
            start,
            asides: Vec::new(),
            given: None,
            slope: None,
            smoothing: None,
        };
        let count = out.used.len().max(1) as f64;
        out.mean = out.used.iter().map(|at| record.output[*at]).sum::<f64>() / count;
        let off = out.used.iter().map(|at| record.output[*at] - out.mean);
        out.output = off.collect();
        let deviation = (out.output.iter().map(|y| y * y).sum::<f64>() / count).sqrt();
        let step = decimal_step(out.used.iter().map(|at| record.output[*at]));
        out.rounding = (SEARCH.rounding * deviation).max(step / 12.0_f64.sqrt());
        out.measure_gaps();
        out
    }

    /// Residuals of the record and its values, where they are means of those of the output.
    pub(super) fn shown(&self, residual: &[f64]) -> (Vec<f64>, &[f64]) {
        match &self.smoothing {
            Some(smoothing) => (smoothing.shown(residual), smoothing.readings()),
            None => (residual.to_vec(), &self.output),
        }
    }

    /// Does no row lack between the first and the last that counts?
    pub(super) fn is_whole(&self) -> bool {
        self.gaps.iter().all(|gap| *gap == 1)
    }

    fn measure_gaps(&mut self) {
        self.gaps = vec![1; self.used.len()];
        for (gap, pair) in self.gaps.iter_mut().skip(1).zip(self.used.windows(2)) {
            let rows = (self.time[pair[1]] - self.time[pair[0]]) / self.row;
            *gap = (rows.round() as usize).max(1);
        }
    }

    /// Every so many of the rows that count.
    fn thinned(&self, every: usize) -> Self {
        let mut out = self.clone();
        if let Some(smoothing) = out.smoothing.take() {
            out.output = smoothing.readings().to_vec();
        }
        out.used = self.used.iter().copied().step_by(every).collect();
        out.output = out.output.iter().copied().step_by(every).collect();
        out.measure_gaps();
        out
    }
}

/// Digits behind the point to which outputs may have been rounded: more than files have.
const DIGITS: i32 = 9;

/// Error of a rounded decimal number, as a share of its last digit.
const DECIMAL: f64 = 1e-4;

/// The step of the last decimal digit of these values; 0 where they are no rounded decimal numbers.
fn decimal_step(values: impl Iterator<Item = f64> + Clone) -> f64 {
    for digits in 0..=DIGITS {
        let scale = 10.0_f64.powi(digits);
        let is_rounded = |value: f64| (value * scale - (value * scale).round()).abs() < DECIMAL;
        if values.clone().all(is_rounded) {
            return 1.0 / scale;
        }
    }
    0.0
}

/// The records that are explained together, with what they share.
#[derive(Debug, Clone)]
pub(super) struct Rows {
    pub(super) parts: Vec<Part>,
    /// One over the size of the noise of each, up to a factor.
    pub(super) weights: Vec<f64>,
    pub(super) straight: bool,
    /// Median distance of rows, the least of all, and length of the longest record, s.
    pub(super) row: f64,
    pub(super) span: f64,
    pub(super) largest_delay: f64,
    pub(super) in_loop: bool,
    /// What is fitted beside the plant.
    pub(super) causes: Vec<CauseKind>,
    /// Of each of these, what the command passes.
    pub(super) shapes: Vec<Option<Shape>>,
    /// May the class be in error?
    pub(super) flexible: bool,
}

impl Rows {
    pub(super) fn new(
        records: &[Record],
        starts: &[Start],
        largest_delay: f64,
        straight: bool,
        in_loop: bool,
    ) -> Self {
        let pairs = records.iter().zip(starts);
        let parts: Vec<Part> = pairs
            .map(|(record, start)| Part::new(record, *start, largest_delay, straight))
            .collect();
        Self {
            weights: vec![1.0; parts.len()],
            straight,
            row: parts
                .iter()
                .fold(f64::INFINITY, |row, part| row.min(part.row)),
            span: parts.iter().fold(0.0, |span, part| part.span.max(span)),
            largest_delay,
            in_loop,
            causes: Vec::new(),
            shapes: Vec::new(),
            flexible: false,
            parts,
        }
    }

    /// How many rows count.
    pub(super) fn count(&self) -> usize {
        self.parts.iter().map(|part| part.used.len()).sum()
    }

    /// Where the rows of each part stand in columns of all.
    pub(super) fn places(&self) -> Vec<std::ops::Range<usize>> {
        let mut end = 0;
        let place = |part: &Part| {
            let start = end;
            end += part.used.len();
            start..end
        };
        self.parts.iter().map(place).collect()
    }

    /// One column of all parts.
    pub(super) fn joined<'a>(&'a self, of: impl Fn(&'a Part) -> Vec<f64>) -> Vec<f64> {
        if let [part] = &self.parts[..] {
            return of(part);
        }
        self.parts.iter().flat_map(of).collect()
    }

    /// About so many rows of those that count, to start from.
    pub(super) fn thinned(&self, most: usize) -> Self {
        let every = self.count().div_ceil(most.max(1)).max(1);
        let parts = self.parts.iter().map(|part| part.thinned(every));
        Self {
            parts: parts.collect(),
            ..self.clone()
        }
    }
}
