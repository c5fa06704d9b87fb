//! The spectral method of steps for y′(t) = f(t, y(t), y(t − τ_1), …, y(t − τ_m)[, y′(t − τ_j)]).
//!
//! The solution is built element by element. On each it is a polynomial through Radau points that
//! satisfies the equation there (Radau IIA collocation of 4 to 24 stages, or up to 48 where the
//! components are not coupled), found by sweeps that each call the right-hand side once for all
//! points of the element. Delayed values are values of the stored polynomials. Elements end on
//! breaking points, so that every polynomial approximates something smooth. Length and degree follow
//! the decay of the Chebyshev coefficients and the defect of the equation at the start of an element,
//! where that of collocation is largest; both judge the polynomial everywhere, not only its end. An
//! element whose nodes do not resolve the stored past is shortened. Not guaranteed: the estimates are
//! local, as in every method of this
//! kind; how errors of the past grow depends on the equation.

pub mod breaks;
mod chebyshev;
mod control;
mod delayed;
mod element;
mod events;
mod fit;
pub mod history;
mod isolate;
mod jacobian;
mod newton;
mod nodes;
mod output;
mod problem;
mod products;
mod run;
mod scalar;
mod shifted;
mod signal;
mod sizes;
mod sparsity;
#[cfg(test)]
mod tests;
mod unread;

pub use fit::{Approximation, approximate};
pub use problem::{Columns, Equation, Event, Jump, Outcome, Problem, Solution};
pub use run::solve;
pub use signal::{Series, series};
pub use sparsity::Sparsity;
