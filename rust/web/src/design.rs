//! Gains with the best response to a load under a largest Ms.

use deadtime::tuning::{Posed, settled_first};
use deadtime::{Error, Task};

use crate::request::Request;

/// After the loop, the largest Ms, and the part of the best response to a load that an earlier end of a
/// step may cost. The answer: Ms, the response to a unit load that was made least, the weight of the
/// reference (NaN where it stays), then the gains.
pub(crate) fn design(request: &mut Request<'_>) -> Result<Vec<f64>, Error> {
    let control_loop = request.control_loop()?;
    let (max_sensitivity, slack) = (request.number()?, request.number()?);
    let posed = Posed::for_loads(control_loop, max_sensitivity, slack);
    let (found, weight) = settled_first(&posed, &Task::new())?;
    let margins = found.margins.first();
    let had = margins.map_or(f64::NAN, |margins| margins.peaks.sensitivity.value);
    let mut answer = vec![had, found.value, weight.unwrap_or(f64::NAN)];
    answer.extend(found.gains);
    Ok(answer)
}
