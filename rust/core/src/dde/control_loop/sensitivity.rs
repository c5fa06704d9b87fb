//! Derivatives of a response with respect to numbers of the loop: the simulation runs in [`Dual`]s.

use crate::{Error, Task};

use super::linear_loop::Start;
use super::reference::Reference;
use super::requested_output::RequestedOutput;
use super::row::{Row, width};
use crate::dde::scalar::Dual;

/// A loop, its start and their slopes with respect to a number of parameters, one after the other.
#[derive(Debug, Clone, Copy)]
pub struct Sloped<'a> {
    /// Number of states.
    pub states: usize,
    /// A, B, E, K, C, L, M, D, impulse, delay, sample time (0 for none), limit (∞ for none).
    pub row: &'a [f64],
    /// Slopes of the row.
    pub row_slopes: &'a [f64],
    /// x(0).
    pub state: &'a [f64],
    /// Slopes of x(0).
    pub state_slopes: &'a [f64],
    /// Command before time 0.
    pub command: f64,
    /// Slopes of the command.
    pub command_slopes: &'a [f64],
    /// Slopes of the output times.
    pub ahead: &'a [f64],
}

/// Slopes of the outputs and of the inputs at fixed times, parameter by parameter.
///
/// At a jump of the response they are the derivatives after the jump.
pub fn sensitivities(
    of: &Sloped<'_>,
    command_history: &[f64],
    sample_phase: f64,
    reference: &Reference,
    output_times: &[f64],
    input_times: &[f64],
    task: &Task,
) -> Result<(Vec<f64>, Vec<f64>), Error> {
    let (n, width) = (of.states, width(of.states));
    let (mut outputs, mut inputs) = (Vec::new(), Vec::new());
    for (i, (&command_slope, &ahead)) in of.command_slopes.iter().zip(of.ahead).enumerate() {
        let duals = |values: &[f64], slopes: &[f64], length: usize| -> Result<Vec<Dual>, Error> {
            match slopes.get(i * length..(i + 1) * length) {
                Some(slopes) if values.len() == length => {
                    let pairs = values.iter().zip(slopes);
                    Ok(pairs
                        .map(|(&value, &slope)| Dual::new(value, slope))
                        .collect())
                }
                _ => {
                    refuse!("slopes of parameter {i} are missing: give {length} for each parameter")
                }
            }
        };
        let row = duals(of.row, of.row_slopes, width)?;
        let start = Start {
            state: duals(of.state, of.state_slopes, n)?,
            command: Dual::new(of.command, command_slope),
            command_history: command_history.to_vec(),
            sample_phase,
        };
        let plant = Row::new(n, &row)?.checked()?;
        let requested = RequestedOutput::new(output_times, input_times, Dual::new(0.0, ahead))?;
        let found = plant.serve(&start, reference, requested, task)?;
        outputs.extend(found.outputs.iter().map(|y| y.slope));
        inputs.extend(found.inputs.iter().map(|u| u.slope));
    }
    Ok((outputs, inputs))
}
