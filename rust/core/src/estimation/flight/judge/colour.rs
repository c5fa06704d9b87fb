//! Colour of the whitened residuals that is there while the vehicle rests, too.
//!
//! A position may be corrected by a satellite fix five times a second. No air and no noise of a sensor
//! that decays has such a colour, and whitened residuals keep it. It says nothing against the plant if
//! it is the same whether the vehicle moves or rests: autocorrelations of rows at which it rests must
//! differ from zero (Ljung & Box 1978), and those of rows at which it moves must not differ from them,
//! by variances of Bartlett (1946).
//!
//! The intervals are then made valid for it. With whitened derivatives J of the rows by the common
//! numbers and autocorrelations ρ of the whitened residuals, the covariance is
//!
//! ```text
//! (JᵀJ)⁻¹ (Σ_k w_k ρ_k Σ_t J_t J_(t+k)ᵀ) (JᵀJ)⁻¹
//! ```
//!
//! in the place of (JᵀJ)⁻¹, w the weights of Bartlett's window.

use super::super::fit::FlightFit;
use super::super::intervals::FlightProfile;
use super::super::start::is_long;
use super::motion::{moving_and_resting, rows_since_motion, speeds};
use super::tolerances::{COLOUR, LEVELS};
use super::whiteness::autocovariance;
use crate::estimation::fit::Model;
use crate::estimation::likelihood::Evaluation;
use crate::estimation::point::{Point, Quantity, Timing};
use crate::estimation::rows::Rows;
use crate::estimation::statistics::chi_squared_beyond;
use crate::linear_algebra::singular::Singular;
use crate::linear_algebra::vectors::{add_multiple, dot};
use crate::{Error, Task};

/// Are the whitened residuals coloured at rest, and not otherwise while the vehicle moves? That is
/// known of recordings that are not long.
pub(super) fn is_coloured_at_rest(fit: &FlightFit, task: &Task) -> Result<bool, Error> {
    let mut each = fit.runs.iter().zip(fit.parts(task)?);
    Ok(!is_long(&fit.runs) && each.all(|(run, part)| is_alike(&run.rows, part)))
}

/// The same of one recording.
fn is_alike(rows: &Rows, part: &Evaluation) -> bool {
    let since = rows_since_motion(&speeds(part));
    let [moving, resting] = moving_and_resting(&since, &rows.used)
        .map(|marks| Autocorrelations::of(&part.whitened, &marks));
    let pairs = moving.pairs.iter().chain(&resting.pairs);
    if pairs.copied().fold(f64::INFINITY, f64::min) < COLOUR.fewest as f64 {
        return false;
    }
    let square = |values: &[f64]| dot(values, values);
    let own = resting.pairs.iter().zip(&resting.rho);
    let statistic: f64 = own.map(|(pairs, rho)| pairs * rho * rho).sum();
    let both = moving.pairs.iter().zip(&resting.pairs);
    let variances = both.map(|(one, other)| 1.0 / one + 1.0 / other);
    let differences = moving.rho.iter().zip(&resting.rho);
    let squares = differences.map(|(one, other)| (one - other) * (one - other));
    let differ: f64 = squares
        .zip(variances)
        .map(|(square, variance)| square / variance)
        .sum();
    let spread = 1.0 + 2.0 * square(&resting.rho);
    let beyond = |statistic: f64| chi_squared_beyond(statistic, COLOUR.lags as f64);
    beyond(statistic) < LEVELS.test && beyond(differ / spread) > LEVELS.test
}

/// Autocorrelations of some rows, and the pairs of which each is known.
struct Autocorrelations {
    rho: Vec<f64>,
    pairs: Vec<f64>,
}

impl Autocorrelations {
    fn of(whitened: &[f64], marks: &[bool]) -> Self {
        let counts: Vec<f64> = marks.iter().map(|is| f64::from(u8::from(*is))).collect();
        let values: Vec<f64> = whitened.iter().zip(&counts).map(|(x, is)| x * is).collect();
        let lags = 1..=COLOUR.lags;
        let pairs: Vec<f64> = lags
            .clone()
            .map(|lag| autocovariance(&counts, lag))
            .collect();
        let power = dot(&values, &values) / counts.iter().sum::<f64>().max(1.0);
        let power = if power > 0.0 { power } else { 1.0 };
        let rho = lags.zip(&pairs);
        Self {
            rho: rho
                .map(|(lag, pairs)| autocovariance(&values, lag) / pairs.max(1.0) / power)
                .collect(),
            pairs,
        }
    }
}

