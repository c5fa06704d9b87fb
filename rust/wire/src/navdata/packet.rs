//! A packet: its head, its options one after the other, its checksum.

use super::option::{Known, Layout, Value};
use super::table::LAYOUTS;
use crate::bytes::{u16_at, u32_at};
use crate::error::{Error, Fault};

/// The first word of a packet.
const HEADER: u32 = 0x5566_7788;
/// The first word of a packet of another firmware.
const OTHER_HEADER: u32 = 0x5566_7789;
/// Tag of the checksum.
const CHECKSUM: u16 = 0xffff;
/// Bytes before the first option.
const HEAD: usize = 16;
/// Bytes of the checksum with its tag and size.
const LAST: usize = 8;
/// The most bytes of a packet, several times those of a full one: it bounds the work for one.
pub const LIMIT: usize = 8192;

/// The words before the options.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Head {
    /// 0x55667788, of some firmwares 0x55667789.
    pub header: u32,
    /// 32 bits of state.
    pub state: u32,
    /// Number of the packet, counted from 1 after a connection.
    pub sequence: u32,
    /// Whether the camera's evaluation is there.
    pub vision: u32,
}

impl Default for Head {
    fn default() -> Self {
        Self {
            header: HEADER,
            state: 0,
            sequence: 1,
            vision: 0,
        }
    }
}

/// An option of a packet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OptionView<'a> {
    /// What it is.
    pub tag: u16,
    /// Its bytes, without tag and size.
    pub bytes: &'a [u8],
}

impl OptionView<'_> {
    /// How its fields are read, where they are known.
    pub fn layout(&self) -> Option<&'static Layout> {
        LAYOUTS.iter().find(|layout| layout.tag == self.tag)
    }

    /// The values of its fields, where they are known and all there.
    pub fn values(&self) -> Option<Vec<Value>> {
        self.layout()?.read(self.bytes)
    }
}

/// What was read of a packet; the bytes stay where they are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Packet<'a> {
    /// The words before the options.
    pub head: Head,
    /// The options in their order, without the checksum.
    pub options: Vec<OptionView<'a>>,
    /// Whether the checksum is that of the bytes.
    pub checksum_matches: bool,
}

impl Packet<'_> {
    /// The fields of the first option of this kind, where it is there and long enough.
    pub fn option<K: Known>(&self) -> Option<K> {
        let option = self
            .options
            .iter()
            .find(|option| option.tag == K::LAYOUT.tag)?;
        K::read(option.bytes)
    }
}

/// Reads a packet.
///
/// With `verify` a checksum that does not match is an error; without, it is reported in the result.
///
/// # Errors
///
/// More than [`LIMIT`] bytes, an unknown header, an option smaller than its own head or ending
/// beyond the packet, and a checksum that is missing or not the last option.
///
/// ```
/// use deadtime_wire::navdata;
///
/// let bootstrap = [
///     0x88, 0x77, 0x66, 0x55, 0x10, 0x0c, 0x80, 0x4f, 1, 0, 0, 0, 0, 0, 0, 0, 0xff, 0xff, 8, 0,
///     0xa6, 2, 0, 0,
/// ];
/// let packet = navdata::read(&bootstrap, true)?;
/// assert_eq!(packet.head.state >> 11 & 1, 1);
/// assert!(packet.options.is_empty());
/// # Ok::<(), deadtime_wire::Error>(())
/// ```
pub fn read(packet: &[u8], verify: bool) -> Result<Packet<'_>, Error> {
    let length = packet.len();
    if length > LIMIT {
        let limit = LIMIT;
        return Err(Fault::Long { length, limit }.at(limit));
    }
    let short = Fault::Short {
        length,
        needed: HEAD + LAST,
    };
    let (Some(header), Some(state), Some(sequence), Some(vision)) = (
        u32_at(packet, 0),
        u32_at(packet, 4),
        u32_at(packet, 8),
        u32_at(packet, 12),
    ) else {
        return Err(short.at(length));
    };
    if header != HEADER && header != OTHER_HEADER {
        return Err(Fault::Header(header).at(0));
    }
    let mut options = Vec::with_capacity(32);
    let mut at = HEAD;
    loop {
        let (Some(tag), Some(size)) = (u16_at(packet, at), u16_at(packet, at + 2)) else {
            return Err(Fault::NoChecksum.at(at));
        };
        let size = usize::from(size);
        let wrong = Fault::OptionSize {
            tag,
            size,
            left: length - at,
        };
        // A size below that of its own head would be the same option for ever.
        let Some(bytes) = size
            .checked_sub(4)
            .and_then(|_| packet.get(at + 4..at + size))
        else {
            return Err(wrong.at(at));
        };
        if tag != CHECKSUM {
            options.push(OptionView { tag, bytes });
            at += size;
            continue;
        }
        let Some(stated) = u32_at(bytes, 0).filter(|_| size == LAST && at + size == length) else {
            return Err(Fault::NoChecksum.at(at));
        };
        let summed = sum(packet.get(..at).unwrap_or_default());
        if verify && stated != summed {
            return Err(Fault::Checksum { stated, summed }.at(at + 4));
        }
        let head = Head {
            header,
            state,
            sequence,
            vision,
        };
        return Ok(Packet {
            head,
            options,
            checksum_matches: stated == summed,
        });
    }
}

/// Writes a packet: the head, the options in their order, the checksum.
///
/// # Errors
///
/// A header that no reader takes, an option with the checksum's tag, or more than [`LIMIT`] bytes.
pub fn write(head: &Head, options: &[OptionView<'_>]) -> Result<Vec<u8>, Error> {
    if head.header != HEADER && head.header != OTHER_HEADER {
        return Err(Fault::Header(head.header).at(0));
    }
    let length = options
        .iter()
        .map(|option| option.bytes.len() + 4)
        .sum::<usize>()
        + HEAD
        + LAST;
    if length > LIMIT {
        let limit = LIMIT;
        return Err(Fault::Long { length, limit }.at(limit));
    }
    let mut packet = Vec::with_capacity(length);
    for word in [head.header, head.state, head.sequence, head.vision] {
        packet.extend_from_slice(&word.to_le_bytes());
    }
    for option in options {
        if option.tag == CHECKSUM {
            return Err(Fault::Tag(option.tag).at(packet.len()));
        }
        packet.extend_from_slice(&option.tag.to_le_bytes());
        // No longer than the packet, whose length 16 bits hold.
        packet.extend_from_slice(&((option.bytes.len() + 4) as u16).to_le_bytes());
        packet.extend_from_slice(option.bytes);
    }
    let summed = sum(&packet);
    packet.extend_from_slice(&CHECKSUM.to_le_bytes());
    packet.extend_from_slice(&(LAST as u16).to_le_bytes());
    packet.extend_from_slice(&summed.to_le_bytes());
    Ok(packet)
}

/// The sum of the bytes; no packet is long enough to overflow it.
fn sum(bytes: &[u8]) -> u32 {
    bytes.iter().map(|&byte| u32::from(byte)).sum()
}
