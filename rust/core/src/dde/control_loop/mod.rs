//! Linear control loops with one delay, an optional limit and an optional hold.
//!
//! * `linear_loop` holds the equations, `reference` the reference, `simulate` runs them:
//!   [`sampled`] with the command held between samples, `continuous` in continuous time.
//! * `requested_output` collects what a run has to deliver; `response` is the public request.
//! * `series` and `level_crossings` are the polynomials between events; `step_metrics` measures a
//!   response from them, `metrics` defines what is measured, `deviation` integrates it.
//! * [`fixed_step`] runs the loop in fixed steps, with the errors of block-diagram tools.
//! * [`ensemble`] runs many loops at once, one in each `row` of numbers; [`sensitivity`]
//!   differentiates a response with respect to numbers of the loop.

mod continuous;
mod deviation;
pub mod ensemble;
pub mod fixed_step;
mod level_crossings;
mod linear_loop;
mod metrics;
mod reference;
mod requested_output;
mod response;
mod row;
pub mod sampled;
mod sensitivity;
mod series;
mod simulate;
mod step_metrics;

pub use deviation::Deviation;
pub(crate) use deviation::{DeviationMetrics, Ending};
pub use linear_loop::{Bounds, Equations, Kick, LinearLoop, Start, Update};
pub(crate) use metrics::TIME_CONSTANTS;
pub use metrics::{Criteria, Metrics};
pub use reference::Reference;
pub(crate) use requested_output::RequestedOutput;
pub use requested_output::Trajectory;
pub use response::{Request, Response, on_sample};

#[cfg(test)]
mod tests;
