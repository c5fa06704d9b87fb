//! Stability of quasi-polynomials with parameters.
//!
//! `family` is h(s; p) with gains and delays as parameters; `demand` what is asked of the roots; `cell` judges one
//! member, with a proved count of the roots that offend.
//!
//! Maps: `grid` judges the members over two parameters, by `rows` along which one gain varies. `row` is one of them, `pencil` its functions,
//! `crossing` says where its roots cross the edge, `curves` joins the crossings of all rows to the boundaries;
//! `branch` follows roots along a row, `settle` proves each of them by the values and bounds of `plane`, `leading` says
//! which is the rightmost. `along` lists the crossings of the imaginary axis as a single gain varies. Where a family is affine in neither parameter, `blocks` cuts the map into
//! pieces, `block` divides one of them by the proofs of boxes, and `transect` finds the crossings of a row.
//!
//! Whole boxes of parameters: `reduced` is the family with its fixed parameters put in, `local` what
//! a box knows of it, `value_set` the proof that h has no zero over a box and a stretch of the edge,
//! `tail` that nothing comes from infinity, `prove` both together with a count. `boxes` divides ranges
//! into proved boxes, `largest` looks for one large stable box, `radius` asks how far parameters may
//! move, `robust` maps what holds over an interval.

mod along;
mod block;
mod blocks;
mod boxes;
mod branch;
mod cell;
mod chart;
mod crossing;
mod curves;
mod demand;
mod family;
mod grid;
mod largest;
mod leading;
mod local;
mod pencil;
mod plane;
mod prove;
mod radius;
mod reduced;
mod robust;
mod row;
mod rows;
mod settle;
mod tail;
mod transect;
mod value_set;

pub(crate) use along::radius_of_members;
pub use along::{Place, crossings_along};
pub use boxes::{Boxes, Limits, Node, proved_boxes};
pub use cell::{Cell, ENDLESS, UNKNOWN, judge};
pub use chart::Chart;
pub use curves::Vertex;
pub use demand::{Damping, Demand};
pub use family::{Affine, Family, Term};
pub use grid::{Axis, Boundaries, Proof, Question, boundaries, chains, map};
pub use largest::largest_stable_box;
pub use radius::{Radius, stability_radius};
pub use robust::robust_map;

#[cfg(test)]
mod tests;
