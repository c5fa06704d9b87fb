//! Gains with the best response to a load under a largest Ms.

use deadtime::loops::Place;
use deadtime::tuning::{Posed, settled_first};
use deadtime::{Error, Task};

use crate::request::Request;

/// After the loop, the list of delays that the gains must hold for, the nominal one first; the largest Ms;
/// the part of the best response to a load that an earlier end of a step may cost. The answer: Ms and the
/// response to a unit load at their worst, the weight of the reference (NaN where it stays), then the gains.
pub(crate) fn design(request: &mut Request<'_>) -> Result<Vec<f64>, Error> {
    let control_loop = request.control_loop()?;
    let delays = request.list()?.iter();
    let loops = delays.map(|late| control_loop.with_number(Place::Delay, *late));
    let posed = Posed::for_loads(loops.collect(), request.number()?, request.number()?);
    let settled = settled_first(&posed, None, &Task::new())?;
    let (found, weight) = (settled.best, settled.weight);
    let margins = found.margins.iter();
    let worst = margins.fold(0.0_f64, |worst, one| worst.max(one.peaks.sensitivity.value));
    let mut answer = vec![worst, found.value, weight.unwrap_or(f64::NAN)];
    answer.extend(found.gains);
    Ok(answer)
}
