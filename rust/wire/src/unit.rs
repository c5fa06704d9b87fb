//! Values of a motion, as shares of a limit.

use crate::error::Fault;

/// A finite number in [-1, 1], in single precision as on the wire.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Default)]
pub struct Unit(f32);

impl Unit {
    /// No motion.
    pub const ZERO: Self = Self(0.0);

    /// The number in single precision.
    ///
    /// # Errors
    ///
    /// A number that is not finite, or lies outside of [-1, 1].
    pub fn new(value: f64) -> Result<Self, Fault> {
        if !value.is_finite() {
            return Err(Fault::NotFinite {
                name: "command",
                value,
            });
        }
        if !(-1.0..=1.0).contains(&value) {
            return Err(Fault::Range {
                name: "command",
                value,
            });
        }
        // Rounding is monotone and keeps the ends, so that it cannot leave the range.
        Ok(Self(value as f32))
    }

    /// The number with these 32 bits, clipped to [-1, 1]; `None` for NaN and the infinities.
    pub fn from_bits(bits: u32) -> Option<Self> {
        let value = f32::from_bits(bits);
        value.is_finite().then(|| Self(value.clamp(-1.0, 1.0)))
    }

    /// The 32 bits of the number.
    pub fn to_bits(self) -> u32 {
        self.0.to_bits()
    }

    /// The number.
    pub fn get(self) -> f64 {
        f64::from(self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn holds_nothing_but_finite_numbers_of_its_range() {
        for value in [f64::NAN, f64::INFINITY, -f64::INFINITY, 1.000_000_1, -2.0] {
            assert!(Unit::new(value).is_err(), "{value}");
        }
        for value in [-1.0, -0.0, 0.0, 1.0, 1.0 - f64::EPSILON, 1e-320] {
            assert!(Unit::new(value).is_ok_and(|unit| unit.get().abs() <= 1.0));
        }
    }

    #[test]
    fn bits_beyond_the_range_are_clipped_and_others_refused() {
        assert_eq!(Unit::from_bits(7.5f32.to_bits()).map(Unit::get), Some(1.0));
        assert_eq!(
            Unit::from_bits(0x8000_0000).map(Unit::to_bits),
            Some(0x8000_0000)
        );
        assert_eq!(Unit::from_bits(f32::NAN.to_bits()), None);
        assert_eq!(Unit::from_bits(f32::NEG_INFINITY.to_bits()), None);
    }
}
