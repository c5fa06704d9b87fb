//! Linear systems with any number of delays, retarded or neutral, of any order.
//!
//!   x′(t) + Σ N_j x′(t − τ_j) = Σ A_j x(t − τ_j) + Σ B_j u(t − τ_j),
//!   y(t) = Σ C_j x(t − τ_j) + Σ F_j x′(t − τ_j) + Σ D_j u(t − τ_j).
//!
//! Method of steps on Legendre elements no longer than the smallest delay: all delayed values are
//! known, and x′ = A_0 x + g is solved for all coefficients at once (`solver`). Elements end on
//! breaking points. There the jumps of all derivatives satisfy the equation themselves; a bound on
//! them is computed (`jumps`), and a break that a single polynomial represents up to rounding
//! errors ends no element any more. Legendre series are used rather than Taylor series, because a
//! function that has become smooth is then read across the ends of earlier elements without loss,
//! for any ratios of the delays, and because a stiff A_0 restricts the length only while its
//! transients last. x may jump at 0; in a neutral system x + Σ N_j x(t − τ_j) has no later jumps.
//! Guaranteed: series truncated below rounding, normwise in every row of the equation. Not
//! guaranteed: speed where a delay is very short relative to the time, or where breaks of a neutral
//! system with several delays become small slowly; beyond a limit such runs are refused.

mod element;
mod equations;
mod input_breaks;
mod jumps;
mod legendre;
mod outputs;
mod run;
mod simulate;
mod solver;
mod terms;
mod track;

#[cfg(test)]
mod tests;

pub use equations::{Past, Signal, SystemEquations, SystemResponse};
pub(crate) use legendre::{TERMS, from_values, nodes};
pub use simulate::LinearSystem;
pub use terms::Term;
