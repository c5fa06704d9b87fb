//! Roots followed along a row of a map.
//!
//! `plane` evaluates A and B of a pencil with bounds, `branch` follows each root from cell to cell,
//! `certify` proves the roots of many cells at once, and `leading` decides which root is the
//! rightmost.

mod branch;
mod certify;
mod held;
mod leading;
mod plane;

pub(crate) use held::rightmost;
