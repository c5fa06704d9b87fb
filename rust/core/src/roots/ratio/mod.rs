//! Poles of a ratio n/d of two quasi-polynomials: roots of d that are not roots of n as well.
//!
//! `shared` decides how many roots of a disc of d the numerator has too, to the rounding of the
//! coefficients and delays; `poles` answers the questions about roots without these. What is left
//! out is listed as hidden: the ratio is finite there, but equations that realise it may hold the
//! mode.

mod poles;
mod shared;

pub use poles::{Poles, Stability};
pub use shared::Ratio;
