//! Characteristic roots of a loop.

use deadtime::dde::sampled;
use deadtime::loops::Input;
use deadtime::roots::{chain_abscissa, rightmost as search, spectral_abscissa};
use deadtime::stability::HeldLoop;
use deadtime::{Error, Task};

use crate::request::Request;

/// After the loop, how many. The answer has the spectral abscissa and that of the chains (−∞ for
/// none), both in 1/s, and for each root its real and imaginary part, multiplicity and the radius of
/// its disc (of a sampled loop all poles s = ln(z)/Ts, rightmost first, without discs).
pub(crate) fn rightmost(request: &mut Request<'_>) -> Result<Vec<f64>, Error> {
    let control_loop = request.control_loop()?;
    let many = request.whole()?;
    let task = Task::new();
    if control_loop.values().sample_time.is_some() {
        let linear = control_loop.linear(Input::Reference)?;
        let poles = sampled::poles(&linear)?;
        let abscissa = HeldLoop::new(&linear)?.abscissa(&task)?;
        let mut answer = vec![abscissa, f64::NEG_INFINITY];
        for pole in poles.iter().take(many) {
            answer.extend([pole.re, pole.im, 1.0, f64::NAN]);
        }
        return Ok(answer);
    }
    let h = control_loop.characteristic()?;
    let mut answer = vec![spectral_abscissa(&h, true, &task)?, chain_abscissa(&h)];
    let found = search(&h, many, &task)?;
    let places = found.roots.iter().zip(&found.multiplicities);
    for ((root, many), radius) in places.zip(&found.radii) {
        answer.extend([root.re, root.im, f64::from(*many), *radius]);
    }
    Ok(answer)
}
