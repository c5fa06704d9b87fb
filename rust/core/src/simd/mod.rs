//! SIMD arithmetic: several doubles at a time, one element of an array in each lane.
//!
//! Kernels are written once, over [`Real`] and [`Complex`], and compiled for every instruction set
//! that pulp knows (AVX2, AVX-512, NEON, and plain arithmetic elsewhere); which one runs is decided
//! on the machine. Only operations that IEEE 754 rounds correctly are offered, the fused
//! multiply-add among them, and none crosses lanes. The bits of an element therefore depend neither
//! on the instruction set nor on its neighbours, provided that a kernel blends lanes and uses
//! [`Mask::any`] only to skip work.

mod bits;
mod columns;
mod complex;
mod dispatch;
pub(crate) mod double_double;
mod real;

#[cfg(test)]
pub(crate) use columns::sweep_on;
pub(crate) use columns::{Columns, Kernel, SHORT, sweep, sweep_along};
pub(crate) use complex::Complex;
pub(crate) use dispatch::{Instructions, outlined};
pub(crate) use pulp::Simd;
pub(crate) use real::{Lanes, Mask, Real, flat, flat_mut};
