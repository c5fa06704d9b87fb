//! Rows at which the vehicle moves, and rows at which it has rested for long.

use super::tolerances::REST;
use crate::estimation::likelihood::Evaluation;

/// Speed of a vehicle of unit gain at each row.
pub(super) fn speeds(part: &Evaluation) -> Vec<f64> {
    let rates = part.rate.iter();
    rates.map(|rate| (rate / part.gain).abs()).collect()
}

/// How many rows before each row the vehicle moved last; very many where it never did.
pub(super) fn rows_since_motion(speeds: &[f64]) -> Vec<isize> {
    let least = REST.moves * speeds.iter().copied().fold(0.0, f64::max);
    let mut since = speeds.len() as isize;
    let counted = speeds.iter().map(|speed| {
        since = if *speed > least { 0 } else { since + 1 };
        since
    });
    counted.collect()
}

/// Rows that are used and near motion, and those that are used and far from it.
pub(super) fn moving_and_resting(since: &[isize], used: &[bool]) -> [Vec<bool>; 2] {
    let marked = |is: fn(isize) -> bool| {
        let rows = since.iter().zip(used);
        rows.map(|(since, used)| *used && is(*since)).collect()
    };
    [
        marked(|since| since < REST.shows),
        marked(|since| since > REST.rests),
    ]
}
