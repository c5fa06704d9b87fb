//! Commands that arrive at uneven times: each change of the command early or late by N(0, s²).
//!
//! To first order such a change adds its size times the response to an impulse, so often times as it is late.
//! The sizes of these are random, and s is that of the largest marginal likelihood.

use super::super::cause::{Cause, CauseKind};
use super::super::information::products;
use super::super::minima::Minimum;
use super::super::random::likeliest;
use super::super::response::pulse;
use super::super::tolerances::{CAUSES, JITTER};
use super::screen::{Frame, frames};
use crate::elementary::log;
use crate::linear_algebra::vectors::dot;

/// The jitter of the commands, and BIC with it.
pub(super) fn jitter(found: &[Minimum<'_>]) -> Option<(Cause, f64)> {
    let least = found.first()?.bic;
    let tried = frames(found);
    let each = tried
        .iter()
        .take(2)
        .filter_map(|frame| beside(frame, least));
    each.min_by(|a, b| a.1.total_cmp(&b.1))
}

fn beside(frame: &Frame<'_>, least: f64) -> Option<(Cause, f64)> {
    let columns = changes(frame);
    let rows = frame.left.len() as f64;
    let row = frame.model.rows.row;
    let (mut variance, mut best) = (frame.squares / rows, None);
    // The noise is what jitter leaves.
    for _ in 0..JITTER.rounds {
        let information = products(&columns, &vec![row; columns.len()], variance);
        let scores: Vec<f64> = columns
            .iter()
            .map(|column| row * dot(column, &frame.left) / variance)
            .collect();
        let found = likeliest(&information, &scores, (JITTER.least, JITTER.most))?;
        let explained = found.explained;
        let left = (frame.squares - variance * explained).max(JITTER.left * frame.squares);
        let fall = rows * log(frame.squares / left) - found.log_volume - found.penalty;
        best = Some((found.deviation, fall));
        variance = left / rows;
    }
    let (deviation, fall) = best?;
    let bic = frame.bic - fall + log(rows);
    let cause = Cause {
        kind: CauseKind::Jitter,
        size: row * deviation,
        error: row * deviation / (2.0 * columns.len() as f64).sqrt(),
        time: f64::NAN,
        record: 0,
        lead: least - bic,
        named: least - bic >= CAUSES.named,
        rivals: Vec::new(),
    };
    Some((cause, bic))
}

/// What the larger changes of the command add when they are late by one, beside the numbers of the plant.
fn changes(frame: &Frame<'_>) -> Vec<Vec<f64>> {
    let model = &frame.model;
    let (numbers, gain) = (model.numbers(&frame.point.x), model.gain(&frame.point));
    let mut all: Vec<(f64, usize, usize)> = Vec::new();
    for (at, part) in model.rows.parts.iter().enumerate() {
        let steps = part.command.windows(2).enumerate();
        all.extend(steps.map(|(row, two)| (two[1] - two[0], at, row + 1)));
    }
    all.sort_by(|a, b| b.0.abs().total_cmp(&a.0.abs()));
    let largest = all.first().map_or(0.0, |one| one.0.abs());
    all.retain(|one| one.0.abs() > JITTER.share * largest);
    all.truncate(JITTER.changes);
    let places = model.rows.places();
    let column = |(step, at, row): &(f64, usize, usize)| {
        let part = &model.rows.parts[*at];
        let sent = part.sent[*row];
        let own = pulse(
            part,
            (sent, sent + JITTER.width * part.row),
            model.class,
            &numbers,
        );
        let mut raw = vec![0.0; frame.left.len()];
        for (entry, value) in raw[places[*at].clone()].iter_mut().zip(own) {
            *entry = -gain * step * value;
        }
        frame.beside(&raw)
    };
    all.iter().map(column).collect()
}
