//! Kinds of numbers inside an option, each with its unit.

use crate::bytes::{array, put};

/// A number with a unit, at an offset.
pub(super) trait Field {
    /// Type of the number outside the packet.
    type Value: Copy;
    /// Bytes it takes.
    const WIDTH: usize;
    /// Reads it.
    fn get(bytes: &[u8], at: usize) -> Option<Self::Value>;
    /// Writes it; fails where the field cannot represent it.
    fn put(bytes: &mut [u8], at: usize, value: Self::Value) -> Option<()>;
}

macro_rules! whole {
    ($($kind:ident),*) => { $(
        impl Field for $kind {
            type Value = $kind;
            const WIDTH: usize = size_of::<$kind>();
            fn get(bytes: &[u8], at: usize) -> Option<$kind> {
                array(bytes, at).map($kind::from_le_bytes)
            }
            fn put(bytes: &mut [u8], at: usize, value: $kind) -> Option<()> {
                put(bytes, at, value.to_le_bytes())
            }
        }
    )* };
}
whole!(u8, u16, i16, u32, i32);

/// A single-precision number, `1 / PER` of a unit.
pub(super) struct Real<const PER: u32>;

impl<const PER: u32> Field for Real<PER> {
    type Value = f64;
    const WIDTH: usize = 4;
    fn get(bytes: &[u8], at: usize) -> Option<f64> {
        array(bytes, at).map(|four| f64::from(f32::from_le_bytes(four)) / f64::from(PER))
    }
    fn put(bytes: &mut [u8], at: usize, value: f64) -> Option<()> {
        let single = (value * f64::from(PER)) as f32;
        if !single.is_finite() {
            return None;
        }
        put(bytes, at, single.to_le_bytes())
    }
}

/// An angle in single precision, `1 / PER` of a degree; rad outside.
pub(super) struct Degrees<const PER: u32>;

impl<const PER: u32> Field for Degrees<PER> {
    type Value = f64;
    const WIDTH: usize = 4;
    fn get(bytes: &[u8], at: usize) -> Option<f64> {
        Real::<PER>::get(bytes, at).map(f64::to_radians)
    }
    fn put(bytes: &mut [u8], at: usize, value: f64) -> Option<()> {
        Real::<PER>::put(bytes, at, value.to_degrees())
    }
}

/// Thousandths of a unit as a signed integer.
pub(super) struct Thousandths;

impl Field for Thousandths {
    type Value = f64;
    const WIDTH: usize = 4;
    fn get(bytes: &[u8], at: usize) -> Option<f64> {
        i32::get(bytes, at).map(|count| f64::from(count) / 1000.0)
    }
    fn put(bytes: &mut [u8], at: usize, value: f64) -> Option<()> {
        let count = (value * 1000.0).round();
        if !(f64::from(i32::MIN)..=f64::from(i32::MAX)).contains(&count) {
            return None;
        }
        i32::put(bytes, at, count as i32)
    }
}

/// A clock: 11 bits of seconds, then 21 of microseconds. It starts again after 2048 s.
pub(super) struct Ticks;

impl Field for Ticks {
    type Value = f64;
    const WIDTH: usize = 4;
    fn get(bytes: &[u8], at: usize) -> Option<f64> {
        let word = u32::get(bytes, at)?;
        Some(f64::from(word >> 21) + f64::from(word & 0x001f_ffff) * 1e-6)
    }
    fn put(bytes: &mut [u8], at: usize, value: f64) -> Option<()> {
        if !value.is_finite() || value < 0.0 {
            return None;
        }
        let micros = (value.rem_euclid(2048.0) * 1e6).round() as u64 % 2_048_000_000;
        let word = ((micros / 1_000_000) << 21) | (micros % 1_000_000);
        u32::put(bytes, at, word as u32)
    }
}
