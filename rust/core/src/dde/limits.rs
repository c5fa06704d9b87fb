//! Limits of a run: finite numbers, divergence, and the least difference of two times.

use super::scalar::Scalar;
use crate::Error;

/// Magnitude of a state above which a run counts as diverging.
pub(crate) const DIVERGED: f64 = 1e150;

/// What memory is requested for, in errors.
pub(crate) const RESPONSE: &str = "the response";

/// Return an error if a state or the command exceeds [`DIVERGED`].
pub(crate) fn check_growth<S: Scalar>(x: &[S], u: S, t: S) -> Result<(), Error> {
    let sound = |v: &S| v.value().abs() <= DIVERGED;
    if x.iter().all(sound) && sound(&u) {
        Ok(())
    } else {
        Err(Error::Diverges {
            bound: DIVERGED,
            time: t.value(),
        })
    }
}

/// Two times closer than this are equal: rounding errors of sums of delays and samples.
pub(crate) fn slack<S: Scalar>(t: S, delay: S) -> f64 {
    16.0 * f64::EPSILON * (t.value().abs() + delay.value())
}

/// Check that all numbers, and their slopes, are finite.
///
/// # Errors
/// [`Error::Argument`] with the first one that is not.
pub(crate) fn finite<S: Scalar>(name: &str, values: &[S]) -> Result<(), Error> {
    if values
        .iter()
        .fold(true, |all, value| all & value.is_finite())
    {
        return Ok(());
    }
    match values.iter().find(|value| !value.is_finite()) {
        Some(value) => refuse!(
            "{name} contains {}: give finite numbers",
            if value.value().is_finite() {
                value.slope()
            } else {
                value.value()
            }
        ),
        None => Ok(()),
    }
}

/// Most samples in a delay, 2⁵³: of more, a double does not tell how many they are.
const MOST_SAMPLES: f64 = 9_007_199_254_740_992.0;

/// Refuse a delay whose samples cannot be counted.
///
/// # Errors
/// [`Error::Argument`].
pub(crate) fn countable(delay: f64, sample_time: f64) -> Result<(), Error> {
    refuse_if!(
        delay / sample_time > MOST_SAMPLES,
        "delay={delay} is {:.3e} samples of sample_time={sample_time}, too many to count in \
         double precision: give a longer sample_time, or leave it out",
        delay / sample_time
    );
    Ok(())
}
