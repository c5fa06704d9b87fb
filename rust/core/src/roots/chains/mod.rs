//! Chains of roots of neutral equations.
//!
//! `abscissa` bounds the real parts of the chains for delays that may change by arbitrarily little;
//! `base_delay` finds the common base of commensurate delays.

mod abscissa;
mod base_delay;

pub use abscissa::chain_abscissa;
pub use base_delay::base_delay;
pub(crate) use base_delay::difference_part;
