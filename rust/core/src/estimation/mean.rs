//! The mean of the rows of one recording: a column for each linear unknown, and the derivatives by
//! the numbers that are searched.

use super::path::{Held, respond};
use super::plant::{Plant, PlantSpace};
use super::rows::Rows;
use crate::{Error, Task, memory};

/// Relative step of the difference quotient by a lag.
const STEP: f64 = 1e-5;

/// Change of a response, as a share of its largest value, below which it is rounding: a column of
/// rounding would pass for one that depends on no other.
const ROUNDING: f64 = 8.0 * f64::EPSILON;

/// What memory is asked for.
const WHAT: &str = "the columns of the likelihood";

/// The gain of the plant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Gain {
    /// Unknown and eliminated.
    Eliminated,
    /// Unknown and searched, or held in a profile: at this value.
    Searched(f64),
    /// Given.
    Known(f64),
}

/// The numbers of the mean.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Values {
    /// s.
    pub(super) delay: f64,
    /// Lags before the given part of the plant, s.
    pub(super) lags: Vec<f64>,
    /// Time of the zero behind the last lag, s.
    pub(super) zero: f64,
    /// The gain.
    pub(super) gain: Gain,
}

/// By which numbers of the mean the likelihood is corrected for their estimation.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Derivatives {
    pub(super) delay: bool,
    pub(super) lags: Vec<bool>,
    pub(super) zero: bool,
}

impl Derivatives {
    /// By nothing.
    pub(super) fn none() -> Self {
        Self {
            delay: false,
            lags: Vec::new(),
            zero: false,
        }
    }

    /// Is there a derivative by this lag? A lag of zero has no state, so none.
    fn by_lag(&self, values: &Values, lag: usize) -> bool {
        self.lags.get(lag) == Some(&true) && values.lags.get(lag).is_some_and(|lag| *lag != 0.0)
    }
}

/// The columns J of the mean, then the output less its known part.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Mean {
    /// One column after the other.
    pub(super) columns: Vec<f64>,
    /// Columns of linear unknowns, which come first.
    pub(super) linear: usize,
    /// Columns of J.
    pub(super) count: usize,
    /// Slope of the response of the plant of unit gain.
    pub(super) rate: Vec<f64>,
}

impl Mean {
    pub(super) fn new(
        rows: &Rows,
        plant: &Plant,
        space: &PlantSpace,
        values: &Values,
        by: &Derivatives,
        task: &Task,
    ) -> Result<Self, Error> {
        let n = rows.time.len();
        let (linear, count) = sizes(rows, values, by);
        let base = base_of(plant, rows);
        let shifted = rows.commands.value.iter().map(|value| value - base);
        let shifted = memory::collected(WHAT, shifted)?;
        let held = Held {
            time: &rows.commands.time,
            value: &shifted,
        };
        let mut response = memory::filled(WHAT, 0.0, n)?;
        let mut rate = memory::filled(WHAT, 0.0, n)?;
        let (delay, time) = (values.delay, &rows.time);
        let slope = Some(rate.as_mut_slice());
        let mut columns = memory::filled(WHAT, 0.0, (count + 1).saturating_mul(n))?;
        // The plants of the difference quotients, and their steps; their columns come last.
        let mut others = Vec::new();
        for (i, lag) in values.lags.iter().enumerate() {
            if by.by_lag(values, i) {
                let mut moved = values.lags.clone();
                moved[i] = lag * (1.0 + STEP);
                others.push((plant.space(&moved, values.zero), moved[i] - lag));
            }
        }
        if by.zero {
            // The response is linear in it: the quotient is exact, and a long step has the least rounding.
            let step = values.lags.last().copied().unwrap_or(1.0);
            others.push((plant.space(&values.lags, values.zero + step), step));
        }
        let from = (count - others.len()) * n;
        let mut outs = columns[from..].chunks_exact_mut(n);
        let out = response.as_mut_slice();
        if let Some(((other, _), quotient)) = others.first().zip(outs.next()) {
            let (plants, outs) = ([space, other], [out, quotient]);
            respond(plants, held, delay, time, outs, slope, task)?;
        } else {
            respond([space], held, delay, time, [out], slope, task)?;
        }
        for ((other, _), out) in others.iter().skip(1).zip(outs) {
            respond([other], held, delay, time, [out], None, task)?;
        }
        let mut places = columns.chunks_exact_mut(n);
        let mut place = || places.next().unwrap_or_default();
        if values.gain == Gain::Eliminated {
            place().copy_from_slice(&response);
        }
        if rows.offset {
            place().fill(1.0);
        }
        if rows.trim {
            place().copy_from_slice(&trim_of(space, time, task)?);
        }
        for ends in &rows.commands.unknown {
            pulse(space, *ends, delay, time, place(), task)?;
        }
        if matches!(values.gain, Gain::Searched(_)) {
            place().copy_from_slice(&response);
        }
        if by.delay {
            for (place, rate) in place().iter_mut().zip(&rate) {
                *place = -rate;
            }
        }
        let rounding = ROUNDING * response.iter().fold(0.0_f64, |most, y| most.max(y.abs()));
        for (_, step) in &others {
            for (out, response) in place().iter_mut().zip(&response) {
                let change = *out - response;
                *out = if change.abs() > rounding {
                    change / step
                } else {
                    0.0
                };
            }
        }
        let target = place();
        target.copy_from_slice(&rows.output);
        if let Gain::Searched(gain) | Gain::Known(gain) = values.gain {
            for (target, response) in target.iter_mut().zip(&response) {
                *target -= gain * response;
            }
        }
        Ok(Self {
            columns,
            linear,
            count,
            rate,
        })
    }
}

/// The command that is subtracted from all: a plant that does not integrate is at rest under the first.
pub(super) fn base_of(plant: &Plant, rows: &Rows) -> f64 {
    let first = rows.commands.value.first();
    first
        .copied()
        .filter(|_| !plant.integrates())
        .unwrap_or(0.0)
}

/// The response to a constant input of one.
pub(super) fn trim_of(space: &PlantSpace, time: &[f64], task: &Task) -> Result<Vec<f64>, Error> {
    let mut out = memory::filled(WHAT, 0.0, time.len())?;
    pulse(space, (time[0], f64::INFINITY), 0.0, time, &mut out, task)?;
    Ok(out)
}

/// Linear unknowns, and all columns of J.
pub(super) fn sizes(rows: &Rows, values: &Values, by: &Derivatives) -> (usize, usize) {
    let linear = usize::from(values.gain == Gain::Eliminated)
        + usize::from(rows.offset)
        + usize::from(rows.trim)
        + rows.commands.unknown.len();
    let lags = (0..values.lags.len()).filter(|lag| by.by_lag(values, *lag));
    let searched = usize::from(matches!(values.gain, Gain::Searched(_)))
        + usize::from(by.delay)
        + lags.count()
        + usize::from(by.zero);
    (linear, linear + searched)
}

/// The response to an input of one between two times, `delay` later.
fn pulse(
    space: &PlantSpace,
    ends: (f64, f64),
    delay: f64,
    times: &[f64],
    out: &mut [f64],
    task: &Task,
) -> Result<(), Error> {
    let held = Held {
        time: &[ends.0, ends.1],
        value: &[1.0, 0.0],
    };
    respond([space], held, delay, times, [out], None, task)
}
