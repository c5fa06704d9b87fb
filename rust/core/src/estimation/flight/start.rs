//! Least squares, from which the search for the noise starts, and the part of long recordings for it.
//!
//! Least squares is the likelihood without air and coloured noise. Its cost has several local minima
//! over the delay, so a grid over delay and lag comes first, for each recording alone.
//!
//! A search takes a few thousand evaluations, each linear in the rows. In a long recording it is made
//! on the rows in which the command changes most; the maximum on all rows is near, and takes some
//! tens of evaluations.

use std::ops::Range;
use std::sync::Arc;

use super::super::fit::{Fit, Model};
use super::super::likelihood::Noise;
use super::super::point::{Point, Timing};
use super::super::rows::{Commands, Rows};
use super::fit::{FlightFit, FlightRun, fitted};
use super::grid;
use super::plant::FlightPlant;
use super::tolerances::{LONG, SEARCH};
use crate::{Error, Task};

/// Would a search on all rows take too long?
pub fn is_long(runs: &[FlightRun]) -> bool {
    runs.iter().any(|run| run.rows.time.len() > LONG.part)
}

/// The rows and the commands of the part in which the command changes most; none of a recording that
/// is not long.
///
/// It keeps the commands of as long a time before it. What those before have left is a part of the
/// offset.
pub(super) fn excited_part(
    time: &[f64],
    sent: &[f64],
    commands: &[f64],
) -> Option<(Range<usize>, Range<usize>)> {
    if time.len() <= LONG.part {
        return None;
    }
    let mut changes = vec![0.0];
    let mut sum = 0.0;
    for pair in commands.windows(2) {
        sum += (pair[1] - pair[0]).abs();
        changes.push(sum);
    }
    let sent_by = |moment: f64| sent.partition_point(|time| *time <= moment);
    let last = |moment: f64| sent_by(moment).saturating_sub(1);
    let firsts = (0..=time.len() - LONG.part).step_by(LONG.part / LONG.overlap);
    let (mut best, mut most) = (0, f64::NEG_INFINITY);
    for first in firsts {
        let (begin, end) = (time[first], time[first + LONG.part - 1]);
        // Before the first command there is none.
        let own = if sent_by(end) == 0 {
            sum
        } else {
            changes[last(end)]
        };
        let moved = own - changes[last(begin)];
        if moved > most {
            (best, most) = (first, moved);
        }
    }
    let rows = best..best + LONG.part;
    let (begin, end) = (time[rows.start], time[rows.end - 1]);
    let since = (2.0 * begin - end).max(*sent.first()?);
    Some((rows, last(since)..sent_by(end).max(1)))
}

/// The rows of a search: all, or those in which the command changes most.
fn excited(run: &FlightRun) -> FlightRun {
    let (all, commands) = (&run.rows, &run.rows.commands);
    let Some((kept, sent)) = excited_part(&all.time, &commands.time, &commands.value) else {
        return run.clone();
    };
    let (start, stop) = (all.time[kept.start], all.time[kept.end - 1]);
    let speed = if all.speed.is_empty() {
        Vec::new()
    } else {
        all.speed[kept.clone()].to_vec()
    };
    let unknown = commands.unknown.iter().copied();
    let uncertain = commands.uncertain.iter().copied();
    let rows = Rows {
        time: all.time[kept.clone()].to_vec(),
        output: all.output[kept.clone()].to_vec(),
        used: all.used[kept.clone()].to_vec(),
        speed,
        commands: Commands {
            time: commands.time[sent.clone()].to_vec(),
            value: commands.value[sent].to_vec(),
            unknown: unknown
                .filter(|one| start < one.1 && one.0 < stop)
                .collect(),
            uncertain: uncertain
                .filter(|one| start < one.1 && one.0 < stop)
                .collect(),
        },
        offset: all.offset || kept.start > 0,
        trim: all.trim,
    };
    FlightRun::new(rows, run.rounding)
}

