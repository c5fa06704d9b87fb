//! Margins of a loop.

use deadtime::frequency::{held_margins, margins as of_loop_gain};
use deadtime::loops::Input;
use deadtime::stability::HeldLoop;
use deadtime::{Error, Task};

use crate::request::Request;

/// The answer: is it stable (0 or 1), gain margin, gain reduction, phase margin in rad, delay margin
/// in s, and the frequencies of these four in rad/s.
pub(crate) fn margins(request: &mut Request<'_>) -> Result<Vec<f64>, Error> {
    let control_loop = request.control_loop()?;
    let task = Task::new();
    let found = if control_loop.values().sample_time.is_some() {
        let linear = control_loop.linear(Input::Reference)?;
        held_margins(HeldLoop::new(&linear)?, true, &task)?
    } else {
        let (n, d) = control_loop.loop_gain()?;
        of_loop_gain(&n, &d, &task)?
    };
    Ok(vec![
        f64::from(u8::from(found.stable)),
        found.gain_margin,
        found.gain_reduction,
        found.phase_margin,
        found.delay_margin,
        found.gain_margin_omega,
        found.gain_reduction_omega,
        found.phase_margin_omega,
        found.delay_margin_omega,
    ])
}
