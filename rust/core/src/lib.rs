//! Time-delay systems: Lambert W, quasi-polynomials and their roots, stability maps, delay
//! differential equations, the likelihood of recordings.
//!
//! This crate holds all numerical methods of the `deadtime` Python package and does not depend on
//! Python. Dependencies run one way: error, simd ← linear_algebra, lambertw, elementary ← quasipoly
//! ← roots ← stability ← frequency ← loops ← tuning, estimation; linear_algebra ← dde ← stability.

#[macro_use]
pub mod error;

mod between;
pub mod dde;
pub mod elementary;
pub mod estimation;
pub mod frequency;
pub mod lambertw;
mod linear_algebra;
pub mod loops;
pub mod memory;
mod order;
mod parallel;
pub mod quasipoly;
pub mod roots;
mod simd;
mod simplex;
pub mod stability;
pub mod status;
pub mod task;
pub mod tuning;

pub use error::Error;
pub use task::Task;
