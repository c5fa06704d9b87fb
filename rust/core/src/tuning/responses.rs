//! Figures of the response of a loop to a unit step of its load or of its reference, limit left out.

use crate::dde::{LinearLoop, Request, Start};
use crate::elementary::exp;
use crate::loops::{ControlLoop, Input, Place};
use crate::{Error, Task};

/// Times at which a response is evaluated: more are more exact and take time in proportion.
const POINTS: usize = 1500;

/// Length of the first run in units of the slowest time of the loop, and most doublings of it.
const FIRST: f64 = 8.0;
const DOUBLINGS: usize = 8;

/// Share of the largest deviation within which a response rests, over the last part of the run.
const QUIET: f64 = 1e-4;
const QUIET_FOR: f64 = 0.3;

/// Half width of the settling band, as a share of the step.
const BAND: f64 = 0.02;

/// Figures of a response; NaN of one that does not come to rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Figures {
    /// Integral of the modulus of the deviation from rest.
    pub iae: f64,
    /// The largest deviation from where the response began.
    pub peak: f64,
    /// After which the deviation from rest is below 2 % of the step, s; of a load of its peak.
    pub settling_time: f64,
    /// How far the output goes beyond its rest, % of that; zero of a load.
    pub overshoot: f64,
}

impl Figures {
    const NONE: Self = Self {
        iae: f64::NAN,
        peak: f64::NAN,
        settling_time: f64::NAN,
        overshoot: f64::NAN,
    };
}

/// The figures of a response.
///
/// # Errors
/// Those that end all work.
pub fn figures(of: &ControlLoop, input: Input, task: &Task) -> Result<Figures, Error> {
    match measured(of, input, task) {
        Err(error) if error.ends_all() => Err(error),
        found => Ok(found.unwrap_or(Figures::NONE)),
    }
}

/// The settling time of a step of the reference, s; NaN where it does not settle.
///
/// # Errors
/// As [`figures`].
pub(super) fn settling_time(of: &ControlLoop, task: &Task) -> Result<f64, Error> {
    Ok(figures(of, Input::Reference, task)?.settling_time)
}

fn measured(of: &ControlLoop, input: Input, task: &Task) -> Result<Figures, Error> {
    let mut values = of.values().clone();
    values.limit = None;
    let of = of.with(values);
    let linear = of.linear(input)?;
    let wait = of.values().delay + of.values().sample_time.unwrap_or(0.0);
    let mut span = FIRST * (wait + of.slowest_time()?);
    for _ in 0..DOUBLINGS {
        if let Some(found) = over(&linear, input, span, task)? {
            return Ok(found);
        }
        span *= 2.0;
    }
    Ok(Figures::NONE)
}

fn over(linear: &LinearLoop, input: Input, span: f64, task: &Task) -> Result<Option<Figures>, Error> {
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
    let outputs = linear.respond(&start, &asked, task)?.outputs;
    let rest = outputs.last().copied().unwrap_or(f64::NAN);
    let peak = outputs.iter().fold(0.0, |most: f64, y| most.max(y.abs()));
    let first = ((1.0 - QUIET_FOR) * POINTS as f64) as usize;
    let tail = outputs.iter().skip(first);
    if !tail.clone().all(|y| (y - rest).abs() <= QUIET * peak) {
        return Ok(None);
    }
    let is_load = input == Input::Load;
    let band = BAND * if is_load { peak } else { rest.abs() };
    let outside = outputs.iter().rposition(|y| (y - rest).abs() > band);
    let off: f64 = outputs.iter().map(|y| (y - rest).abs()).sum();
    let beyond = outputs.iter().map(|y| (y - rest) * rest.signum());
    Ok(Some(Figures {
        iae: (off - 0.5 * (outputs[0] - rest).abs()) * step,
        peak,
        settling_time: outside.map_or(0.0, |place| time[(place + 1).min(POINTS - 1)]),
        overshoot: if is_load {
            0.0
        } else {
            100.0 * beyond.fold(0.0, f64::max) / rest.abs()
        },
    }))
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
    (values.limit, values.sample_time, values.delay) = (None, None, 0.0);
    open = open.with(values);
    let linear = open.linear(Input::Load)?;
    let start = Start {
        state: vec![0.0; linear.equations().states()],
        ..Start::default()
    };
    let slow = open.slowest_time()?;
    let span = if slow > 0.0 { FIRST * slow } else { 1.0 };
    let step = span / (POINTS - 1) as f64;
    let time: Vec<f64> = (0..POINTS).map(|k| k as f64 * step).collect();
    let asked = Request {
        time: &time,
        output_lead: 0.0,
        reference_before: 0.0,
        reference_time: &[0.0],
        reference: &[1.0],
    };
    let outputs = linear.respond(&start, &asked, task)?.outputs;
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
    let dead = (time[best] + 0.5 * step - middle / slope).max(0.0);
    Ok(Some((slope, dead, time[place - 1] + share * step)))
}
