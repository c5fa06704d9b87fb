//! Derivatives of a response with respect to a number of the loop: the simulation runs in [`Dual`]s.

use crate::{Error, Task};

use super::linear_loop::{LinearLoop, Start};
use super::reference::Reference;
use super::requested_output::RequestedOutput;
use crate::dde::scalar::Dual;

impl LinearLoop<Dual> {
    /// Slopes of the outputs and of the inputs at fixed times; output times have the slope of `ahead`.
    ///
    /// At a jump of the response they are the derivatives after the jump.
    ///
    /// # Errors
    /// As a simulation.
    pub fn slopes(
        &self,
        start: &Start<Dual>,
        reference: &Reference,
        (output_times, input_times): (&[f64], &[f64]),
        ahead: Dual,
        task: &Task,
    ) -> Result<(Vec<f64>, Vec<f64>), Error> {
        let requested = RequestedOutput::new(output_times, input_times, ahead)?;
        let found = self.serve(start, reference, requested, task)?;
        let slopes = |values: &[Dual]| values.iter().map(|value| value.slope).collect();
        Ok((slopes(&found.outputs), slopes(&found.inputs)))
    }
}
