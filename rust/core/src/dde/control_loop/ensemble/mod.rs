//! Many loops at once: step responses from rest, or their metrics, one loop for each set of
//! numbers.
//!
//! Sampled loops of up to four states run in SIMD lanes, one set in each. A sample is one linear map
//! of the states and two commands ([`transition`]); outputs between the arrivals of commands are
//! short Taylor series. A run leaves a trace of the outputs where parts of samples meet and of a
//! bound on how far they are exceeded in between ([`walk`]); the metrics are found from the trace,
//! by polynomials only where the bound says that they matter ([`rounds`]). Sets whose delays hold
//! the same number of whole samples share a block ([`shape`]), so that its lanes read their delayed
//! commands from the same index. Continuous loops with a delay run in lanes, by the method of steps,
//! if their command is at its limit at first at most ([`delayed`]). All other sets are run one
//! by one by the code for single loops ([`each`]). The result of a set has the same bits for any
//! neighbours, number of threads and instruction set.

mod block;
mod decay;
mod delayed;
mod each;
mod expand;
mod extremes;
mod levels;
mod loops;
mod measured;
mod metrics;
mod piece;
mod responses;
mod rounds;
mod saturated;
mod search;
mod sets;
mod shape;
mod spots;
mod sweep;
mod through;
mod trace;
mod transition;
mod view;
mod walk;

#[cfg(test)]
mod tests;

pub use each::{Alone, metrics_alone};
pub use sets::{Measures, Outcome, Sets};
pub use sweep::{metrics, responses};
