//! Commands to the drone: `AT*NAME=sequence,argument,…` and a carriage return, in ASCII.
//!
//! Several share a datagram, in their order; none spans two. A number with a fraction is written as
//! the 32 bits of its single-precision form, read as a signed integer in decimal.

mod command;
mod read;
mod text;
mod write;

pub use command::Command;
pub use read::read;
pub use write::write;

/// The most bytes a datagram of commands may have; of a longer one the drone reads no more.
pub const LIMIT: usize = 1024;
