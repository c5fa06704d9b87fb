//! Frames of a Blackbox log, as Betaflight and INAV write it (data version 2).
//!
//! A log opens with lines of text, of which some define the fields of each kind of frame: by what
//! a value is predicted and how the difference is encoded. Frames follow, each with one letter
//! before it: `I` has values of its own, `P` differences to the two frames before; `S` (modes and
//! states), `G` and `H` (GPS and its home) stand alone; `E` is an event. No frame states its length
//! or a checksum. So a frame is taken as whole when another letter, or the end, follows it; after a
//! damaged one the next letter is searched, and the next `I` frame starts again.
//!
//! The text is read by the caller; here are the frames.

mod encoding;
mod fields;
mod frames;
mod stream;

pub use fields::{Fields, Layout, MAX_FIELDS};
pub use frames::{Frames, Table, read};
