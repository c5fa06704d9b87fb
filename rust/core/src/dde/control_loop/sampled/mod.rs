//! The loop with a hold: u_k is computed at t_k = t_0 + k Ts and reaches the plant Td later.
//!
//! With m = ⌊Td/Ts⌋ and δ = Td − m Ts the plant sees u_{k−m−1} on [t_k, t_k + δ) and u_{k−m} on
//! [t_k + δ, t_{k+1}), so between events its response is a matrix exponential and the loop as a
//! whole is one linear map of (x, u_{k−1}, …, u_{k−m−1}): finite-dimensional, with poles
//! s = ln(z)/Ts. Everything here is exact to rounding. A delay within rounding of a whole number
//! of samples is taken as that number.

mod run;
mod timing;
mod transition;
mod window;

pub(crate) use run::run;
pub use timing::Timing;
pub(crate) use transition::{eigenvalues, multipliers};
pub use transition::{poles, transition_matrix};
