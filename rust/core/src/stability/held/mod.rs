//! Stability of loops with a hold: their characteristic functions in σ (`hold`).
//!
//! * `model` forms the two polynomials of a loop from its equations.
//! * `single` is one loop with numbers, `poles` has all its poles, `map` covers two parameters.

mod map;
mod model;
mod poles;
mod single;

pub use map::{LoopRows, held_boundaries, held_map};
pub use single::{HeldLoop, HeldNumbers};

#[cfg(test)]
mod tests;
