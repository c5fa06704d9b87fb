//! Boxes of parameters: what is proved for all of their points at once.
//!
//! `reduced` is the family with its fixed parameters put in, `box_expansion` its expansion about a
//! box. `value_set` proves that h has no zero over a box and a stretch of the edge,
//! `unbounded_frequency` that none comes from beyond a frequency, `prove` joins both with a count.
//! `division` divides ranges into proved boxes, `largest` searches for one large stable box, and
//! `radius` asks how far parameters may move.

mod box_expansion;
mod division;
mod largest;
mod prove;
mod radius;
mod reduced;
mod unbounded_frequency;
mod value_set;

pub(crate) use box_expansion::{BoxExpansion, Range};
pub use division::{Boxes, Limits, Node, proved_boxes};
pub(crate) use division::{check, reduce};
pub use largest::largest_stable_box;
pub(crate) use prove::{Claim, Examined, Finding, Stretch, examine, find_unstable};
pub use radius::{Radius, stability_radius};
pub(crate) use reduced::Reduced;
pub(crate) use value_set::tangent;
