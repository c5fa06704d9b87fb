//! Stability of loops with a hold: their characteristic functions in σ (`hold`).
//!
//! * `model` forms the two polynomials of a loop from its equations.
//! * `count` finds where roots cross the edge of the specification, and counts those beyond it.
//! * `rightmost` finds the rightmost root of one loop.
//! * `single` is one loop with numbers, `map` covers two parameters.

mod count;
mod map;
mod model;
mod rightmost;
mod single;

pub(crate) use count::{count, crossings};
pub use map::{LoopRows, held_boundaries, held_crossings, held_map};
pub(crate) use rightmost::{rightmost, with_abscissa};
pub use single::{HeldLoop, HeldNumbers};

#[cfg(test)]
mod tests;
