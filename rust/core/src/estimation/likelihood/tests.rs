//! Compares with the same formula written with dense matrices.

use super::super::tests::{
    cholesky, coloured, commands, forward, gaussian, gram, integral, integrated, log_det,
    recording, solve,
};
use super::*;

const WINDY: Noise = Noise {
    air_time: 0.8,
    air: 3.0,
    sensor_time: 0.2,
    sensor: 0.5,
    stamps: 0.0,
    arrivals: 0.0,
};
const DELAY: f64 = 0.31;

fn integrator() -> Plant {
    Plant::new(&[1.0], &[1.0, 0.0]).unwrap()
}

fn values(gain: Gain, lags: &[f64]) -> Values {
    Values {
        delay: DELAY,
        lags: lags.to_vec(),
        zero: 0.0,
        gain,
    }
}

fn by_delay(lags: usize) -> Derivatives {
    Derivatives {
        delay: true,
        lags: vec![true; lags],
        zero: false,
    }
}

/// Rows with a hole, noise, trim and a time of unknown command.
fn rows(count: usize) -> Rows {
    let mut rows = recording(count);
    let sent = commands(&rows);
    let noise = gaussian(5, count);
    for (i, output) in rows.output.iter_mut().enumerate() {
        *output = 0.3 + 0.85 * integral(&sent, DELAY, rows.time[i]) + 0.01 * noise[i];
        rows.used[i] = !(20..26).contains(&i);
    }
    rows.trim = true;
    rows.commands.unknown = vec![(1.3, 1.69)];
    rows.checked().unwrap()
}

fn at(rows: &Rows, values: &Values, noise: &Noise) -> Evaluation {
    let by = by_delay(values.lags.len());
    evaluate(
        rows,
        &integrator(),
        values,
        &noise.through(values),
        &by,
        Wanted::All,
        &Task::new(),
    )
    .unwrap()
}

/// −2 ln L by dense matrices, the linear unknowns, and the mean there.
fn dense(
    rows: &Rows,
    noise: &Noise,
    kicks: &[(usize, f64)],
    known: Option<f64>,
) -> (f64, Vec<f64>) {
    let sent = commands(rows);
    let place: Vec<usize> = (0..rows.time.len()).filter(|i| rows.used[*i]).collect();
    let column =
        |of: &dyn Fn(f64) -> f64| -> Vec<f64> { place.iter().map(|i| of(rows.time[*i])).collect() };
    let response = column(&|t| integral(&sent, DELAY, t));
    let mut x = vec![column(&|_| 1.0), column(&|t| t - rows.time[0])];
    for (start, end) in &rows.commands.unknown {
        x.push(column(&|t| {
            integral(&[(*start, 1.0), (*end, 0.0)], DELAY, t)
        }));
    }
    if known.is_none() {
        x.insert(0, response.clone());
    }
    let y: Vec<f64> = place
        .iter()
        .zip(&response)
        .map(|(i, response)| rows.output[*i] - known.unwrap_or(0.0) * response)
        .collect();
    let v: Vec<Vec<f64>> = place
        .iter()
        .map(|i| {
            let entry = |j: &usize| {
                let (s, t) = (rows.time[*i] - rows.time[0], rows.time[*j] - rows.time[0]);
                let kicked = kicks.iter().filter(|(row, _)| row <= i && row <= j);
                let moved = noise.stamps * rows.speed.get(*i).copied().unwrap_or(0.0);
                f64::from(u8::from(i == j)) * (1.0 + moved * moved)
                    + integrated(noise.air, noise.air_time, s, t)
                    + coloured(noise.sensor, noise.sensor_time, s, t)
                    + kicked.map(|(_, size)| size * size).sum::<f64>()
            };
            place.iter().map(entry).collect()
        })
        .collect();
    let l = cholesky(&v);
    let white = |columns: &[Vec<f64>]| -> Vec<Vec<f64>> {
        columns.iter().map(|column| forward(&l, column)).collect()
    };
    let target = forward(&l, &y);
    let whitened = white(&x);
    let product = |a: &[f64]| -> f64 { a.iter().zip(&target).map(|(a, b)| a * b).sum() };
    let right: Vec<f64> = whitened.iter().map(|column| product(column)).collect();
    let linear = solve(&gram(&whitened), &right);
    let explained: f64 = linear.iter().zip(&right).map(|(a, b)| a * b).sum();
    let m = (place.len() - x.len()) as f64;
    let objective = m * ((product(&target) - explained) / m).ln()
        + log_det(&l)
        + log_det(&cholesky(&gram(&whitened)))
        - log_det(&cholesky(&gram(&x)));
    (objective, linear)
}

#[test]
fn the_objective_is_that_of_dense_matrices() {
    let rows = rows(90);
    for noise in [Noise::QUIET, WINDY] {
        for known in [None, Some(0.8)] {
            let gain = known.map_or(Gain::Eliminated, Gain::Known);
            let found = at(&rows, &values(gain, &[]), &noise);
            let (objective, linear) = dense(&rows, &noise, &[], known);
            assert!((found.objective - objective).abs() < 1e-7, "{found:?}");
            assert_eq!(found.linear.len(), linear.len());
            for (found, expected) in found.linear.iter().zip(&linear) {
                assert!((found - expected).abs() < 1e-9);
            }
        }
    }
}

