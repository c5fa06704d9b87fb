//! The columns of a table within a window of its first one.

use super::date::date;
use super::number::{self, NoNumber, Number, number, text};
use super::record::{Cells, is_blank, next};

/// Records between two checks whether to go on.
const CHECKED: usize = 1024;

/// What to read.
#[derive(Debug, Clone)]
pub struct Layout {
    /// Separator of the cells; a space for any number of blanks.
    pub delimiter: u8,
    /// Number of columns in the header.
    pub width: usize,
    /// Index and name of each column to read, of which the first is the time.
    pub columns: Vec<(usize, String)>,
    /// Rows are kept whose time is in this range; of others nothing but the time is read.
    pub window: (f64, f64),
    /// Number of the first line, for messages.
    pub line: usize,
}

/// The columns, in the order of the layout.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Columns {
    /// Their values, one vector a column; NaN where a cell is empty or holds one. Dates are seconds
    /// after the first of them.
    pub values: Vec<Vec<f64>>,
    /// Where the time goes back; reading ends there.
    pub backward: Option<Backward>,
    /// The first time that is that of the row before.
    pub repeated: Option<Backward>,
}

/// A time that is not above the one before it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Backward {
    /// Its line.
    pub line: usize,
    /// The time before it.
    pub before: f64,
    /// The time.
    pub now: f64,
}

/// Why a table cannot be read.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Fault {
    /// A quoted cell that does not end, or not with its quote.
    #[error("line {line}: this is not a CSV file: {reason}")]
    Quotes {
        /// The line.
        line: usize,
        /// What is wrong.
        reason: &'static str,
    },
    /// More cells than the header has names.
    #[error(
        "line {line} has {cells} cells, but there are {width} column names. If commas are decimal \
         marks, write points, or separate the columns by semicolons"
    )]
    Wide {
        /// The line.
        line: usize,
        /// Number of its cells.
        cells: usize,
        /// Number of columns.
        width: usize,
    },
    /// A column without a cell.
    #[error("line {line} has {cells} cells, so the cell of the column {name} is missing")]
    Missing {
        /// The line.
        line: usize,
        /// Number of its cells.
        cells: usize,
        /// Name of the column, in quotes.
        name: String,
    },
    /// A cell that cannot be used as a number.
    #[error("line {line}: {cell} in column {name} {reason}")]
    Cell {
        /// The line.
        line: usize,
        /// The cell, in quotes.
        cell: String,
        /// Name of the column, in quotes.
        name: String,
        /// What is wrong.
        reason: String,
    },
    /// A number that is not finite.
    #[error(
        "line {line}: {name} is {value}. Leave this row out, or choose a window without this \
        row"
    )]
    NotFinite {
        /// The line.
        line: usize,
        /// Name of the column, in quotes.
        name: String,
        /// The value.
        value: String,
    },
    /// The numbers do not fit into memory.
    #[error("line {line}: the numbers up to this line fill the memory. Read a part of the file")]
    Memory {
        /// The line.
        line: usize,
    },
}

/// Read the columns of a table; `check` is called regularly and ends the work by its error.
pub fn read<E: From<Fault>>(
    table: &[u8],
    layout: &Layout,
    check: impl Fn() -> Result<(), E>,
) -> Result<Columns, E> {
    let mut values: Vec<Vec<f64>> = layout.columns.iter().map(|_| Vec::new()).collect();
    let mut marks = Marks::default();
    let mut cells = Cells::new();
    let mut rest = table;
    let mut line = layout.line;
    let mut clock = Clock::default();
    let mut records = 0_usize;
    while !rest.is_empty() {
        if records.is_multiple_of(CHECKED) {
            check()?;
        }
        records += 1;
        line += next(&mut rest, layout.delimiter, &mut cells).map_err(|found| Fault::Quotes {
            line: line + found.lines,
            reason: found.reason,
        })?;
        if !cells.is_empty() {
            let row = Row {
                layout,
                cells: &cells,
                line,
            };
            row.check_width()?;
            if let Some(backward) = row.push(&mut values, &mut clock, &mut marks)? {
                return Ok(Columns {
                    values,
                    backward: Some(backward),
                    repeated: clock.repeated,
                });
            }
        }
        line += 1;
    }
    marks.check_thousands()?;
    Ok(Columns {
        values,
        backward: None,
        repeated: clock.repeated,
    })
}

/// The times so far.
#[derive(Default)]
struct Clock {
    /// The last one, s.
    last: Option<f64>,
    /// The first one, ns, where times are dates.
    first_date: Option<i64>,
    /// The first time that is that of the row before.
    repeated: Option<Backward>,
}

/// One record.
struct Row<'a> {
    layout: &'a Layout,
    cells: &'a Cells<'a>,
    line: usize,
}

