//! The characters that a command may hold, for reader and writer.

/// Names of the commands that have a type of their own.
const NAMES: [&str; 9] = [
    "REF",
    "PCMD",
    "PCMD_MAG",
    "CONFIG",
    "CONFIG_IDS",
    "CTRL",
    "COMWDG",
    "FTRIM",
    "CALIB",
];

/// May a command without a type of its own have this name?
pub(super) fn is_other(name: &str) -> bool {
    let allowed = |byte: u8| byte.is_ascii_uppercase() || byte.is_ascii_digit() || byte == b'_';
    !name.is_empty() && name.bytes().all(allowed) && !NAMES.contains(&name)
}

pub(super) fn printable(byte: u8) -> bool {
    (b' '..=b'~').contains(&byte)
}

/// The first argument of a list, quotes included, and the rest of the list, if any. A comma between
/// quotes belongs to the argument.
pub(super) fn split(list: &str) -> (&str, Option<&str>) {
    let mut inside = false;
    let end = list.bytes().position(|byte| {
        inside ^= byte == b'"';
        byte == b',' && !inside
    });
    match end.and_then(|end| list.split_at_checked(end)) {
        Some((argument, rest)) => (argument, rest.strip_prefix(',')),
        None => (list, None),
    }
}

/// Does a text remain one argument among others? Commas are allowed only between quotes, and quotes
/// only in pairs.
pub(super) fn is_one_argument(text: &str) -> bool {
    split(text).1.is_none() && text.bytes().filter(|&byte| byte == b'"').count() % 2 == 0
}
