//! The likeliest plant and noise without outliers, from a part of long recordings first.

use std::sync::Arc;

use super::super::likelihood::Noise;
use super::super::point::Point;
use super::fit::{FlightFit, FlightRun, with_noise, with_times};
use super::outliers::{outliers, spikes, without};
use super::plant::FlightPlant;
use super::search::fit_noise;
use super::start::{is_long, parts_of};
use super::tolerances::{LONG, OUTLIERS, START};
use crate::{Error, Task};

/// The likeliest plant and noise from a fit of least squares, without the spikes that it leaves.
///
/// # Errors
///
/// As for `fit_flight`.
pub fn beside_noise(white: &FlightFit, task: &Task) -> Result<FlightFit, Error> {
    let pairs = white.runs.iter().zip(white.parts(task)?);
    let kept = pairs.map(|(run, part)| without(run, &spikes(&part.residuals, run.rounding)));
    let first = white.with_gain(task)?.point;
    fit_flight(&white.plant, &kept.collect(), &first, task)
}

/// The likeliest plant and noise of recordings, from numbers under white noise.
///
/// # Errors
///
/// As for `Model::fit`.
pub fn fit_flight(
    plant: &FlightPlant,
    all: &Arc<[FlightRun]>,
    first: &Point,
    task: &Task,
) -> Result<FlightFit, Error> {
    let start = start_of(plant, all, first);
    let mut fit = fit_noise(plant, parts_of(all), &start, task)?;
    for _ in 0..OUTLIERS.rounds {
        let parts = fit.parts(task)?.iter().zip(fit.runs.iter());
        let found: Vec<Vec<bool>> = parts.map(|(part, run)| outliers(part, run)).collect();
        if !found.iter().flatten().any(|is| *is) {
            break;
        }
        let pairs = fit.runs.iter().zip(&found);
        let kept = pairs.map(|(run, rows)| without(run, rows)).collect();
        fit = fit_noise(plant, kept, &fit.fit.point, task)?;
    }
    let fit = if is_long(all) {
        on_all_rows(&fit, all, task)?
    } else {
        fit
    };
    Ok(in_order(fit))
}

/// The numbers under white noise; a lag of about zero becomes a short one.
///
/// Free lags that are equal would stay equal, since they have the same effect: they are spread.
fn start_of(plant: &FlightPlant, all: &[FlightRun], first: &Point) -> Point {
    let least = OUTLIERS.start_lag * all.first().map_or(1.0, |run| run.row_time);
    let (mut delay, mut lags) = (first.delay(), Vec::new());
    for (lag, free) in first.lags.iter().zip(&plant.free.lags) {
        let mut lag = *lag;
        if *free && lag.abs() < least {
            delay = (delay - least + lag).max(0.0);
            lag = least;
        }
        while *free && lags.contains(&lag) {
            lag *= START.shorter;
        }
        lags.push(lag);
    }
    with_noise(
        &with_times(first, delay, lags),
        vec![Noise::QUIET; all.len()],
    )
}

/// The same plant with the longest of its free lags first: their order has no effect.
fn in_order(fit: FlightFit) -> FlightFit {
    let (one, free) = (&fit.fit.point, &fit.plant.free.lags);
    let own = one.lags.iter().zip(free).filter(|(_, free)| **free);
    let mut longest: Vec<f64> = own.map(|(lag, _)| *lag).collect();
    longest.sort_by(|one, other| other.total_cmp(one));
    let mut next = longest.into_iter();
    let lags = one.lags.iter().zip(free);
    let lags = lags.map(|(lag, free)| {
        if *free {
            next.next().unwrap_or(*lag)
        } else {
            *lag
        }
    });
    let lags: Vec<f64> = lags.collect();
    if lags == one.lags {
        return fit;
    }
    let mut moved = fit.fit.clone();
    moved.point = with_times(one, one.delay(), lags);
    fit.moved(moved)
}

/// The maximum on all rows of recordings, near the `fit` to parts of them, without outliers.
fn on_all_rows(fit: &FlightFit, all: &Arc<[FlightRun]>, task: &Task) -> Result<FlightFit, Error> {
    let mut whole = fit.on(Arc::clone(all))?;
    if fit.noises().iter().any(|noise| noise.stamps > 0.0) {
        let quiet = with_noise(&fit.fit.point, vec![Noise::QUIET; all.len()]);
        let mut white = fit.fit.clone();
        white.point = quiet;
        let white = whole.moved(white);
        let pairs = all.iter().zip(white.parts(task)?);
        let speeds = pairs.map(|(run, part)| {
            run.with_speed(part.rate.iter().map(|rate| rate / part.gain).collect())
        });
        whole = whole.on(speeds.collect())?;
    }
    let pairs = whole.runs.iter().zip(whole.parts(task)?);
    let kept = pairs.map(|(run, part)| without(run, &outliers(part, run)));
    let kept = whole.on(kept.collect())?;
    let start = fit.with_gain(task)?.point;
    let found = kept.fitted(&start, LONG.close, task)?;
    Ok(kept.moved(found))
}
