//! A loop in fixed steps, as block-diagram tools run it: for comparison, not for accuracy.
//!
//!   x_p′ = A x_p + B w,  y = C x_p + D w,   x_c′ = F x_c + G v + H r,
//!   u = sat(P x_c + p v + (q v + i r)˙ + M r),
//! with w = u, v = y, one of them through a transport delay: a buffer of the values at whole steps
//! t_k = k h, read by linear interpolation (and by extrapolation beyond its newest value, where the
//! delay is shorter than a stage). States advance by one explicit Runge–Kutta formula, in which
//! every stage reads the reference at its own time; steps do not end on breaking points except by
//! chance. An ideal derivative is the difference quotient since the latest whole step. With a
//! sample time (whole steps) u is computed at samples and held. The error is of first order after
//! each jump inside a step and of second order through the buffer, for every formula. Reproducing
//! this error is the purpose.

mod buffer;
mod prince_dormand;
mod simulation;
mod solver;
mod tableau;

pub use simulation::{Blocks, Driven, Path, Rest, Settings, run};
pub use solver::Solver;
