//! Characteristic roots: counted, located, each with a proof.
//!
//! * `region`, `disc` and `root_set` hold where roots are sought, where they are, and the evidence.
//! * `chains` bounds the chains of roots of neutral equations.
//! * `counting` proves how many roots a region holds; `locating` finds them, encloses each in a
//!   disc, and decides about stability.
//! * `ratio` leaves out the roots that a numerator has as well.
//! * [`matrix`] answers the same questions for det M(s) without expanding the determinant.
//!
//! Elementary functions are those of [`crate::elementary`], whose error bounds are proved. Each
//! file states how much of its inequalities is left for rounding errors.

mod chains;
mod counting;
mod disc;
mod locating;
pub mod matrix;
mod ratio;
mod region;
mod root_set;

pub use chains::{base_delay, chain_abscissa};
pub(crate) use counting::radius_right_of;
pub use counting::{
    Certificate, Contour, RealPart, Segment, certify, count, count_right_of, exact_chain_abscissa,
};
pub(crate) use disc::Disc;
pub(crate) use locating::chain_margin;
pub(crate) use locating::within;
pub use locating::{
    Edge, count_with_edge, is_stable, rightmost, roots, roots_with_edge, sensitivity,
    spectral_abscissa, unstable_and_rightmost,
};
pub use ratio::{Poles, Ratio, Stability};
pub use region::Region;
pub use root_set::RootSet;

#[cfg(test)]
mod tests;
