//! Commands to bytes.

use super::text::{is_one_argument, is_other, printable};
use super::{Command, LIMIT};
use crate::error::{Error, Fault};
use crate::unit::Unit;
use std::fmt::Write as _;

/// Bits of `REF` that are always set, according to the drone's guide.
const REF_BASE: u32 = (1 << 18) | (1 << 20) | (1 << 22) | (1 << 24) | (1 << 28);

/// A datagram of commands with the sequence numbers `first`, `first + 1`, …
///
/// # Errors
///
/// More than [`LIMIT`] bytes in all, a text that would break the line it stands in, or a sequence
/// number beyond 2³¹ − 1.
///
/// ```
/// use deadtime_wire::{Unit, at};
///
/// let climb = at::Command::Move {
///     flag: 1,
///     roll: Unit::ZERO,
///     pitch: Unit::ZERO,
///     gaz: Unit::new(0.5)?,
///     yaw: Unit::ZERO,
/// };
/// assert_eq!(at::write(&[climb], 7)?, b"AT*PCMD=7,1,0,0,1056964608,0\r");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write(commands: &[Command], first: u32) -> Result<Vec<u8>, Error> {
    let mut text = String::with_capacity(64 * commands.len());
    for (sequence, command) in (i64::from(first)..).zip(commands) {
        if sequence > i64::from(i32::MAX) {
            let name = "sequence";
            let value = sequence as f64;
            return Err(Fault::Range { name, value }.at(text.len()));
        }
        line(&mut text, command, sequence)?;
        if text.len() > LIMIT {
            let (length, limit) = (text.len(), LIMIT);
            return Err(Fault::Long { length, limit }.at(limit));
        }
    }
    Ok(text.into_bytes())
}

/// Appends one command and its carriage return.
fn line(text: &mut String, command: &Command, sequence: i64) -> Result<(), Error> {
    text.push_str("AT*");
    match command {
        Command::Ref {
            take_off,
            emergency,
        } => {
            let bits = REF_BASE | u32::from(*take_off) << 9 | u32::from(*emergency) << 8;
            head(text, "REF", sequence);
            number(text, bits as i32);
        }
        Command::Move {
            flag,
            roll,
            pitch,
            gaz,
            yaw,
        } => {
            head(text, "PCMD", sequence);
            number(text, *flag);
            units(text, &[*roll, *pitch, *gaz, *yaw]);
        }
        Command::MoveFrom {
            flag,
            roll,
            pitch,
            gaz,
            yaw,
            heading,
            accuracy,
        } => {
            head(text, "PCMD_MAG", sequence);
            number(text, *flag);
            units(text, &[*roll, *pitch, *gaz, *yaw, *heading, *accuracy]);
        }
        Command::Config { key, value } => {
            head(text, "CONFIG", sequence);
            quoted(text, "key", key)?;
            quoted(text, "value", value)?;
        }
        Command::ConfigIds {
            session,
            user,
            application,
        } => {
            head(text, "CONFIG_IDS", sequence);
            quoted(text, "session", session)?;
            quoted(text, "user", user)?;
            quoted(text, "application", application)?;
        }
        Command::Control { mode } => {
            head(text, "CTRL", sequence);
            number(text, *mode);
            number(text, 0);
        }
        Command::Watchdog => head(text, "COMWDG", sequence),
        Command::FlatTrim => head(text, "FTRIM", sequence),
        Command::Calibrate { device } => {
            head(text, "CALIB", sequence);
            number(text, *device);
        }
        Command::Other { name, arguments } => {
            // A motion cannot be written under another name than that of its type.
            if !is_other(name) {
                return Err(Fault::Name(name.clone()).at(text.len()));
            }
            head(text, name, sequence);
            for argument in arguments {
                text.push(',');
                let (name, offset) = ("argument", text.len());
                check(name, argument, offset, printable)?;
                if !is_one_argument(argument) {
                    let byte = if argument.contains('"') { b'"' } else { b',' };
                    return Err(Fault::Sign { name, byte }.at(offset));
                }
                text.push_str(argument);
            }
        }
    }
    text.push('\r');
    Ok(())
}

fn head(text: &mut String, name: &str, sequence: i64) {
    let _ = write!(text, "{name}={sequence}");
}

fn number(text: &mut String, value: i32) {
    let _ = write!(text, ",{value}");
}

fn units(text: &mut String, values: &[Unit]) {
    for value in values {
        number(text, value.to_bits() as i32);
    }
}

fn quoted(text: &mut String, name: &'static str, value: &str) -> Result<(), Error> {
    text.push_str(",\"");
    check(name, value, text.len(), |byte| {
        printable(byte) && byte != b'"'
    })?;
    text.push_str(value);
    text.push('"');
    Ok(())
}

/// Refuses a byte that would end the text, the line or the datagram.
fn check(
    name: &'static str,
    text: &str,
    offset: usize,
    allowed: impl Fn(u8) -> bool,
) -> Result<(), Error> {
    match text.bytes().enumerate().find(|(_, byte)| !allowed(*byte)) {
        Some((at, byte)) => Err(Fault::Sign { name, byte }.at(offset + at)),
        None => Ok(()),
    }
}
