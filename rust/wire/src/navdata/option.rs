//! An option of navdata: its tag, its size, its fields.

use super::field::Field;
use crate::error::{Error, Fault};

/// The value of a field of any kind.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Value {
    /// A count, a state or bits.
    Integer(i64),
    /// A quantity in SI units.
    Real(f64),
}

impl From<f64> for Value {
    fn from(value: f64) -> Self {
        Self::Real(value)
    }
}

macro_rules! integers {
    ($($kind:ident),*) => { $(
        impl From<$kind> for Value {
            fn from(value: $kind) -> Self {
                Self::Integer(i64::from(value))
            }
        }
        impl TryFrom<Value> for $kind {
            type Error = f64;
            fn try_from(value: Value) -> Result<$kind, f64> {
                match value {
                    Value::Integer(value) => $kind::try_from(value).map_err(|_| value as f64),
                    Value::Real(value) => Err(value),
                }
            }
        }
    )* };
}
integers!(u8, u16, i16, u32, i32);

impl TryFrom<Value> for f64 {
    type Error = f64;
    fn try_from(value: Value) -> Result<f64, f64> {
        Ok(value.number())
    }
}

impl Value {
    fn number(self) -> f64 {
        match self {
            Self::Integer(value) => value as f64,
            Self::Real(value) => value,
        }
    }

    /// The same value, bit by bit; all NaNs are one.
    fn is(self, other: Self) -> bool {
        let (one, two) = (self.number(), other.number());
        one.to_bits() == two.to_bits() || one.is_nan() && two.is_nan()
    }
}

/// An option whose fields are known.
pub trait Known: Sized {
    /// The tag of the option and the places of its fields.
    const LAYOUT: Layout;
    /// Reads the fields; nothing when the option is too short for them.
    fn read(option: &[u8]) -> Option<Self>;
    /// Writes the fields over the bytes of an option.
    ///
    /// # Errors
    ///
    /// Too few bytes for the fields, or a value that has no place on the wire.
    fn write(&self, option: &mut [u8]) -> Result<(), Error>;
}

/// The name of an option, and how its fields are read and written without knowing its type.
#[derive(Debug, Clone, Copy)]
pub struct Layout {
    /// The tag.
    pub tag: u16,
    /// Bytes of the option without tag and size, in the firmware with the longest one.
    pub length: usize,
    /// The name of the type.
    pub name: &'static str,
    /// What the option is.
    pub doc: &'static str,
    /// The names of the fields and what they are, in the order of the values.
    pub fields: &'static [(&'static str, &'static str)],
    pub(super) read: fn(&[u8]) -> Option<Vec<Value>>,
    pub(super) write: fn(&mut [u8], &[Value]) -> Result<(), Error>,
}

impl Layout {
    /// The values of the fields; nothing when the option is too short for them.
    pub fn read(&self, option: &[u8]) -> Option<Vec<Value>> {
        (self.read)(option)
    }

    /// Writes the values of the fields over the bytes of an option.
    ///
    /// # Errors
    ///
    /// Another number of values than of fields, too few bytes, or a value that has no place on the
    /// wire.
    pub fn write(&self, option: &mut [u8], values: &[Value]) -> Result<(), Error> {
        (self.write)(option, values)
    }
}

/// Writes one field.
///
/// Writing a value that is already stored does not change its bytes: two bit patterns may represent
/// one value (two NaNs, or 1.2 s and 0 s with 1 200 000 µs), and what was read has to be written
/// again unchanged.
pub(super) fn put<F: Field>(
    option: &mut [u8],
    at: usize,
    value: F::Value,
    name: &'static str,
) -> Result<(), Error>
where
    F::Value: Into<Value>,
{
    if option.len() < at + F::WIDTH {
        let (length, needed) = (option.len(), at + F::WIDTH);
        return Err(Fault::Short { length, needed }.at(length));
    }
    if F::get(option, at).is_some_and(|there| there.into().is(value.into())) {
        return Ok(());
    }
    F::put(option, at, value).ok_or_else(|| out_of_range(value.into(), name).at(at))
}

/// Converts a value to the type of a field.
pub(super) fn take<T: TryFrom<Value, Error = f64>>(
    value: Value,
    name: &'static str,
) -> Result<T, Error> {
    T::try_from(value).map_err(|value| out_of_range(Value::Real(value), name).at(0))
}

fn out_of_range(value: Value, name: &'static str) -> Fault {
    let value = value.number();
    if value.is_finite() {
        Fault::Range { name, value }
    } else {
        Fault::NotFinite { name, value }
    }
}

/// Declares options: a type with its tag, its size on the wire (tag and size included) and its
/// fields with their kinds and offsets, counted from the tag as the drone's headers count.
macro_rules! options {
    ($($(#[doc = $doc:literal])* $name:ident: tag $tag:literal, size $size:literal {
        $($(#[doc = $field_doc:literal])* $field:ident: $value:ident as $kind:ty = $at:literal,)*
    })*) => {
        $(
            $(#[doc = $doc])*
            #[derive(Debug, Clone, Copy, PartialEq, Default)]
            pub struct $name {
                $($(#[doc = $field_doc])* pub $field: $value,)*
            }

            impl Known for $name {
                const LAYOUT: Layout = Layout {
                    tag: $tag,
                    length: $size - 4,
                    name: stringify!($name),
                    doc: concat!($($doc),*),
                    fields: &[$((stringify!($field), concat!($($field_doc),*))),*],
                    read: |option| {
                        let known = <$name as Known>::read(option)?;
                        Some(vec![$(known.$field.into()),*])
                    },
                    write: |option, values| {
                        let mut given = values.iter().copied();
                        let mut next = || given.next().ok_or_else(|| {
                            let wanted = <$name as Known>::LAYOUT.fields.len();
                            Fault::Length { length: values.len(), wanted }.at(0)
                        });
                        let known = $name { $($field: take(next()?, stringify!($field))?,)* };
                        if given.next().is_some() {
                            let wanted = <$name as Known>::LAYOUT.fields.len();
                            return Err(Fault::Length { length: values.len(), wanted }.at(0));
                        }
                        known.write(option)
                    },
                };

                fn read(option: &[u8]) -> Option<Self> {
                    Some(Self { $($field: <$kind as Field>::get(option, $at - 4)?,)* })
                }

                fn write(&self, option: &mut [u8]) -> Result<(), Error> {
                    $(put::<$kind>(option, $at - 4, self.$field, stringify!($field))?;)*
                    Ok(())
                }
            }
        )*

        /// Every option whose fields are known, by tag.
        pub const LAYOUTS: &[Layout] = &[$(<$name as Known>::LAYOUT),*];
    };
}
pub(super) use options;
