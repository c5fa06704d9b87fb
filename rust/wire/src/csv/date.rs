//! Dates with a time of day, as ISO 8601 writes them.

use super::number::is_blank;

const SECOND: i64 = 1_000_000_000;

/// Nanoseconds since 1970 of `2026-01-05 08:00:00.5`, with `T`, `Z` or an offset where they stand;
/// None where the cell is no such date, or one that 64 bits do not hold (before 1678, after 2261).
pub(super) fn date(cell: &str) -> Option<i64> {
    let cell = cell.trim_matches(is_blank);
    let (day, clock) = cell.split_at_checked(10)?;
    let clock = clock.trim_start_matches(['T', 't', ' ']);
    let (clock, offset) = split_offset(clock)?;
    let clock = clock.trim_end();
    let (clock, fraction) = clock.split_once(['.', ',']).unwrap_or((clock, "0"));
    let mut parts = clock.split(':');
    let hour = digits(parts.next()?, 2, 0..=23)?;
    let minute = digits(parts.next()?, 2, 0..=59)?;
    let second = parts
        .next()
        .map_or(Some(0), |part| digits(part, 2, 0..=60))?;
    if parts.next().is_some() || fraction.len() > 9 {
        return None;
    }
    let nanos = digits(&format!("{fraction:0<9}"), 9, 0..=SECOND - 1)?;
    let seconds = days(day)? * 86_400 + hour * 3600 + minute * 60 + second - offset;
    seconds.checked_mul(SECOND)?.checked_add(nanos)
}

/// The time of day, and the seconds by which its zone is ahead of Greenwich.
fn split_offset(clock: &str) -> Option<(&str, i64)> {
    if let Some(clock) = clock.strip_suffix(['Z', 'z']) {
        return Some((clock, 0));
    }
    let Some(place) = clock.find(['+', '-']) else {
        return Some((clock, 0));
    };
    let (clock, zone) = clock.split_at_checked(place)?;
    let (sign, zone) = zone.split_at_checked(1)?;
    let hour = digits(zone.get(..2)?, 2, 0..=23)?;
    let rest = zone.get(2..)?;
    let rest = rest.strip_prefix(':').unwrap_or(rest);
    let minute = if rest.is_empty() {
        0
    } else {
        digits(rest, 2, 0..=59)?
    };
    let seconds = hour * 3600 + minute * 60;
    Some((clock, if sign == "-" { -seconds } else { seconds }))
}

/// Days from 1970-01-01 to a day of the Gregorian calendar, written `2026-01-05` or `2026/01/05`.
fn days(day: &str) -> Option<i64> {
    let mark = day.get(4..5).filter(|mark| matches!(*mark, "-" | "/"))?;
    let mut parts = day.split(mark);
    let year = digits(parts.next()?, 4, 0..=9999)?;
    let month = digits(parts.next()?, 2, 1..=12)?;
    let of_month = digits(parts.next()?, 2, 1..=31)?;
    // Years that begin in March end with the leap day; 153 days are five months from there.
    let (year, month) = if month < 3 {
        (year - 1, month + 9)
    } else {
        (year, month - 3)
    };
    let leap = year.div_euclid(4) - year.div_euclid(100) + year.div_euclid(400);
    Some(365 * year + leap + (153 * month + 2) / 5 + of_month - 1 - 719_468)
}

/// A number of so many digits within a range.
fn digits(text: &str, count: usize, range: std::ops::RangeInclusive<i64>) -> Option<i64> {
    let plain = text.len() == count && text.bytes().all(|byte| byte.is_ascii_digit());
    let value = plain.then(|| text.parse().ok()).flatten()?;
    range.contains(&value).then_some(value)
}
