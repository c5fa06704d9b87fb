//! How much work a continuous response may be.

use crate::{Error, Task};

/// Elements between two looks at the task.
const CHECK_EVERY: u64 = 1024;

/// More elements than anyone waits for.
pub(super) const MOST_ELEMENTS: u64 = 20_000_000;

/// Look at the task now and then, and give up on endless work.
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
        advice: "shorten the time simulated; a delay or a lag of almost nothing is better set to \
                 zero"
            .to_owned(),
    }
}
