//! Numbers of a plant that are searched around the likelihood.
//!
//! The likelihood knows a gain, a delay, lags and a zero. Limits of the rate of a command, complex poles
//! and named numbers of a plant are not among them. With such numbers given, command and plant are known,
//! and the rest is searched as always. They are searched around that, in their logarithms, so that each
//! keeps its sign. Their covariance is the inverse of half the curvature of −2 ln L, minimised over all
//! else; how the other numbers change with them adds to the variance of these. Both are approximations by
//! a parabola.

use std::sync::Arc;

use super::super::point::Quantity;
use super::fit::{FlightFit, FlightRun};
use super::plant::FlightPlant;
use super::start::{least_squares, parts_of};
use super::tolerances::{AROUND, LAG_FACTORS};
use crate::linear_algebra::symmetric::Symmetric;
use crate::simplex::least_around;
use crate::{Error, Task};

/// The plant with such numbers, and the rows under the command that it gets.
pub type WithNumbers<'a> = &'a dyn Fn(&[f64]) -> Result<(FlightPlant, Arc<[FlightRun]>), Error>;

/// The likeliest numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct FreeNumbers {
    /// Their values.
    pub values: Vec<f64>,
    /// Covariance of their logarithms, row-major.
    pub cov: Vec<f64>,
    /// Derivatives of the other quantities by these logarithms.
    pub slopes: Vec<(Quantity, Vec<f64>)>,
}

impl FreeNumbers {
    /// The standard deviation that the unknown numbers add to that of a quantity.
    pub fn added(&self, quantity: Quantity) -> f64 {
        let slope = self.slope(quantity);
        self.covariance(&slope, &slope).sqrt()
    }

    /// Standard deviation of the logarithm of a number.
    pub fn deviation(&self, place: usize) -> f64 {
        self.cov[place * (self.values.len() + 1)].sqrt()
    }

    /// Covariance of quantities and the numbers, from that of the quantities for known ones.
    pub fn joined(&self, quantities: &[Quantity], cov: &[f64]) -> Vec<f64> {
        let (n, k) = (quantities.len(), self.values.len());
        let unit =
            |place: usize| (0..k).map(move |i| if i == place { self.values[i] } else { 0.0 });
        let mut slopes: Vec<Vec<f64>> = quantities.iter().map(|one| self.slope(*one)).collect();
        slopes.extend((0..k).map(|place| unit(place).collect()));
        let entry = |place: usize| {
            let (i, j) = (place / (n + k), place % (n + k));
            let own = if i < n && j < n { cov[i * n + j] } else { 0.0 };
            own + self.covariance(&slopes[i], &slopes[j])
        };
        (0..(n + k) * (n + k)).map(entry).collect()
    }

    fn slope(&self, quantity: Quantity) -> Vec<f64> {
        let found = self.slopes.iter().find(|(own, _)| *own == quantity);
        found.map_or_else(|| vec![0.0; self.values.len()], |(_, slope)| slope.clone())
    }

    fn covariance(&self, one: &[f64], other: &[f64]) -> f64 {
        let k = self.values.len();
        let by = |i: usize| (0..k).map(|j| self.cov[i * k + j] * other[j]).sum::<f64>();
        (0..k).map(|i| one[i] * by(i)).sum()
    }
}

/// The search around a fit.
struct Around<'a> {
    given: WithNumbers<'a>,
    /// The numbers that it starts from.
    first: &'a [f64],
    white: bool,
    task: &'a Task,
}

impl Around<'_> {
    /// The numbers with these logarithms, each with its sign.
    fn values(&self, logs: &[f64]) -> Vec<f64> {
        let pairs = self.first.iter().zip(logs);
        pairs
            .map(|(first, log)| log.exp().copysign(*first))
            .collect()
    }

    /// The fit of plant and noise, or of the plant alone, with numbers given.
    fn at(&self, logs: &[f64], near: &FlightFit, tolerance: f64) -> Result<FlightFit, Error> {
        let (plant, runs) = (self.given)(&self.values(logs))?;
        let fit = FlightFit::new(plant, runs, near.trim, near.fit.clone(), None)?;
        fit.refit(tolerance, self.white, self.task)
    }

    /// Logarithms of the likeliest numbers.
    fn likeliest(&self, fit: &FlightFit) -> Result<Vec<f64>, Error> {
        let start: Vec<f64> = self.first.iter().map(|x| x.abs().ln()).collect();
        let mut best: Option<FlightFit> = None;
        let mut cost = |logs: &[f64]| {
            // The best so far is near.
            let found = self.at(logs, best.as_ref().unwrap_or(fit), AROUND.close)?;
            let value = found.fit.objective;
            if best.as_ref().is_none_or(|best| value < best.fit.objective) {
                best = Some(found);
            }
            Ok(value)
        };
        let mut middle = (f64::INFINITY, start.clone());
        for moves in grid(&vec![vec![-AROUND.away, 0.0, AROUND.away]; start.len()]) {
            let place: Vec<f64> = start.iter().zip(moves).map(|(x, by)| x + by).collect();
            let value = cost(&place)?;
            if value < middle.0 {
                middle = (value, place);
            }
        }
        let (mut middle, most) = (middle.1, AROUND.most * start.len());
        for _ in 0..AROUND.searches {
            middle = least_around(&middle, AROUND.step, AROUND.accuracy, most, &mut cost)?;
        }
        Ok(middle)
    }

    /// Second derivatives of −2 ln L, and first ones of the other quantities.
    ///
    /// Where the two sides differ, as where there is air on one side only, the flatter one counts.
    fn parabola(&self, middle: &[f64], best: &FlightFit) -> Result<(Vec<f64>, Slopes), Error> {
        let (k, base) = (middle.len(), best.fit.objective);
        let moved = |by: &[(usize, f64)]| {
            let mut place = middle.to_vec();
            by.iter().for_each(|(i, step)| place[*i] += step);
            self.at(&place, best, AROUND.exact)
        };
        let mut curvature = vec![0.0; k * k];
        let known = quantities_of(best, self.task)?;
        let mut slopes: Slopes = known.iter().map(|(own, _)| (*own, Vec::new())).collect();
        let (mut steps, mut rises) = (Vec::new(), Vec::new());
        for i in 0..k {
            let mut step = AROUND.quotient;
            let (higher, lower, above, below) = loop {
                let (higher, lower) = (moved(&[(i, step)])?, moved(&[(i, -step)])?);
                let (above, below) = (higher.fit.objective - base, lower.fit.objective - base);
                if above.min(below) > AROUND.least_rise || step > AROUND.longest {
                    break (higher, lower, above, below);
                }
                step *= 2.0;
            };
            curvature[i * k + i] = 2.0 * above.min(below) / (step * step);
            steps.push(step);
            rises.push(above);
            let ends = [
                quantities_of(&higher, self.task)?,
                quantities_of(&lower, self.task)?,
            ];
            for (place, (_, slope)) in slopes.iter_mut().enumerate() {
                slope.push((ends[0][place].1 - ends[1][place].1) / (2.0 * step));
            }
        }
        for i in 0..k {
            for j in 0..i {
                let both = moved(&[(i, steps[i]), (j, steps[j])])?.fit.objective - base;
                let own = (both - rises[i] - rises[j]) / (steps[i] * steps[j]);
                curvature[i * k + j] = own;
                curvature[j * k + i] = own;
            }
        }
        Ok((curvature, slopes))
    }
}

