//! Where roots cross the edge of a specification as one gain, or one delay, varies.
//!
//! `pencil` is the family A + k B along one gain, `crossing` isolates its crossings, `row` counts
//! the cells between them, `one_gain` lists the crossings for a single gain, `one_delay` has those for
//! a delay, and `held` those of a loop with a hold.

mod crossing;
mod held;
mod one_delay;
mod one_gain;
mod pencil;
mod row;

pub use crossing::Crossing;
pub(crate) use held::{count, crossings};
pub use one_gain::crossings_along;
pub(crate) use one_gain::radius_of_members;
pub(crate) use pencil::{sizes, united};
pub(crate) use row::{ByParts, Delay, Members, Row, Span};
