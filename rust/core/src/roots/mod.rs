//! Characteristic roots: counted, located, each with a proof.
//!
//! `winding` proves how arg h turns along a line, `dominated` the same in long steps where one row
//! outweighs the others; `cell` builds rectangles with counts from it,
//! `count` half planes; `newton` proves discs around single roots and clusters; `isolate` finds
//! all roots of a region; `rightmost` those that decide stability; `neutral` knows the chains, `stable`
//! decides; `sensitivity` says how a root moves;
//! `bounds` says where roots cannot be. All proofs take exp, sin and cos of the `libm` crate to
//! be right within 2 ulp.

mod bounds;
mod cell;
mod count;
mod dominated;
mod isolate;
mod neutral;
mod newton;
mod real;
mod region;
mod rightmost;
mod sensitivity;
mod set;
mod stable;
mod winding;

pub use count::{count, count_right_of};
pub use neutral::chain_abscissa;
pub use region::Region;
pub use rightmost::{rightmost, spectral_abscissa, unstable_and_rightmost};
pub use sensitivity::sensitivity;
pub use set::{RootSet, roots};
pub use stable::is_stable;

#[cfg(test)]
mod tests;
