//! Is the air that is found there while the vehicle rests, too, and slower than the rows?
//!
//! Air takes the place of what a plant lacks. What the plant lacks shows while the vehicle moves; air
//! does not know of that. Changes of the residuals over a few rows are compared between rows at which
//! the vehicle moves and rows at which it rests. For the fitted noise their covariance is known: with
//! it each mean square has degrees of freedom (Satterthwaite 1946), and their ratio is about that of
//! F. The fit takes a part of what it sees while the vehicle moves: the probability is rather too
//! large.

use super::super::fit::{FlightFit, FlightRun};
use super::motion::{moving_and_resting, rows_since_motion, speeds};
use super::pairs::pairs;
use super::tolerances::REST;
use crate::elementary::exp;
use crate::estimation::likelihood::{Evaluation, Noise};
use crate::estimation::statistics::f_beyond;
use crate::{Error, Task};

/// How far air that changes within a row moves the output, in deviations of sensor noise.
pub(super) fn restless_air(fit: &FlightFit, run: usize) -> f64 {
    let (noise, rows) = (fit.noises()[run], &fit.runs[run]);
    if !fit.plant.integrates() || noise.air_time > rows.row_time {
        return 0.0;
    }
    let moved = noise.air * (2.0 * noise.air_time * rows.rows.span()).sqrt();
    moved / noise.sensor.hypot(1.0)
}

/// Probability of residuals that change so much more while the vehicle moves, by the noise.
pub(super) fn air_at_rest(fit: &FlightFit, run: usize, task: &Task) -> Result<f64, Error> {
    let (rows, noise) = (&fit.runs[run], fit.noises()[run]);
    // Rounding hides changes at rest, and commands that are late move the vehicle.
    let has_air = fit.plant.integrates() && noise.air > 0.0;
    if !has_air || rows.rounding > 0.0 || noise.arrivals > 0.0 {
        return Ok(1.0);
    }
    let part = &fit.parts(task)?[run];
    let mut least: f64 = 1.0;
    for count in REST.over {
        task.check()?;
        least = least.min(over(rows, part, &noise, count));
    }
    Ok((REST.over.len() as f64 * least).min(1.0))
}

/// The same for changes over so many rows.
fn over(run: &FlightRun, part: &Evaluation, noise: &Noise, count: usize) -> f64 {
    let rows = &run.rows;
    let n = rows.time.len();
    if n <= count {
        return 1.0;
    }
    let speed = speeds(part);
    let since: Vec<isize> = rows_since_motion(&speed)[count..]
        .iter()
        .map(|since| since - count as isize)
        .collect();
    let usual = count as f64 * run.row_time;
    let is_even =
        |i: usize| (rows.time[i + count] - rows.time[i] - usual).abs() < REST.uneven * run.row_time;
    let used: Vec<bool> = (0..n - count)
        .map(|i| rows.used[i] && rows.used[i + count] && is_even(i))
        .collect();
    let kinds = moving_and_resting(&since, &used);
    let few = |kind: &Vec<bool>| kind.iter().filter(|is| **is).count() < REST.fewest;
    if kinds.iter().any(few) {
        return 1.0;
    }
    let covariance = covariance(noise, run.row_time, count, n);
    let [(size, freedom), (least, own_freedom)] = kinds.map(|kind| {
        let places: Vec<usize> = (0..kind.len()).filter(|i| kind[*i]).collect();
        let mean = |value: &dyn Fn(usize) -> f64| {
            places.iter().map(|i| value(*i)).sum::<f64>() / places.len() as f64
        };
        let late = |i: usize| noise.stamps * noise.stamps * speed[i] * speed[i];
        let expected = covariance[0] + mean(&|i| late(i) + late(i + count));
        let change = |i: usize| part.residuals[i + count] - part.residuals[i];
        let square = mean(&|i| change(i) * change(i)) / part.variance;
        (
            square / expected,
            freedom(&kind, places.len(), expected, &covariance),
        )
    });
    if least > 0.0 {
        f_beyond(size / least, freedom, own_freedom)
    } else {
        1.0
    }
}

/// Degrees of freedom of the mean square of so many changes.
fn freedom(kind: &[bool], count: usize, expected: f64, covariance: &[f64]) -> f64 {
    let pairs = pairs(kind);
    let own = pairs[0] * expected * expected;
    let others = pairs.iter().zip(covariance).skip(1);
    let others: f64 = others.map(|(pairs, one)| pairs * one * one).sum();
    (count * count) as f64 * expected * expected / (own + 2.0 * others)
}

/// Covariance of changes that begin so many rows apart, in white variances.
fn covariance(noise: &Noise, between: f64, count: usize, size: usize) -> Vec<f64> {
    // Air moves the output by the integral of its speed: variance of that over a time.
    let moved = |rows: usize| {
        let x = between * rows as f64 / noise.air_time;
        let size = noise.air * noise.air_time;
        2.0 * size * size * (x + libm::expm1(-x))
    };
    let alike = |rows: usize| {
        if noise.sensor > 0.0 {
            noise.sensor * noise.sensor * exp(-between * rows as f64 / noise.sensor_time)
        } else {
            0.0
        }
    };
    let each = (0..size).map(|lag| {
        let (far, near) = (lag + count, lag.abs_diff(count));
        let white = match lag {
            0 => 2.0,
            _ if lag == count => -1.0,
            _ => 0.0,
        };
        let air = 0.5 * (moved(far) + moved(near)) - moved(lag);
        air + (2.0 * alike(lag) - alike(far) - alike(near)) + white
    });
    each.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_covariance_of_changes_is_that_of_the_integral_of_air() {
        let noise = Noise {
            air_time: 0.4,
            air: 40.0,
            ..Noise::QUIET
        };
        let (between, count, parts) = (0.065, 4, 100);
        let found = covariance(&noise, between, count, 30);
        // By sums over short steps of the exponential covariance of the speed.
        let step = between / f64::from(parts);
        let at = |i: i32| (f64::from(i) + 0.5) * step;
        for apart in [0_usize, 2, 4, 7, 20] {
            let mut expected = 0.0;
            for i in 0..4 * parts {
                for j in 0..4 * parts {
                    let gap = (at(i) - at(j) - apart as f64 * between).abs();
                    expected += 1600.0 * (-gap / 0.4).exp() * step * step;
                }
            }
            expected += match apart {
                0 => 2.0,
                4 => -1.0,
                _ => 0.0,
            };
            assert!(
                (found[apart] - expected).abs() < 1e-4 * expected.abs() + 1e-9,
                "{apart}"
            );
        }
    }
}
