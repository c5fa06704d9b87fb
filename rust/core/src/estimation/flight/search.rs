//! The likeliest plant and noise: starts in calm and in strong air, and which parts of the noise the
//! recordings have.

use std::sync::Arc;

use super::super::fit::Fit;
use super::super::likelihood::Noise;
use super::super::point::Point;
use super::fit::{FlightFit, FlightRun, likeliest, with_noise, with_times};
use super::grid;
use super::plant::FlightPlant;
use super::tolerances::{PRICES, SEARCH};
use crate::{Error, Task};

/// A part of the noise that scatters times.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scatter {
    /// The times of rows and of their commands.
    Stamps,
    /// The times at which commands arrive.
    Arrivals,
}

impl Scatter {
    fn of(self, noise: &Noise) -> f64 {
        match self {
            Self::Stamps => noise.stamps,
            Self::Arrivals => noise.arrivals,
        }
    }

    fn with(self, noise: &Noise, size: f64) -> Noise {
        let mut noise = *noise;
        match self {
            Self::Stamps => noise.stamps = size,
            Self::Arrivals => noise.arrivals = size,
        }
        noise
    }
}

/// Strong air, and weak air that is slow, for each recording.
pub(super) fn airs_of(plant: &FlightPlant, runs: &[FlightRun]) -> [Vec<Noise>; 2] {
    let air = |[a_row, flat]: [f64; 2], slow: f64| {
        let of = |run: &FlightRun| Noise {
            air_time: slow * SEARCH.air_time * run.rows.span(),
            air: if plant.integrates() {
                a_row / run.row_time
            } else {
                flat
            },
            ..Noise::QUIET
        };
        runs.iter().map(of).collect()
    };
    [air(SEARCH.strong, 1.0), air(SEARCH.weak, SEARCH.slow)]
}

impl FlightFit {
    /// The maximum near the numbers, and from slow air where there is none, unless the noise is white:
    /// without air there is none after a search either.
    ///
    /// # Errors
    ///
    /// As for `Model::at`.
    pub fn refit(&self, tolerance: f64, white: bool, task: &Task) -> Result<Self, Error> {
        let mut starts = vec![self.fit.point.clone()];
        if !white && self.noises().iter().any(|noise| noise.air == 0.0) {
            let [_, slow] = airs_of(&self.plant, &self.runs);
            starts.push(with_noise(&self.fit.point, slow));
        }
        let found = likeliest(self.model(), &starts, tolerance, task)?;
        Ok(self.moved(found.unwrap_or_else(|| self.fit.clone())))
    }
}

/// The likeliest plant and noise, from least squares (`first`) and a grid in strong air.
pub(super) fn fit_noise(
    plant: &FlightPlant,
    runs: Arc<[FlightRun]>,
    first: &Point,
    task: &Task,
) -> Result<FlightFit, Error> {
    let best = in_air(plant, runs, first, task)?;
    let best = least(best, with_sensor, beside_sensor, task)?;
    let best = least(best, with_scatter, FlightFit::criterion, task)?;
    let best = without_idle_air(best, task)?;
    let found = best.fitted(&best.fit.point, SEARCH.fine, task)?;
    without_idle_lags(without_idle_air(best.moved(found), task)?, task)
}

