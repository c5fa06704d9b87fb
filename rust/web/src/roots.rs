//! Characteristic roots of a loop.

use deadtime::dde::sampled;
use deadtime::loops::Input;
use deadtime::roots::{chain_abscissa, rightmost as search, spectral_abscissa};
use deadtime::stability::HeldLoop;
use deadtime::{Error, Task};

use crate::request::Request;

/// After the loop, how many. The answer has the spectral abscissa and that of the chains (−∞ for
/// none), both in 1/s, and the real and imaginary part of each root (of a sampled loop all poles
/// s = ln(z)/Ts), rightmost first.
pub(crate) fn rightmost(request: &mut Request<'_>) -> Result<Vec<f64>, Error> {
    let control_loop = request.control_loop()?;
    let many = request.whole()?;
    let task = Task::new();
    let (roots, mut answer) = if control_loop.values().sample_time.is_some() {
        let linear = control_loop.linear(Input::Reference)?;
        let abscissa = HeldLoop::new(&linear)?.abscissa(&task)?;
        (sampled::poles(&linear)?, vec![abscissa, f64::NEG_INFINITY])
    } else {
        let h = control_loop.characteristic()?;
        let abscissa = spectral_abscissa(&h, true, &task)?;
        let found = search(&h, many, &task)?;
        (found.roots, vec![abscissa, chain_abscissa(&h)])
    };
    answer.extend(roots.iter().take(many).flat_map(|root| [root.re, root.im]));
    Ok(answer)
}
