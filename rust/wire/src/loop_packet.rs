//! Packets between the plant and the controller of a loop over UDP.
//!
//! | offset | type | field |
//! |---|---|---|
//! | 0 | 4 bytes | `DTL1` |
//! | 4 | u32 | flags |
//! | 8, 12 | u32 | sequence; sequence of the packet that is answered, 0 for none |
//! | 16, 24 | f64 | when this one was sent, s; when the answered one was, s of its sender's clock |
//! | 32 | f64 | between receiving the one that is answered and sending this one, s |
//! | 40, 48 | f64 | value, reference |
//!
//! Little-endian, 56 bytes. An end without this header sends bare doubles instead.

use crate::bytes::{array, f64_at, u32_at};
use crate::error::{Error, Fault};

/// The first four bytes.
const HEADER: [u8; 4] = *b"DTL1";
/// Bytes of a packet.
pub const LENGTH: usize = 56;

/// One packet; all its numbers are finite.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LoopPacket {
    /// Bits with a meaning that the two ends agree upon.
    pub flags: u32,
    /// Number of the packet, counted from 1.
    pub sequence: u32,
    /// Number of the packet that this one answers, 0 for none.
    pub echo_sequence: u32,
    /// Time of sending, in s of its sender's clock.
    pub sent: f64,
    /// Time at which the answered packet was sent, in s of its sender's clock.
    pub echo_sent: f64,
    /// Time between receiving the answered one and sending this one, s, not negative.
    pub held: f64,
    /// The output or the command.
    pub value: f64,
    /// The reference.
    pub reference: f64,
}

impl LoopPacket {
    /// Check the conditions of every packet.
    fn check(&self) -> Result<(), Error> {
        let numbers = [
            ("sent", self.sent, 16),
            ("echo_sent", self.echo_sent, 24),
            ("held", self.held, 32),
            ("value", self.value, 40),
            ("reference", self.reference, 48),
        ];
        for (name, value, offset) in numbers {
            if !value.is_finite() {
                return Err(Fault::NotFinite { name, value }.at(offset));
            }
        }
        if self.held < 0.0 {
            let (name, value) = ("held", self.held);
            return Err(Fault::Range { name, value }.at(32));
        }
        Ok(())
    }
}

/// Reads a packet.
///
/// # Errors
///
/// Another length or header, a number that is not finite, or a negative holding time.
pub fn read(packet: &[u8]) -> Result<LoopPacket, Error> {
    let length = packet.len();
    let wrong = Fault::Length {
        length,
        wanted: LENGTH,
    };
    if length != LENGTH {
        return Err(wrong.at(length.min(LENGTH)));
    }
    let fields = || {
        let found = LoopPacket {
            flags: u32_at(packet, 4)?,
            sequence: u32_at(packet, 8)?,
            echo_sequence: u32_at(packet, 12)?,
            sent: f64_at(packet, 16)?,
            echo_sent: f64_at(packet, 24)?,
            held: f64_at(packet, 32)?,
            value: f64_at(packet, 40)?,
            reference: f64_at(packet, 48)?,
        };
        Some((array::<4>(packet, 0)?, found))
    };
    let Some((header, found)) = fields() else {
        return Err(wrong.at(length));
    };
    if header != HEADER {
        return Err(Fault::Header(u32::from_be_bytes(header)).at(0));
    }
    found.check()?;
    Ok(found)
}

/// Writes a packet.
///
/// # Errors
///
/// A number that is not finite, or a negative holding time.
///
/// ```
/// use deadtime_wire::loop_packet::{self, LoopPacket};
///
/// let packet = LoopPacket { sequence: 7, sent: 1.5, value: 0.25, ..LoopPacket::default() };
/// assert_eq!(loop_packet::read(&loop_packet::write(&packet)?)?, packet);
/// # Ok::<(), deadtime_wire::Error>(())
/// ```
pub fn write(packet: &LoopPacket) -> Result<Vec<u8>, Error> {
    packet.check()?;
    let mut bytes = Vec::with_capacity(LENGTH);
    bytes.extend_from_slice(&HEADER);
    for word in [packet.flags, packet.sequence, packet.echo_sequence] {
        bytes.extend_from_slice(&word.to_le_bytes());
    }
    for number in [
        packet.sent,
        packet.echo_sent,
        packet.held,
        packet.value,
        packet.reference,
    ] {
        bytes.extend_from_slice(&number.to_le_bytes());
    }
    Ok(bytes)
}

/// Reads exactly `count` bare doubles.
///
/// # Errors
///
/// Another number of bytes, or a number that is not finite.
pub fn read_doubles(bytes: &[u8], count: usize) -> Result<Vec<f64>, Error> {
    let (chunks, rest) = bytes.as_chunks::<8>();
    if chunks.len() != count || !rest.is_empty() {
        let (length, wanted) = (bytes.len(), count.saturating_mul(8));
        return Err(Fault::Length { length, wanted }.at(length.min(wanted)));
    }
    let values: Vec<f64> = chunks
        .iter()
        .map(|eight| f64::from_le_bytes(*eight))
        .collect();
    finite(&values)?;
    Ok(values)
}

/// Writes bare doubles.
///
/// # Errors
///
/// A number that is not finite.
pub fn write_doubles(values: &[f64]) -> Result<Vec<u8>, Error> {
    finite(values)?;
    Ok(values
        .iter()
        .flat_map(|value| value.to_le_bytes())
        .collect())
}

fn finite(values: &[f64]) -> Result<(), Error> {
    match values
        .iter()
        .enumerate()
        .find(|(_, value)| !value.is_finite())
    {
        Some((at, &value)) => {
            let name = "value";
            Err(Fault::NotFinite { name, value }.at(8 * at))
        }
        None => Ok(()),
    }
}
