//! Tests of the likelihood of rounded rows on a straight line.

use super::super::joint::{Fitted, Part};
use super::*;
use crate::estimation::tests::gaussian;

const STEP: f64 = 0.01;
const ROWS: u32 = 60;

/// A straight line, for which all is known in closed form.
struct Line(Vec<f64>);

fn time(row: u32) -> f64 {
    f64::from(row) / f64::from(ROWS - 1)
}

impl Part for Line {
    fn misfit(&self, point: &[f64], _: &Task) -> Result<Vec<f64>, Error> {
        let rows = (0..ROWS).zip(&self.0);
        Ok(rows
            .map(|(row, y)| point[0] + point[1] * time(row) - y)
            .collect())
    }

    fn slopes(&self, _: &[f64], _: &Task) -> Result<Vec<Vec<f64>>, Error> {
        Ok(vec![
            vec![1.0; ROWS as usize],
            (0..ROWS).map(time).collect(),
        ])
    }
}

fn line(deviation: f64, seed: u64) -> (Joint<'static>, Readings) {
    let noise = gaussian(seed + 1, ROWS as usize);
    let read = |(row, noise): (u32, f64)| {
        let output = 0.003 + 0.11 * time(row) + deviation * noise;
        STEP * (output / STEP).round()
    };
    let output: Vec<f64> = (0..ROWS).zip(noise).map(read).collect();
    let part = Fitted {
        part: Box::new(Line(output.clone())),
        rows: ROWS as usize,
        low: vec![f64::NEG_INFINITY; 2],
        high: vec![f64::INFINITY; 2],
        axes: Vec::new(),
    };
    let readings = Readings {
        recording: vec![0; output.len()],
        used: vec![true; output.len()],
        output,
        steps: vec![STEP],
    };
    (Joint::new(vec![part], vec![1.0], 2), readings)
}

/// −2 ln L, and its derivatives by the parameters and the logarithm of the noise.
fn at(own: &Rounded<'_>, point: &[f64], log_: f64) -> (f64, Vec<f64>) {
    let task = Task::new();
    let misfit = own.model.misfit(point, &task).unwrap();
    let slopes = own.slopes(&misfit, &[log_]);
    let columns = own.model.slopes(point, &task).unwrap();
    (slopes.value, own.gradient(&columns, &slopes))
}

#[test]
fn it_is_the_probability_of_the_readings_and_so_are_its_derivatives() {
    for deviation in [0.0005, 0.003, 0.02] {
        let (model, readings) = line(deviation, 1);
        let own = Rounded {
            model: &model,
            readings: &readings,
        };
        let (point, log_) = ([0.004, 0.108], log(deviation));
        let (value, gradient) = at(&own, &point, log_);
        let mut direct = 0.0;
        for (row, y) in (0..ROWS).zip(&readings.output) {
            let away = y - point[0] - point[1] * time(row);
            let [low, high] = [-0.5, 0.5].map(|half| (away + half * STEP) / deviation);
            direct -= 2.0 * (normal_beyond(low.max(-high)) - normal_beyond(high.max(-low))).ln();
        }
        assert!((value / direct - 1.0).abs() < 1e-6, "{value} {direct}");
        for (place, found) in gradient.iter().enumerate() {
            let moved = |by: f64| {
                let mut point = point;
                let by_log = if place == 2 { by } else { 0.0 };
                point.iter_mut().skip(place).take(1).for_each(|x| *x += by);
                at(&own, &point, log_ + by_log).0
            };
            let slope = (moved(1e-7) - moved(-1e-7)) / 2e-7;
            let size = 1e-2 + 1e-4 * slope.abs();
            assert!((found - slope).abs() < size, "{place}: {slope}");
        }
    }
}

#[test]
fn a_reading_that_is_next_to_impossible_has_a_finite_likelihood() {
    let (model, readings) = line(0.0005, 1);
    let own = Rounded {
        model: &model,
        readings: &readings,
    };
    let (value, gradient) = at(&own, &[5.0, 0.0], log(0.0005));
    assert!(value.is_finite() && gradient.iter().all(|x| x.is_finite()));
    assert!(gradient[0] > 0.0);
}

/// Fisher's information is the variance of the derivative of ln L, over what might be read.
#[test]
fn the_covariance_is_the_inverse_of_the_mean_square_of_the_slope() {
    for deviation in [0.004, 0.03] {
        let (point, log_) = ([0.003, 0.11], log(deviation));
        let draws = 3000;
        let mut whole = vec![0.0; 9];
        for seed in 0..draws {
            let (model, readings) = line(deviation, seed);
            let own = Rounded {
                model: &model,
                readings: &readings,
            };
            let slope = at(&own, &point, log_).1;
            for place in 0..9 {
                whole[place] += 0.25 * slope[place / 3] * slope[place % 3] / draws as f64;
            }
        }
        let inverse = inverse_of_positive(&whole, 3, 0.0).unwrap();
        let (model, readings) = line(deviation, 1);
        let own = Rounded {
            model: &model,
            readings: &readings,
        };
        let peak = Peak {
            value: 0.0,
            point: point.to_vec(),
            logs: vec![log_],
        };
        let found = own.covariance(&peak, &Task::new()).unwrap();
        for place in 0..2 {
            let ratio = (found[place * 3] / inverse[place * 4]).sqrt();
            assert!((ratio - 1.0).abs() < 0.08, "{deviation}: {ratio}");
        }
    }
}

#[test]
fn the_information_in_coarse_noise_is_that_of_the_variance_with_rounding() {
    let (model, readings) = line(0.01, 1);
    let own = Rounded {
        model: &model,
        readings: &readings,
    };
    let misfit = model.misfit(&[0.003, 0.11], &Task::new()).unwrap();
    for [of_mean, ..] in own.information(&misfit, &[log(0.01)]) {
        // Sheppard's correction (1898) is the first term of a series.
        let variance = 0.01 * 0.01 + STEP * STEP / 12.0;
        assert!((of_mean * variance - 1.0).abs() < 2e-3);
    }
}

#[test]
fn the_search_ends_where_the_slope_is_zero() {
    let task = Task::new();
    for deviation in [0.001, 0.004, 0.02] {
        let (model, readings) = line(deviation, 3);
        let own = Rounded {
            model: &model,
            readings: &readings,
        };
        let peak = own.likeliest(&[0.0, 0.1], &task).unwrap();
        let (value, gradient) = at(&own, &peak.point, peak.logs[0]);
        assert_eq!(value, peak.value);
        let cov = own.covariance(&peak, &task).unwrap();
        for place in 0..2 {
            assert!((gradient[place] * cov[place * 3].sqrt()).abs() < 1e-3);
        }
        // Held at the peak it is the same, and away from it less likely.
        let held = |by: f64| own.held(&peak, &[1], peak.point[1] + by, &task).unwrap();
        assert!((held(0.0) - peak.value).abs() < 1e-6);
        let away = 2.0 * cov[3].sqrt();
        assert!(held(away) - peak.value > 1.0);
    }
}