/// The parts of these recordings for a search.
pub(super) fn parts_of(runs: &Arc<[FlightRun]>) -> Arc<[FlightRun]> {
    if is_long(runs) {
        runs.iter().map(excited).collect()
    } else {
        Arc::clone(runs)
    }
}

/// The fit under white noise alone, from this delay and gain where they are known.
///
/// # Errors
///
/// If no delay within the window lets the output depend on the command, and as for `Model::fit`.
pub fn least_squares(
    plant: &FlightPlant,
    runs: Arc<[FlightRun]>,
    (delay, gain): (f64, f64),
    task: &Task,
) -> Result<FlightFit, Error> {
    let Some(row_time) = runs.first().map(|run| run.row_time) else {
        refuse!("no recording was given: give at least one")
    };
    // At a zero of none its effect is that of a shorter delay: to first order, they cannot be told
    // apart.
    let zero = if plant.zero == 0.0 && plant.free.zero {
        row_time
    } else {
        plant.zero
    };
    let first = Point {
        timing: Timing::Delay(delay),
        lags: plant.lags.clone(),
        zero,
        gain,
        noise: vec![Noise::QUIET],
    };
    let quiet = vec![Noise::QUIET; runs.len()];
    let rows = |runs: &[FlightRun]| runs.iter().map(|run| run.rows.clone()).collect();
    let model = plant.model(rows(&runs), false)?;
    let mut best: Option<Fit> = None;
    for run in runs.iter() {
        let own = if runs.len() > 1 {
            Some(plant.model(rows(std::slice::from_ref(run)), false)?)
        } else {
            None
        };
        let alone = own.as_ref().unwrap_or(&model);
        for start in minima(plant, run, alone, &first, task)? {
            let gain = alone.at(0, &start.point, task)?.gain;
            let start = Point {
                gain,
                noise: quiet.clone(),
                ..start.point
            };
            let found = fitted(&model, &start, SEARCH.rough, task)?;
            if best
                .as_ref()
                .is_none_or(|best| found.objective < best.objective)
            {
                best = Some(found);
            }
        }
    }
    let Some(best) = best else {
        return Err(nothing_told(plant, &runs, &first, task)?);
    };
    let best = fitted(&model, &best.point, SEARCH.fine, task)?;
    Ok(FlightFit::of(plant.clone(), runs, false, best, model))
}

/// The lowest local minima over the delay at each set of lags.
fn minima(
    plant: &FlightPlant,
    run: &FlightRun,
    model: &Model,
    first: &Point,
    task: &Task,
) -> Result<Vec<Fit>, Error> {
    let delays = if plant.free.delay {
        grid::even(run, plant.free.lags.contains(&true))
    } else {
        vec![first.delay()]
    };
    let mut found = Vec::new();
    for lags in grid::lags_of(plant, run.row_time) {
        found.extend(grid::minima(model, &delays, &[lags], first, task)?);
    }
    Ok(found)
}

/// Why there is no minimum.
fn nothing_told(
    plant: &FlightPlant,
    runs: &[FlightRun],
    first: &Point,
    task: &Task,
) -> Result<Error, Error> {
    if let (true, true, Some(run)) = (plant.free.delay, plant.free.zero, runs.first()) {
        let mut without = plant.clone();
        without.free.zero = false;
        let model = without.model(vec![run.rows.clone()], false)?;
        if !minima(&without, run, &model, first, task)?.is_empty() {
            return Ok(Error::NotIdentifiable(
                "delay and zero cannot be distinguished. With a zero for every lag the output \
                 jumps with the command, and a later jump looks like a smaller one. Leave delay \
                 or zero out of free=, or give the plant a further lag"
                    .into(),
            ));
        }
    }
    Ok(Error::NotIdentifiable(
        "within the window, the output does not depend on the command: choose a longer window, or \
         check the columns"
            .into(),
    ))
}
