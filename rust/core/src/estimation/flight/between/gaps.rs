//! Rows that are further apart than the samples of a controller, and the samples between.

use super::sent::differences;
use super::tolerances::GAPS;

/// A gap between two rows.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Gap {
    /// The row before.
    pub(super) row: usize,
    /// Times of the missing samples, s.
    pub(super) places: Vec<f64>,
    /// Time of the row after, s.
    pub(super) end: f64,
}

impl Gap {
    /// How many samples are missing.
    pub(super) fn count(&self) -> usize {
        self.places.len()
    }

    /// Each missing sample with the time of the next one, s.
    pub(super) fn ends(&self) -> impl Iterator<Item = (f64, f64)> {
        let next = self.places.iter().skip(1).chain([&self.end]);
        self.places.iter().copied().zip(next.copied())
    }
}

/// The gaps between rows at these times.
pub(super) fn gaps_of(time: &[f64], sample_time: f64) -> Vec<Gap> {
    let apart: Vec<f64> = differences(time).iter().map(|x| x / sample_time).collect();
    let mut found = Vec::new();
    for (row, own) in apart.iter().enumerate() {
        let whole = own.round_ties_even();
        let next = apart.get(row + 1).copied().unwrap_or(f64::INFINITY);
        // A row that is late, not lost, is as much closer to the next one.
        let is_late = own + next < whole + 0.5;
        if whole <= 1.0 || is_late || (own - whole).abs() >= GAPS.near_whole * whole {
            continue;
        }
        let (start, end) = (time[row], time[row + 1]);
        let count = whole as usize - 1;
        let place = |k: usize| start + (k + 1) as f64 / (count + 1) as f64 * (end - start);
        found.push(Gap {
            row,
            places: (0..count).map(place).collect(),
            end,
        });
    }
    found
}
