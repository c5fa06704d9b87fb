//! Frequencies at which the command has power, and whether it is one sine, which tells two numbers.

use std::f64::consts::TAU;

use super::projection::Projection;
use super::rows::{Part, Rows, Start};
use crate::elementary::sin_cos;
use crate::linear_algebra::vectors::dot;

/// Most frequencies that are looked at, in multiples of one over the length of the record: more
/// see faster commands and take more time.
const MULTIPLES: usize = 400;

/// Most frequencies that are told, and their least power as a share of the largest.
const FEW: usize = 8;
const SHARE: f64 = 0.01;

/// Parts of a multiple to which a peak is found.
const PARTS: usize = 16;

/// The power of the command of one record.
fn power(part: &Part, omega: f64) -> f64 {
    let mean = part.command.iter().sum::<f64>() / part.command.len() as f64;
    let (mut real, mut imaginary) = (0.0, 0.0);
    for (t, u) in part.sent.iter().zip(&part.command) {
        let (sine, cosine) = sin_cos(omega * (t - part.sent[0]));
        real += (u - mean) * cosine;
        imaginary += (u - mean) * sine;
    }
    real * real + imaginary * imaginary
}

/// The largest peaks of the spectrum of the command, rad/s, in order.
pub(super) fn excited(rows: &Rows) -> Vec<f64> {
    let power = |omega: f64| {
        rows.parts
            .iter()
            .map(|part| power(part, omega))
            .sum::<f64>()
    };
    let unit = TAU / rows.span;
    let most = MULTIPLES.min((0.5 * rows.span / rows.row) as usize);
    let powers: Vec<f64> = (0..=most)
        .map(|k| power(unit * (k.max(1)) as f64))
        .collect();
    let is_peak = |k: &usize| {
        powers[*k] >= powers[k - 1] && powers.get(k + 1).is_none_or(|after| powers[*k] > *after)
    };
    let mut peaks: Vec<usize> = (1..=most).filter(is_peak).collect();
    peaks.sort_by(|a, b| powers[*b].total_cmp(&powers[*a]));
    let largest = peaks.first().map_or(0.0, |k| powers[*k]);
    peaks.retain(|k| powers[*k] > SHARE * largest);
    peaks.truncate(FEW);
    let refined = |k: usize| {
        let places = (0..=PARTS).map(|part| k as f64 - 0.5 + part as f64 / PARTS as f64);
        let powers = places.map(|place| (power(unit * place), unit * place));
        powers
            .max_by(|a, b| a.0.total_cmp(&b.0))
            .map_or(unit, |(_, omega)| omega)
    };
    let mut out: Vec<f64> = peaks.into_iter().map(refined).collect();
    out.sort_by(f64::total_cmp);
    out
}

/// What is left of a command beside one sine, as a share of it, below which it is that sine: more
/// takes a rich command of small amplitude for nothing.
const PURE: f64 = 1e-3;

/// Steps of the search for its frequency: enough for a share of 1e-9 of the distance of two peaks.
const SECTIONS: usize = 44;

/// The golden section.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// Is the command one sine that ran before the first row?
pub(super) fn is_one_sine(rows: &Rows, excited: &[f64]) -> bool {
    let [omega] = excited else {
        return false;
    };
    if rows.parts.iter().any(|part| part.start != Start::Unknown) {
        return false;
    }
    let unit = TAU / rows.span;
    let (mut low, mut high) = ((omega - 0.5 * unit).max(0.1 * unit), omega + 0.5 * unit);
    let mut least = f64::INFINITY;
    for _ in 0..SECTIONS {
        let (left, right) = (high - GOLDEN * (high - low), low + GOLDEN * (high - low));
        let (at_left, at_right) = (left_beside(rows, left), left_beside(rows, right));
        least = least.min(at_left).min(at_right);
        if at_left < at_right {
            high = right;
        } else {
            low = left;
        }
    }
    least < PURE
}

/// What a sine and a constant leave of the commands, as a share of their deviation.
fn left_beside(rows: &Rows, omega: f64) -> f64 {
    let (mut before, mut after) = (0.0, 0.0);
    for part in &rows.parts {
        let wave = |t: &f64| sin_cos(omega * (t - part.sent[0]));
        let waves: Vec<(f64, f64)> = part.sent.iter().map(wave).collect();
        let ones = vec![1.0; waves.len()];
        let constant = Projection::new(vec![ones.clone()]);
        let sine = waves.iter().map(|wave| wave.0).collect();
        let all = Projection::new(vec![ones, sine, waves.iter().map(|wave| wave.1).collect()]);
        let (mut moving, mut left) = (part.command.clone(), part.command.clone());
        constant.taken(&mut moving);
        all.taken(&mut left);
        before += dot(&moving, &moving);
        after += dot(&left, &left);
    }
    (after / before).sqrt()
}