/// The fit with or without air and trim.
fn in_air(
    plant: &FlightPlant,
    runs: Arc<[FlightRun]>,
    first: &Point,
    task: &Task,
) -> Result<FlightFit, Error> {
    let [strong, slow] = airs_of(plant, &runs);
    let weaken = |air: &Noise| Noise {
        air_time: air.air_time / SEARCH.slow,
        ..*air
    };
    let weak: Vec<Noise> = slow.iter().map(weaken).collect();
    let first = with_noise(first, vec![Noise::QUIET; runs.len()]);
    let start = Fit {
        point: first.clone(),
        objective: f64::INFINITY,
    };
    let plain = FlightFit::new(plant.clone(), runs, false, start.clone(), None)?;
    let mut calms = grid_in(&plain, &first, task)?;
    calms.truncate(1);
    calms.insert(0, first.clone());
    let airs = grid_in(&plain, &with_noise(&first, strong), task)?;
    let searched = |own: &FlightFit, calm: Fit| -> Result<FlightFit, Error> {
        let mut starts = vec![
            with_noise(&calm.point, weak.clone()),
            with_noise(&calm.point, slow.clone()),
        ];
        starts.extend(airs.iter().cloned());
        let found = likeliest(own.model(), &starts, SEARCH.rough, task)?;
        let airy = found.filter(|found| found.objective < calm.objective);
        Ok(own.moved(airy.unwrap_or(calm)))
    };
    let calm_of = |own: &FlightFit| -> Result<Fit, Error> {
        let found = likeliest(own.model(), &calms, SEARCH.rough, task)?;
        Ok(found.unwrap_or_else(|| start.clone()))
    };
    let calm = calm_of(&plain)?;
    let without = searched(&plain, calm)?;
    if !plant.integrates() {
        return Ok(without);
    }
    let own = FlightFit::new(
        plant.clone(),
        Arc::clone(&without.runs),
        true,
        start.clone(),
        None,
    )?;
    let calm = calm_of(&own)?;
    let near = own.fitted(&without.fit.point, SEARCH.rough, task)?;
    let mut least = own.moved(calm.clone()).criterion(task)?;
    least = least.min(own.moved(near).criterion(task)?);
    let criterion = without.criterion(task)?;
    if least - criterion > SEARCH.doubtful * own.runs.len() as f64 {
        return Ok(without);
    }
    let with = searched(&own, calm)?;
    Ok(if with.criterion(task)? < criterion {
        with
    } else {
        without
    })
}

/// The likeliest points of a grid over delay and lag under the noise of a point.
fn grid_in(fit: &FlightFit, first: &Point, task: &Task) -> Result<Vec<Point>, Error> {
    let (plant, Some(run)) = (&fit.plant, fit.runs.first()) else {
        return Ok(Vec::new());
    };
    if !plant.free.delay {
        return Ok(vec![first.clone()]);
    }
    let delays = grid::growing(run);
    let lags = grid::lags_of(plant, run.row_time);
    let found = grid::minima(fit.model(), &delays, &lags, first, task)?;
    Ok(found.into_iter().map(|one| one.point).collect())
}

/// The fit, or one of others with a lower criterion.
fn least(
    best: FlightFit,
    others: fn(&FlightFit, &Task) -> Result<Vec<FlightFit>, Error>,
    criterion: fn(&FlightFit, &Task) -> Result<f64, Error>,
    task: &Task,
) -> Result<FlightFit, Error> {
    let mut lowest = criterion(&best, task)?;
    let mut kept = None;
    for other in others(&best, task)? {
        let own = criterion(&other, task)?;
        if own < lowest {
            lowest = own;
            kept = Some(other);
        }
    }
    Ok(kept.unwrap_or(best))
}

/// Akaike's criterion where fast air has its price too.
///
/// It moves the output as a sensor's noise of long correlation does, which may take its place.
fn beside_sensor(fit: &FlightFit, task: &Task) -> Result<f64, Error> {
    let mut pairs = fit.noises().iter().zip(fit.runs.iter());
    let fast =
        pairs.any(|(noise, run)| noise.air > 0.0 && noise.air_time < SEARCH.fast * run.row_time);
    Ok(fit.criterion(task)? + if fast { PRICES.sensor } else { 0.0 })
}

/// The fit with coloured sensor noise beside the air and in its place.
fn with_sensor(best: &FlightFit, task: &Task) -> Result<Vec<FlightFit>, Error> {
    let mut found = Vec::new();
    for keeps_air in [true, false] {
        if keeps_air && best.noises().iter().all(|noise| noise.air == 0.0) {
            continue;
        }
        let pairs = best.noises().iter().zip(best.runs.iter());
        let noise = pairs.map(|(noise, run)| Noise {
            air_time: noise.air_time,
            air: if keeps_air { noise.air } else { 0.0 },
            sensor_time: SEARCH.sensor_time * run.row_time,
            sensor: SEARCH.sensor,
            ..Noise::QUIET
        });
        let start = with_noise(&best.fit.point, noise.collect());
        found.push(best.moved(best.fitted(&start, SEARCH.rough, task)?));
    }
    Ok(found)
}

