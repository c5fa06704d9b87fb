//! Likelihood of the rows of one recording, with all linear unknowns eliminated.
//!
//! With V the covariance of the rows for white noise of unit variance, X the columns of the linear
//! unknowns and D the derivatives of the mean by the searched ones (delay, lags), J = [X D],
//!
//! ```text
//! −2 ln L = m ln(r/m) + ln det V + ln det JᵀV⁻¹J − ln det JᵀJ,   m = n − columns of J,
//! ```
//!
//! r the least sum of squares of the whitened rows over the linear unknowns. It is the likelihood of
//! the residuals (Patterson & Thompson 1971, Harville 1977) extended to the searched unknowns (Cox &
//! Reid 1987), so that the numbers of the noise are not biased by the fit. The last term makes it
//! independent of the scale of the columns, which changes with the lags.

use super::disturbance::{Disturbance, Entry, Joint};
use super::orthogonal::Orthogonal;
use super::path::{Held, respond};
use super::plant::{Plant, PlantSpace};
use super::whiten::{Kick, whiten_in_place};
use crate::dde::propagator::Propagator;
use crate::{Error, Task};

/// Relative step of the difference quotient by a lag.
const STEP: f64 = 1e-5;

/// Smallest sum of squares, as a share of that of the output: below is rounding.
const ROUNDING: f64 = 1e-26;

/// What was sent to the plant.
#[derive(Debug, Clone, PartialEq)]
pub struct Commands {
    /// From when each command holds, s, increasing.
    pub time: Vec<f64>,
    /// The commands.
    pub value: Vec<f64>,
    /// Times between which the command is unknown: a linear unknown for each.
    pub unknown: Vec<(f64, f64)>,
    /// Times between which the command was computed, and its error: the standard deviation of the
    /// response it causes, as a factor on that of a unit command, in white deviations.
    pub uncertain: Vec<(f64, f64, f64)>,
}

/// The rows of one recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Rows {
    /// s, increasing.
    pub time: Vec<f64>,
    /// The output.
    pub output: Vec<f64>,
    /// Rows that are not used have no part in the likelihood.
    pub used: Vec<bool>,
    /// The commands.
    pub commands: Commands,
    /// Is the output at the start unknown?
    pub offset: bool,
    /// Is there a constant input besides the command?
    pub trim: bool,
}

impl Rows {
    /// The rows, checked.
    ///
    /// # Errors
    ///
    /// If lengths differ or times do not increase.
    pub fn checked(self) -> Result<Self, Error> {
        let n = self.time.len();
        refuse_if!(
            n < 2 || self.output.len() != n || self.used.len() != n,
            "{n} times, {} outputs and {} marks of use: give two or more of each, equally many",
            self.output.len(),
            self.used.len()
        );
        let commands = &self.commands;
        refuse_if!(
            commands.time.is_empty() || commands.time.len() != commands.value.len(),
            "{} times of commands and {} commands: give equally many, at least one",
            commands.time.len(),
            commands.value.len()
        );
        for time in [&self.time, &commands.time] {
            if let Some(pair) = time.windows(2).find(|pair| !(pair[1] > pair[0])) {
                refuse!(
                    "the time {} follows {}: give increasing times",
                    pair[1],
                    pair[0]
                );
            }
        }
        Ok(self)
    }
}

/// The gain of the plant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Gain {
    /// Unknown and eliminated.
    Eliminated,
    /// Unknown and searched, or held in a profile: at this value.
    Searched(f64),
    /// Given.
    Known(f64),
}

/// The numbers of the mean.
#[derive(Debug, Clone, PartialEq)]
pub struct Values {
    /// s.
    pub delay: f64,
    /// Lags before the given part of the plant, s.
    pub lags: Vec<f64>,
    /// Time of the zero behind the last lag, s.
    pub zero: f64,
    /// The gain.
    pub gain: Gain,
}

/// Numbers of the noise, in standard deviations of the white noise; zero where there is none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// Time constant of the air, s.
    pub air_time: f64,
    /// Standard deviation of the air, at the input of the plant.
    pub air: f64,
    /// Time constant of the coloured sensor noise, s.
    pub sensor_time: f64,
    /// Its standard deviation.
    pub sensor: f64,
}

impl Noise {
    fn disturbances(&self) -> Vec<Disturbance> {
        [
            (Entry::Input, self.air_time, self.air),
            (Entry::Output, self.sensor_time, self.sensor),
        ]
        .into_iter()
        .filter(|(_, _, deviation)| *deviation > 0.0)
        .map(|(entry, time_constant, deviation)| Disturbance {
            entry,
            time_constant,
            deviation,
        })
        .collect()
    }
}

