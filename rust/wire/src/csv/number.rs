//! The number in a cell.

use std::borrow::Cow;

/// Powers of ten that are doubles.
const POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16,
    1e17, 1e18, 1e19, 1e20, 1e21, 1e22,
];

/// What a cell holds, by its decimal mark.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Number {
    /// No decimal mark.
    Whole(f64),
    /// A decimal point.
    Point(f64),
    /// A decimal comma.
    Comma(f64),
    /// One to three digits, a comma and three digits: a decimal, of this value, or a thousand.
    CommaOrThousand(f64),
}

/// A cell that holds no number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NoNumber {
    /// It has commas, but not as a decimal comma.
    Commas,
    /// It is something else.
    Other,
}

/// The number in a cell, correctly rounded; blanks round it do not count.
pub fn number(cell: &[u8]) -> Result<Number, NoNumber> {
    if let Some(found) = short(cell) {
        return Ok(found);
    }
    if let Some(value) = std::str::from_utf8(cell)
        .ok()
        .and_then(|cell| cell.parse().ok())
    {
        return Ok(marked(value, cell.contains(&b'.')));
    }
    let text = text(cell);
    let trimmed = text.trim_matches(is_blank);
    if trimmed.contains(',') {
        return comma(trimmed);
    }
    let value = trimmed.parse().map_err(|_| NoNumber::Other)?;
    Ok(marked(value, trimmed.contains('.')))
}

const fn marked(value: f64, has_point: bool) -> Number {
    if has_point {
        Number::Point(value)
    } else {
        Number::Whole(value)
    }
}

/// A number without an exponent whose digits are a double, as are the powers of ten by which they
/// are divided: one division rounds once (Clinger 1990).
fn short(cell: &[u8]) -> Option<Number> {
    let (is_negative, digits) = match cell.split_first()? {
        (b'-', rest) => (true, rest),
        _ => (false, cell),
    };
    if digits.len() > 19 {
        return None; // they may exceed 64 bits
    }
    let mut whole = 0_u64;
    let mut point = None;
    for (place, &byte) in digits.iter().enumerate() {
        let digit = byte.wrapping_sub(b'0');
        if digit < 10 {
            whole = whole * 10 + u64::from(digit);
        } else if byte == b'.' && point.is_none() {
            point = Some(place);
        } else {
            return None;
        }
    }
    if digits.len() == usize::from(point.is_some()) || whole > 1 << f64::MANTISSA_DIGITS {
        return None; // no digit, or too many
    }
    let decimals = point.map_or(0, |place| digits.len() - place - 1);
    #[allow(clippy::cast_precision_loss)] // exact
    let value = whole as f64 / POWERS.get(decimals)?;
    let value = if is_negative { -value } else { value };
    Some(marked(value, point.is_some()))
}

/// A number with a decimal comma.
fn comma(cell: &str) -> Result<Number, NoNumber> {
    let (whole, decimals) = cell.split_once(',').ok_or(NoNumber::Commas)?;
    if cell.contains('.') || !decimals.starts_with(|sign: char| sign.is_ascii_digit()) {
        return Err(NoNumber::Commas);
    }
    let value = format!("{whole}.{decimals}").parse();
    let value = value.map_err(|_| NoNumber::Commas)?;
    let digits = whole.strip_prefix(['+', '-']).unwrap_or(whole);
    let may_be_thousand = matches!(digits.len(), 1..=3)
        && !digits.starts_with('0')
        && decimals.len() == 3
        && decimals.bytes().all(|byte| byte.is_ascii_digit());
    Ok(if may_be_thousand {
        Number::CommaOrThousand(value)
    } else {
        Number::Comma(value)
    })
}

/// What Python's `str.strip` removes.
pub(super) fn is_blank(sign: char) -> bool {
    sign.is_whitespace() || ('\x1c'..='\x1f').contains(&sign)
}

/// The text of a cell, in UTF-8 or else Latin-1.
pub(super) fn text(cell: &[u8]) -> Cow<'_, str> {
    match std::str::from_utf8(cell) {
        Ok(text) => Cow::Borrowed(text),
        Err(_) => Cow::Owned(cell.iter().copied().map(char::from).collect()),
    }
}
