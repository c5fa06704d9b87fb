//! Roots found and enclosed in discs.
//!
//! * `newton` finds a single root and proves its disc, `clusters` does the same for several roots
//!   that cannot be separated; `isolate` and `all_roots` find every root of a region, `edge`
//!   decides about roots on its edge.
//! * `chain_laws` states how roots of large modulus are distributed, `along_chains` locates them
//!   many at a time; `starts` guesses where roots of large modulus are.
//! * `lines` searches for vertical lines with a known number of roots to their right, `rightmost`
//!   finds the rightmost roots with them, `exact_abscissa` those of commensurate delays.
//! * `stable` decides about stability, sooner where `unstable` finds one root in the right half
//!   plane; `sensitivity` differentiates a root with respect to coefficients and delays.

mod all_roots;
mod along_chains;
mod chain_laws;
mod clusters;
mod edge;
mod exact_abscissa;
mod isolate;
mod lines;
mod newton;
mod rightmost;
mod sensitivity;
mod stable;
mod starts;
mod unstable;

pub(crate) use all_roots::all_discs;
pub use all_roots::roots;
pub(crate) use edge::within;
pub use edge::{Edge, count_with_edge, roots_with_edge};
pub(crate) use isolate::{Search, Seek};
pub(crate) use lines::{Effort, Line, Spectrum, chain_margin, half_plane_discs};
pub(crate) use newton::Outcome;
pub(crate) use rightmost::{abscissa_with, first, leading};
pub use rightmost::{rightmost, spectral_abscissa, unstable_and_rightmost};
pub use sensitivity::sensitivity;
pub(crate) use stable::is_none;
pub use stable::is_stable;
pub(crate) use unstable::{balances, leads_right, rightmost_first};
