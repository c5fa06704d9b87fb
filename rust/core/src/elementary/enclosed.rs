//! Functions of one number over an interval, enclosed: Taylor models (Makino & Berz 2003,
//! International Journal of Pure and Applied Mathematics 4).
//!
//! With t in [−1, 1] across the interval, f(t) = c + d₁ t + … + d_N t^N + e(t), |e| ≤ r. Sums and
//! products are those of polynomials; powers beyond N and all rounding errors become part of r. c is
//! a double-double, so that what cancels in it leaves digits. With u = 2⁻⁵³, A = |c| and B = Σ |d_k|,
//!
//! * a sum adds u (B + B′) + 4u² (A + A′) to r, and
//! * a product u (N + 3) (A B′ + B A′ + B B′) + 8u² A A′, the products of powers beyond N, and
//!   (A + B) r′ + (A′ + B′) r + r r′.
//!
//! A quotient is the product with q ≈ 1/x: where x q = 1 + E and |E| ≤ e < 1, 1/x is within
//! |q| e/(1 − e) of q.

use std::ops::{Add, Div, Mul, Neg, Sub};

use super::double_double::DoubleDouble;

/// N: a higher order gives wider intervals and takes longer.
pub const ORDER: usize = 4;

/// u and u².
const UNIT: f64 = 0.5 * f64::EPSILON;
const SQUARE: f64 = UNIT * UNIT;

/// Covers the rounding of bounds.
const ROOM: f64 = 1.0 + 64.0 * f64::EPSILON;

/// A function over an interval.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Enclosed {
    /// c.
    pub center: DoubleDouble,
    /// d₁, …, d_N.
    pub slopes: [f64; ORDER],
    /// r.
    pub radius: f64,
}

impl Enclosed {
    /// The number that goes from `low` to `high` itself, and a few units of rounding beyond.
    pub fn between(low: f64, high: f64) -> Self {
        let center = 0.5 * (low + high);
        let beyond = 8.0 * f64::EPSILON * low.abs().max(high.abs());
        let mut slopes = [0.0; ORDER];
        slopes[0] = (high - center).max(center - low) + beyond;
        Self {
            center: center.into(),
            slopes,
            radius: 0.0,
        }
    }

    /// The value in the middle, rounded.
    pub fn near(self) -> f64 {
        self.center.high
    }

    /// A bound on the modulus.
    pub fn size(self) -> f64 {
        (self.center.high.abs() + self.spread() + self.radius) * ROOM
    }

    /// The same with an error of this size more.
    #[must_use]
    pub fn blurred(self, error: f64) -> Self {
        Self {
            radius: self.radius + error,
            ..self
        }
    }

    /// Times a power of two, exactly.
    #[must_use]
    pub fn scaled(self, power: f64) -> Self {
        Self {
            center: self.center.scaled(power),
            slopes: self.slopes.map(|slope| slope * power),
            radius: self.radius * power,
        }
    }

    /// Divided by a double.
    #[must_use]
    pub fn over(self, divisor: f64) -> Self {
        let rounding = UNIT * self.spread() + 4.0 * SQUARE * self.center.high.abs();
        Self {
            center: self.center.over(divisor),
            slopes: self.slopes.map(|slope| slope / divisor),
            radius: (self.radius + rounding) / divisor.abs() * ROOM,
        }
    }

    /// Σ |d_k|.
    fn spread(self) -> f64 {
        self.slopes.iter().map(|slope| slope.abs()).sum()
    }

    /// 1/x; unbounded where x may be zero.
    fn inverse(self) -> Self {
        let first = DoubleDouble::ONE.over(self.center.high);
        // A step of Newton's iteration.
        let center = first + first * (DoubleDouble::ONE - self.center * first);
        let mut found = Self {
            center,
            ..Self::default()
        };
        for k in 0..ORDER {
            let sum: f64 = (0..k)
                .map(|i| self.slopes[i] * found.slopes[k - 1 - i])
                .sum();
            found.slopes[k] = -(self.slopes[k] * center.high + sum) * center.high;
        }
        let off = (self * found - Self::from(1.0)).size();
        found.radius = if off < 1.0 {
            found.size() * off / (1.0 - off) * ROOM
        } else {
            f64::INFINITY
        };
        found
    }
}

