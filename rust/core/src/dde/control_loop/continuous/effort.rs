//! Limits on the work for a continuous response.

use crate::{Error, Task};

/// Elements between two checks for cancellation.
const CHECK_EVERY: u64 = 1024;

/// Upper limit on the elements of a response (bounds time and memory).
pub(super) const MOST_ELEMENTS: u64 = 20_000_000;

/// Check for cancellation and for the limit on elements.
pub(super) fn watch(elements: u64, task: &Task) -> Result<(), Error> {
    if elements.is_multiple_of(CHECK_EVERY) {
        task.check()?;
    }
    if elements >= MOST_ELEMENTS {
        return Err(endless());
    }
    Ok(())
}

pub(super) fn endless() -> Error {
    Error::TooMuch {
        what: "the continuous response",
        limit: MOST_ELEMENTS,
        unit: "elements of time",
        advice: "simulate a shorter time, and set delays and lags close to zero to exactly zero"
            .to_owned(),
    }
}
