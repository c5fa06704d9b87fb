//! The loop in continuous time, exact to rounding, by the method of steps on Taylor elements.
//!
//! The command w that reaches the plant is the command of Td ago, known as a queue of pieces,
//! each a polynomial or a constant. An element of time covers one piece, or part of one, and no
//! jump of the reference, so x and u are analytic on it: their Taylor coefficients follow from
//! x_{j+1} = h (A x_j + B w_j + E r_j)/(j + 1), u_j = K x_j + L w_j + M r_j, and the element is
//! shortened until the last ones are below rounding. u is cut exactly where it crosses ±limit;
//! the cut pieces, shifted by Td, join the queue. Breaking points are therefore element ends by
//! construction. Without a delay the loop is closed inside the element instead ([`direct`]).
//! Guaranteed: truncation below rounding, no crossing of the limit missed, switching times to
//! rounding. Not guaranteed: speed where the delay or a lag is tiny against the time simulated
//! (elements are no longer than either allows), or where many breaks accumulate.

mod crossing;
mod direct;
mod impulses;
mod pieces;
mod run;
mod series;

pub(crate) use crossing::crossings;
pub(crate) use series::{DEGREE, Series};

use crate::dde::linear::{LinearLoop, Reference, Start, Trajectory};
use crate::dde::scalar::Scalar;
use crate::dde::wanted::Wanted;
use crate::{Error, Task};

/// Elements between two looks at the task.
const CHECK_EVERY: u64 = 1024;

/// More elements than anyone waits for.
const MOST_ELEMENTS: u64 = 20_000_000;

pub(crate) fn run<S: Scalar>(
    plant: &LinearLoop<S>,
    start: &Start<S>,
    reference: &Reference,
    wanted: Wanted<'_, S>,
    task: &Task,
) -> Result<Trajectory<S>, Error> {
    if plant.delay().value() > 0.0 {
        // No element is longer than the delay: work without end is refused before it starts.
        if wanted.last() / plant.delay().value() >= MOST_ELEMENTS as f64 {
            return Err(endless());
        }
        run::run(plant, start, reference, wanted, task)
    } else {
        direct::run(plant, start, reference, wanted, task)
    }
}

/// Look at the task now and then, and give up on endless work.
fn watch(elements: u64, task: &Task) -> Result<(), Error> {
    if elements.is_multiple_of(CHECK_EVERY) {
        task.check()?;
    }
    if elements >= MOST_ELEMENTS {
        return Err(endless());
    }
    Ok(())
}

fn endless() -> Error {
    Error::TooMuch {
        what: "the continuous response",
        limit: MOST_ELEMENTS,
        unit: "elements of time",
        advice: "shorten the time simulated; a delay or a lag of almost nothing is better set to \
                 zero"
            .to_owned(),
    }
}
