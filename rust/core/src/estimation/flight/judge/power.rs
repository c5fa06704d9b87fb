//! The smallest further lag that a recording would have shown.
//!
//! With a further lag L, and the delay shorter by L, the mean of the rows is another. What is left of
//! the whitened difference after the fitted numbers have followed it has a length δ, which grows with
//! L² at first because a lag is a delay to first order. Where a lag is fitted, it becomes the longer of
//! both, and the delay takes the place of the shorter: then δ grows no more. The root of the likelihood
//! ratio is about normal around δ (Wald 1943).

use super::super::fit::{FlightFit, with_times};
use super::super::plant::longest_delay;
use super::super::start::{is_long, parts_of};
use super::tolerances::{LEVELS, POWER};
use crate::estimation::fit::{Model, Search};
use crate::estimation::statistics::normal_quantile;
use crate::{Error, Task};

/// Below this further lag, s, the test for one finds it in less than 90 % of such recordings.
///
/// Infinite where none would be found. A long recording shows at least what its excited part shows.
///
/// # Errors
///
/// As for `Model::at`.
pub fn unseen_lag(fit: &FlightFit, task: &Task) -> Result<f64, Error> {
    let part = if is_long(&fit.runs) {
        Some(fit.on(parts_of(&fit.runs))?)
    } else {
        None
    };
    let fit = part.as_ref().unwrap_or(fit);
    // Half the distribution of the ratio is at zero.
    let wanted = normal_quantile(1.0 - LEVELS.test) + normal_quantile(POWER.power);
    let longest = longest_delay(&fit.rows());
    let richer = fit.plant.with_lag().model(fit.rows(), fit.trim)?;
    let (mut low, mut high, mut below) = (0.0, longest, 0.0);
    let (mut lag, mut order) = (POWER.first * fit.runs[0].row_time, 2.0);
    for _ in 0..POWER.evaluations {
        let found = seen(fit, &richer, lag, task)?;
        if (found - wanted).abs() <= POWER.enough * wanted {
            return Ok(lag);
        }
        if found > wanted {
            high = lag;
        } else if found <= below || low >= longest * POWER.near {
            return Ok(f64::INFINITY);
        } else {
            if low > 0.0 {
                let grown = (found / below).ln() / (lag / low).ln();
                order = grown.max(POWER.least_order);
            }
            (low, below) = (lag, found);
        }
        let guess = lag * (wanted / found.max(POWER.least)).powf(1.0 / order);
        lag = if low < guess && guess < high {
            guess
        } else {
            0.5 * (low + high)
        };
    }
    Ok(lag)
}

/// The length of what a further lag leaves of the rows.
fn seen(fit: &FlightFit, richer: &Model, lag: f64, task: &Task) -> Result<f64, Error> {
    let centre = fit.with_gain(task)?.point;
    let may_move = fit.plant.free.delay;
    let delay = centre.delay();
    let delay = if may_move {
        (delay - lag).max(0.0)
    } else {
        delay
    };
    let lags = centre.lags.iter().copied().chain([lag]).collect();
    let with_lag = with_times(&centre, delay, lags);
    let mut means = fit.rows();
    for (run, rows) in means.iter_mut().enumerate() {
        let residuals = richer.at(run, &with_lag, task)?.residuals;
        for (output, residual) in rows.output.iter_mut().zip(residuals) {
            *output -= residual;
        }
    }
    left(fit, &fit.plant.model(means, fit.trim)?, lag, task)
}

/// Length of what the fitted numbers leave of these rows, in white deviations of the fit.
///
/// They follow a further lag from where they are, and where a free lag is longer by as much.
fn left(fit: &FlightFit, model: &Model, lag: f64, task: &Task) -> Result<f64, Error> {
    let centre = fit.with_gain(task)?.point;
    let mut starts = vec![centre.clone()];
    for (place, free) in fit.plant.free.lags.iter().enumerate() {
        if fit.plant.free.delay && *free {
            let mut lags = centre.lags.clone();
            lags[place] += lag;
            starts.push(with_times(&centre, (centre.delay() - lag).max(0.0), lags));
        }
    }
    let (mut least, mut best) = (f64::INFINITY, centre);
    for start in starts {
        let start = model.timed(start);
        let found = model.fit(&start, None, Search::Mean, POWER.enough, task)?;
        if found.objective < least {
            (least, best) = (found.objective, found.point);
        }
    }
    let mut total = 0.0;
    for (run, own) in fit.parts(task)?.iter().enumerate() {
        let part = model.at(run, &best, task)?;
        total += part.variance * part.freedom as f64 / own.variance;
    }
    Ok(total.sqrt())
}
