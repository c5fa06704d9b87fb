//! Commands between rows that are further apart than the samples of the controller.
//!
//! A sampled controller sends a command at each of its samples, logged or not. Where rows are further
//! apart than its samples (`gaps`), the commands between them are those of the controller, computed from
//! the reference and a straight line between the outputs, if that controller is known and its law holds
//! on the rows; else the mean of the commands before and after (`controlled`). Where the reference
//! changes between two such rows, or many rows are missing, the mean command between them is an unknown
//! of a first fit. With its plant, the output in between is predicted, and the commands are computed from
//! that (`predicted`, `refilling`); each time at which the reference may have changed is tried (`rounds`). In missing
//! rows the commands so depend on the numbers of the plant, and a response to them tells of these
//! (`missing`). Commands with times of their own may be lost too (`sent`).

mod controlled;
mod gaps;
mod missing;
mod predicted;
mod refilling;
mod rounds;
mod sent;
mod smoothed;
#[cfg(test)]
mod tests;
mod tolerances;

pub use controlled::Controlled;
pub use refilling::RunCommands;
pub use rounds::{BetweenRows, between_rows};
pub use sent::Sent;
