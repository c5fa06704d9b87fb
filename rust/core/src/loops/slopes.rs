//! Derivatives of a response by numbers of its loop.

use crate::dde::{Dual, LinearLoop, Reference, Start};
use crate::{Error, Task};

use super::control_loop::{ControlLoop, Place};
use super::plant::Fraction;

/// Where and when a response is differentiated.
#[derive(Debug, Clone, Copy)]
pub struct SlopesAsked<'a> {
    /// Output and reference before the start, at rest.
    pub rest: (f64, f64),
    /// Sampled loops: commands at the samples before the start, latest last.
    pub command_history: &'a [f64],
    /// Sampled loops: time of the first sample.
    pub sample_phase: f64,
    /// Since the start, s.
    pub output_times: &'a [f64],
    /// Since the start, s.
    pub input_times: &'a [f64],
}

impl ControlLoop {
    /// Derivatives of outputs and inputs by numbers of the loop, one after the other; `given` are the
    /// polynomials of a [`Plant::Given`](super::Plant::Given), one for each.
    ///
    /// At a jump of the response they are the derivatives after the jump.
    ///
    /// # Errors
    /// As [`linear_in`](Self::linear_in), and as a simulation.
    pub fn sensitivities(
        &self,
        places: &[Place],
        given: &[Fraction<Dual>],
        asked: &SlopesAsked<'_>,
        reference: &Reference,
        task: &Task,
    ) -> Result<(Vec<f64>, Vec<f64>), Error> {
        let (mut outputs, mut inputs) = (Vec::new(), Vec::new());
        for (index, place) in places.iter().enumerate() {
            let mut values = self.values().entries::<Dual>();
            let own = self.values().get(*place).unwrap_or(0.0);
            // In units of its own size, all slopes are comparable with the values.
            let unit = if own == 0.0 { 1.0 } else { own.abs() };
            values.set(*place, Dual::new(own, unit));
            values.given = given.get(index).cloned();
            let start = Start {
                command_history: asked.command_history.to_vec(),
                sample_phase: asked.sample_phase,
                ..self.start_at_rest(&values, asked.rest.0, asked.rest.1)?
            };
            let moves = *place == Place::Delay && self.is_measured();
            let ahead = Dual::new(0.0, if moves { unit } else { 0.0 });
            let plant: LinearLoop<Dual> = self.linear_in(&values)?;
            let times = (asked.output_times, asked.input_times);
            let found = plant.slopes(&start, reference, times, ahead, task)?;
            outputs.extend(found.0.iter().map(|slope| slope / unit));
            inputs.extend(found.1.iter().map(|slope| slope / unit));
        }
        Ok((outputs, inputs))
    }
}
