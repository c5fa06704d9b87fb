//! Stability of loops with a hold: their characteristic functions in σ (`hold`).
//!
//! * `model` forms the two polynomials of a loop from its equations.
//! * `count` finds where roots cross the edge of the specification, and counts those beyond it.
//! * `rightmost` finds the rightmost root of one loop.
//! * `map` covers two parameters.

mod count;
mod map;
mod model;
mod rightmost;

pub(crate) use count::{count, crossings};
pub use map::{LoopRows, held_boundaries, held_map};
pub(crate) use rightmost::{rightmost, with_abscissa};

#[cfg(test)]
mod tests;
