//! Does the plant lack a lag, a lag with a zero, or a delay below zero?
//!
//! White residuals are not enough: the air can take the place of a lag that the plant lacks, and the
//! whitened residuals stay white. The likelihood ratio of a further lag has half its distribution at
//! zero (Self & Liang 1987). Coloured residuals may hide a plant that overshoots: a further lag with a
//! zero is tried beside the noise.

use super::super::fit::{FlightFit, with_noise, with_times};
use super::super::start::is_long;
use super::tolerances::FURTHER;
use crate::estimation::fit::{Fit, Search};
use crate::estimation::likelihood::Noise;
use crate::estimation::point::{Point, Quantity};
use crate::estimation::statistics::{chi_squared_beyond, normal_beyond};
use crate::linear_algebra::vectors::dot;
use crate::{Error, Task};

/// A richer plant, and the probability of such a likelihood ratio without what it has more.
pub(super) struct Richer {
    pub(super) point: Point,
    pub(super) p_value: f64,
}

impl Richer {
    /// The lag that it has more.
    pub(super) fn lag(&self) -> f64 {
        self.point.lags.last().copied().unwrap_or(0.0)
    }
}

/// The likeliest numbers with a further lag. In long recordings the noise stays as it is.
pub(super) fn further_lag(fit: &FlightFit, task: &Task) -> Result<Richer, Error> {
    let plant = fit.plant.with_lag();
    let model = plant.model(fit.rows(), fit.trim)?;
    let centre = fit.with_gain(task)?.point;
    let between = fit.runs[0].row_time;
    let behind = |rows: f64, noise: &[Noise]| {
        let lag = rows * between;
        let lags = centre.lags.iter().copied().chain([lag]).collect();
        let point = with_times(&centre, (centre.delay() - lag).max(0.0), lags);
        with_noise(&point, noise.to_vec())
    };
    let own = fit.noises();
    let without = behind(FURTHER.none, own);
    let least = if is_long(&fit.runs) {
        model.objective(&without, task)?
    } else {
        let near = Fit {
            point: model.timed(without.clone()),
            objective: f64::INFINITY,
        };
        let quantity = Quantity::Lag(centre.lags.len());
        let held = model.held(&near, quantity, FURTHER.none * between, task)?;
        held.objective
    };
    let quiet = vec![Noise::QUIET; own.len()];
    let mut noises = vec![own];
    if !is_long(&fit.runs) && own.iter().any(|noise| noise.air > 0.0) {
        noises.push(&quiet);
    }
    let (starts, searched, tolerance) = if is_long(&fit.runs) {
        (&FURTHER.starts[..1], Search::Mean, FURTHER.clear)
    } else {
        (&FURTHER.starts[..], Search::All, FURTHER.rough)
    };
    let mut best: Option<Fit> = None;
    for noise in noises {
        for lag in starts {
            let start = model.timed(behind(*lag, noise));
            let found = model.fit(&start, None, searched, tolerance, task)?;
            if best
                .as_ref()
                .is_none_or(|best| found.objective < best.objective)
            {
                best = Some(found);
            }
        }
    }
    let likelier = best.filter(|best| best.objective < least);
    Ok(likelier.map_or(
        Richer {
            point: without,
            p_value: 1.0,
        },
        |best| Richer {
            p_value: 0.5 * chi_squared_beyond(least - best.objective, 1.0),
            point: best.point,
        },
    ))
}

/// The likeliest numbers with a further lag and a zero.
///
/// Two numbers more: half the distribution with one degree of freedom and half with two, since the lag
/// is at its bound without them.
pub(super) fn overshoots(fit: &FlightFit, task: &Task) -> Result<Richer, Error> {
    let mut plant = fit.plant.with_lag();
    plant.free.zero = true;
    let model = plant.model(fit.rows(), fit.trim)?;
    let centre = fit.with_gain(task)?.point;
    let between = fit.runs[0].row_time;
    let mut best: Option<Fit> = None;
    for (lag, zero) in FURTHER.overshoots {
        let lags = centre.lags.iter().copied().chain([lag * between]);
        let mut start = with_times(&centre, centre.delay(), lags.collect());
        start.zero += zero * between;
        let start = model.timed(start);
        let found = model.fit(&start, None, Search::All, FURTHER.rough, task)?;
        if best
            .as_ref()
            .is_none_or(|best| found.objective < best.objective)
        {
            best = Some(found);
        }
    }
    let best = best.unwrap_or_else(|| fit.fit.clone());
    let fall = (fit.fit.objective - best.objective).max(0.0);
    Ok(Richer {
        point: best.point,
        p_value: 0.5 * (chi_squared_beyond(fall, 1.0) + chi_squared_beyond(fall, 2.0)),
    })
}

/// Probability of such a slope of the likelihood at a delay of zero, which is its bound.
pub(super) fn below_zero(fit: &FlightFit, task: &Task) -> Result<f64, Error> {
    if !fit.plant.free.delay || fit.fit.point.delay() > 0.0 {
        return Ok(1.0);
    }
    let parts = fit.parts(task)?.iter();
    let slopes: Vec<f64> = parts
        .filter(|part| !part.score.is_empty())
        .map(|part| dot(&part.score, &part.whitened))
        .collect();
    let size = slopes.iter().sum::<f64>().abs() / (slopes.len().max(1) as f64).sqrt();
    Ok(normal_beyond(size))
}