#[test]
fn the_error_of_a_command_is_in_the_objective() {
    let mut rows = rows(90);
    rows.commands.unknown.clear();
    // The first ends when row 40 is read; the second has no row any more.
    rows.commands.uncertain = vec![(2.0, 2.6 - DELAY, 0.5), (5.0, 9.0, 1.0)];
    let rows = rows.checked().unwrap();
    for noise in [Noise::QUIET, WINDY] {
        let found = at(&rows, &values(Gain::Eliminated, &[]), &noise);
        let size = 0.5 * noise.sensor.hypot(1.0) * (2.6 - DELAY - 2.0);
        let (objective, _) = dense(&rows, &noise, &[(40, size)], None);
        assert!((found.objective - objective).abs() < 1e-7);
    }
}

#[test]
fn scattered_times_are_in_the_objective() {
    let mut rows = rows(90);
    rows.speed = rows.time.iter().map(|t| (3.0 * t).sin()).collect();
    let rows = rows.checked().unwrap();
    let sent = commands(&rows);
    for noise in [Noise::QUIET, WINDY] {
        let noise = Noise {
            stamps: 1.5,
            arrivals: 2.0,
            ..noise
        };
        // Every command that changes moves the rows after its arrival, both scatters together.
        let kicks: Vec<(usize, f64)> = sent
            .windows(2)
            .map(|pair| {
                let row = rows.time.partition_point(|time| *time < pair[1].0 + DELAY);
                (row, 2.5 * (pair[1].1 - pair[0].1))
            })
            .collect();
        let found = at(&rows, &values(Gain::Eliminated, &[]), &noise);
        let (objective, _) = dense(&rows, &noise, &kicks, None);
        assert!((found.objective - objective).abs() < 1e-7);
    }
}

#[test]
fn delay_and_zero_of_a_response_that_jumps_are_dependent_at_any_lag() {
    // Commands arrive between the same rows, whatever the delay in between.
    let mut rows = recording(300);
    let step = 0.05;
    rows.time = (0..300).map(|i| step * f64::from(i)).collect();
    rows.commands.time = (0..30).map(|i| 10.0 * step * f64::from(i)).collect();
    rows.commands.value = (0..30).map(|i| f64::from(i % 3) - 0.7).collect();
    rows.output = gaussian(3, 300);
    rows.used = vec![true; 300];
    let rows = rows.checked().unwrap();
    let by = Derivatives {
        zero: true,
        ..by_delay(1)
    };
    let plant = Plant::new(&[1.0], &[1.0]).unwrap();
    for lag in [1e-3, 0.01, 0.03, 0.1, 0.5] {
        for zero in [-0.1, 1e-3, 0.2] {
            for noise in [Noise::QUIET, WINDY] {
                let at = Values {
                    delay: 0.12,
                    zero,
                    ..values(Gain::Eliminated, &[lag])
                };
                let (wanted, task) = (Wanted::Slopes, Task::new());
                let noise = noise.through(&at);
                let found = evaluate(&rows, &plant, &at, &noise, &by, wanted, &task).unwrap();
                assert_eq!(found.objective, f64::INFINITY, "{lag} {zero}");
            }
        }
    }
}

