//! Bytes to commands, as a drone reads them: malformed commands are ignored.

use super::text::{is_one_argument, is_other, printable, split};
use super::{Command, LIMIT};
use crate::unit::Unit;

/// The commands of a datagram in their order, each with its sequence number.
///
/// A malformed command is left out: one without a carriage return or line feed at its end (its rest
/// may be missing) or not within the first [`LIMIT`] bytes, with too few arguments or with some of
/// another kind. Finite values of a motion are clipped to [-1, 1]; a command with any other value
/// is left out. Missing base bits of `REF` and additional arguments are accepted.
///
/// ```
/// use deadtime_wire::at::{self, Command};
///
/// let read = at::read(b"AT*PMODE=1,2\rAT*PCMD=2,1,0,0,nonsense,0\rAT*REF=3,512\r");
/// assert_eq!(read.len(), 2);
/// assert_eq!(read[1], (3, Command::Ref { take_off: true, emergency: false }));
/// ```
pub fn read(datagram: &[u8]) -> Vec<(u32, Command)> {
    let read = datagram.get(..LIMIT).unwrap_or(datagram);
    read.split_inclusive(|byte| matches!(byte, b'\r' | b'\n'))
        .filter_map(|line| line.strip_suffix(b"\r").or(line.strip_suffix(b"\n")))
        .filter_map(|line| command(std::str::from_utf8(line).ok()?))
        .collect()
}

fn command(line: &str) -> Option<(u32, Command)> {
    let (name, rest) = line.strip_prefix("AT*")?.split_once('=')?;
    let mut arguments = Arguments(Some(rest));
    let sequence = u32::try_from(arguments.integer()?).ok()?;
    let command = match name {
        "REF" => {
            let bits = arguments.bits()?;
            Command::Ref {
                take_off: bits & (1 << 9) != 0,
                emergency: bits & (1 << 8) != 0,
            }
        }
        "PCMD" => Command::Move {
            flag: arguments.integer()?,
            roll: arguments.unit()?,
            pitch: arguments.unit()?,
            gaz: arguments.unit()?,
            yaw: arguments.unit()?,
        },
        "PCMD_MAG" => Command::MoveFrom {
            flag: arguments.integer()?,
            roll: arguments.unit()?,
            pitch: arguments.unit()?,
            gaz: arguments.unit()?,
            yaw: arguments.unit()?,
            heading: arguments.unit()?,
            accuracy: arguments.unit()?,
        },
        "CONFIG" => Command::Config {
            key: arguments.quoted()?,
            value: arguments.quoted()?,
        },
        "CONFIG_IDS" => Command::ConfigIds {
            session: arguments.quoted()?,
            user: arguments.quoted()?,
            application: arguments.quoted()?,
        },
        "CTRL" => Command::Control {
            mode: arguments.integer()?,
        },
        "COMWDG" => Command::Watchdog,
        "FTRIM" => Command::FlatTrim,
        "CALIB" => Command::Calibrate {
            device: arguments.integer()?,
        },
        _ => {
            if !is_other(name) {
                return None;
            }
            let mut others = Vec::new();
            while let Some(argument) = arguments.next() {
                if !argument.bytes().all(printable) || !is_one_argument(argument) {
                    return None;
                }
                others.push(argument.to_owned());
            }
            Command::Other {
                name: name.to_owned(),
                arguments: others,
            }
        }
    };
    Some((sequence, command))
}

/// The rest of a line after its name.
struct Arguments<'a>(Option<&'a str>);

impl<'a> Arguments<'a> {
    fn next(&mut self) -> Option<&'a str> {
        let (argument, rest) = split(self.0.take()?);
        self.0 = rest;
        Some(argument)
    }

    fn integer(&mut self) -> Option<i32> {
        self.next()?.trim_matches(' ').parse().ok()
    }

    /// 32 bits, read as a signed or an unsigned number.
    fn bits(&mut self) -> Option<u32> {
        let number: i64 = self.next()?.trim_matches(' ').parse().ok()?;
        u32::try_from(number)
            .or_else(|_| i32::try_from(number).map(|signed| signed as u32))
            .ok()
    }

    fn unit(&mut self) -> Option<Unit> {
        Unit::from_bits(self.bits()?)
    }

    /// The text between the quotes of the next argument.
    fn quoted(&mut self) -> Option<String> {
        let inside = self
            .next()?
            .trim_matches(' ')
            .strip_prefix('"')?
            .strip_suffix('"')?;
        let readable = inside.bytes().all(|byte| printable(byte) && byte != b'"');
        readable.then(|| inside.to_owned())
    }
}
