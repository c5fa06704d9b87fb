//! Commands that hold from their times on, some of them unknown, computed or lost.

use super::super::median::median;
use super::tolerances::{GAPS, LOG};

/// Commands that hold from their times on.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Sent {
    /// s.
    pub time: Vec<f64>,
    /// The commands.
    pub command: Vec<f64>,
    /// Times between which the mean command is unknown, s.
    pub unknown: Vec<(f64, f64)>,
    /// Times between which a command was computed from an output, and its change by a unit of the error
    /// of that output, zero at its limit; in the order of the later times.
    pub computed: Vec<(f64, f64, f64)>,
    /// In how many ways the reference may have changed between rows.
    pub ways: usize,
    /// Most samples in a row that are missing.
    pub longest: usize,
    /// Gaps in the log of commands with times of their own, in which some are taken for lost.
    pub lost: usize,
}

impl Sent {
    /// Commands that are all there.
    pub fn complete(time: Vec<f64>, command: Vec<f64>) -> Self {
        Self {
            time,
            command,
            ways: 1,
            ..Self::default()
        }
    }

    /// Commands with times of their own beside these rows, without holding one where the next ones were
    /// lost.
    ///
    /// Commands that were logged regularly, each time they were computed, leave a gap where some were
    /// lost. After a usual step the mean of those around it is taken; where many were lost, or the
    /// command changes much, it is an unknown. Near the end of the rows it has no effect yet.
    pub fn with_lost(time: Vec<f64>, command: Vec<f64>, rows: &[f64]) -> Self {
        let steps = differences(&time);
        let (Some(first), Some(end)) = (rows.first(), rows.last()) else {
            return Self::complete(time, command);
        };
        if steps.len() < LOG.fewest {
            return Self::complete(time, command);
        }
        let usual = median(steps.clone());
        let share = |count: usize| count as f64 / steps.len() as f64;
        let near = |step: &&f64| (**step - usual).abs() < GAPS.near_whole * usual;
        let changes: Vec<f64> = differences(&command).iter().map(|x| x.abs()).collect();
        let moving = changes.iter().filter(|x| **x != 0.0).count();
        let gaps: Vec<usize> = (0..steps.len())
            .filter(|k| steps[*k] > LOG.gap * usual)
            .collect();
        let regular = share(steps.iter().filter(near).count()) > LOG.regular;
        if !regular || share(moving) <= LOG.moves || gaps.is_empty() {
            return Self::complete(time, command);
        }
        let last = end - LOG.end * (end - first);
        let jump = (LOG.jump * range(&command)).max(LOG.unusual * median(changes.clone()));
        let is_doubtful = |k: &&usize| steps[**k] > GAPS.hole as f64 * usual || changes[**k] > jump;
        let within = |k: &&usize| time[**k] >= *first && time[**k + 1] <= last;
        let mut doubtful: Vec<usize> = gaps
            .iter()
            .filter(is_doubtful)
            .filter(within)
            .copied()
            .collect();
        doubtful.sort_by(|p, q| steps[*q].total_cmp(&steps[*p]));
        doubtful.truncate((GAPS.most_unknown * rows.len() as f64) as usize);
        doubtful.sort_unstable();
        let unknown = doubtful.iter().map(|k| (time[*k] + usual, time[*k + 1]));
        let unknown = unknown.collect();
        let between = gaps
            .iter()
            .map(|k| (time[*k] + usual, 0.5 * (command[*k] + command[*k + 1])));
        let mut every: Vec<(f64, f64)> =
            time.iter().copied().zip(command.iter().copied()).collect();
        every.extend(between);
        every.sort_by(|p, q| p.0.total_cmp(&q.0));
        let (time, command) = every.into_iter().unzip();
        Self {
            unknown,
            lost: gaps.len(),
            ..Self::complete(time, command)
        }
    }
}

/// Differences of neighbours.
pub(super) fn differences(values: &[f64]) -> Vec<f64> {
    values.windows(2).map(|pair| pair[1] - pair[0]).collect()
}

/// The largest value less the smallest.
pub(super) fn range(values: &[f64]) -> f64 {
    let least = values.iter().copied().fold(f64::INFINITY, f64::min);
    values.iter().copied().fold(f64::NEG_INFINITY, f64::max) - least
}
