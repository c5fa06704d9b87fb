//! The cells of one record.

use std::borrow::Cow;

use memchr::{memchr, memchr2, memchr3};

/// Cells of a record, without the quotes round them.
pub(super) type Cells<'a> = Vec<Cow<'a, [u8]>>;

/// What is wrong with a quoted cell: the line ends before it, and the reason.
pub(super) struct Quotes {
    pub(super) lines: usize,
    pub(super) reason: &'static str,
}

/// Take the next record off `rest`; no cells are left where the line is to be skipped. Returns the
/// number of line ends that it holds between its cells.
pub(super) fn next<'a>(
    rest: &mut &'a [u8],
    delimiter: u8,
    cells: &mut Cells<'a>,
) -> Result<usize, Quotes> {
    cells.clear();
    let text: &'a [u8] = rest;
    let start = text.iter().position(|&byte| !is_blank(byte));
    let first = start.and_then(|at| text.get(at));
    if first == Some(&b'#') {
        let (_, after) = split(text, memchr2(b'\n', b'\r', text));
        *rest = after_line_end(after);
        return Ok(0);
    }
    let (line, after) = split(text, memchr3(b'\n', b'\r', b'"', text));
    if after.first() == Some(&b'"') {
        return with_quotes(rest, delimiter, cells);
    }
    *rest = after_line_end(after);
    if first.is_none_or(|byte| matches!(byte, b'\n' | b'\r')) {
        return Ok(0);
    }
    if delimiter == b' ' {
        let parts = line.split(|&byte| is_blank(byte));
        cells.extend(parts.filter(|cell| !cell.is_empty()).map(Cow::Borrowed));
    } else {
        cells.extend(line.split(|&byte| byte == delimiter).map(Cow::Borrowed));
    }
    Ok(0)
}

/// [`next`] for a record that has quotes.
fn with_quotes<'a>(
    rest: &mut &'a [u8],
    delimiter: u8,
    cells: &mut Cells<'a>,
) -> Result<usize, Quotes> {
    let mut text: &'a [u8] = rest;
    let mut lines = 0;
    loop {
        if delimiter == b' ' {
            text = split(text, text.iter().position(|&byte| !is_blank(byte))).1;
            if text
                .first()
                .is_none_or(|byte| matches!(byte, b'\n' | b'\r'))
            {
                break;
            }
        }
        let cell = if let Some((b'"', inside)) = text.split_first() {
            let (cell, after) = quoted(inside).ok_or(Quotes {
                lines,
                reason: "a quoted cell has no end",
            })?;
            lines += line_ends(&cell);
            text = after;
            cell
        } else {
            let (cell, after) = split(text, memchr3(delimiter, b'\n', b'\r', text));
            text = after;
            Cow::Borrowed(cell)
        };
        cells.push(cell);
        match text.split_first() {
            Some((&byte, after)) if byte == delimiter || (delimiter == b' ' && is_blank(byte)) => {
                text = after;
            }
            None | Some((b'\n' | b'\r', _)) => break,
            Some(_) => {
                let reason = "a cell continues after its closing quote";
                return Err(Quotes { lines, reason });
            }
        }
    }
    *rest = after_line_end(text);
    Ok(lines)
}

/// A cell up to its closing quote, and what follows it.
fn quoted(inside: &[u8]) -> Option<(Cow<'_, [u8]>, &[u8])> {
    let mut doubled = Vec::new();
    let mut rest = inside;
    loop {
        let (part, after) = rest.split_at_checked(memchr(b'"', rest)?)?;
        let after = after.get(1..)?;
        if after.first() != Some(&b'"') {
            if doubled.is_empty() {
                return Some((Cow::Borrowed(part), after));
            }
            doubled.extend_from_slice(part);
            return Some((Cow::Owned(doubled), after));
        }
        doubled.extend_from_slice(part);
        doubled.push(b'"');
        rest = after.get(1..)?;
    }
}

/// A blank within a line.
pub(super) const fn is_blank(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t' | b'\x0b' | b'\x0c')
}

fn split(text: &[u8], at: Option<usize>) -> (&[u8], &[u8]) {
    at.and_then(|at| text.split_at_checked(at))
        .unwrap_or((text, &[]))
}

fn after_line_end(text: &[u8]) -> &[u8] {
    match text {
        [b'\r', b'\n', rest @ ..] | [_, rest @ ..] => rest,
        [] => text,
    }
}

/// How many lines end in these bytes.
fn line_ends(bytes: &[u8]) -> usize {
    let pairs = bytes.windows(2).filter(|pair| pair == b"\r\n").count();
    bytes
        .iter()
        .filter(|byte| matches!(byte, b'\n' | b'\r'))
        .count()
        - pairs
}
