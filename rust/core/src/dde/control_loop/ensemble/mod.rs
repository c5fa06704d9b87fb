//! Many loops at once: step responses from rest, or their metrics, one loop a set of numbers.
//!
//! Sampled loops whose output is a line between events (an integrator under any controller) run
//! in lanes, one set in each (`walk`); sets whose delays hold the same number of whole samples
//! share a block, so that its lanes read their delayed commands from the same place. All other
//! sets run one by one by the engines of a single loop (`each`). A set's result has the same
//! bits whatever its neighbours, the number of threads and the instruction set.

mod block;
mod corners;
mod each;
mod measured;
mod sets;
mod sweep;
mod through;
mod walk;

#[cfg(test)]
mod tests;

pub use sets::{Outcome, Sets};
pub use sweep::{metrics, responses};
