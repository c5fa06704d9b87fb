//! Responses of a loop to a unit step of its load or of its reference, limit left out.

use crate::dde::{LinearLoop, Request, Start};
use crate::elementary::exp;
use crate::loops::{ControlLoop, DeviationAsked, Drive, Figures, Input, Place};
use crate::{Error, Task};

/// Times at which a response is evaluated for a slope or an overshoot: more are more exact and take time
/// in proportion.
const POINTS: usize = 1500;

/// Length of the step response of a plant in units of a bound on its slowest time.
const FIRST: f64 = 8.0;

/// Delays within which a response has to come to rest: more judge slower gains and take time in
/// proportion.
const SLOWEST: f64 = 2e4;

/// Half width of the settling band, as a share of the largest deviation.
const BAND: f64 = 0.02;

/// The figures of a response; none of one that does not come to rest.
///
/// # Errors
/// Those that end all work.
pub fn figures(of: &ControlLoop, drive: Drive, task: &Task) -> Result<Option<Figures>, Error> {
    let asked = DeviationAsked {
        of: drive,
        size: 1.0,
        band: BAND,
        span: None,
        most_delays: SLOWEST,
    };
    match without_limit(of).deviation(&asked, task) {
        Err(error) if error.ends_all() => Err(error),
        found => Ok(found.ok().filter(|found| found.is_settled)),
    }
}

/// The settling time of a step of the reference, s; NaN where it does not settle.
///
/// # Errors
/// As [`figures`].
pub(super) fn settling_time(of: &ControlLoop, task: &Task) -> Result<f64, Error> {
    let found = figures(of, Drive::Reference, task)?;
    Ok(found.map_or(f64::NAN, |found| found.deviation.recovery_time))
}

/// How far a step of the reference goes beyond its rest, in % of that, within `span`; NaN where that is
/// not known.
///
/// # Errors
/// Those that end all work.
pub(super) fn overshoot(of: &ControlLoop, span: f64, task: &Task) -> Result<f64, Error> {
    let of = without_limit(of);
    let found = of.rest_gains().and_then(|(rest, _)| {
        let linear = of.linear(Input::Reference)?;
        let outputs = response(&linear, span, task)?;
        let beyond = outputs.iter().map(|y| (y - rest) / rest);
        Ok(100.0 * beyond.fold(0.0, f64::max))
    });
    match found {
        Err(error) if error.ends_all() => Err(error),
        found => Ok(found.unwrap_or(f64::NAN)),
    }
}

fn without_limit(of: &ControlLoop) -> ControlLoop {
    let mut values = of.values().clone();
    (values.limit, values.low, values.rate) = (None, None, None);
    of.with(values)
}

/// The response to a unit step from rest at zero.
fn response(linear: &LinearLoop, span: f64, task: &Task) -> Result<Vec<f64>, Error> {
    let step = span / (POINTS - 1) as f64;
    let time: Vec<f64> = (0..POINTS).map(|k| k as f64 * step).collect();
    let start = Start {
        state: vec![0.0; linear.equations().states()],
        ..Start::default()
    };
    let asked = Request {
        time: &time,
        output_lead: 0.0,
        reference_before: 0.0,
        reference_time: &[0.0],
        reference: &[1.0],
    };
    Ok(linear.respond(&start, &asked, task)?.outputs)
}

/// The steepest slope of the response of the plant to a unit step of its command, delay and hold left
/// out, where its tangent there meets zero, and when 63 % of the end is reached, s; none where the
/// response has no such slope. Of a plant with an integrator the slope at the end.
///
/// # Errors
/// Those that end all work.
pub(super) fn steepest(
    of: &ControlLoop,
    is_integrating: bool,
    task: &Task,
) -> Result<Option<(f64, f64, f64)>, Error> {
    let count = of.controller().kind.gains().len();
    let mut open = (0..count).fold(of.clone(), |made, i| {
        made.with_number(Place::Controller(i), 0.0)
    });
    let mut values = open.values().clone();
    (values.sample_time, values.delay) = (None, 0.0);
    open = without_limit(&open.with(values));
    let linear = open.linear(Input::Load)?;
    let slow = open.slowest_time()?;
    let span = if slow > 0.0 { FIRST * slow } else { 1.0 };
    let step = span / (POINTS - 1) as f64;
    let outputs = response(&linear, span, task)?;
    let (Some(last), Some(before)) = (outputs.last(), outputs.get(POINTS - 2)) else {
        return Ok(None);
    };
    if is_integrating {
        let slope = (last - before) / step;
        return Ok(Some((slope, span - last / slope, f64::INFINITY)));
    }
    let sign = last.signum();
    let rise = |k: usize| sign * (outputs[k + 1] - outputs[k]);
    let Some(best) = (0..POINTS - 1).max_by(|i, j| rise(*i).total_cmp(&rise(*j))) else {
        return Ok(None);
    };
    let slope = (outputs[best + 1] - outputs[best]) / step;
    let middle = 0.5 * (outputs[best + 1] + outputs[best]);
    let part = (1.0 - exp(-1.0)) * last;
    let reached = outputs.iter().position(|y| sign * (y - part) >= 0.0);
    let Some(place) = reached.filter(|place| *place > 0) else {
        return Ok(None);
    };
    let share = (part - outputs[place - 1]) / (outputs[place] - outputs[place - 1]);
    let dead = ((best as f64 + 0.5) * step - middle / slope).max(0.0);
    Ok(Some((slope, dead, (place as f64 - 1.0 + share) * step)))
}
