//! Quasi-polynomials h(s) = Σ_j p_j(s) e^(−s τ_j) with real coefficients and delays τ_j ≥ 0.
//!
//! They are the characteristic functions of linear systems with delays. The delays are sorted and
//! distinct, no row p_j is zero, none has trailing zeros: checked once, in
//! [`QuasiPolynomial::new`]. Values are computed as g(s) = h(s) e^(s τ_c) with the delay τ_c of the
//! term that dominates at s, so that no exponential overflows, and have a bound on their rounding
//! error, derived in `probe` down to the elementary functions.

mod algebra;
mod double_double;
mod expansion;
mod jet;
mod kind;
mod lanes;
mod order;
mod overflow;
mod probe;
mod quasi_polynomial;
mod value;

pub(crate) use algebra::{convolve, equate_close_delays};
pub(crate) use double_double::relative_turn;
pub use expansion::Expansion;
pub(crate) use expansion::{changes, expansion, remainder};
pub use jet::Jet;
pub(crate) use jet::modulus;
pub use kind::Kind;
pub(crate) use lanes::Lanes;
pub use probe::Probe;
pub use quasi_polynomial::QuasiPolynomial;
pub use value::Scaled;

#[cfg(test)]
mod tests;
#[cfg(test)]
pub(crate) use tests::make;
