//! Gains of a controller that are best in the worst of some scenarios, within required margins.
//!
//! `candidates` are the loops that differ in their gains, with their poles and margins, `steps` their
//! steps; `goal` makes one number of these. `survey` is the map from which a search begins, `pattern` the
//! search, `search`, `simplices` and `between` the minimum of a function with kinks near a start, and
//! `exchange` finds the scenarios that matter. `tail`, with `lasting` and
//! `sampled_tail`, proves by `contraction` that a step stays at rest.
//!
//! By the responses to a load and a set point: `posed` are the loops and rays of gains, `open` what Ms
//! leaves of a ray, `demands` what else must hold, `responses` what gains give. `reach` joins these for
//! the ratios of gains, `robust` looks for the best of them, `settling` weighs the reference, and `rules`
//! has rules of thumb.

mod candidates;
mod contraction;
mod demands;
mod exchange;
mod goal;
mod lasting;
mod open;
mod pattern;
mod posed;
mod reach;
mod responses;
mod robust;
mod rules;
mod sampled_tail;
mod search;
mod settling;
mod simplices;
mod steps;
mod survey;
mod tail;

pub use candidates::{Candidates, Dominant};
pub use demands::{Demands, margins_of, noise_gain};
pub use exchange::{Found, Robust, Sought, Spot};
pub use goal::Objective;
pub use posed::{Best, Neighbour, Posed, Wish, lasting};
pub use responses::figures;
pub use robust::best;
pub use rules::{Reduced, Row, reduced, rules};
pub use settling::{SLACK, Settled, settled_first};
pub use steps::Step;
pub use survey::Survey;
pub use tail::proved_step;

#[cfg(test)]
mod tests;
