//! What the equations of a loop are made of.
//!
//! The formulas of a loop are written once, over any [`Entry`]: a number, a number with a slope
//! ([`Dual`](crate::dde::Dual)), the numbers of many loops ([`Each`](super::Each)), or a polynomial in
//! free numbers ([`Symbol`](super::Symbol)), or a function of a number over an interval ([`Enclosed`]).

use std::ops::{Add, Div, Mul, Neg, Sub};

use crate::dde::Scalar;
use crate::elementary::Enclosed;

/// What can be added and multiplied.
pub trait Entry: Clone + From<f64> + Add<Output = Self> + Mul<Output = Self> {
    /// Is it zero: value and slope, in every loop, for all values of free numbers?
    fn is_zero(&self) -> bool;
}

/// What can be divided as well.
pub trait Number: Entry + Sub<Output = Self> + Div<Output = Self> + Neg<Output = Self> {}

impl<S: Scalar> Entry for S {
    fn is_zero(&self) -> bool {
        self.is_nothing()
    }
}

impl<S: Scalar> Number for S {}

impl Entry for Enclosed {
    fn is_zero(&self) -> bool {
        *self == Self::default()
    }
}

impl Number for Enclosed {}
