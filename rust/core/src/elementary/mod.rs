//! Exponential, sine and cosine, logarithm and angle with proved error bounds.
//!
//! Proofs by winding numbers depend on the errors of these functions, which are therefore derived.
//! Each file contains its derivation; "loses" states a rounding error there. u = 2⁻⁵³ is half an
//! ulp of 1; every sum and product of the derivations is one IEEE operation, rounded to nearest,
//! relative error at most u.
//!
//! | function | bound |
//! |---|---|
//! | [`exp`] | 1.25 u relative, and 2⁻¹⁰⁷⁵ where the result is subnormal |
//! | [`sin_cos`] | u for each of the two, at every finite argument |
//! | [`log`] | 4 u (1 + \|log x\|) |
//! | [`angle`] | 8 u |
//! | [`precise::exp`], [`precise::sin_cos`] of a [`DoubleDouble`] | 8 u² |
//!
//! No library function and no fused operation is used: the bits are the same on every machine.
//! `simd` computes several elements at once with the same bits.

mod angle;
mod circular;
mod double_double;
mod enclosed;
mod exponential;
mod logarithm;
mod nearest;
pub mod precise;
pub(crate) mod simd;
mod tables;

pub use angle::angle;
pub use circular::sin_cos;
pub use double_double::DoubleDouble;
pub use enclosed::{Enclosed, ORDER};
pub use exponential::{exp, exp_above};
pub use logarithm::log;

#[cfg(test)]
mod tests;
