//! Stability of loops with a hold: their characteristic functions in σ (`hold`).
//!
//! * `step` takes the states over a part of a sample, `model` forms the two polynomials of a loop from
//!   its equations.
//! * `single` is one loop with numbers, `poles` has all its poles in discs, `zeros` all of
//!   them without proof for a long delay, `interval` proves that none is on
//!   the circle over an interval of a number, `map` covers two parameters.

mod interval;
mod map;
mod model;
mod poles;
mod single;
mod step;
mod zeros;

pub use interval::HeldInterval;
pub use map::{LoopRows, held_boundaries, held_map};
pub use single::{HeldLoop, HeldNumbers};
pub use step::enclosed_step;

#[cfg(test)]
mod tests;