/// The fit with scattered times of the rows, and of the commands.
fn with_scatter(best: &FlightFit, task: &Task) -> Result<Vec<FlightFit>, Error> {
    let mut found = Vec::new();
    for part in [Scatter::Stamps, Scatter::Arrivals] {
        let (mut runs, mut noises) = (Vec::new(), Vec::new());
        let parts = best.parts(task)?;
        for ((run, like), noise) in best.runs.iter().zip(parts).zip(best.noises()) {
            let speed: Vec<f64> = like.rate.iter().map(|rate| rate / like.gain).collect();
            let commands = &run.rows.commands.value;
            let size = match part {
                Scatter::Stamps => largest(speed.iter().copied()),
                Scatter::Arrivals => largest(commands.windows(2).map(|pair| pair[1] - pair[0])),
            };
            let most = SEARCH.steady * run.rows.time.len() as f64;
            let steady = part == Scatter::Arrivals && commands.len() as f64 > most;
            // A gain of zero leaves no finite speed.
            if !(size > 0.0 && size.is_finite())
                || steady
                || speed.iter().any(|one| !one.is_finite())
            {
                return Ok(found);
            }
            let own = part.of(noise);
            noises.push(part.with(noise, if own > 0.0 { own } else { 1.0 / size }));
            runs.push(run.with_speed(speed));
        }
        let moved = best.on(runs.into())?;
        let start = with_noise(&best.fit.point, noises);
        let fit = moved.moved(moved.fitted(&start, SEARCH.rough, task)?);
        // No command arrives before it is sent.
        let bounded = part == Scatter::Arrivals && fit.plant.free.delay;
        let latest = if bounded {
            fit.fit.point.delay()
        } else {
            f64::INFINITY
        };
        let mut within = true;
        for run in 0..fit.runs.len() {
            let most = latest.min(SEARCH.most_scatter * fit.runs[run].row_time);
            within &= scatter_of(&fit, run, part, task)? < most;
        }
        if within {
            found.push(fit);
        }
    }
    Ok(found)
}

/// Scatter of the times of the rows or of the commands, s.
///
/// # Errors
///
/// As for `FlightFit::parts`.
pub fn scatter_of(fit: &FlightFit, run: usize, part: Scatter, task: &Task) -> Result<f64, Error> {
    let (Some(like), Some(noise)) = (fit.parts(task)?.get(run), fit.noises().get(run)) else {
        return Ok(0.0);
    };
    Ok(part.of(noise) * like.variance.sqrt() / like.gain.abs())
}

/// The largest size, zero of none; infinite or not a number as they are.
fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, |most, value| {
        let size = value.abs();
        if size > most || size.is_nan() {
            size
        } else {
            most
        }
    })
}

/// The fit without air that makes its recording no likelier.
fn without_idle_air(mut fit: FlightFit, task: &Task) -> Result<FlightFit, Error> {
    for run in 0..fit.runs.len() {
        let mut noise = fit.noises().to_vec();
        let Some(own) = noise.get_mut(run).filter(|own| own.air > 0.0) else {
            continue;
        };
        own.air = 0.0;
        let point = with_noise(&fit.fit.point, noise);
        let objective = fit.model().objective(&point, task)?;
        if objective < fit.fit.objective + SEARCH.idle {
            fit = fit.moved(Fit { point, objective });
        }
    }
    Ok(fit)
}

/// The fit without lags that make its recordings no likelier than the shortest lag does.
///
/// A search ends at a lag far below the time between rows where the likelihood has a kink over the
/// delay; there rows hardly tell lag and delay apart.
fn without_idle_lags(mut fit: FlightFit, task: &Task) -> Result<FlightFit, Error> {
    let shortest = SEARCH.shortest * fit.runs.first().map_or(1.0, |run| run.row_time);
    let places = if fit.plant.free.delay {
        fit.plant.lags.len()
    } else {
        0
    };
    for place in (0..places)
        .filter(|place| fit.plant.free.lags[*place])
        .collect::<Vec<_>>()
    {
        let one = &fit.fit.point;
        let mut lags = one.lags.clone();
        let late = lags[place] - shortest;
        lags[place] = shortest;
        let delays = [one.delay(), one.delay() + late];
        for delay in delays.into_iter().filter(|_| late > 0.0) {
            let without = with_times(&fit.fit.point, delay, lags.clone());
            if fit.model().objective(&without, task)? < fit.fit.objective + SEARCH.idle {
                let found = fit.fitted(&without, SEARCH.fine, task)?;
                if found.objective < fit.fit.objective {
                    fit = fit.moved(found);
                }
                break;
            }
        }
    }
    Ok(fit)
}
