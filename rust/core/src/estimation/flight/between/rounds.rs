//! Fits with the commands between rows that their plant predicts.

use super::super::fit::FlightFit;
use super::super::rounds::fit_flight;
use super::super::start::is_long;
use super::missing::Missing;
use super::refilling::{Refilling, RunCommands};
use super::tolerances::PREDICTED;
use crate::{Error, Task};

/// A fit with its commands between rows.
#[derive(Debug, Clone)]
pub struct BetweenRows {
    /// The fit.
    pub fit: FlightFit,
    /// Does the recording leave open when the reference changes?
    pub is_unclear: bool,
    /// Covariance of the numbers that all recordings share, where commands are functions of them.
    pub covariance: Option<Vec<f64>>,
}

/// The fit with the commands between rows that its plant predicts.
///
/// Where the reference changes between rows that are further apart than samples, each sample at which it
/// may have changed is tried. Single rows are predicted well enough. Where many are missing, the numbers
/// of the plant are searched with the commands that follow from them, if `searches`; where most are, as in
/// a log at a lower rate, the likelihood has too many kinks for that.
///
/// # Errors
///
/// As for `fit_flight`.
pub fn between_rows(
    fit: FlightFit,
    runs: &[RunCommands],
    searches: bool,
    task: &Task,
) -> Result<BetweenRows, Error> {
    let ways = |run: &&RunCommands| run.sent.ways > 1;
    let most = runs.iter().map(|run| run.sent.ways).max().unwrap_or(1);
    let is_tried = runs.iter().filter(ways).count() == 1 && most <= PREDICTED.most_ways;
    let steps: Vec<Option<usize>> = if is_tried {
        (0..most).map(Some).collect()
    } else {
        vec![None]
    };
    let mut tried = Vec::new();
    for step in steps {
        let found = with_step(&fit, runs, step, task)?;
        tried.push((found.criterion(task)?, step, found));
    }
    tried.sort_by(|p, q| p.0.total_cmp(&q.0));
    let is_unclear = tried.len() > 1 && tried[1].0 - tried[0].0 < PREDICTED.clearly;
    let (_, step, fit) = tried.swap_remove(0);
    let controlled = runs.iter().filter_map(|run| run.controlled.as_ref());
    let period = controlled
        .filter_map(|one| one.sample_time)
        .fold(0.0, f64::max);
    let missing = runs.iter().map(|run| run.sent.longest).max().unwrap_or(0);
    let are_few = runs.iter().all(|run| {
        let own = run.controlled.as_ref();
        own.is_none_or(|own| run.sent.time.len() < 2 * own.command.len())
    });
    if searches && missing > 1 && are_few && !is_long(&fit.runs) {
        let refilling = Refilling::new(runs, step, false);
        if let Some((fit, covariance)) = Missing::found(&fit, refilling, period, task)? {
            return Ok(BetweenRows {
                fit,
                is_unclear,
                covariance: Some(covariance),
            });
        }
    }
    Ok(BetweenRows {
        fit,
        is_unclear,
        covariance: None,
    })
}

/// The fit where the reference changes after so many missing samples.
fn with_step(
    fit: &FlightFit,
    runs: &[RunCommands],
    step: Option<usize>,
    task: &Task,
) -> Result<FlightFit, Error> {
    let mut refilling = Refilling::new(runs, step, true);
    let gain = fit.gain(task)?;
    let between = runs.iter().zip(fit.runs.iter());
    let between = between.map(|(own, run)| match own.computed() {
        Some(controlled) => own.refilled(run, &controlled.sent(step), gain),
        None => run.clone(),
    });
    let first = fit.with_gain(task)?.point;
    let mut again = fit_flight(&fit.plant, &between.collect(), &first, task)?;
    // Predicted outputs are better than a straight line between rows, or not, as where they depend on
    // each other through the controller.
    for _ in 0..PREDICTED.refills {
        let rows = refilling.rows(&again, task)?;
        let start = again.with_gain(task)?.point;
        let further = fit_flight(&again.plant, &rows, &start, task)?;
        let gained = again.criterion(task)? - further.criterion(task)?;
        if gained > 0.0 {
            again = further;
        }
        if gained < PREDICTED.gained {
            break;
        }
    }
    Ok(again)
}
