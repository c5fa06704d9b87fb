//! What can be wrong with bytes, and with what is to become bytes.

use std::fmt;

/// Something wrong, and the byte at which it is.
#[derive(Debug, Clone, PartialEq)]
pub struct Error {
    /// What is wrong, with the value.
    pub fault: Fault,
    /// Offset from the first byte of what was read, or of what would have been written.
    pub offset: usize,
}

/// What is wrong.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Fault {
    /// The bytes end before what has to be there.
    Short {
        /// How many bytes are there.
        length: usize,
        /// How many it takes at least.
        needed: usize,
    },
    /// A size that is not the one this format has.
    Length {
        /// How many bytes are there.
        length: usize,
        /// How many there have to be.
        wanted: usize,
    },
    /// More bytes than one packet may hold.
    Long {
        /// How many bytes there are.
        length: usize,
        /// How many there may be.
        limit: usize,
    },
    /// The first four bytes are those of no known format.
    Header(u32),
    /// An option of navdata that is smaller than its own head, or that ends beyond the packet.
    OptionSize {
        /// Which option.
        tag: u16,
        /// The size it gives itself.
        size: usize,
        /// The bytes left from its head to the end of the packet.
        left: usize,
    },
    /// Navdata without a checksum as its last option.
    NoChecksum,
    /// The checksum is another one than that of the bytes before it.
    Checksum {
        /// What the packet says.
        stated: u32,
        /// The sum of its bytes.
        summed: u32,
    },
    /// A tag that navdata options cannot have: it is that of the checksum.
    Tag(u16),
    /// A number that has to be finite and is not.
    NotFinite {
        /// What it is called.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// A number outside of what its place on the wire can hold or may say.
    Range {
        /// What it is called.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// A sign that cannot stand in this text.
    Sign {
        /// What the text is called.
        name: &'static str,
        /// The byte.
        byte: u8,
    },
    /// A name that is no name, or that of a command which has a type of its own.
    Name(String),
    /// Bytes that are no UTF-8 text.
    Text,
    /// A line of the configuration without "section:key = value".
    Line,
    /// A key of the configuration that is given twice, with two values.
    Twice(String),
    /// The configuration does not end with a NUL byte.
    NoEnd,
    /// Bytes after the end of the configuration.
    AfterEnd,
}

impl Fault {
    /// This fault, found at `offset`.
    pub(crate) const fn at(self, offset: usize) -> Error {
        Error {
            fault: self,
            offset,
        }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Fault::Short { length, needed } => {
                write!(f, "{length} bytes, of which it takes {needed} at least")?;
            }
            Fault::Length { length, wanted } => {
                write!(f, "{length} bytes in place of {wanted}")?;
            }
            Fault::Long { length, limit } => {
                write!(f, "{length} bytes, of which there may be {limit} at most")?;
            }
            Fault::Header(found) => write!(f, "0x{found:08x} is the header of no known format")?,
            Fault::OptionSize { tag, size, left } => write!(
                f,
                "the option of tag {tag} says that it has {size} bytes: 4 at least and {left} at \
                 most are possible"
            )?,
            Fault::NoChecksum => f.write_str("the last option is no checksum")?,
            Fault::Checksum { stated, summed } => write!(
                f,
                "the checksum is {stated}, but the bytes before it sum to {summed}"
            )?,
            Fault::Tag(tag) => write!(f, "the tag {tag} is that of the checksum alone")?,
            Fault::NotFinite { name, value } => {
                write!(f, "{name}={value}: give a finite number")?;
            }
            Fault::Range { name, value } => write!(f, "{name}={value} is out of its range")?,
            Fault::Sign { name, byte } => {
                write!(
                    f,
                    "{name} holds the byte 0x{byte:02x}, which has no place in it"
                )?;
            }
            Fault::Name(name) => write!(f, "\"{name}\" is no name of another command")?,
            Fault::Text => f.write_str("these bytes are no UTF-8 text")?,
            Fault::Line => f.write_str("a line that is not of the form \"section:key = value\"")?,
            Fault::Twice(key) => write!(f, "the key {key} has two different values")?,
            Fault::NoEnd => f.write_str("there is no NUL byte that ends the configuration")?,
            Fault::AfterEnd => f.write_str("bytes after the NUL that ends the configuration")?,
        }
        Ok(())
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}, at byte {}", self.fault, self.offset)
    }
}

impl std::error::Error for Fault {}

impl std::error::Error for Error {}
