//! Frequencies at which the command has power.

use std::f64::consts::TAU;

use super::rows::Rows;
use crate::elementary::sin_cos;

/// Most frequencies that are looked at, in multiples of one over the length of the record: more
/// see faster commands and take more time.
const MULTIPLES: usize = 400;

/// Most frequencies that are told, and their least power as a share of the largest.
const FEW: usize = 8;
const SHARE: f64 = 0.01;

/// Parts of a multiple to which a peak is found.
const PARTS: usize = 16;

/// The largest peaks of the spectrum of the command, rad/s, in order.
pub(super) fn excited(rows: &Rows) -> Vec<f64> {
    let count = rows.command.len() as f64;
    let mean = rows.command.iter().sum::<f64>() / count;
    let power = |omega: f64| {
        let (mut real, mut imaginary) = (0.0, 0.0);
        for (t, u) in rows.time.iter().zip(&rows.command) {
            let (sine, cosine) = sin_cos(omega * (t - rows.time[0]));
            real += (u - mean) * cosine;
            imaginary += (u - mean) * sine;
        }
        real * real + imaginary * imaginary
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
