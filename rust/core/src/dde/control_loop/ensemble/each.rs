//! One loop, run by the code for single loops.

use crate::dde::control_loop::linear_loop::{LinearLoop, Start};
use crate::dde::control_loop::metrics::{Criteria, Pace};
use crate::dde::control_loop::reference::Reference;
use crate::dde::control_loop::requested_output::{RequestedOutput, Trajectory};
use crate::dde::control_loop::row::Row;
use crate::dde::control_loop::step_metrics::StepMetrics;
use crate::memory::collected;
use crate::{Error, Task};

use super::sets::{Found, Outcome, Sets};

/// Metrics of one set, with its steady state and the slowest time constant of plant and controller.
pub(super) fn metrics(
    sets: &Sets<'_>,
    set: usize,
    (steady, slowest): (f64, f64),
    span: f64,
    criteria: &Criteria,
    task: &Task,
) -> Result<(Found, Outcome), Error> {
    let Some((plant, ahead)) = loop_of(sets, set)? else {
        return Ok((Found::UNKNOWN, Outcome::Refused));
    };
    let end = [ahead + span];
    let mut steady = steady;
    if steady.is_nan() {
        match run(sets, &plant, RequestedOutput::new(&end, &[], 0.0)?, task)? {
            Ok(found) => steady = found.outputs.last().copied().unwrap_or(f64::NAN),
            Err(outcome) => return Ok((Found::UNKNOWN, outcome)),
        }
    }
    let row = sets.row(set);
    let row = Row::new(sets.states(), &row)?;
    let pace = Pace {
        span,
        wait: row.delay + row.sample_time,
        slowest,
    };
    let mut metrics = StepMetrics::new(ahead, ahead + span, steady, *criteria);
    let requested = RequestedOutput::new(&end, &[], 0.0)?.measured_by(&mut metrics);
    Ok(match run(sets, &plant, requested, task)? {
        Ok(_) => {
            let record = metrics.record();
            let found = Found {
                metrics: metrics.metrics(),
                limited_until: record.limited_until,
            };
            (found, record.verdict(&pace).into())
        }
        Err(outcome) => (Found::UNKNOWN, outcome),
    })
}

/// Outputs of one set.
pub(super) fn response(
    sets: &Sets<'_>,
    set: usize,
    times: &[f64],
    task: &Task,
) -> Result<(Vec<f64>, Outcome), Error> {
    let Some((plant, ahead)) = loop_of(sets, set)? else {
        return Ok((Vec::new(), Outcome::Refused));
    };
    let times = collected("the sweep", times.iter().map(|t| t + ahead))?;
    Ok(
        match run(sets, &plant, RequestedOutput::new(&times, &[], 0.0)?, task)? {
            Ok(found) => (found.outputs, Outcome::Ok),
            Err(outcome) => (Vec::new(), outcome),
        },
    )
}

/// The loop and the time by which its output is read ahead; none where the numbers are not those of
/// a loop.
fn loop_of(sets: &Sets<'_>, set: usize) -> Result<Option<(LinearLoop, f64)>, Error> {
    let found = sets.loop_of(set)?;
    Ok(found.map(|plant| {
        let ahead = sets.ahead(plant.delay());
        (plant, ahead)
    }))
}

fn run(
    sets: &Sets<'_>,
    plant: &LinearLoop,
    requested: RequestedOutput<'_>,
    task: &Task,
) -> Result<Result<Trajectory, Outcome>, Error> {
    let start = Start {
        state: vec![0.0; sets.states()],
        ..Start::default()
    };
    let reference = Reference::step(0.0, sets.amplitude)?;
    match plant.serve(&start, &reference, requested, task) {
        Ok(found) => Ok(Ok(found)),
        Err(error) if error.ends_all() => Err(error),
        Err(Error::Diverges { .. }) => Ok(Err(Outcome::Diverged)),
        Err(_) => Ok(Err(Outcome::Refused)),
    }
}
