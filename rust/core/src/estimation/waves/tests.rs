//! Compares with dense matrices and the closed form of an integrator.

use super::super::likelihood::Noise;
use super::super::tests::{
    cholesky, coloured, commands, forward, gaussian, gram, integral, integrated, recording, solve,
};
use super::*;

const DELAY: f64 = 0.31;

/// Rows with a hole, of a response of gain 0.85 with noise.
fn rows(count: usize) -> Rows {
    let mut rows = recording(count);
    let sent = commands(&rows);
    let noise = gaussian(7, count);
    for (i, output) in rows.output.iter_mut().enumerate() {
        *output = 0.3 + 0.85 * integral(&sent, DELAY, rows.time[i]) + 0.01 * noise[i];
        rows.used[i] = !(20..26).contains(&i);
    }
    rows.trim = true;
    rows.checked().unwrap()
}

fn values(gain: Gain) -> Values {
    Values {
        delay: DELAY,
        lags: Vec::new(),
        zero: 0.0,
        gain,
    }
}

fn at(rows: &Rows, gain: Gain, noise: Noise, number: usize) -> Waves {
    let by = Derivatives {
        delay: true,
        lags: Vec::new(),
        zero: false,
    };
    let plant = Plant::new(&[1.0], &[1.0, 0.0]).unwrap();
    let values = values(gain);
    let through = noise.through(&values);
    waves(rows, &plant, &values, &through, &by, number, &Task::new()).unwrap()
}

/// Waves of 1, 2, 3 half periods over the rows.
fn cosines(rows: &Rows) -> Vec<Vec<f64>> {
    let wave = |k: u32| {
        let share = |time: &f64| time / rows.time[rows.time.len() - 1];
        let times = rows.commands.time.iter();
        times
            .map(|time| (PI * f64::from(k) * share(time)).cos())
            .collect()
    };
    (1..=3).map(wave).collect()
}

/// Inner products of the waves with each other and with the residuals, by dense matrices.
fn dense(rows: &Rows, noise: &Noise, gain: Option<f64>) -> (Vec<Vec<f64>>, Vec<f64>) {
    let sent = commands(rows);
    let place: Vec<usize> = (0..rows.time.len()).filter(|i| rows.used[*i]).collect();
    let column =
        |of: &dyn Fn(f64) -> f64| -> Vec<f64> { place.iter().map(|i| of(rows.time[*i])).collect() };
    let response = column(&|t| integral(&sent, DELAY, t));
    let held = |t: f64| sent.iter().rev().find(|(start, _)| start + DELAY < t);
    let slope = column(&|t| held(t).map_or(0.0, |(_, value)| *value));
    let v: Vec<Vec<f64>> = place
        .iter()
        .map(|i| {
            let entry = |j: &usize| {
                let (s, t) = (rows.time[*i] - rows.time[0], rows.time[*j] - rows.time[0]);
                f64::from(u8::from(i == j))
                    + integrated(noise.air, noise.air_time, s, t)
                    + coloured(noise.sensor, noise.sensor_time, s, t)
            };
            place.iter().map(entry).collect()
        })
        .collect();
    let l = cholesky(&v);
    let output: Vec<f64> = place
        .iter()
        .zip(&response)
        .map(|(i, response)| rows.output[*i] - gain.unwrap_or(0.0) * response)
        .collect();
    let mut means = vec![column(&|_| 1.0), column(&|t| t - rows.time[0]), slope];
    if gain.is_none() {
        means.insert(0, response);
    }
    let moved = |wave: &[f64]| {
        column(&|t| {
            let mut before = 0.0;
            let jumps = sent.iter().zip(wave).map(|((start, value), w)| {
                let jump = value - before;
                before = *value;
                if start + DELAY < t { -w * jump } else { 0.0 }
            });
            jumps.sum()
        })
    };
    let means: Vec<Vec<f64>> = means.iter().map(|one| forward(&l, one)).collect();
    let product = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
    let normal = gram(&means);
    let left = |column: Vec<f64>| {
        let mut column = forward(&l, &column);
        let right: Vec<f64> = means.iter().map(|mean| product(mean, &column)).collect();
        for (mean, factor) in means.iter().zip(solve(&normal, &right)) {
            column
                .iter_mut()
                .zip(mean)
                .for_each(|(c, m)| *c -= factor * m);
        }
        column
    };
    // The gain alone is that of the linear unknowns, not of the derivative by the delay.
    let target = forward(&l, &output);
    let linear = &means[..means.len() - 1];
    let right: Vec<f64> = linear.iter().map(|mean| product(mean, &target)).collect();
    let factor = gain.unwrap_or_else(|| solve(&gram(linear), &right)[0]);
    let rest = left(output);
    let variance = product(&rest, &rest) / (place.len() - means.len()) as f64;
    let columns: Vec<Vec<f64>> = cosines(rows)
        .iter()
        .map(|wave| left(moved(wave)).iter().map(|c| factor * c).collect())
        .collect();
    let inner = columns
        .iter()
        .map(|a| columns.iter().map(|b| product(a, b) / variance).collect())
        .collect();
    let along = columns.iter().map(|a| product(a, &rest) / variance);
    (inner, along.collect())
}

#[test]
fn they_are_those_of_dense_matrices() {
    let windy = Noise {
        air_time: 0.8,
        air: 3.0,
        sensor_time: 0.2,
        sensor: 0.5,
        ..Noise::QUIET
    };
    let rows = rows(90);
    for noise in [Noise::QUIET, windy] {
        for gain in [None, Some(0.85)] {
            let searched = gain.map_or(Gain::Eliminated, Gain::Known);
            let found = at(&rows, searched, noise, 3);
            let (inner, along) = dense(&rows, &noise, gain);
            let entry = |i: usize, j: usize| found.factor[i * 3 + j];
            let scale = inner[0][0].abs();
            for i in 0..3 {
                for j in 0..3 {
                    let sum: f64 = (0..3).map(|k| entry(k, i) * entry(k, j)).sum();
                    assert!((sum - inner[i][j]).abs() < 1e-9 * scale, "{sum} {inner:?}");
                }
                let sum: f64 = (0..3).map(|k| entry(k, i) * found.along[k]).sum();
                assert!(
                    (sum - along[i]).abs() < 1e-8 * scale.sqrt(),
                    "{sum} {along:?}"
                );
            }
            assert_eq!(found.freedom, 84 - if gain.is_some() { 3 } else { 4 });
        }
    }
}

#[test]
fn waves_that_the_delay_follows_do_nothing() {
    // The delay of a single command does all that they do.
    let mut rows = rows(60);
    rows.commands.time = vec![0.5];
    rows.commands.value = vec![1.0];
    let found = at(&rows, Gain::Eliminated, Noise::QUIET, 2);
    assert_eq!(found.factor, [0.0; 4]);
}