/// The variance of the squares of coloured residuals along a direction, over that of white ones.
///
/// Squares of Gaussian rows have the squared autocorrelations.
pub(super) fn colour_of_squares(whitened: &[f64], direction: &[f64]) -> f64 {
    let shares = tapered(whitened).into_iter().enumerate();
    let products = shares.map(|(lag, share)| share * share * autocovariance(direction, lag));
    (2.0 * products.sum::<f64>() / dot(direction, direction) - 1.0).max(1.0)
}

/// Autocorrelations, that at zero first, in Bartlett's window.
fn tapered(whitened: &[f64]) -> Vec<f64> {
    let most = COLOUR.window.min(whitened.len().saturating_sub(1));
    let power = dot(whitened, whitened);
    let weight = |lag: usize| 1.0 - lag as f64 / (COLOUR.window as f64 + 1.0);
    (0..=most)
        .map(|lag| weight(lag) * autocovariance(whitened, lag) / power)
        .collect()
}

/// The variance of each quantity of a profile for coloured residuals, over that for white ones.
///
/// # Errors
///
/// As for `Model::at`.
pub fn colour_factors(profile: &FlightProfile, task: &Task) -> Result<Vec<f64>, Error> {
    let fit = &profile.fit;
    let common = fit.plant.common();
    let size = common.len();
    let (mut plain, mut spread) = (vec![0.0; size * size], vec![0.0; size * size]);
    for (run, rows) in fit.runs.iter().enumerate() {
        let used = |values: &[f64]| used(values, &rows.rows.used);
        let columns = columns(fit, run, &common, task)?;
        let columns: Vec<Vec<f64>> = columns.iter().map(|column| used(column)).collect();
        let shares = tapered(&used(&fit.parts(task)?[run].whitened));
        for (i, one) in columns.iter().enumerate() {
            for (j, other) in columns.iter().enumerate() {
                plain[i * size + j] += dot(one, other);
                let lagged = shares.iter().enumerate().skip(1);
                let lagged = lagged.map(|(lag, share)| {
                    let count = one.len() - lag;
                    let ahead = dot(&one[lag..], &other[..count]);
                    share * (ahead + dot(&one[..count], &other[lag..]))
                });
                spread[i * size + j] += dot(one, other) + lagged.sum::<f64>();
            }
        }
    }
    let bread = Singular::new(&plain, size).pseudo_inverse(COLOUR.singular);
    let times = |matrix: &[f64], vector: &[f64]| -> Vec<f64> {
        matrix
            .chunks_exact(size)
            .map(|row| dot(row, vector))
            .collect()
    };
    let factors = profile.weights.iter().map(|weights| {
        let moved = times(&bread, weights);
        let coloured = dot(&moved, &times(&spread, &moved));
        (coloured / dot(weights, &moved)).max(1.0)
    });
    Ok(factors.collect())
}

/// The values of rows that are used.
pub(super) fn used(values: &[f64], used: &[bool]) -> Vec<f64> {
    let marked = values.iter().zip(used).filter(|(_, used)| **used);
    marked.map(|(value, _)| *value).collect()
}

/// Derivatives of the whitened rows by the common numbers.
fn columns(
    fit: &FlightFit,
    run: usize,
    common: &[Quantity],
    task: &Task,
) -> Result<Vec<Vec<f64>>, Error> {
    // A gain that is not searched stays in its column.
    let mut plant = fit.plant.clone();
    plant.free.gain = false;
    let rows = fit.runs.iter().map(|run| run.rows.clone()).collect();
    let model = plant.model(rows, fit.trim)?;
    let centre = fit.with_gain(task)?.point;
    let here = whitened_at(&model, run, &centre, task)?;
    let step = COLOUR.time_step * fit.runs[run].row_time;
    let mut found = Vec::new();
    for quantity in common {
        // Times below zero are none.
        let move_by = match quantity {
            Quantity::Gain => 2.0 * COLOUR.gain_step * centre.gain.abs(),
            _ => 2.0 * step,
        };
        let moved = moved_by(&centre, *quantity, move_by);
        let mut column = whitened_at(&model, run, &moved, task)?;
        add_multiple(&mut column, -1.0, &here);
        column.iter_mut().for_each(|entry| *entry /= move_by);
        found.push(column);
    }
    Ok(found)
}

