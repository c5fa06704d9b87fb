//! A loop at rest.

use crate::dde::{Request, Scalar, Start};
use crate::{Error, Task};

use super::control_loop::{ControlLoop, Values};
use super::controller::Paths;
use super::entry::{Entry, Number};
use super::equations::Input;
use super::plant::Fraction;

/// A loop counts as one without a rest where its determinant is below this part of its summands: more
/// takes larger rounding errors for zero.
const NO_REST: f64 = 1e-13;

/// Output and command at rest under a unit reference, NaN where there is no such rest: with plant b/a,
/// feedback f/g and reference path r/g they are b r/(a g + b f) and a r/(a g + b f) at s = 0.
pub(super) fn rest_gains([b, a, f, g, r]: [f64; 5]) -> (f64, f64) {
    let total = total_at_rest(a * g, b * f);
    (b * r / total, a * r / total)
}

/// a g + b f at s = 0, NaN where it is zero but for rounding.
pub(super) fn total_at_rest(own: f64, fed: f64) -> f64 {
    let total = own + fed;
    let exists = total.abs() > NO_REST * (own.abs() + fed.abs());
    if exists { total } else { f64::NAN }
}

impl ControlLoop {
    /// Output and command at rest under a unit reference, limit left out; NaN without such a rest.
    ///
    /// # Errors
    /// [`Error::Argument`] for a plant without polynomials.
    pub fn rest_gains(&self) -> Result<(f64, f64), Error> {
        let parts = self.polynomials(self.values())?;
        Ok(rest_gains(
            parts.each_ref().map(|p| p.last().copied().unwrap_or(0.0)),
        ))
    }

    /// b, a, f, g and r.
    pub(super) fn polynomials<S: Entry>(&self, values: &Values<S>) -> Result<[Vec<S>; 5], Error> {
        let Fraction { num, den } = self
            .plant()
            .fraction(&values.plant, values.given.as_ref())?;
        let Paths { f, r, g } = self.controller().paths(&values.controller);
        Ok([num, den, f, g, r])
    }

    /// The start of a run at rest at `output` under `reference`.
    ///
    /// # Errors
    /// As [`equations`](Self::equations), and where the plant rests at zero only.
    pub fn start_at_rest<S: Scalar + Number>(
        &self,
        values: &Values<S>,
        output: f64,
        reference: f64,
    ) -> Result<Start<S>, Error> {
        let fraction = self
            .plant()
            .fraction(&values.plant, values.given.as_ref())?;
        let (mut state, command) = fraction.rest(&fraction.state_space()?, output)?;
        let own = self
            .controller()
            .rest(&values.controller, output, reference, &command);
        state.extend(own);
        Ok(Start {
            state,
            command,
            ..Start::default()
        })
    }

    /// Outputs from rest at `output` on, of which `past` are the commands at the samples before the start
    /// and the time of the first sample.
    ///
    /// # Errors
    /// As [`start_at_rest`](Self::start_at_rest), and as a simulation.
    pub fn outputs_after_rest(
        &self,
        output: f64,
        past: (Vec<f64>, f64),
        asked: &Request<'_>,
        task: &Task,
    ) -> Result<Vec<f64>, Error> {
        let first = asked.time.first().copied().unwrap_or(0.0);
        let before = asked.reference_time.partition_point(|time| *time < first);
        let reference = match before.checked_sub(1) {
            Some(index) => asked.reference.get(index).copied(),
            None => None,
        };
        let start = Start {
            command_history: past.0,
            sample_phase: past.1,
            ..self.start_at_rest(self.values(), output, reference.unwrap_or(output))?
        };
        let linear = self.linear(Input::Reference)?;
        Ok(linear.respond(&start, asked, task)?.outputs)
    }
}
