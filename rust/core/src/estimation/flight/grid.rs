//! Local minima of the likelihood on a grid over delay and lags.

use super::super::fit::{Fit, Model};
use super::super::point::{Point, Timing};
use super::fit::FlightRun;
use super::plant::FlightPlant;
use super::tolerances::START;
use crate::{Error, Task};

/// The delays of a grid that grows, in the window of a recording.
pub(super) fn growing(run: &FlightRun) -> Vec<f64> {
    let (longest, mut last) = (START.longest * run.rows.span(), 0.0);
    let mut delays = vec![last];
    while last < longest {
        last += f64::max(START.step * run.row_time, START.growth * last);
        delays.push(last);
    }
    on_parts_of_rows(delays, run)
}

/// The delays of a grid whose steps are equal, smaller ones without a lag.
pub(super) fn even(run: &FlightRun, is_smooth: bool) -> Vec<f64> {
    let longest = START.longest * run.rows.span();
    let step = if is_smooth {
        START.smooth_step
    } else {
        START.sharp_step
    };
    let count = (longest / (step * run.row_time)).max(2.0);
    let count = count.min(START.most_points).floor();
    let places = (0..=count as usize).map(|place| place as f64 * longest / count);
    on_parts_of_rows(places.collect(), run)
}

/// Increasing delays, moved to parts of a row where rows are even: a response serves all delays that
/// are whole rows apart, there.
fn on_parts_of_rows(delays: Vec<f64>, run: &FlightRun) -> Vec<f64> {
    let time = &run.rows.time;
    let part = run.rows.span() / (time.len() - 1) as f64 / START.parts_of_row;
    let steps = time.windows(2).map(|pair| pair[1] - pair[0]);
    let ends = steps.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), step| {
        (step.min(low), step.max(high))
    });
    if ends.1 - ends.0 > START.even * part {
        return delays;
    }
    let mut parts: Vec<f64> = delays
        .iter()
        .map(|delay| (delay / part).round_ties_even())
        .collect();
    parts.dedup();
    parts.into_iter().map(|count| part * count).collect()
}

/// The lags of the grid, for rows so far apart.
pub(super) fn lags_of(plant: &FlightPlant, between: f64) -> Vec<Vec<f64>> {
    let free = &plant.free.lags;
    if !free.contains(&true) {
        return vec![plant.lags.clone()];
    }
    if plant.time_constant {
        let known = plant.lags.first().copied().unwrap_or(between);
        return START.factors.map(|factor| vec![factor * known]).to_vec();
    }
    let at = |rows: f64| {
        let mut size = rows * between;
        let lags = plant.lags.iter().zip(free);
        let moved = lags.map(|(known, is_free)| {
            if !is_free {
                return *known;
            }
            let lag = if *known < 0.0 { -size } else { size };
            size *= START.shorter;
            lag
        });
        moved.collect()
    };
    START.lags.map(at).to_vec()
}

/// The lowest local minima over the delay at sets of lags, else as at `first`, the lowest first.
pub(super) fn minima(
    model: &Model,
    delays: &[f64],
    lags: &[Vec<f64>],
    first: &Point,
    task: &Task,
) -> Result<Vec<Fit>, Error> {
    let mut found: Vec<Fit> = Vec::new();
    for some in lags {
        let at = |delay: f64| Point {
            timing: Timing::Delay(delay),
            lags: some.clone(),
            ..first.clone()
        };
        let values = model.over_delays(&at(0.0), delays, task)?;
        for (place, (value, delay)) in values.iter().zip(delays).enumerate() {
            let before = place.checked_sub(1).and_then(|place| values.get(place));
            let mut beside = before.into_iter().chain(values.get(place + 1));
            // Where the command has no effect yet, the likelihood is infinite.
            if value.is_finite() && beside.all(|other| value <= other) {
                found.push(Fit {
                    point: at(*delay),
                    objective: *value,
                });
            }
        }
    }
    found.sort_by(|one, other| one.objective.total_cmp(&other.objective));
    let mut told = Vec::new();
    for one in found {
        // Nor do rows tell the numbers apart in which it has only just begun.
        if told.len() < START.refined && model.objective(&one.point, task)?.is_finite() {
            told.push(one);
        }
    }
    Ok(told)
}