/// By which numbers of the mean the likelihood is corrected for their estimation.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Derivatives {
    pub(super) delay: bool,
    pub(super) lags: Vec<bool>,
    pub(super) zero: bool,
}

/// The likelihood at one set of numbers, and the best linear unknowns there.
#[derive(Debug, Clone, PartialEq)]
pub struct Evaluation {
    /// −2 ln L, but for a constant.
    pub objective: f64,
    /// ln det V.
    pub log_det: f64,
    /// Variance of the white noise.
    pub variance: f64,
    /// m: rows less unknowns of the mean.
    pub freedom: usize,
    /// The gain.
    pub gain: f64,
    /// Linear unknowns: gain if eliminated, offset if unknown, trim if there, unknown commands.
    pub linear: Vec<f64>,
    /// (JᵀV⁻¹J)⁻¹, row-major: the linear unknowns, a searched gain, delay, lags and zero.
    pub inverse: Vec<f64>,
    /// The whitened derivative by the delay, orthogonal to the linear unknowns, of norm one; empty
    /// where the delay is known.
    pub score: Vec<f64>,
    /// Whitened residuals in units of the white noise, zero in rows that are not used.
    pub whitened: Vec<f64>,
    /// Recorded output minus the mean.
    pub residuals: Vec<f64>,
    /// Slope of the response of a plant of this gain at the rows.
    pub rate: Vec<f64>,
}

/// What is asked of an evaluation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Wanted {
    /// The objective alone.
    Objective,
    /// All of it.
    All,
}

pub(super) fn evaluate(
    rows: &Rows,
    plant: &Plant,
    values: &Values,
    noise: &Noise,
    by: &Derivatives,
    wanted: Wanted,
    task: &Task,
) -> Result<Evaluation, Error> {
    let n = rows.time.len();
    let space = plant.space(&values.lags, values.zero);
    let base = if plant.integrates() {
        0.0
    } else {
        rows.commands.value.first().copied().unwrap_or(0.0)
    };
    let shifted: Vec<f64> = rows
        .commands
        .value
        .iter()
        .map(|value| value - base)
        .collect();
    let held = Held {
        time: &rows.commands.time,
        value: &shifted,
    };
    let mut response = vec![0.0; n];
    let mut rate = vec![0.0; n];
    respond(
        &space,
        held,
        values.delay,
        &rows.time,
        &mut response,
        Some(&mut rate),
    );
    // Columns of J, and the output last.
    let mut columns = Vec::with_capacity(8 * n);
    let (gain, eliminated) = match values.gain {
        Gain::Eliminated => (1.0, true),
        Gain::Searched(gain) | Gain::Known(gain) => (gain, false),
    };
    if eliminated {
        columns.extend_from_slice(&response);
    }
    if rows.offset {
        columns.extend(std::iter::repeat_n(1.0, n));
    }
    if rows.trim {
        columns.extend(response_to_pulse(
            &space,
            (rows.time[0], f64::INFINITY),
            0.0,
            &rows.time,
        ));
    }
    for pulse in &rows.commands.unknown {
        columns.extend(response_to_pulse(&space, *pulse, values.delay, &rows.time));
    }
    let linear = columns.len() / n;
    if matches!(values.gain, Gain::Searched(_)) {
        columns.extend_from_slice(&response);
    }
    if by.delay {
        columns.extend(rate.iter().map(|rate| -rate));
    }
    for (i, lag) in values.lags.iter().enumerate() {
        if by.lags.get(i) == Some(&true) && *lag != 0.0 {
            let mut moved = values.lags.clone();
            moved[i] = lag * (1.0 + STEP);
            let other = plant.space(&moved, values.zero);
            columns.extend(difference(
                &other,
                held,
                values.delay,
                &rows.time,
                &response,
                lag * STEP,
            ));
        }
    }
    if by.zero {
        let lag = values.lags.last().copied().unwrap_or(1.0);
        let other = plant.space(&values.lags, values.zero + lag * STEP);
        columns.extend(difference(
            &other,
            held,
            values.delay,
            &rows.time,
            &response,
            lag * STEP,
        ));
    }
    let count = columns.len() / n;
    let mut target: Vec<f64> = rows.output.clone();
    if !eliminated {
        for (target, response) in target.iter_mut().zip(&response) {
            *target -= gain * response;
        }
    }
    let power: f64 = rows.output.iter().map(|y| y * y).sum();
    let raw_target = target.clone();
    columns.extend(target);
    let raw = (wanted == Wanted::All).then(|| columns[..linear * n].to_vec());
    let all_used = rows.used.iter().all(|used| *used);
    if !all_used {
        for column in columns.chunks_exact_mut(n) {
            clear(column, &rows.used);
        }
    }
    let disturbances = noise.disturbances();
    let kicks = kicks(rows, &space, values.delay);
    let is_white = disturbances.is_empty() && kicks.is_empty();
    let (mut log_det, mut raw_log_det) = (0.0, 0.0);
    if !is_white {
        let mut copy = columns[..count * n].to_vec();
        raw_log_det = Orthogonal::new(&mut copy, n, count).log_det();
        let joint = Joint::new(&space, &disturbances)?;
        log_det = whiten_in_place(&rows.time, &rows.used, &mut columns, &joint, &kicks, task)?;
    }
    let (x, target) = columns.split_at_mut(count * n);
    let mut orthogonal = Orthogonal::new(&mut x[..linear * n], n, linear);
    let parts = orthogonal.project(x, target);
    let squares = target
        .iter()
        .map(|e| e * e)
        .sum::<f64>()
        .max(ROUNDING * power);
    for column in linear..count {
        let (before, rest) = x.split_at_mut(column * n);
        orthogonal.push(before, &mut rest[..n]);
    }
    let used = rows.used.iter().filter(|used| **used).count();
    refuse_if!(
        used <= count,
        "{used} rows for {count} unknowns: the likelihood needs more rows than unknowns"
    );
    let freedom = used - count;
    let m = freedom as f64;
    let variance = (squares / m).max(f64::MIN_POSITIVE);
    let log_gram = if is_white {
        0.0
    } else {
        orthogonal.log_det() - raw_log_det
    };
    let objective = m * variance.ln() + log_det + log_gram;
    let mut found = Evaluation {
        objective: if orthogonal.dependent {
            f64::INFINITY
        } else {
            objective
        },
        log_det,
        variance,
        freedom,
        gain,
        linear: Vec::new(),
        inverse: Vec::new(),
        score: Vec::new(),
        whitened: Vec::new(),
        residuals: Vec::new(),
        rate: Vec::new(),
    };
    if let Some(raw) = raw {
        found.linear = orthogonal.solve(&parts);
        if eliminated {
            found.gain = found.linear.first().copied().unwrap_or(0.0);
        }
        found.inverse = orthogonal.inverse();
        if by.delay {
            let place = linear + usize::from(matches!(values.gain, Gain::Searched(_)));
            found.score = x[place * n..(place + 1) * n].to_vec();
        }
        found.whitened = target.iter().map(|e| e / variance.sqrt()).collect();
        found.residuals = raw_target;
        for (value, column) in found.linear.iter().zip(raw.chunks_exact(n)) {
            for (residual, column) in found.residuals.iter_mut().zip(column) {
                *residual -= value * column;
            }
        }
        found.rate = rate.iter().map(|rate| found.gain * rate).collect();
    }
    Ok(found)
}

