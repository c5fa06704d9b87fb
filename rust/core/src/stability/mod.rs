//! Stability of quasi-polynomials with parameters.
//!
//! `family` is h(s; p) with gains and delays as parameters; `cell` judges one member of it, with
//! a proved count of the unstable roots; `grid` judges the members over two parameters.

mod cell;
mod family;
mod grid;

pub use cell::{Cell, ENDLESS, UNKNOWN, judge};
pub use family::{Affine, Family, Term};
pub use grid::{Axis, Chart, map};

#[cfg(test)]
mod tests;
