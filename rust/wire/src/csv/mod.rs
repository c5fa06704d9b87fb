//! Columns of numbers in a CSV table, below its header.
//!
//! A record is a line, or several where a quoted cell holds line ends. Lines end in `\n`, `\r\n` or
//! `\r`; empty lines, and those that begin with `#`, are skipped. A cell that opens with a quote
//! ends at the next single one; two quotes in it stand for one. The separator is one byte; a space
//! stands for any number of blanks. Text is UTF-8 or Latin-1, of which only messages depend.
//!
//! A number is read as Python's `float` reads it, correctly rounded, but without underscores and
//! foreign digits. Commas stand for decimal points in all cells that are read or in none. `1,234`
//! may be a thousand as well: it is read as a decimal if another cell can be nothing else. An empty
//! cell is a missing value, NaN, but for a time. Times may be dates.

mod date;
mod number;
mod record;
mod table;

pub use number::{NoNumber, Number, number};
pub use table::{Backward, Columns, Fault, Layout, read};