impl From<f64> for Enclosed {
    fn from(number: f64) -> Self {
        Self {
            center: number.into(),
            ..Self::default()
        }
    }
}

impl Neg for Enclosed {
    type Output = Self;

    fn neg(self) -> Self {
        Self {
            center: -self.center,
            slopes: self.slopes.map(|slope| -slope),
            radius: self.radius,
        }
    }
}

impl Add for Enclosed {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        let sizes = self.center.high.abs() + other.center.high.abs();
        let rounding = UNIT * (self.spread() + other.spread()) + 4.0 * SQUARE * sizes;
        Self {
            center: self.center + other.center,
            slopes: std::array::from_fn(|k| self.slopes[k] + other.slopes[k]),
            radius: (self.radius + other.radius + rounding) * ROOM,
        }
    }
}

impl Sub for Enclosed {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for Enclosed {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        let (c, c_other) = (self.center.high, other.center.high);
        let (size, size_other) = (c.abs(), c_other.abs());
        let (spread, spread_other) = (self.spread(), other.spread());
        let mut slopes = [0.0; ORDER];
        let mut beyond = 0.0;
        for k in 0..ORDER {
            slopes[k] += c * other.slopes[k] + self.slopes[k] * c_other;
            for l in 0..ORDER - 1 - k {
                slopes[k + l + 1] += self.slopes[k] * other.slopes[l];
            }
            let rest = &other.slopes[ORDER - 1 - k..];
            beyond += self.slopes[k].abs() * rest.iter().map(|d| d.abs()).sum::<f64>();
        }
        let moving = size * spread_other + spread * size_other + spread * spread_other;
        let rounding = UNIT * (ORDER + 3) as f64 * moving + 8.0 * SQUARE * size * size_other;
        let errors = (size + spread) * other.radius
            + (size_other + spread_other) * self.radius
            + self.radius * other.radius;
        Self {
            center: self.center * other.center,
            slopes,
            radius: (beyond + errors + rounding) * ROOM,
        }
    }
}

impl Div for Enclosed {
    type Output = Self;

    #[expect(
        clippy::suspicious_arithmetic_impl,
        reason = "a quotient is a product with 1/x"
    )]
    fn div(self, other: Self) -> Self {
        self * other.inverse()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn value(x: Enclosed, t: f64) -> f64 {
        let slopes = x.slopes.iter().rev().fold(0.0, |sum, d| (sum + d) * t);
        x.center.high + slopes
    }

    proptest! {
        #[test]
        fn results_are_enclosed(
            low in 0.1..3.0_f64, width in 1e-9..2.0_f64, other in -2.0..2.0_f64, t in -1.0..1.0_f64
        ) {
            let x = Enclosed::between(low, low + width);
            let at = value(x, t);
            let made = (x * x - Enclosed::from(other)) / (x + Enclosed::from(0.5)) * x;
            let exact = (at * at - other) / (at + 0.5) * at;
            prop_assert!((value(made, t) - exact).abs() <= made.radius + 1e-13 * (1.0 + exact.abs()));
        }

        #[test]
        fn the_error_falls_with_the_order(low in 0.5..3.0_f64, other in -2.0..2.0_f64) {
            let error = |width: f64| {
                let x = Enclosed::between(low, low + width);
                (Enclosed::from(other) / (x * x + Enclosed::from(1.0))).radius
            };
            prop_assert!(error(0.01) <= 1e-4 * error(0.1) + 1e-14);
        }
    }

    #[test]
    fn nothing_is_known_of_a_quotient_by_what_may_be_zero() {
        let x = Enclosed::between(-0.1, 1.0);
        assert!(!(Enclosed::from(1.0) / x).radius.is_finite());
    }
}
