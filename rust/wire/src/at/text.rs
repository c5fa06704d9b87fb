//! What may stand where in a command, for reader and writer.

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

/// Whether a command may have this name that has no type of its own.
pub(super) fn is_other(name: &str) -> bool {
    let allowed = |byte: u8| byte.is_ascii_uppercase() || byte.is_ascii_digit() || byte == b'_';
    !name.is_empty() && name.bytes().all(allowed) && !NAMES.contains(&name)
}

pub(super) fn printable(byte: u8) -> bool {
    (b' '..=b'~').contains(&byte)
}

/// The first argument of a list, quotes included, and the rest of the list, where there is one; a
/// comma between quotes belongs to the argument.
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

/// Whether a text stays one argument between others: no comma but between quotes, quotes in pairs.
pub(super) fn is_one_argument(text: &str) -> bool {
    split(text).1.is_none() && text.bytes().filter(|&byte| byte == b'"').count() % 2 == 0
}
