//! The rows of a record as the family uses them: which count, and where the command is known.

use super::tolerances::REST;
use crate::Error;

/// One record.
#[derive(Debug, Clone)]
pub struct Record {
    /// Times of the rows, s.
    pub time: Vec<f64>,
    /// The command at each row.
    pub command: Vec<f64>,
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
        refuse_if!(
            self.command.len() != count || self.output.len() != count,
            "{count} times, {} commands and {} outputs: give one of each for every row",
            self.command.len(),
            self.output.len()
        );
        let increases = |at: usize| self.time[at] > self.time[at - 1];
        if let Some(at) = (1..count).find(|at| !increases(*at)) {
            refuse!(
                "time {} s in row {at} after {} s: times must increase",
                self.time[at],
                self.time[at - 1]
            );
        }
        if let Some(at) = (0..count).find(|at| !self.time[*at].is_finite()) {
            refuse!("time {} in row {at}: times must be finite", self.time[at]);
        }
        if let Some(at) = (0..count).find(|at| !self.command[*at].is_finite()) {
            refuse!(
                "command {} in row {at}: commands must be finite",
                self.command[at]
            );
        }
        if let Some(at) = (0..count).find(|at| self.output[*at].is_infinite()) {
            refuse!(
                "output {} in row {at}: outputs must be finite, or NaN where they are missing",
                self.output[at]
            );
        }
        refuse_if!(
            self.earlier >= count,
            "{} earlier rows of {count}: leave rows to fit",
            self.earlier
        );
        Ok(self)
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

    /// Does the record begin with rows in which neither the command nor the output moves?
    pub(super) fn begins_at_rest(&self) -> bool {
        let moves = self.command.iter().position(|u| *u != self.command[0]);
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

/// Rows that count, with the whole command.
#[derive(Debug, Clone)]
pub(super) struct Rows {
    pub(super) time: Vec<f64>,
    /// The command less that of the first row.
    pub(super) command: Vec<f64>,
    /// That of the first row.
    pub(super) base: f64,
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
    /// Standard deviation of the output.
    pub(super) deviation: f64,
    pub(super) start: Start,
    pub(super) largest_delay: f64,
    pub(super) in_loop: bool,
}

impl Rows {
    pub(super) fn new(
        record: &Record,
        start: Start,
        largest_delay: f64,
        straight: bool,
        in_loop: bool,
    ) -> Self {
        let (row, span) = (record.row(), record.span());
        let from = match start {
            Start::Unknown => record.time[0] + largest_delay,
            Start::Rest | Start::Held => record.time[0],
        };
        let counts = |at: &usize| {
            *at >= record.earlier && record.time[*at] >= from && record.output[*at].is_finite()
        };
        let used: Vec<usize> = (0..record.time.len()).filter(counts).collect();
        let mut gaps = vec![1; used.len()];
        for (gap, pair) in gaps.iter_mut().skip(1).zip(used.windows(2)) {
            let rows = (record.time[pair[1]] - record.time[pair[0]]) / row;
            *gap = (rows.round() as usize).max(1);
        }
        let count = used.len().max(1) as f64;
        let mean = used.iter().map(|at| record.output[*at]).sum::<f64>() / count;
        let output: Vec<f64> = used.iter().map(|at| record.output[*at] - mean).collect();
        let deviation = (output.iter().map(|y| y * y).sum::<f64>() / count).sqrt();
        let first = record.command[0];
        Self {
            time: record.time.clone(),
            command: record.command.iter().map(|u| u - first).collect(),
            base: first,
            straight,
            row,
            span,
            used,
            gaps,
            output,
            mean,
            deviation,
            start,
            largest_delay,
            in_loop,
        }
    }
}
