//! Commands to the drone: `AT*NAME=sequence,argument,…` and a carriage return, in ASCII.
//!
//! A datagram holds several commands in order; no command spans two datagrams. A number with a
//! fraction is written as the 32 bits of its single-precision form, read as a signed integer in
//! decimal.

mod command;
mod read;
mod text;
mod write;

pub use command::Command;
pub use read::read;
pub use write::write;

/// Upper limit on the bytes of a datagram of commands; the drone reads no more.
pub const LIMIT: usize = 1024;
