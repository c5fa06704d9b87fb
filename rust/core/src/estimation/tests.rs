//! What the tests of this module compare with: dense matrices, closed forms, deterministic noise.

use super::path::{Held, respond};
use super::plant::Plant;
use super::rows::{Commands, Rows};
use crate::Task;

/// Numbers of about a Gaussian distribution of variance one, the same in every run.
pub(super) fn gaussian(seed: u64, count: usize) -> Vec<f64> {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    let mut uniform = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    (0..count)
        .map(|_| (0..12).map(|_| uniform()).sum::<f64>() - 6.0)
        .collect()
}

/// L of a positive definite matrix V = L Lᵀ.
pub(super) fn cholesky(v: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let n = v.len();
    let mut l = vec![vec![0.0; n]; n];
    for i in 0..n {
        for j in 0..=i {
            let sum: f64 = (0..j).map(|k| l[i][k] * l[j][k]).sum();
            l[i][j] = if i == j {
                (v[i][i] - sum).sqrt()
            } else {
                (v[i][j] - sum) / l[j][j]
            };
        }
    }
    l
}

/// L⁻¹ z.
pub(super) fn forward(l: &[Vec<f64>], z: &[f64]) -> Vec<f64> {
    let mut x: Vec<f64> = Vec::with_capacity(z.len());
    for (row, z) in l.iter().zip(z) {
        let sum: f64 = row.iter().zip(&x).map(|(l, x)| l * x).sum();
        x.push((z - sum) / row[x.len()]);
    }
    x
}

/// ln det V.
pub(super) fn log_det(l: &[Vec<f64>]) -> f64 {
    (0..l.len()).map(|i| 2.0 * l[i][i].ln()).sum()
}

/// Inner products of columns.
pub(super) fn gram(x: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum();
    x.iter()
        .map(|a| x.iter().map(|b| product(a, b)).collect())
        .collect()
}

/// The solution of V x = z.
pub(super) fn solve(v: &[Vec<f64>], z: &[f64]) -> Vec<f64> {
    let l = cholesky(v);
    let mut x = forward(&l, z);
    for i in (0..x.len()).rev() {
        let sum: f64 = (i + 1..x.len()).map(|k| l[k][i] * x[k]).sum();
        x[i] = (x[i] - sum) / l[i][i];
    }
    x
}

/// Covariance of an Ornstein–Uhlenbeck process.
pub(super) fn coloured(deviation: f64, tau: f64, s: f64, t: f64) -> f64 {
    deviation * deviation * (-(t - s).abs() / tau).exp()
}

/// Covariance of its integral from 0 on.
pub(super) fn integrated(deviation: f64, tau: f64, s: f64, t: f64) -> f64 {
    let decayed = |time: f64| tau * (-time / tau).exp();
    let inner = 2.0 * s.min(t) - tau + decayed(s) + decayed(t) - decayed((t - s).abs());
    deviation * deviation * tau * inner
}

/// The integral to `time` of inputs that hold from their times on, each `delay` later.
pub(super) fn integral(inputs: &[(f64, f64)], delay: f64, time: f64) -> f64 {
    let ends = inputs.iter().skip(1).map(|(time, _)| *time);
    inputs
        .iter()
        .zip(ends.chain([f64::INFINITY]))
        .map(|((start, value), end)| value * ((end + delay).min(time) - (start + delay).min(time)))
        .sum()
}

/// The response of 1/(lag s + 1) to them.
pub(super) fn lagged(inputs: &[(f64, f64)], delay: f64, lag: f64, time: f64) -> f64 {
    let ends = inputs.iter().skip(1).map(|(time, _)| *time);
    let decayed = |to: f64| (-(time - (to + delay).min(time)) / lag).exp();
    inputs
        .iter()
        .zip(ends.chain([f64::INFINITY]))
        .map(|((start, value), end)| value * (decayed(end) - decayed(*start)))
        .sum()
}

/// Rows every 65 ms with commands at the same times that change every second or so.
pub(super) fn recording(count: usize) -> Rows {
    let time: Vec<f64> = (0..count).map(|i| 0.065 * i as f64).collect();
    let value = time
        .iter()
        .map(|t| if (t * 0.9).sin() > 0.0 { 1.0 } else { -0.4 })
        .collect();
    Rows {
        output: vec![0.0; count],
        speed: Vec::new(),
        used: vec![true; count],
        commands: Commands {
            time: time.clone(),
            value,
            unknown: Vec::new(),
            uncertain: Vec::new(),
        },
        time,
        offset: true,
        trim: false,
    }
}

/// The commands of rows, each with its time.
pub(super) fn commands(rows: &Rows) -> Vec<(f64, f64)> {
    let commands = &rows.commands;
    commands
        .time
        .iter()
        .copied()
        .zip(commands.value.iter().copied())
        .collect()
}

/// A recording of this plant with white noise. A plant that does not integrate is in steady state
/// under the first command.
pub(super) fn recorded(
    plant: (&[f64], &[f64]),
    true_values: (f64, f64, f64),
    noise: f64,
    seed: u64,
) -> Rows {
    let (delay, gain, lag) = true_values;
    let mut rows = recording(200);
    let plant = Plant::new(plant.0, plant.1).unwrap();
    let space = plant.space(&[lag], 0.0);
    let sent = &rows.commands.value;
    let base = if plant.integrates() { 0.0 } else { sent[0] };
    let moved: Vec<f64> = sent.iter().map(|value| value - base).collect();
    let held = Held {
        time: &rows.commands.time,
        value: &moved,
    };
    respond(
        [&space],
        held,
        delay,
        &rows.time,
        [&mut rows.output],
        None,
        &Task::new(),
    )
    .unwrap();
    for (output, noise_value) in rows.output.iter_mut().zip(gaussian(seed, 200)) {
        *output = gain * *output + 0.2 + noise * noise_value;
    }
    rows.checked().unwrap()
}