impl Row<'_> {
    fn check_width(&self) -> Result<(), Fault> {
        let mut more = self.cells.iter().skip(self.layout.width);
        if more.any(|cell| !cell.iter().all(|&byte| is_blank(byte))) {
            return Err(Fault::Wide {
                line: self.line,
                cells: self.cells.len(),
                width: self.layout.width,
            });
        }
        Ok(())
    }

    /// Keep the numbers of a row in the window, or say where the time does not increase.
    fn push(
        &self,
        values: &mut [Vec<f64>],
        clock: &mut Clock,
        marks: &mut Marks,
    ) -> Result<Option<Backward>, Fault> {
        let (low, high) = self.layout.window;
        let mut is_time = true;
        for ((column, name), kept) in self.layout.columns.iter().zip(values) {
            let value = if is_time {
                let now = self.time(*column, name, clock, marks)?;
                if let Some(before) = clock.last.replace(now).filter(|&before| now <= before) {
                    let line = self.line;
                    let found = Backward { line, before, now };
                    if now < before {
                        return Ok(Some(found));
                    }
                    clock.repeated.get_or_insert(found);
                }
                if !(low..=high).contains(&now) {
                    return Ok(None);
                }
                is_time = false;
                now
            } else if self.is_empty(*column) {
                f64::NAN
            } else {
                self.value(*column, name, marks)?
            };
            kept.try_reserve(1)
                .map_err(|_| Fault::Memory { line: self.line })?;
            kept.push(value);
        }
        Ok(None)
    }

    /// Whether the cell is there and has nothing in it.
    fn is_empty(&self, column: usize) -> bool {
        let cell = self.cells.get(column);
        cell.is_some_and(|cell| text(cell).trim_matches(number::is_blank).is_empty())
    }

    /// The time, s: a number, or a date.
    fn time(
        &self,
        column: usize,
        name: &str,
        clock: &mut Clock,
        marks: &mut Marks,
    ) -> Result<f64, Fault> {
        let written = self.cells.get(column).map(|cell| text(cell));
        let found = written.as_deref().and_then(date);
        let kind = match (found, clock.last, clock.first_date) {
            (Some(_), Some(_), None) => Some("is a date, but the times above are numbers"),
            (None, _, Some(_)) => Some("is not a date, but the times above are dates"),
            _ => None,
        };
        if let Some(reason) = kind {
            return Err(Fault::Cell {
                line: self.line,
                cell: quoted(written.as_deref().unwrap_or_default()),
                name: quoted(name),
                reason: reason.to_owned(),
            });
        }
        let Some(now) = found else {
            let now = self.value(column, name, marks)?;
            let is_known = !now.is_nan();
            return is_known
                .then_some(now)
                .ok_or_else(|| self.not_finite(name, now));
        };
        let first = *clock.first_date.get_or_insert(now);
        #[allow(clippy::cast_precision_loss)] // up to 104 days in ns are exact
        let nanos = now.saturating_sub(first) as f64;
        Ok(nanos / 1e9)
    }

    fn not_finite(&self, name: &str, value: f64) -> Fault {
        let written = value.to_string();
        Fault::NotFinite {
            line: self.line,
            name: quoted(name),
            value: written.to_lowercase(),
        }
    }

    fn value(&self, column: usize, name: &str, marks: &mut Marks) -> Result<f64, Fault> {
        let line = self.line;
        let cell = self.cells.get(column).ok_or_else(|| Fault::Missing {
            line,
            cells: self.cells.len(),
            name: quoted(name),
        })?;
        let fault = |reason: String| Fault::Cell {
            line,
            cell: quoted(&text(cell)),
            name: quoted(name),
            reason,
        };
        let value = match number(cell) {
            Ok(Number::Whole(value)) => value,
            Ok(Number::Point(value)) => {
                if let Some(other) = marks.comma {
                    return Err(fault(two_marks("point", other)));
                }
                marks.point.get_or_insert(line);
                value
            }
            Ok(found @ (Number::Comma(value) | Number::CommaOrThousand(value))) => {
                if let Some(other) = marks.point {
                    return Err(fault(two_marks("comma", other)));
                }
                marks.comma.get_or_insert(line);
                if let Number::Comma(_) = found {
                    marks.is_decimal = true;
                } else if !marks.is_decimal && marks.unclear.is_none() {
                    let grouped = text(cell).trim().replace(',', "");
                    marks.unclear = Some(fault(format!(
                        "may be {value} or {grouped}, and no other cell shows which: write a \
                         decimal point, or no comma"
                    )));
                }
                value
            }
            Err(NoNumber::Commas) => {
                return Err(fault(
                    "is not a number: write a decimal point and no comma".to_owned(),
                ));
            }
            Err(NoNumber::Other) => {
                let date = if text(cell).contains(['/', ':']) {
                    ": write a date as 2026-01-31 08:00:00, or give seconds"
                } else {
                    ""
                };
                return Err(fault(format!("is not a number{date}")));
            }
        };
        if value.is_infinite() {
            return Err(self.not_finite(name, value));
        }
        Ok(value)
    }
}

/// Which decimal marks the cells have.
#[derive(Default)]
struct Marks {
    /// Line of the first point.
    point: Option<usize>,
    /// Line of the first comma.
    comma: Option<usize>,
    /// Whether a comma can be nothing but a decimal comma.
    is_decimal: bool,
    /// The first cell whose comma may stand for thousands.
    unclear: Option<Fault>,
}

impl Marks {
    fn check_thousands(self) -> Result<(), Fault> {
        match self.unclear {
            Some(fault) if !self.is_decimal => Err(fault),
            _ => Ok(()),
        }
    }
}

fn two_marks(mark: &str, other: usize) -> String {
    format!(
        "has a decimal {mark}, but line {other} has the other mark: write a decimal point in all \
         cells"
    )
}

/// A text in quotes on one line.
fn quoted(text: &str) -> String {
    let escaped: String = text
        .chars()
        .flat_map(|sign| {
            let is_plain = sign == '"' || sign == '\'';
            let plain = is_plain.then_some(sign);
            plain.into_iter().chain(
                (!is_plain)
                    .then(|| sign.escape_debug())
                    .into_iter()
                    .flatten(),
            )
        })
        .collect();
    format!("'{escaped}'")
}
