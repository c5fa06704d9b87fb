//! Errors of reading and writing.

use std::fmt;

/// A fault, and the byte at which it is.
#[derive(Debug, Clone, PartialEq)]
pub struct Error {
    /// The fault, with the value.
    pub fault: Fault,
    /// Offset from the first byte of what was read, or of what would have been written.
    pub offset: usize,
}

/// What is wrong.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Fault {
    /// The bytes end too early.
    Short {
        /// Number of bytes.
        length: usize,
        /// Least number of bytes needed.
        needed: usize,
    },
    /// A size that does not belong to this format.
    Length {
        /// Number of bytes.
        length: usize,
        /// Required number of bytes.
        wanted: usize,
    },
    /// More bytes than a packet may hold.
    Long {
        /// Number of bytes.
        length: usize,
        /// Upper limit.
        limit: usize,
    },
    /// The first four bytes belong to no known format.
    Header(u32),
    /// An option of navdata that is smaller than its own head, or ends beyond the packet.
    OptionSize {
        /// Its tag.
        tag: u16,
        /// The size that it states.
        size: usize,
        /// The bytes left from its head to the end of the packet.
        left: usize,
    },
    /// Navdata without a checksum as its last option.
    NoChecksum,
    /// The checksum differs from that of the bytes before it.
    Checksum {
        /// The checksum that the packet states.
        stated: u32,
        /// The sum of its bytes.
        summed: u32,
    },
    /// A tag that is reserved for the checksum.
    Tag(u16),
    /// A number that is not finite.
    NotFinite {
        /// Its name.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// A number outside the range of its field.
    Range {
        /// Its name.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// A character that is not allowed in this text.
    Sign {
        /// Name of the text.
        name: &'static str,
        /// The byte.
        byte: u8,
    },
    /// A name that is invalid, or that of a command with a type of its own.
    Name(String),
    /// Bytes that are no UTF-8 text.
    Text,
    /// A line of the configuration without "section:key = value".
    Line,
    /// A key of the configuration that occurs twice, with two values.
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
