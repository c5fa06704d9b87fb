//! Delay differential equations.
//!
//! * [`control_loop`]: the loop x′ = A x + B w + E r, u = K x + L w + M r, w(t) = sat(u(t − Td)):
//!   sampled or in continuous time, exact to rounding; in fixed steps; many at once; derivatives.
//! * [`system`]: linear systems of any order with any number of delays, retarded or neutral.
//! * [`spectral`]: any equation with constant delays, by collocation on elements that end on
//!   breaking points.
//! * `propagator` is the response of x′ = A x + g to constant g (matrix exponential), `scalar` the
//!   numbers to compute with, plain or with a derivative, `limits` when a run is given up.
//! * [`RateLimits`]: a command that follows another one within limits of its rate.

pub mod control_loop;
mod limits;
pub(crate) mod propagator;
mod rate_limits;
mod scalar;
pub mod spectral;
pub mod system;

pub use control_loop::{
    Bounds, Criteria, Deviation, Equations, Kick, LinearLoop, Metrics, Reference, Request,
    Response, Start, Trajectory, Update, ensemble, fixed_step, on_sample, sampled,
};
pub(crate) use control_loop::{DeviationMetrics, Ending, RequestedOutput, TIME_CONSTANTS};
pub(crate) use limits::countable;
pub use rate_limits::RateLimits;
pub use scalar::{Dual, Scalar};
pub use spectral::{breaks, history};
pub use system::{LinearSystem, Past, Signal, SystemEquations, SystemResponse};
