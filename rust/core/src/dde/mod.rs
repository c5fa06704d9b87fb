//! Delay differential equations.
//!
//! * [`linear`]: the loop x′ = A x + B w + E r, u = K x + L w + M r, w(t) = sat(u(t − Td)),
//!   its start and its reference;
//! * [`sampled`]: the same loop with the command held between samples: exact response, transition
//!   matrix, poles, grids of poles;
//! * [`continuous`]: the loop in continuous time, exact to rounding by the method of steps;
//! * [`system`]: linear systems of any order with any number of delays, retarded or neutral;
//! * [`propagator`]: the response of x′ = A x + g to constant g (matrix exponential).

pub mod continuous;
pub mod linear;
pub mod propagator;
pub mod sampled;
pub mod system;

#[cfg(test)]
mod tests;

pub use linear::{Equations, LinearLoop, Reference, Start, Trajectory};
pub use system::{LinearSystem, Past, Signal, SystemEquations, SystemResponse};
