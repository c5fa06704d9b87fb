//! Where roots cross the edge of a specification as one gain varies.
//!
//! `pencil` is the family A + k B along one gain, `crossing` isolates its crossings, `row` counts
//! the cells between them, and `one_gain` lists the crossings for a single gain.

mod crossing;
mod one_gain;
mod pencil;
mod row;

pub use crossing::Crossing;
pub(crate) use crossing::crossings;
pub use one_gain::crossings_along;
pub(crate) use one_gain::radius_of_members;
pub(crate) use pencil::{Pencil, sizes, united};
pub(crate) use row::{Members, Row};