/// The numbers with one of them larger by so much, and the other ones as they are.
fn moved_by(centre: &Point, quantity: Quantity, by: f64) -> Point {
    let mut moved = centre.clone();
    moved.timing = Timing::Delay(centre.delay());
    match quantity {
        Quantity::Gain => moved.gain += by,
        Quantity::Zero => moved.zero += by,
        Quantity::Lag(i) => moved.lags[i] += by,
        Quantity::Delay | Quantity::Total => moved.timing = Timing::Delay(centre.delay() + by),
    }
    moved
}

/// The whitened residuals, in units of the output.
fn whitened_at(model: &Model, run: usize, point: &Point, task: &Task) -> Result<Vec<f64>, Error> {
    let part = model.at(run, point, task)?;
    let deviation = part.variance.sqrt();
    Ok(part.whitened.iter().map(|one| one * deviation).collect())
}

#[cfg(test)]
mod tests {
    use super::super::super::fit::FlightRun;
    use super::super::super::plant::FlightPlant;
    use super::*;
    use crate::estimation::fit::Fit;
    use crate::estimation::likelihood::Noise;
    use crate::estimation::tests::{gaussian, recorded};

    #[test]
    fn derivatives_of_the_rows_have_the_covariance_of_the_likelihood() {
        let rows = recorded((&[1.0], &[1.0, 0.0]), (0.31, 0.85, 0.17), 0.01, 8);
        let mut plant = FlightPlant::new(vec![1.0], vec![1.0, 0.0], 1);
        plant.lags = vec![0.17];
        let point = Point {
            timing: Timing::Delay(0.31),
            lags: vec![0.17],
            zero: 0.0,
            gain: 0.85,
            noise: vec![Noise {
                air: 0.3,
                ..Noise::QUIET
            }],
        };
        let run = FlightRun::new(rows, 0.0);
        let fit = Fit {
            point,
            objective: 0.0,
        };
        let task = Task::new();
        let fit = FlightFit::new(plant, vec![run].into(), false, fit, None).unwrap();
        let columns = columns(&fit, 0, &fit.plant.common(), &task).unwrap();
        let size = columns.len();
        let squares: Vec<f64> = columns
            .iter()
            .flat_map(|one| columns.iter().map(move |other| dot(one, other)))
            .collect();
        let inverse = Singular::new(&squares, size).pseudo_inverse(COLOUR.singular);
        let variance = fit.parts(&task).unwrap()[0].variance;
        let expected = fit.covariance(&task).unwrap();
        for i in 0..size {
            for j in 0..size {
                let scale = (expected[i * (size + 1)] * expected[j * (size + 1)]).sqrt();
                let found = inverse[i * size + j] * variance;
                assert!(
                    (found - expected[i * size + j]).abs() < 0.02 * scale,
                    "{i} {j} {found}"
                );
            }
        }
    }

    #[test]
    fn squares_of_coloured_rows_vary_more_along_a_slow_direction() {
        // Autocorrelations 0.7^k: squares have 0.49^k, and along a constant the factor is their sum.
        let slow: Vec<f64> = (0..1000)
            .map(|i| (std::f64::consts::TAU * f64::from(i) / 500.0).cos())
            .collect();
        let draws = 200;
        let (mut told, mut squares) = (0.0, 0.0);
        for seed in 0..draws {
            let mut rows = gaussian(seed, 3000);
            for i in 1..rows.len() {
                rows[i] += 0.7 * rows[i - 1];
            }
            let rows: Vec<f64> = rows[2000..].iter().map(|x| x * 0.51_f64.sqrt()).collect();
            told += colour_of_squares(&rows, &slow) / draws as f64;
            let along: f64 = rows
                .iter()
                .zip(&slow)
                .map(|(x, by)| (x * x - 1.0) * by)
                .sum();
            squares += along * along / draws as f64;
        }
        let found = squares / (2.0 * dot(&slow, &slow));
        assert!((told / found - 1.0).abs() < 0.25, "{told} {found}");
        assert!(found > 2.0);
        assert!(colour_of_squares(&gaussian(1, 1000), &slow) < 1.2);
    }
}