type Slopes = Vec<(Quantity, Vec<f64>)>;

/// The likeliest numbers with plant and noise, from the fit with those of `first`; none of the numbers
/// where the recordings do not tell them from what else is fitted.
///
/// # Errors
///
/// As for `Model::fit`, and those of `given`.
pub fn fit_numbers(
    fit: &FlightFit,
    given: WithNumbers<'_>,
    first: &[f64],
    task: &Task,
) -> Result<(FlightFit, Option<FreeNumbers>), Error> {
    let around = Around {
        given,
        first,
        white: false,
        task,
    };
    let middle = around.likeliest(fit)?;
    let best = around.at(&middle, fit, AROUND.exact)?;
    let (curvature, slopes) = around.parabola(&middle, &best)?;
    let k = first.len();
    let half: Vec<f64> = curvature.iter().map(|entry| 0.5 * entry).collect();
    let Symmetric { values, vectors } = Symmetric::new(&half, k);
    if !values.iter().all(|size| *size > AROUND.least_curvature) {
        return Ok((best, None));
    }
    let entry = |place: usize| {
        let directions = values.iter().zip(&vectors);
        let parts = directions.map(|(size, v)| v[place / k] * v[place % k] / size);
        parts.sum()
    };
    let numbers = FreeNumbers {
        values: around.values(&middle),
        cov: (0..k * k).map(entry).collect(),
        slopes,
    };
    Ok((best, Some(numbers)))
}

/// The fit of least squares on parts of long recordings, and the numbers under which it is best; from
/// this delay and gain where they are known.
///
/// # Errors
///
/// As for `least_squares`, and those of `given`.
pub fn first_numbers(
    given: WithNumbers<'_>,
    first: &[f64],
    start: (f64, f64),
    task: &Task,
) -> Result<(FlightFit, Vec<f64>), Error> {
    let within = |values: &[f64]| {
        let (plant, runs) = given(values)?;
        Ok((plant, parts_of(&runs)))
    };
    let mut best: Option<(FlightFit, Vec<f64>)> = None;
    for factors in grid(&vec![LAG_FACTORS.to_vec(); first.len()]) {
        let values: Vec<f64> = first.iter().zip(factors).map(|(x, by)| by * x).collect();
        let (plant, runs) = within(&values)?;
        let fit = least_squares(&plant, runs, start, task)?;
        let least = best.as_ref().map(|(best, _)| best.fit.objective);
        if least.is_none_or(|least| fit.fit.objective < least) {
            best = Some((fit, values));
        }
    }
    let Some((fit, values)) = best else {
        refuse!("the fit has no starting values")
    };
    if values.is_empty() {
        return Ok((fit, values));
    }
    let around = Around {
        given: &within,
        first: &values,
        white: true,
        task,
    };
    let middle = around.likeliest(&fit)?;
    let found = around.at(&middle, &fit, AROUND.exact)?;
    Ok((found, around.values(&middle)))
}

/// Gain, delay, zero, lags, and the sum of the times.
fn quantities_of(fit: &FlightFit, task: &Task) -> Result<Vec<(Quantity, f64)>, Error> {
    let point = fit.with_gain(task)?.point;
    let lags = (0..point.lags.len()).map(Quantity::Lag);
    let known = [Quantity::Gain, Quantity::Delay, Quantity::Zero];
    let every = known.into_iter().chain(lags);
    let mut found: Vec<(Quantity, f64)> = every.map(|one| (one, one.value(&point))).collect();
    found.push((Quantity::Total, fit.total()));
    Ok(found)
}

/// All points of a grid, the last axis first.
pub(super) fn grid(axes: &[Vec<f64>]) -> Vec<Vec<f64>> {
    axes.iter().fold(vec![Vec::new()], |points, axis| {
        let longer = |point: Vec<f64>| {
            let with = |value: &f64| [point.clone(), vec![*value]].concat();
            axis.iter().map(with).collect::<Vec<_>>()
        };
        points.into_iter().flat_map(longer).collect()
    })
}
