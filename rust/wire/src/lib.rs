//! Wire formats: the AR.Drone 2.0's commands, navdata and configuration, a loop's UDP packets, the
//! frames of a Blackbox log, and tables in text.
//!
//! Bytes come from a network or a file, so that a reader accepts any input: it never panics, never
//! reads past the end, and its work grows linearly with the number of bytes. Its results are
//! checked: the value of a command is finite and in [-1, 1] by its type. Writers refuse everything
//! that readers refuse.
//!
//! | module | what it holds |
//! |---|---|
//! | [`at`] | commands to the drone, UDP 5556 |
//! | [`navdata`] | messages of the drone, UDP 5554 |
//! | [`configuration`] | the drone's settings, TCP 5559 |
//! | [`blackbox`] | frames of a flight log of Betaflight or INAV |
//! | [`csv`] | columns of numbers in a CSV table |
//! | [`loop_packet`] | packets between the two ends of a control loop, and bare doubles |

#![forbid(unsafe_code)]
#![deny(clippy::indexing_slicing)]
#![cfg_attr(test, allow(clippy::indexing_slicing))]

pub mod at;
pub mod blackbox;
mod bytes;
pub mod configuration;
pub mod csv;
mod error;
pub mod loop_packet;
pub mod navdata;
mod unit;

pub use error::{Error, Fault};
pub use unit::Unit;
