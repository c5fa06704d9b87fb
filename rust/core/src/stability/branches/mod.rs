//! Roots followed along a row of a map.
//!
//! `plane` evaluates A and B of a pencil with bounds, `branch` follows each root from cell to cell,
//! `certify` proves the roots of many cells at once, and `leading` decides which root is the
//! rightmost.

mod branch;
mod certify;
mod leading;
mod plane;

pub(crate) use branch::{Branches, Root};
pub(crate) use leading::are_apart;
pub(crate) use plane::Plane;
