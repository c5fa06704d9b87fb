//! Gains of a controller that are best in the worst of some scenarios, within required margins.
//!
//! `candidates` are the loops that differ in their gains, with their poles and margins; `goal` makes
//! one number of these. `simplices` and `between` find a minimum of a function with kinks, of several
//! variables and of one, and `search` looks for the best gains with them.

mod candidates;
mod demands;
mod goal;
mod open;
mod responses;
mod robust;
mod rules;
mod search;
mod simplices;

pub use candidates::{Candidates, Dominant, Loops, Scenario};
pub use demands::{Demands, margins_of, noise_gain};
pub use goal::{Decisive, Goal, Objective};
pub use responses::figures;
pub use robust::{Best, Neighbour, Posed, Wish, best, lasting};
pub use rules::{Reduced, Row, reduced, rules};
pub use search::{Within, best_within, least, worst_delay};

#[cfg(test)]
mod tests;
