//! How values are packed into bytes.

/// How a value, or a group of values, is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Encoding {
    /// Zigzag, then as [`Encoding::Unsigned`].
    Signed,
    /// Seven bits a byte, the least first; the top bit says that more follow.
    Unsigned,
    /// The negative of an unsigned value's low 14 bits, which have a sign.
    Negative14,
    /// Up to eight signed values, of which a first byte says which are not zero.
    Tagged8,
    /// Three values of 2, 4 or 6 bits, or of whole bytes each.
    Tagged3,
    /// Four values of 0, 4, 8 or 16 bits each.
    Tagged4,
    /// Nothing: the value is zero.
    Null,
    /// Three values of 2 bits; of 5, 5 and 4; of 8, 7 and 7; or of whole bytes each.
    Tagged3Variable,
}

impl Encoding {
    pub(crate) const fn of(code: u8) -> Option<Self> {
        Some(match code {
            0 => Self::Signed,
            1 => Self::Unsigned,
            3 => Self::Negative14,
            6 => Self::Tagged8,
            7 => Self::Tagged3,
            8 => Self::Tagged4,
            9 => Self::Null,
            10 => Self::Tagged3Variable,
            _ => return None,
        })
    }

    /// The number of values in a group, where `run` fields with this encoding follow each other.
    pub(crate) fn group(self, run: usize) -> usize {
        match self {
            Self::Tagged8 => run.min(8),
            Self::Tagged3 | Self::Tagged3Variable => 3,
            Self::Tagged4 => 4,
            _ => 1,
        }
    }
}

/// The low `bits` of a number, with a sign.
const fn extended(value: u32, bits: u32) -> i32 {
    let empty = 32 - bits;
    (value << empty) as i32 >> empty
}

/// Bytes, read from the first to the last; `None` where they end.
#[derive(Debug, Clone)]
pub(crate) struct Bytes<'a> {
    pub(crate) data: &'a [u8],
    pub(crate) at: usize,
}

impl Bytes<'_> {
    pub(crate) fn byte(&mut self) -> Option<u8> {
        let byte = *self.data.get(self.at)?;
        self.at += 1;
        Some(byte)
    }

    /// A byte, as a wider number.
    fn wide(&mut self) -> Option<u32> {
        self.byte().map(u32::from)
    }

    pub(crate) fn unsigned(&mut self) -> Option<u32> {
        let mut value = 0;
        for shift in [0, 7, 14, 21, 28] {
            let byte = self.wide()?;
            value |= (byte & 0x7f) << shift;
            if byte < 0x80 {
                return Some(value);
            }
        }
        None
    }

    pub(crate) fn signed(&mut self) -> Option<i32> {
        let value = self.unsigned()?;
        Some((value >> 1) as i32 ^ -((value & 1) as i32))
    }

    /// A group of values of one encoding.
    pub(crate) fn group(&mut self, encoding: Encoding, values: &mut [i32]) -> Option<()> {
        match encoding {
            Encoding::Signed => fill(values, || self.signed()),
            Encoding::Unsigned => fill(values, || self.unsigned().map(|value| value as i32)),
            Encoding::Negative14 => fill(values, || {
                self.unsigned()
                    .map(|value| extended(value, 14).wrapping_neg())
            }),
            Encoding::Null => fill(values, || Some(0)),
            Encoding::Tagged8 => self.tagged8(values),
            Encoding::Tagged4 => self.tagged4(values),
            Encoding::Tagged3 => self.tagged3(values, false),
            Encoding::Tagged3Variable => self.tagged3(values, true),
        }
    }

    fn tagged8(&mut self, values: &mut [i32]) -> Option<()> {
        // A single field has no first byte.
        let mut tags = if values.len() == 1 { 1 } else { self.byte()? };
        fill(values, || {
            let tag = tags & 1;
            tags >>= 1;
            if tag == 1 { self.signed() } else { Some(0) }
        })
    }

    /// Half bytes, the high one first; a value may begin in the middle of a byte.
    fn tagged4(&mut self, values: &mut [i32]) -> Option<()> {
        let mut tags = self.byte()?;
        let mut half: Option<u32> = None;
        fill(values, || {
            let tag = tags & 3;
            tags >>= 2;
            let mut value = 0;
            for _ in 0..[0, 1, 2, 4].get(usize::from(tag)).copied()? {
                let next = match half.take() {
                    Some(low) => low,
                    None => {
                        let byte = self.wide()?;
                        half = Some(byte & 15);
                        byte >> 4
                    }
                };
                value = value << 4 | next;
            }
            Some(match tag {
                0 => 0,
                1 => extended(value, 4),
                2 => extended(value, 8),
                _ => extended(value, 16),
            })
        })
    }

    fn tagged3(&mut self, values: &mut [i32], variable: bool) -> Option<()> {
        let lead = self.wide()?;
        let three = match (lead >> 6, variable) {
            (0, _) => [
                extended(lead >> 4, 2),
                extended(lead >> 2, 2),
                extended(lead, 2),
            ],
            (1, false) => {
                let next = self.wide()?;
                [extended(lead, 4), extended(next >> 4, 4), extended(next, 4)]
            }
            (2, false) => [
                extended(lead, 6),
                extended(self.wide()?, 6),
                extended(self.wide()?, 6),
            ],
            (1, true) => {
                let bits = lead << 8 | self.wide()?;
                [
                    extended(bits >> 9, 5),
                    extended(bits >> 4, 5),
                    extended(bits, 4),
                ]
            }
            (2, true) => {
                let bits = lead << 16 | self.wide()? << 8 | self.wide()?;
                [
                    extended(bits >> 14, 8),
                    extended(bits >> 7, 7),
                    extended(bits, 7),
                ]
            }
            _ => {
                let mut three = [0; 3];
                for (place, shift) in three.iter_mut().zip([0, 2, 4]) {
                    let bytes = (lead >> shift & 3) + 1;
                    let mut value = 0;
                    for number in 0..bytes {
                        value |= self.wide()? << (8 * number);
                    }
                    *place = extended(value, 8 * bytes);
                }
                three
            }
        };
        for (place, value) in values.iter_mut().zip(three) {
            *place = value;
        }
        Some(())
    }
}

