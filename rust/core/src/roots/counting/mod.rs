//! Proved numbers of roots.
//!
//! * `turn` holds the change of arg h along a line; `winding` proves it step by step, `dominated`
//!   in long steps where one row exceeds all the others together, and `taylor_bound` where several
//!   roots are close.
//! * `cell` counts the roots of rectangles, `count` those of regions and half planes.
//! * `bounds`, with `cauchy` and `close_delays`, proves where no root can be; `closed_region`
//!   closes open sides with these bounds.
//! * `real_axis` counts real roots, `exact_delays` counts right of a line when the delays are
//!   multiples of one base.
//! * `prepared` takes out roots at 0 and scales coefficients, `time_scaling` chooses a unit of
//!   time.
//! * `certificate` writes the proof of a count down, as a list of `segment`s.

mod bounds;
mod cauchy;
mod cell;
mod certificate;
mod close_delays;
mod closed_region;
mod count;
mod dominated;
mod exact_delays;
mod prepared;
mod real_axis;
mod segment;
mod taylor_bound;
mod time_scaling;
mod turn;
mod winding;

pub(crate) use bounds::{dominance, radius_right_of};
pub(crate) use cell::Cell;
pub use certificate::{Certificate, Contour, certify};
pub(crate) use closed_region::{Closed, EDGE_MARGIN, close};
pub(crate) use count::half_plane;
pub use count::{count, count_right_of};
pub(crate) use exact_delays::cell_right_of;
pub use exact_delays::exact_chain_abscissa;
pub(crate) use prepared::Prepared;
pub use real_axis::RealPart;
pub use segment::Segment;
pub(crate) use time_scaling::TimeScaling;
pub(crate) use turn::{Turn, Walk};
pub(crate) use winding::{MAX_EVALUATIONS, Walker, newton_step};