#[test]
fn several_noises_at_once_have_the_objective_slopes_and_covariance_of_each() {
    // More rows than a block, more noises than lanes; some scatter, and two have no air.
    let mut rows = rows(300);
    rows.speed = rows.time.iter().map(|t| (3.0 * t).sin()).collect();
    let mut computed = rows.clone();
    computed.commands.uncertain = vec![(2.0, 2.3, 0.5)];
    let noise = |k: u32| Noise {
        air: if k < 2 { 0.0 } else { 0.3 * f64::from(k) },
        stamps: f64::from(k % 3),
        arrivals: f64::from(k % 4),
        ..WINDY
    };
    let (plant, task) = (integrator(), Task::new());
    for rows in [rows, computed] {
        let rows = rows.checked().unwrap();
        for gain in [Gain::Eliminated, Gain::Searched(0.8), Gain::Known(0.8)] {
            for noises in [(0..2), (2..13), (0..13)] {
                let (values, by) = (values(gain, &[0.1, 0.03]), by_delay(2));
                let noises = noises.map(|k| Through {
                    lags: vec![0.1, 0.03 + 0.01 * f64::from(k % 5)],
                    ..noise(k).through(&values)
                });
                let noises: Vec<Through> = noises.collect();
                for wanted in [Wanted::Value, Wanted::Slopes, Wanted::Covariance] {
                    let found = evaluations(&rows, &plant, &values, &noises, &by, wanted, &task);
                    let found = found.unwrap();
                    assert_eq!(found.len(), noises.len());
                    for (found, noise) in found.iter().zip(&noises) {
                        let one = evaluate(&rows, &plant, &values, noise, &by, wanted, &task);
                        let expected = one.unwrap();
                        let near = |x: f64, y: f64| (x - y).abs() < 1e-9 * y.abs();
                        assert!(near(found.objective, expected.objective));
                        for (found, expected) in [
                            (&found.searched.slope, &expected.searched.slope),
                            (&found.inverse, &expected.inverse),
                        ] {
                            assert_eq!(found.len(), expected.len());
                            let size = expected.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
                            let apart = found.iter().zip(expected).map(|(x, y)| (x - y).abs());
                            assert!(apart.fold(0.0, f64::max) <= 1e-8 * size);
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn residuals_score_and_covariance_are_those_of_the_fit() {
    let rows = rows(90);
    let found = at(&rows, &values(Gain::Eliminated, &[0.1]), &WINDY);
    let norm = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>();
    assert!((norm(&found.score) - 1.0).abs() < 1e-12);
    let unused = rows.used.iter().zip(&found.score).zip(&found.whitened);
    assert!(
        unused
            .filter(|((used, _), _)| !**used)
            .all(|((_, s), w)| *s == 0.0 && *w == 0.0)
    );
    // Gain, offset, trim and the unknown command are eliminated; delay and lag are searched.
    assert_eq!(found.freedom, 84 - 6);
    assert!((norm(&found.whitened) / found.freedom as f64 - 1.0).abs() < 1e-9);
    assert_eq!(found.gain, found.linear[0]);
    assert_eq!(found.inverse.len(), 36);
    // Without noise beside the white the residuals are those, but for their scale.
    let white = at(&rows, &values(Gain::Eliminated, &[0.1]), &Noise::QUIET);
    for i in (0..90).filter(|i| rows.used[*i]) {
        let expected = white.whitened[i] * white.variance.sqrt();
        assert!((white.residuals[i] - expected).abs() < 1e-12);
    }
    // The delay is known as well as the part of its derivative that no linear unknown explains.
    let alone = at(&rows, &values(Gain::Eliminated, &[]), &Noise::QUIET);
    let sent = commands(&rows);
    let slope: f64 = rows
        .time
        .iter()
        .zip(&rows.used)
        .zip(&alone.score)
        .filter(|((_, used), _)| **used)
        .map(|((t, _), score)| {
            let arrived = sent.iter().rev().find(|(from, _)| from + DELAY <= *t);
            -arrived.map_or(0.0, |(_, value)| *value) * score
        })
        .sum();
    let stretch = slope * alone.gain;
    assert!((alone.inverse[24] * stretch * stretch - 1.0).abs() < 1e-9);
}

#[test]
fn rows_that_are_not_used_have_no_influence() {
    let first = rows(90);
    let expected = at(&first, &values(Gain::Eliminated, &[0.1]), &WINDY);
    for value in [f64::NAN, f64::INFINITY, -1e300, 0.0] {
        let mut other = first.clone();
        for (output, used) in other.output.iter_mut().zip(&first.used) {
            if !used {
                *output = value;
            }
        }
        let found = at(
            &other.checked().unwrap(),
            &values(Gain::Eliminated, &[0.1]),
            &WINDY,
        );
        assert_eq!(found.objective, expected.objective);
        assert_eq!(found.linear, expected.linear);
        assert_eq!(found.inverse, expected.inverse);
        assert_eq!(found.whitened, expected.whitened);
    }
}

#[test]
fn differences_of_the_objective_do_not_depend_on_units() {
    let first = rows(90);
    let mut other = first.clone();
    other.output.iter_mut().for_each(|y| *y *= 1e3);
    other.commands.value.iter_mut().for_each(|u| *u *= 250.0);
    let difference = |rows: &Rows| {
        at(rows, &values(Gain::Eliminated, &[0.1]), &WINDY).objective
            - at(rows, &values(Gain::Eliminated, &[0.3]), &Noise::QUIET).objective
    };
    assert!((difference(&first) - difference(&other)).abs() < 1e-6);
}

#[test]
fn fewer_rows_than_unknowns_are_refused() {
    let mut rows = rows(40);
    rows.used.iter_mut().skip(5).for_each(|used| *used = false);
    let by = by_delay(0);
    let values = values(Gain::Eliminated, &[]);
    let found = evaluate(
        &rows,
        &integrator(),
        &values,
        &Noise::QUIET.through(&values),
        &by,
        Wanted::Slopes,
        &Task::new(),
    );
    assert!(found.is_err_and(|error| error.to_string().starts_with("5 rows are too few")));
}

#[test]
fn an_unknown_that_shows_in_no_row_makes_the_objective_infinite() {
    let mut rows = rows(90);
    rows.commands.value.fill(0.0);
    let found = at(&rows, &values(Gain::Eliminated, &[]), &WINDY);
    assert_eq!(found.objective, f64::INFINITY);
}
