//! Stability of quasi-polynomials with parameters.
//!
//! `family` is h(s; p) with gains and delays as parameters; `cell` judges one member of it, with
//! a proved count of the roots that offend against a `demand`; `grid` judges the members over two parameters, by `row`s in which
//! one gain varies: `pencil` is such a row, `crossing` says where its roots cross the line,
//! `curves` joins the crossings of all rows to the boundaries of the map; `branch` follows one of them and `leading` the rightmost.

mod branch;
mod cell;
mod crossing;
mod curves;
mod demand;
mod family;
mod grid;
mod leading;
mod pencil;
mod row;

pub use cell::{Cell, ENDLESS, UNKNOWN, judge};
pub use curves::Vertex;
pub use demand::{Damping, Demand};
pub use family::{Affine, Family, Term};
pub use grid::{Axis, Boundaries, Chart, Proof, Question, boundaries, map};

#[cfg(test)]
mod tests;
