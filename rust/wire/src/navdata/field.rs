//! Kinds of numbers inside an option, each with its unit.
//!
//! Writing a value that is already stored does not change its bytes: two bit patterns may represent
//! one value (two NaNs, or 1.2 s and 0 s with 1 200 000 µs), and what was read has to be written
//! again unchanged.

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

/// Do the bytes already hold the value to be written?
fn said(there: Option<f64>, value: f64) -> bool {
    there
        .is_some_and(|there| there.to_bits() == value.to_bits() || there.is_nan() && value.is_nan())
}

/// A single-precision number, `1 / PER` of a unit.
pub(super) struct Real<const PER: u32>;

impl<const PER: u32> Field for Real<PER> {
    type Value = f64;
    const WIDTH: usize = 4;
    fn get(bytes: &[u8], at: usize) -> Option<f64> {
        array(bytes, at).map(|four| f64::from(f32::from_le_bytes(four)) / f64::from(PER))
    }
    fn put(bytes: &mut [u8], at: usize, value: f64) -> Option<()> {
        if said(Self::get(bytes, at), value) {
            return Some(());
        }
        single(bytes, at, value * f64::from(PER))
    }
}

/// Writes a finite number that single precision can hold.
fn single(bytes: &mut [u8], at: usize, value: f64) -> Option<()> {
    let single = value as f32;
    if !single.is_finite() {
        return None;
    }
    put(bytes, at, single.to_le_bytes())
}

/// Thousandths of a degree in single precision; rad outside.
pub(super) struct Millidegrees;

impl Field for Millidegrees {
    type Value = f64;
    const WIDTH: usize = 4;
    fn get(bytes: &[u8], at: usize) -> Option<f64> {
        Real::<1000>::get(bytes, at).map(f64::to_radians)
    }
    fn put(bytes: &mut [u8], at: usize, value: f64) -> Option<()> {
        if said(Self::get(bytes, at), value) {
            return Some(());
        }
        single(bytes, at, value.to_degrees() * 1000.0)
    }
}

/// Degrees in single precision; rad outside.
pub(super) struct Degrees;

impl Field for Degrees {
    type Value = f64;
    const WIDTH: usize = 4;
    fn get(bytes: &[u8], at: usize) -> Option<f64> {
        Real::<1>::get(bytes, at).map(f64::to_radians)
    }
    fn put(bytes: &mut [u8], at: usize, value: f64) -> Option<()> {
        if said(Self::get(bytes, at), value) {
            return Some(());
        }
        single(bytes, at, value.to_degrees())
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
        if said(Self::get(bytes, at), value) {
            return Some(());
        }
        if !value.is_finite() || value < 0.0 {
            return None;
        }
        let micros = (value.rem_euclid(2048.0) * 1e6).round() as u64 % 2_048_000_000;
        let word = ((micros / 1_000_000) << 21) | (micros % 1_000_000);
        u32::put(bytes, at, word as u32)
    }
}
