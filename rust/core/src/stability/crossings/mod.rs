//! Where roots cross the edge of a specification as one gain, or one delay, varies.
//!
//! `pencil` is the family A + k B along one gain, `crossing` isolates its crossings by bounds
//! that stay `positive`, `row` counts the cells between them (`counts`), `one_gain` lists the crossings for a single gain, `one_delay` has those for
//! a delay, and `held` those of a loop with a hold.

mod counts;
mod crossing;
mod held;
mod one_delay;
mod one_gain;
mod pencil;
mod positive;
mod row;

pub(crate) use counts::{Row, Span};
pub use crossing::Crossing;
pub(crate) use held::{count, crossings};
pub use one_gain::crossings_along;
pub(crate) use one_gain::radius_of_members;
pub(crate) use pencil::{sizes, united};
pub(crate) use row::{ByParts, Delay, Members};
