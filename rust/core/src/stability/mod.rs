//! Stability of quasi-polynomials with parameters.
//!
//! * `family` is h(s; p) with gains and delays as parameters, `specification` states what is asked
//!   of the roots, and `cell` judges one member by a proved count of the roots that violate it.
//! * `crossings` finds where roots cross the edge of the specification as one gain varies,
//!   `branches` follows roots along a row.
//! * `boxes` proves statements about all points of a box of parameters.
//! * `delayed` finds how fast many continuous loops decay, `one_delay` whether all roots of one are left
//!   of a line.
//! * `map` covers two parameters: counts, boundaries, spectral abscissa, robust maps.

mod boxes;
mod branches;
mod cell;
mod crossings;
mod delayed;
mod family;
mod held;
mod hold;
mod map;
mod one_delay;
mod specification;

pub use boxes::{Boxes, Limits, Node, Radius, largest_stable_box, proved_boxes, stability_radius};
pub use cell::{Cell, ENDLESS, UNKNOWN, judge};
pub(crate) use crossings::radius_of_members;
pub use crossings::{Crossing, crossings_along};
pub use delayed::{abscissae, decay};
pub use family::{Affine, Family, Term};
pub use held::{
    HeldInterval, HeldLoop, HeldNumbers, LoopRows, enclosed_step, held_boundaries, held_map,
};
pub(crate) use hold::ROUNDINGS;
pub use map::{
    Axis, Boundaries, Chart, Proof, Question, Vertex, boundaries, chains, map, robust_map,
};
pub use specification::{Damping, Specification};

#[cfg(test)]
mod tests;
