//! Many loops at once: step responses from rest, or their metrics, one loop for each set of
//! numbers.
//!
//! Sampled loops whose output is a line between events (an integrator under any controller) run in
//! SIMD lanes, one set in each (`walk`). Sets whose delays hold the same number of whole samples
//! share a block, so that its lanes read their delayed commands from the same index. All other sets
//! are run one by one by the code for single loops (`each`). The result of a set has the same bits
//! for any neighbours, number of threads and instruction set.

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
