//! The drone's settings as it sends them: lines "section:key = value", and a NUL byte at the end.

use crate::error::{Error, Fault};
use std::collections::HashMap;

/// Upper limit on the bytes of a configuration: several times the size of the drone's settings.
pub const LIMIT: usize = 16_384;

/// The settings in their order, keys with their section.
///
/// Blank lines, spaces around key and value, and a setting that occurs twice with the same value
/// are accepted.
///
/// # Errors
///
/// No NUL at the end (the rest is missing), bytes after it, more than [`LIMIT`] bytes, a line of
/// another form, text that is not UTF-8 or has control characters in it, and a key with two values.
pub fn read(dump: &[u8]) -> Result<Vec<(&str, &str)>, Error> {
    let length = dump.len();
    if length > LIMIT {
        let limit = LIMIT;
        return Err(Fault::Long { length, limit }.at(limit));
    }
    let Some(end) = dump.iter().position(|&byte| byte == 0) else {
        return Err(Fault::NoEnd.at(length));
    };
    if end + 1 != length {
        return Err(Fault::AfterEnd.at(end + 1));
    }
    let text = std::str::from_utf8(dump.get(..end).unwrap_or_default())
        .map_err(|error| Fault::Text.at(error.valid_up_to()))?;
    let mut settings = Vec::new();
    let mut known = HashMap::new();
    let mut at = 0;
    for line in text.split_inclusive('\n') {
        let offset = at;
        at += line.len();
        let line = line.trim_matches([' ', '\t', '\r', '\n']);
        if line.is_empty() {
            continue;
        }
        let (key, value) = setting(line).ok_or_else(|| Fault::Line.at(offset))?;
        match known.insert(key, value) {
            None => settings.push((key, value)),
            Some(before) if before == value => {}
            Some(_) => return Err(Fault::Twice(key.to_owned()).at(offset)),
        }
    }
    Ok(settings)
}

/// Key and value of a line.
fn setting(line: &str) -> Option<(&str, &str)> {
    let (key, value) = line.split_once('=')?;
    let (key, value) = (
        key.trim_matches([' ', '\t']),
        value.trim_matches([' ', '\t']),
    );
    (is_key(key) && !value.contains(char::is_control)).then_some((key, value))
}

/// Is a text a section and a key, without blanks?
fn is_key(key: &str) -> bool {
    let parts = key.split_once(':');
    let whole = parts.is_some_and(|(section, name)| !section.is_empty() && !name.is_empty());
    whole
        && key
            .bytes()
            .all(|byte| byte.is_ascii_graphic() && byte != b'=')
}

/// Writes settings as the drone does.
///
/// # Errors
///
/// A key that is no "section:key", a value that would not be read as it is (control characters, or
/// blanks at its ends), a key with two values, or more than [`LIMIT`] bytes.
///
/// ```
/// use deadtime_wire::configuration;
///
/// let dump = configuration::write(&[("control:altitude_max", "3000")])?;
/// assert_eq!(dump, b"control:altitude_max = 3000\n\0");
/// assert_eq!(configuration::read(&dump)?, [("control:altitude_max", "3000")]);
/// # Ok::<(), deadtime_wire::Error>(())
/// ```
pub fn write(settings: &[(&str, &str)]) -> Result<Vec<u8>, Error> {
    let mut dump = Vec::new();
    let mut known = HashMap::new();
    for &(key, value) in settings {
        let offset = dump.len();
        let kept = value.trim_matches([' ', '\t']) == value && !value.contains(char::is_control);
        if !is_key(key) || !kept {
            return Err(Fault::Line.at(offset));
        }
        if known
            .insert(key, value)
            .is_some_and(|before| before != value)
        {
            return Err(Fault::Twice(key.to_owned()).at(offset));
        }
        dump.extend_from_slice(key.as_bytes());
        dump.extend_from_slice(b" = ");
        dump.extend_from_slice(value.as_bytes());
        dump.push(b'\n');
    }
    dump.push(0);
    if dump.len() > LIMIT {
        let (length, limit) = (dump.len(), LIMIT);
        return Err(Fault::Long { length, limit }.at(limit));
    }
    Ok(dump)
}
