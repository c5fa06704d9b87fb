//! Characteristic roots: counted, located, each with a proof.
//!
//! `winding` proves how arg h turns along a line, `dominated` the same in long steps where one row
//! outweighs the others; `cell` builds rectangles with counts from it,
//! `count` half planes; `newton` proves discs around single roots, `cluster` around several; `isolate` finds
//! all roots of a region, `contour` sorts those on its edge; `rightmost` those that decide stability, along `lines`; `neutral` knows the chains, `commensurate`
//! those of exact delays, `stable`
//! decides, `unstable` sooner where one root shows it; `sensitivity` says how a root moves; `bounds` says where roots cannot be, `close_delays` where almost equal delays cancel;
//! `tropical` guesses where roots far out are; `unit` chooses the unit of time; `certificate`
//! writes the proof of a count down. `matrix` does the same for det M(s), not expanded. Elementary functions are those of `crate::elementary`, with
//! proved bounds; each file says what its inequalities leave for rounding.

mod base_delay;
mod bounds;
mod cauchy;
mod cell;
mod certificate;
mod close_delays;
mod closed;
mod cluster;
mod commensurate;
mod contour;
mod count;
mod crowd;
mod disc;
mod dominated;
mod exact_abscissa;
mod isolate;
mod lines;
pub mod matrix;
mod neutral;
mod newton;
mod prepared;
mod real;
mod region;
mod rightmost;
mod root_set;
mod segment;
mod sensitivity;
mod set;
mod stable;
mod tropical;
mod turn;
mod unit;
mod unstable;
mod winding;

pub use base_delay::base_delay;
pub(crate) use bounds::radius_right_of;
pub use certificate::{Certificate, Contour, certify};
pub use commensurate::exact_chain_abscissa;
pub use contour::{Edge, count_with_edge, roots_with_edge};
pub use count::{count, count_right_of};
pub(crate) use lines::chain_margin;
pub use neutral::chain_abscissa;
pub use real::RealPart;
pub use region::Region;
pub use rightmost::{rightmost, spectral_abscissa, unstable_and_rightmost};
pub use root_set::RootSet;
pub use segment::Segment;
pub use sensitivity::sensitivity;
pub use set::roots;
pub use stable::is_stable;

#[cfg(test)]
mod tests;
