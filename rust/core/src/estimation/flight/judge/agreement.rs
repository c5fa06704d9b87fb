//! Do recordings that are fitted jointly agree about the vehicle?
//!
//! Each is fitted alone, from the joint fit. Its gain and its sum of delay and lag are compared with
//! their weighted means (Cochran 1954): Q = Σ ((value − mean)/error)² is chi-squared with one degree of
//! freedom less than there are recordings. Student's quantiles widen the standard errors of recordings
//! whose noise is known from few rows.

use std::sync::Arc;

use super::super::fit::{FlightFit, with_noise};
use super::super::intervals::FlightProfile;
use super::finding::Cause;
use super::tolerances::{FURTHER, LEVELS};
use crate::estimation::point::Quantity;
use crate::estimation::statistics::{chi_squared_beyond, normal_quantile, student_reach};
use crate::{Error, Task};

/// A value and its standard error.
type Value = (f64, f64);

/// Of each quantity: the probability of values as different, and each value with its error.
pub(super) fn contradictions(
    fit: &FlightFit,
    quantities: &[Quantity],
    task: &Task,
) -> Result<Vec<(Cause, f64, Vec<f64>)>, Error> {
    let mut alone = Vec::new();
    if fit.runs.len() > 1 {
        for run in 0..fit.runs.len() {
            alone.extend(profile_alone(fit, run, quantities, task)?);
        }
    }
    let mut found = Vec::new();
    for (quantity, cause) in [
        (Quantity::Gain, Cause::Gains),
        (Quantity::Total, Cause::Totals),
    ] {
        if !quantities.contains(&quantity) || fit.runs.len() < 2 {
            continue;
        }
        let each = alone.iter().map(|profile| value_of(profile, quantity));
        let each = each.collect::<Result<Vec<Value>, Error>>()?;
        let sizes = each.iter().flat_map(|(value, error)| [*value, *error]);
        found.push((cause, differ(&each), sizes.collect()));
    }
    Ok(found)
}

/// The profile of one of the recordings alone; none if it tells nothing by itself.
fn profile_alone(
    fit: &FlightFit,
    run: usize,
    quantities: &[Quantity],
    task: &Task,
) -> Result<Option<FlightProfile>, Error> {
    let start = with_noise(&fit.with_gain(task)?.point, vec![fit.noises()[run]]);
    let mut centre = fit.fit.clone();
    centre.point = start.clone();
    let runs = Arc::from(vec![fit.runs[run].clone()]);
    let only = FlightFit::new(fit.plant.clone(), runs, fit.trim, centre, None)?;
    let only = only.moved(only.fitted(&start, FURTHER.rough, task)?);
    match FlightProfile::new(only, quantities, task) {
        Ok(found) => {
            let tells = found.known.iter().all(|known| known.error().is_finite());
            Ok(tells.then_some(found))
        }
        Err(Error::NotIdentifiable(_)) => Ok(None),
        Err(error) => Err(error),
    }
}

/// A quantity of one recording and its standard error, for a Gaussian quantile.
fn value_of(profile: &FlightProfile, quantity: Quantity) -> Result<Value, Error> {
    let known = profile.known_of(quantity)?;
    let reach = student_reach(LEVELS.compared, known.freedom);
    let wider = reach / normal_quantile(0.5 + 0.5 * LEVELS.compared);
    Ok((known.value, known.error() * wider))
}

/// The probability of differences as large as these between equal quantities.
fn differ(values: &[Value]) -> f64 {
    if values.len() < 2 || !values.iter().all(|(_, error)| *error > 0.0) {
        return 1.0;
    }
    let weights: f64 = values.iter().map(|(_, error)| 1.0 / (error * error)).sum();
    let sum = values.iter().map(|(value, error)| value / (error * error));
    let mean = sum.sum::<f64>() / weights;
    let away = values.iter().map(|(value, error)| (value - mean) / error);
    let square: f64 = away.map(|away| away * away).sum();
    chi_squared_beyond(square, (values.len() - 1) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_probability_is_that_of_chi_squared() {
        // Two values 2.5758 standard errors of their difference apart: 1 %, two-sided.
        let apart = [(0.0, 3.0), (2.575_829_303_548_900_4 * 5.0, 4.0)];
        assert!((differ(&apart) - 0.01).abs() < 1e-12);
        assert_eq!(differ(&[(1.0, 1.0)]), 1.0);
        assert_eq!(differ(&[(1.0, 1.0), (9.0, 0.0)]), 1.0);
    }
}
