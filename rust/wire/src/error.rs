//! Errors of reading and writing.

/// A fault, and the byte at which it is.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{fault}, at byte {offset}")]
pub struct Error {
    /// The fault, with the value.
    pub fault: Fault,
    /// Offset from the first byte of what was read, or of what would have been written.
    pub offset: usize,
}

/// What is wrong.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Fault {
    /// The bytes end too early.
    #[error("{length} bytes are too few, because {needed} are needed")]
    Short {
        /// Number of bytes.
        length: usize,
        /// Least number of bytes needed.
        needed: usize,
    },
    /// A size that does not belong to this format.
    #[error("{length} bytes instead of {wanted}")]
    Length {
        /// Number of bytes.
        length: usize,
        /// Required number of bytes.
        wanted: usize,
    },
    /// More bytes than a packet may hold.
    #[error("{length} bytes are too many, because at most {limit} are allowed")]
    Long {
        /// Number of bytes.
        length: usize,
        /// Upper limit.
        limit: usize,
    },
    /// The first four bytes belong to no known format.
    #[error("the header 0x{0:08x} does not belong to a known format")]
    Header(u32),
    /// An option of navdata that is smaller than its own head, or ends beyond the packet.
    #[error(
        "the option of tag {tag} has a stated size of {size} bytes, but only 4 to {left} are \
         possible"
    )]
    OptionSize {
        /// Its tag.
        tag: u16,
        /// The size that it states.
        size: usize,
        /// The bytes left from its head to the end of the packet.
        left: usize,
    },
    /// Navdata without a checksum as its last option.
    #[error("the last option is not a checksum")]
    NoChecksum,
    /// The checksum differs from that of the bytes before it.
    #[error("the checksum is {stated}, but the bytes before it sum to {summed}")]
    Checksum {
        /// The checksum that the packet states.
        stated: u32,
        /// The sum of its bytes.
        summed: u32,
    },
    /// A tag that is reserved for the checksum.
    #[error("the tag {0} may be used only for the checksum")]
    Tag(u16),
    /// A number that is not finite.
    #[error("{name}={value}: give a finite number")]
    NotFinite {
        /// Its name.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// A number outside the range of its field.
    #[error("{name}={value} is outside of its range")]
    Range {
        /// Its name.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// A character that is not allowed in this text.
    #[error("{name} contains the byte 0x{byte:02x}, which is not allowed there")]
    Sign {
        /// Name of the text.
        name: &'static str,
        /// The byte.
        byte: u8,
    },
    /// A name that is invalid, or that of a command with a type of its own.
    #[error("\"{0}\" is not the name of a command")]
    Name(String),
    /// Bytes that are no UTF-8 text.
    #[error("the bytes are not UTF-8 text")]
    Text,
    /// A line of the configuration without "section:key = value".
    #[error("a line does not have the form \"section:key = value\"")]
    Line,
    /// A key of the configuration that occurs twice, with two values.
    #[error("the key {0} has two different values")]
    Twice(String),
    /// The configuration does not end with a NUL byte.
    #[error("the NUL byte at the end of the configuration is missing")]
    NoEnd,
    /// Bytes after the end of the configuration.
    #[error("there are bytes after the NUL byte that ends the configuration")]
    AfterEnd,
    /// A field of a flight log with an encoding or a predictor that is not known.
    #[error("the {name} {code} of a field is not known")]
    Code {
        /// Which of the two.
        name: &'static str,
        /// Its number in the log.
        code: u8,
    },
    /// Fields of a flight log that are encoded together, but are not as many as it takes.
    #[error("{run} fields have an encoding for groups of {group} fields")]
    Group {
        /// Number of fields.
        run: usize,
        /// Number of fields that the encoding takes.
        group: usize,
    },
    /// Few bytes that decode to more values than any flight.
    #[error(
        "the frames decode to more than {limit} values, which is too many for so few bytes of a \
         flight"
    )]
    Values {
        /// Upper limit.
        limit: usize,
    },
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
