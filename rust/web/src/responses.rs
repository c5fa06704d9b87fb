//! Responses of a loop from rest at zero.

use deadtime::dde::{Kick, Request as Asked, Start};
use deadtime::loops::Drive;
use deadtime::{Error, Task};

use crate::request::Request;

/// After the loop, the height of a step of the reference at zero; that of a step of the load and its
/// time in s; whether the delay is that of the measurement (0 or 1), and the list of times in s. The
/// answer has the outputs and then the commands at these times.
pub(crate) fn step(request: &mut Request<'_>) -> Result<Vec<f64>, Error> {
    let control_loop = request.control_loop()?;
    let (height, load, late) = (request.number()?, request.number()?, request.number()?);
    let output_lead = if request.flag()? {
        control_loop.values().delay
    } else {
        0.0
    };
    let time = request.list()?;
    let load = (load != 0.0).then_some(Kick {
        time: late + output_lead,
        input: 0,
        to: load,
    });
    let drives = load.map(|_| (Drive::Load, 0));
    let linear = control_loop.driven(drives.as_slice())?;
    let asked = Asked {
        time,
        output_lead,
        reference_before: 0.0,
        reference_time: time.get(..1).unwrap_or_default(),
        reference: &[height],
    };
    let start = Start {
        state: vec![0.0; linear.equations().states()],
        kicks: load.into_iter().collect(),
        ..Start::default()
    };
    let found = linear.respond(&start, &asked, &Task::new())?;
    let mut answer = found.outputs;
    answer.extend(found.inputs);
    Ok(answer)
}
