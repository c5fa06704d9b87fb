//! Stability of quasi-polynomials with parameters.
//!
//! `family` is h(s; p) with gains and delays as parameters; `cell` judges one member of it, with
//! a proved count of the unstable roots; `grid` judges the members over two parameters.
//!
//! Whole boxes of parameters: `reduced` is the family with its fixed parameters put in, `local` what
//! a box knows of it, `value_set` the proof that h(iw) has no zero over a box and a stretch of w,
//! `tail` that nothing comes from infinity, `prove` both together with a count. `boxes` divides ranges
//! into proved boxes, `largest` looks for one large stable box, `radius` asks how far parameters may
//! move, `robust` maps what holds over an interval.

mod boxes;
mod cell;
mod family;
mod grid;
mod largest;
mod local;
mod prove;
mod radius;
mod reduced;
mod robust;
mod tail;
mod value_set;

pub use boxes::{Boxes, Limits, Node, proved_boxes};
pub use cell::{Cell, ENDLESS, UNKNOWN, judge};
pub use family::{Affine, Family, Term};
pub use grid::{Axis, Chart, map};
pub use largest::largest_stable_box;
pub use radius::{Radius, stability_radius};
pub use robust::robust_map;

#[cfg(test)]
mod tests;
