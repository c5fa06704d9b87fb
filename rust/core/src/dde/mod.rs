//! Delay differential equations.
//!
//! * [`linear`]: the loop x′ = A x + B w + E r, u = K x + L w + M r, w(t) = sat(u(t − Td)),
//!   its start and its reference;
//! * [`sampled`]: the same loop with the command held between samples: exact response, transition
//!   matrix, poles, grids of poles;
//! * [`continuous`]: the loop in continuous time, exact to rounding by the method of steps;
//! * [`fixed_step`]: the loop in fixed steps, with the errors of block-diagram tools;
//! * [`propagator`]: the response of x′ = A x + g to constant g (matrix exponential);
//! * [`ensemble`]: many loops at once, their responses or figures of merit;
//! * [`sensitivity`]: derivatives of a response with respect to numbers of the loop;
//! * [`scalar`]: the numbers all of these compute with, plain or with a slope;
//! * [`spectral`]: any equation with constant delays, by collocation on elements that end on
//!   breaking points, with its [`history`] and its [`breaks`];
//! * [`system`]: linear systems of any order with any number of delays, retarded or neutral.

pub mod breaks;
mod chebyshev;
pub mod continuous;
pub mod ensemble;
mod figures;
pub mod fixed_step;
mod gauge;
pub mod history;
mod level_crossings;
mod limits;
pub mod linear;
pub mod propagator;
mod reference;
mod response;
mod row;
pub mod sampled;
pub mod scalar;
pub mod sensitivity;
mod series;
mod simulate;
pub mod spectral;
pub mod system;
mod wanted;

#[cfg(test)]
mod tests;

pub use figures::{Criteria, Figures};
pub use limits::DIVERGED;
pub use linear::{Equations, LinearLoop, Start, Update};
pub use reference::Reference;
pub use response::{Request, Response, on_sample};
pub use scalar::{Dual, Scalar};
pub use system::{LinearSystem, Past, Signal, SystemEquations, SystemResponse};
pub use wanted::Trajectory;
