//! The rows of recordings under the commands that a plant predicts.

use std::sync::Arc;

use super::super::super::rows::{Commands, Rows};
use super::super::fit::{FlightFit, FlightRun};
use super::super::rounded_rows::{on_same_step, rounding_of};
use super::controlled::Controlled;
use super::predicted::{How, Response};
use super::sent::Sent;
use crate::{Error, Task};

/// The commands of one recording.
#[derive(Debug, Clone, PartialEq)]
pub struct RunCommands {
    /// Rows and controller; none where the commands have times of their own.
    pub controlled: Option<Controlled>,
    /// The commands of a first fit.
    pub sent: Sent,
    /// Times before the first command in which it is unknown.
    pub before: Vec<(f64, f64)>,
}

impl RunCommands {
    /// The commands of rows of a window at these times. The one before the first is unknown if the plant
    /// still answers to it; one that integrates keeps that as a part of the output at the start.
    pub fn of(controlled: Option<Controlled>, sent: Sent, rows: &[f64], integrates: bool) -> Self {
        let ends = (sent.time.first(), rows.first(), rows.last());
        let before = match ends {
            (Some(first), Some(start), Some(end)) if !integrates && first >= start => {
                vec![(first - (end - start), *first)]
            }
            _ => Vec::new(),
        };
        Self {
            controlled,
            sent,
            before,
        }
    }

    /// The rows of a recording for a first fit, without those that tell nothing: the `repeated` ones, and
    /// those of a rounded output that are beside another on the same step. From an output at the start
    /// where that is known.
    ///
    /// # Errors
    ///
    /// As for `Rows::checked`.
    pub fn read(
        &self,
        time: Vec<f64>,
        output: &[f64],
        repeated: &[usize],
        start: Option<f64>,
    ) -> Result<FlightRun, Error> {
        let rounding = rounding_of(output);
        let mut used = vec![true; output.len()];
        if rounding > 0.0 {
            used = on_same_step(output).iter().map(|same| !same).collect();
        }
        for row in repeated {
            used[*row] = false;
        }
        let sent = &self.sent;
        let rows = Rows {
            time,
            output: output.iter().map(|y| y - start.unwrap_or(0.0)).collect(),
            used,
            speed: Vec::new(),
            commands: Commands {
                time: sent.time.clone(),
                value: sent.command.clone(),
                unknown: [&self.before[..], &sent.unknown].concat(),
                uncertain: Vec::new(),
            },
            offset: start.is_none(),
            trim: false,
        };
        Ok(FlightRun::new(rows.checked()?, rounding))
    }

    /// What computes the commands between rows, if there are some.
    pub fn computed(&self) -> Option<&Controlled> {
        let own = self.controlled.as_ref();
        own.filter(|_| !self.sent.computed.is_empty())
    }

    /// The rows under these commands, computed from outputs with errors, for a gain.
    pub(super) fn refilled(&self, run: &FlightRun, sent: &Sent, gain: f64) -> FlightRun {
        let unknown = self.before.iter().chain(&sent.unknown);
        let computed = sent.computed.iter().filter(|(.., slope)| *slope != 0.0);
        let commands = Commands {
            time: sent.time.clone(),
            value: sent.command.clone(),
            unknown: unknown.copied().collect(),
            uncertain: computed
                .map(|(from, to, slope)| (*from, *to, gain.abs() * slope))
                .collect(),
        };
        let rows = Rows {
            commands,
            ..run.rows.clone()
        };
        FlightRun { rows, ..*run }
    }
}

/// Is anything but commands and white noise moving the output of a recording?
pub(super) fn is_calm(fit: &FlightFit, run: usize) -> bool {
    let noise = fit.noises().get(run);
    !fit.trim && noise.is_none_or(|noise| !(noise.air > 0.0 || noise.sensor > 0.0))
}

/// The rows of fits with the commands that their plants predict; each is near the one before.
pub(super) struct Refilling<'a> {
    runs: &'a [RunCommands],
    sent: Vec<Sent>,
    step: Option<usize>,
    unsure: bool,
}

impl<'a> Refilling<'a> {
    pub(super) fn new(runs: &'a [RunCommands], step: Option<usize>, unsure: bool) -> Self {
        let sent = runs.iter().map(|run| run.sent.clone()).collect();
        Self {
            runs,
            sent,
            step,
            unsure,
        }
    }

    /// The rows of a fit.
    pub(super) fn rows(&mut self, fit: &FlightFit, task: &Task) -> Result<Arc<[FlightRun]>, Error> {
        let plant = Response::of(fit, task)?;
        let gain = fit.gain(task)?;
        let mut found = Vec::new();
        for (i, (own, run)) in self.runs.iter().zip(fit.runs.iter()).enumerate() {
            let Some(controlled) = own.computed() else {
                found.push(run.clone());
                continue;
            };
            let how = How {
                step: self.step,
                unsure: self.unsure,
                calm: !self.unsure && is_calm(fit, i),
            };
            self.sent[i] = controlled.predicted(&plant, &self.sent[i], how, task)?;
            found.push(own.refilled(run, &self.sent[i], gain));
        }
        Ok(found.into())
    }
}
