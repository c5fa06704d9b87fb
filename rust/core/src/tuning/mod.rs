//! Gains of a controller that are best in the worst of some scenarios, within required margins.
//!
//! `candidates` are the loops that differ in their gains, with their poles and margins; `goal` makes
//! one number of these. `simplices` and `between` find a minimum of a function with kinks, of several
//! variables and of one, and `search` looks for the best gains with them.

mod between;
mod candidates;
mod goal;
mod search;
mod simplices;

pub use candidates::{Candidates, Dominant, Loops, Scenario};
pub use goal::{Decisive, Goal, Objective};
pub use search::{Within, best_within, least, worst_delay};

#[cfg(test)]
mod tests;
