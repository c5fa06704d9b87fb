//! The numbers with which a loop is simulated: plain numbers, or numbers with a derivative.
//!
//! A [`Dual`] is a value v and its derivative v̇ with respect to one parameter,
//!
//!   (u, u̇)(v, v̇) = (u v, u̇ v + u v̇),   (u, u̇)/(v, v̇) = (u/v, (u̇ − (u/v) v̇)/v).
//!
//! A simulation in duals computes its own derivative (forward mode; Wengert 1964). Times are duals
//! as well: element ends, breaking points and arrivals move with the parameter, and the local
//! coordinate (time − start)/length with them, so that a moving jump is differentiated correctly.
//! Decisions (which element, which mode, which event comes first) depend on values alone; tests
//! that something is negligible depend on both. Events at one value of time that move at different
//! speeds stay separate: between them lies an element of length zero whose length has a derivative.

use std::fmt::Debug;
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub};

/// Relative difference of the slopes of two times below which they move together.
const SAME_SPEED: f64 = 1e-10;

/// A number with which a simulation computes.
pub trait Scalar:
    Copy
    + Debug
    + Default
    + PartialEq
    + Send
    + Sync
    + From<f64>
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + MulAssign
{
    /// Can slopes be other than zero?
    const MOVES: bool;

    /// The number itself.
    fn value(self) -> f64;

    /// Its derivative.
    fn slope(self) -> f64;

    /// Another value with the same slope.
    fn pinned(self, value: f64) -> Self;

    /// `self` · `factor` + `summand`, the value rounded once.
    fn mul_add(self, factor: Self, summand: Self) -> Self;

    /// Are value and slope both zero?
    fn is_nothing(self) -> bool {
        self == Self::default()
    }

    /// Is neither the value nor the slope infinite or NaN?
    fn is_finite(self) -> bool {
        self.value().is_finite() && self.slope().is_finite()
    }

    /// The one with the smaller value.
    fn earlier(self, other: Self) -> Self {
        if other.value() < self.value() {
            other
        } else {
            self
        }
    }
}

impl Scalar for f64 {
    const MOVES: bool = false;

    #[inline(always)]
    fn value(self) -> f64 {
        self
    }

    #[inline(always)]
    fn slope(self) -> f64 {
        0.0
    }

    #[inline(always)]
    fn pinned(self, value: f64) -> f64 {
        value
    }

    #[inline(always)]
    fn mul_add(self, factor: f64, summand: f64) -> f64 {
        self.mul_add(factor, summand)
    }
}

/// A value and its derivative with respect to one parameter.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Dual {
    /// The value.
    pub value: f64,
    /// Its derivative.
    pub slope: f64,
}

impl Dual {
    /// From value and slope.
    pub const fn new(value: f64, slope: f64) -> Self {
        Self { value, slope }
    }
}

impl Scalar for Dual {
    const MOVES: bool = true;

    fn value(self) -> f64 {
        self.value
    }

    fn slope(self) -> f64 {
        self.slope
    }

    fn pinned(self, value: f64) -> Self {
        Self::new(value, self.slope)
    }

    fn mul_add(self, factor: Self, summand: Self) -> Self {
        (self * factor + summand).pinned(self.value.mul_add(factor.value, summand.value))
    }
}

impl From<f64> for Dual {
    fn from(value: f64) -> Self {
        Self::new(value, 0.0)
    }
}

impl Add for Dual {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self::new(self.value + other.value, self.slope + other.slope)
    }
}

impl Sub for Dual {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        Self::new(self.value - other.value, self.slope - other.slope)
    }
}

impl Mul for Dual {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        Self::new(
            self.value * other.value,
            self.slope * other.value + self.value * other.slope,
        )
    }
}

impl Div for Dual {
    type Output = Self;

    fn div(self, other: Self) -> Self {
        let value = self.value / other.value;
        Self::new(value, (self.slope - value * other.slope) / other.value)
    }
}

impl Neg for Dual {
    type Output = Self;

    fn neg(self) -> Self {
        Self::new(-self.value, -self.slope)
    }
}

impl AddAssign for Dual {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl MulAssign for Dual {
    fn mul_assign(&mut self, other: Self) {
        *self = *self * other;
    }
}

/// Do two times of equal value move at different speeds?
pub(crate) fn part_ways<S: Scalar>(s: S, t: S) -> bool {
    let size = s.slope().abs() + t.slope().abs();
    S::MOVES && (s.slope() - t.slope()).abs() > SAME_SPEED * size
}

/// Is the time of `event` at most `t`, or within `slack` after it and moving with it?
pub(crate) fn is_reached<S: Scalar>(event: S, t: S, slack: f64) -> bool {
    event.value() <= t.value() + slack && !part_ways(event, t)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// A rational function of one variable against its derivative by hand.
        #[test]
        fn duals_differentiate(x in 0.1..3.0_f64) {
            let variable = Dual::new(x, 1.0);
            let found = (variable * variable - Dual::from(2.0)) / (Dual::from(1.0) + variable);
            let value = (x * x - 2.0) / (1.0 + x);
            let slope = (x * x + 2.0 * x + 2.0) / ((1.0 + x) * (1.0 + x));
            prop_assert!((found.value - value).abs() < 1e-15 * 4.0);
            prop_assert!((found.slope - slope).abs() < 1e-14);
        }
    }

    #[test]
    fn events_that_part_ways_are_not_one() {
        let (still, moving) = (Dual::new(0.72, 0.0), Dual::new(0.72, 2.0));
        assert!(part_ways(still, moving));
        assert!(!is_reached(moving, still, 1e-12));
        assert!(is_reached(moving, Dual::new(0.72, 2.0 + 1e-14), 1e-12));
        assert!(is_reached(0.72_f64, 0.72 - 1e-13, 1e-12));
    }
}
