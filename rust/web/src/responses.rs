//! Responses of a loop from rest at zero.

use deadtime::dde::{Request as Asked, Start};
use deadtime::loops::Input;
use deadtime::{Error, Task};

use crate::request::Request;

/// After the loop, whether the load steps instead of the reference (0 or 1), the height of the step,
/// whether the delay is that of the measurement (0 or 1), and the list of times from the step on, in s.
/// The answer has the outputs and then the commands at these times.
pub(crate) fn step(request: &mut Request<'_>) -> Result<Vec<f64>, Error> {
    let control_loop = request.control_loop()?;
    let input = if request.flag()? {
        Input::Load
    } else {
        Input::Reference
    };
    let (height, is_measured) = (request.number()?, request.flag()?);
    let time = request.list()?;
    let linear = control_loop.linear(input)?;
    let asked = Asked {
        time,
        output_lead: if is_measured {
            control_loop.values().delay
        } else {
            0.0
        },
        reference_before: 0.0,
        reference_time: time.get(..1).unwrap_or_default(),
        reference: &[height],
    };
    let start = Start {
        state: vec![0.0; linear.equations().states()],
        ..Start::default()
    };
    let found = linear.respond(&start, &asked, &Task::new())?;
    let mut answer = found.outputs;
    answer.extend(found.inputs);
    Ok(answer)
}
