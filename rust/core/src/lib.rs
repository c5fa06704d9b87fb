//! Time-delay systems: Lambert W, quasi-polynomials and their roots, stability maps, delay
//! differential equations.
//!
//! Everything numerical of the `deadtime` Python package is here, and nothing of Python.
//! Dependencies run one way: error, lanes ← lambertw; error ← elementary ← quasipoly ← roots ←
//! stability ← frequency; quasipoly ← dde.

pub mod dde;
pub mod elementary;
pub mod error;
pub mod frequency;
pub mod lambertw;
mod lanes;
pub mod memory;
pub mod quasipoly;
pub mod roots;
pub mod stability;
pub mod status;
pub mod task;

pub use error::Error;
pub use lanes::instructions;
pub use task::Task;