/// Sets every value to the next one.
fn fill(values: &mut [i32], mut next: impl FnMut() -> Option<i32>) -> Option<()> {
    for value in values {
        *value = next()?;
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read<const N: usize>(code: u8, bytes: &[u8]) -> Option<([i32; N], usize)> {
        let mut bytes = Bytes { data: bytes, at: 0 };
        let mut values = [0; N];
        bytes.group(Encoding::of(code)?, &mut values)?;
        Some((values, bytes.at))
    }

    #[test]
    fn single_values() {
        assert_eq!(read(0, &[0x7f]), Some(([-64], 1)));
        assert_eq!(
            read(0, &[0xff, 0xff, 0xff, 0xff, 0x0f]),
            Some(([i32::MIN], 5))
        );
        assert_eq!(read(1, &[0xac, 0x02]), Some(([300], 2)));
        assert_eq!(read(3, &[0x05]), Some(([-5], 1)));
        assert_eq!(read(3, &[0xff, 0x7f]), Some(([1], 2)));
        assert_eq!(read(9, &[]), Some(([0], 0)));
        // Longer than 32 bits take, and cut off.
        assert_eq!(read::<1>(1, &[0x80, 0x80, 0x80, 0x80, 0x80, 0]), None);
        assert_eq!(read::<1>(1, &[0x80]), None);
    }

    #[test]
    fn groups_of_up_to_eight() {
        assert_eq!(read(6, &[0b101, 2, 3]), Some(([1, 0, -2], 3)));
        assert_eq!(read(6, &[2]), Some(([1], 1)));
        assert_eq!(read::<3>(6, &[0b101, 2]), None);
    }

    #[test]
    fn groups_of_three() {
        assert_eq!(read(7, &[0b00_01_10_11]), Some(([1, -2, -1], 1)));
        assert_eq!(read(7, &[0b0100_0111, 0x8f]), Some(([7, -8, -1], 2)));
        assert_eq!(read(7, &[0b1010_0000, 31, 0x3f]), Some(([-32, 31, -1], 3)));
        let bytes = [0b1110_0100, 0x80, 0x00, 0x80, 0xff, 0xff, 0x7f];
        assert_eq!(read(7, &bytes), Some(([-128, -32768, 0x7f_ffff], 7)));
        let bytes = [0b1100_0011, 0, 0, 0, 0x80, 1, 2];
        assert_eq!(read(7, &bytes), Some(([i32::MIN, 1, 2], 7)));
    }

    #[test]
    fn groups_of_three_of_variable_length() {
        assert_eq!(read(10, &[0b00_01_10_11]), Some(([1, -2, -1], 1)));
        // 5, 5 and 4 bits: 10000 01111 1000.
        assert_eq!(
            read(10, &[0b0110_0000, 0b1111_1000]),
            Some(([-16, 15, -8], 2))
        );
        // 8, 7 and 7 bits: 10000000 0111111 1000000.
        let bytes = [0b1010_0000, 0b0001_1111, 0b1100_0000];
        assert_eq!(read(10, &bytes), Some(([-128, 63, -64], 3)));
    }

    #[test]
    fn groups_of_four() {
        assert_eq!(read(8, &[0]), Some(([0; 4], 1)));
        // 4, 8, 16 and 4 bits, so that two begin in the middle of a byte.
        let bytes = [0b01_11_10_01, 0x78, 0x07, 0xff, 0xff];
        assert_eq!(read(8, &bytes), Some(([7, -128, 0x7fff, -1], 5)));
        assert_eq!(read(8, &[0b11, 0x80, 0x01]), Some(([-32767, 0, 0, 0], 3)));
    }
}
