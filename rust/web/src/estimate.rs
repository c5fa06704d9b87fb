//! Delay, gain and lag of a plant from one recording, with intervals and tests: those of the package's
//! method `output_error` where the commands are given.

use deadtime::estimation::{
    Cause, FlightPlant, FlightProfile, FlightRun, Quantity, Rows, beside_noise, judge_profile,
    least_squares,
};
use deadtime::{Error, Task};

use crate::request::Request;

/// Level of the intervals.
const LEVEL: f64 = 0.95;

/// Read the lists num and den, descending, of a plant with unit gain; whether a lag is fitted (0 or 1);
/// the lists of times, outputs, command times and commands. The answer: delay, lag, sum and gain, each
/// with the ends of its interval; the deviation of the white noise; whether there are air and trim; the
/// probability of such residuals if they are white, and of such a further lag if there is none;
/// whether the fit holds; then the fitted outputs.
pub(crate) fn estimate(request: &mut Request<'_>) -> Result<Vec<f64>, Error> {
    let task = Task::new();
    let mut list = || request.list().map(<[f64]>::to_vec);
    let (num, den) = (list()?, list()?);
    let lags = usize::from(request.flag()?);
    let plant = FlightPlant::new(num, den, lags);
    let mut list = || request.list().map(<[f64]>::to_vec);
    let (time, output) = (list()?, list()?);
    let rows = Rows::new((time, output.clone()), (list()?, list()?))?;
    let white = least_squares(
        &plant,
        [FlightRun::new(rows, 0.0)].into(),
        (0.0, 1.0),
        &task,
    )?;
    let mut quantities = plant.common();
    quantities.push(Quantity::Total);
    let fit = beside_noise(&white, &task)?;
    let profile = FlightProfile::best(fit, &quantities, &quantities, &task)?;
    let mut answer = Vec::new();
    for quantity in [
        Quantity::Delay,
        Quantity::Lag(0),
        Quantity::Total,
        Quantity::Gain,
    ] {
        let found = if quantities.contains(&quantity) {
            let (low, high) = profile.interval(quantity, LEVEL, &task)?;
            [profile.known_of(quantity)?.value, low, high]
        } else {
            [0.0; 3]
        };
        answer.extend(found);
    }
    let judgement = judge_profile(&profile, false, &task)?;
    let mut findings = judgement.findings.iter();
    let further = findings.find(|one| one.cause == Cause::Lag);
    let flag = |is: bool| f64::from(u8::from(is));
    let parts = profile.fit.parts(&task)?;
    let part = parts
        .first()
        .ok_or_else(|| Error::argument("no recording"))?;
    let has_air = profile.fit.noises().iter().any(|noise| noise.air > 0.0);
    answer.extend([part.variance.sqrt(), flag(has_air), flag(profile.fit.trim)]);
    answer.extend([
        judgement.whiteness.p_value,
        further.map_or(1.0, |one| one.p_value),
    ]);
    answer.push(flag(!judgement.findings.iter().any(|one| one.is_against)));
    let rows = output.iter().zip(&part.residuals);
    answer.extend(rows.map(|(output, residual)| output - residual));
    Ok(answer)
}
