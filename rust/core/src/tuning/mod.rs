//! Gains of a controller that are best in the worst of some scenarios, within required margins.
//!
//! `candidates` are the loops that differ in their gains, with their poles and margins; `goal` makes
//! one number of these. `simplices` and `between` find a minimum of a function with kinks, of several
//! variables and of one, and `search` looks for the best gains with them.
//!
//! By the responses to a load and a set point: `posed` are the loops and rays of gains, `open` what Ms
//! leaves of a ray, `demands` what else must hold, `responses` what gains give. `reach` joins these for
//! the ratios of gains, `robust` looks for the best of them, `settling` weighs the reference, and `rules`
//! has rules of thumb.

mod candidates;
mod demands;
mod goal;
mod open;
mod posed;
mod reach;
mod responses;
mod robust;
mod rules;
mod search;
mod settling;
mod simplices;

pub use candidates::{Candidates, Dominant, Loops, Scenario};
pub use demands::{Demands, margins_of, noise_gain};
pub use goal::{Decisive, Goal, Objective};
pub use posed::{Best, Neighbour, Posed, Wish, lasting};
pub use responses::figures;
pub use robust::best;
pub use rules::{Reduced, Row, reduced, rules};
pub use search::{Within, best_within, least, worst_delay};
pub use settling::settled_first;

#[cfg(test)]
mod tests;
