//! When a run is given up, and when two of its times are one.

use super::scalar::Scalar;
use crate::Error;

/// Largest magnitude of a state before a run is given up as diverging.
pub(crate) const DIVERGED: f64 = 1e150;

/// What memory is asked for.
pub(crate) const RESPONSE: &str = "the response";

/// The error of a response that has grown out of bounds.
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

/// Two times closer than this are one: rounding of sums of delays and samples.
pub(crate) fn slack<S: Scalar>(t: S, delay: S) -> f64 {
    16.0 * f64::EPSILON * (t.value().abs() + delay.value())
}