/// What the errors of computed commands do to the states of the plant by the next row.
fn kicks(rows: &Rows, space: &PlantSpace, delay: f64) -> Vec<Kick> {
    let n = space.b.len();
    if n == 0 {
        return Vec::new();
    }
    let mut found = Vec::with_capacity(rows.commands.uncertain.len());
    for (start, end, deviation) in &rows.commands.uncertain {
        let arrival = end + delay;
        let row = rows.time.partition_point(|time| *time < arrival);
        let Some(time) = rows.time.get(row).filter(|_| row > 0) else {
            continue;
        };
        let mut state = vec![0.0; n];
        let mut moved = vec![0.0; n];
        Propagator::new(&space.a, &[&space.b], end - start).apply(
            &state,
            &[*deviation],
            &mut moved,
        );
        if *time > arrival {
            std::mem::swap(&mut state, &mut moved);
            Propagator::new(&space.a, &[], time - arrival).apply(&state, &[], &mut moved);
        }
        found.push(Kick { row, state: moved });
    }
    found
}

/// The response to an input of one between two times, `delay` later.
fn response_to_pulse(space: &PlantSpace, ends: (f64, f64), delay: f64, times: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; times.len()];
    let held = Held {
        time: &[ends.0, ends.1],
        value: &[1.0, 0.0],
    };
    respond(space, held, delay, times, &mut out, None);
    out
}

/// The difference quotient of the response.
fn difference(
    other: &PlantSpace,
    held: Held<'_>,
    delay: f64,
    times: &[f64],
    response: &[f64],
    step: f64,
) -> Vec<f64> {
    let mut out = vec![0.0; times.len()];
    respond(other, held, delay, times, &mut out, None);
    for (out, response) in out.iter_mut().zip(response) {
        *out = (*out - response) / step;
    }
    out
}

fn clear(column: &mut [f64], used: &[bool]) {
    for (entry, used) in column.iter_mut().zip(used) {
        if !used {
            *entry = 0.0;
        }
    }
}
