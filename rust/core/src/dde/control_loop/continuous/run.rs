//! The response, with or without a delay.

use super::effort::{MOST_ELEMENTS, endless};
use super::{aligned, modes};
use crate::dde::control_loop::linear_loop::{LinearLoop, Start};
use crate::dde::control_loop::reference::Reference;
use crate::dde::control_loop::requested_output::{RequestedOutput, Trajectory};
use crate::dde::scalar::Scalar;
use crate::simd::Instructions;
use crate::{Error, Task};

pub(crate) fn run<S: Scalar>(
    plant: &LinearLoop<S>,
    start: &Start<S>,
    reference: &Reference,
    mut requested: RequestedOutput<'_, S>,
    task: &Task,
) -> Result<Trajectory<S>, Error> {
    let is_delayed = plant.delay().value() > 0.0;
    if is_delayed {
        // No element is longer than the delay, so that a run that would exceed the limit on
        // elements is refused before it starts.
        if requested.last() / plant.delay().value() >= MOST_ELEMENTS as f64 {
            return Err(endless());
        }
    }
    if is_delayed && !plant.is_watched() {
        let chosen = Instructions::chosen();
        if aligned::run(chosen, plant, start, reference, &mut requested, task)? {
            return Ok(requested.trajectory);
        }
    }
    requested.reserve()?;
    modes::run(plant, start, reference, requested, task)
}
