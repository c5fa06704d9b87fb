//! The frames of a log as tables.

use std::ops::ControlFlow;

use super::fields::{Fields, Layout};
use super::stream::{Kind, Stream};
use crate::error::Fault;

/// Frames of one kind.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Table {
    /// The number of frames.
    pub rows: usize,
    /// Values: all of the first field, then all of the second, and so on.
    pub values: Vec<i32>,
    /// How many main frames stand before each; empty in the table of main frames.
    pub before: Vec<u32>,
    /// Rows that are filled.
    filled: usize,
}

impl Table {
    fn new(rows: usize, fields: usize, is_main: bool) -> Self {
        Self {
            rows,
            values: vec![0; rows * fields],
            before: Vec::with_capacity(if is_main { 0 } else { rows }),
            filled: 0,
        }
    }

    fn push(&mut self, values: &[i32]) {
        let column = self.values.iter_mut().skip(self.filled);
        for (place, value) in column.step_by(self.rows.max(1)).zip(values) {
            *place = *value;
        }
        self.filled += 1;
    }
}

/// What a log holds.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Frames {
    /// `I` and `P` frames.
    pub main: Table,
    /// `S` frames.
    pub slow: Table,
    /// `G` frames, with the coordinates of home added.
    pub gps: Table,
    /// Whether the log has the mark of its end.
    pub ended: bool,
    /// Places at which the log is damaged.
    pub damaged: u32,
    /// Frames that are whole but tell nothing, because what they build on is lost.
    pub unusable: u32,
}

/// Reads the frames of a log, without its head, with `limit` values at most.
///
/// # Errors
/// More values than `limit`, which few bytes can pretend to hold; a layout whose `P` frames have
/// other fields than its `I` frames, or whose iteration or time is none of them.
pub fn read(data: &[u8], layout: &Layout, limit: usize) -> Result<Frames, Fault> {
    let wanted = layout.intra.count();
    let length = layout.inter.as_ref().map_or(wanted, Fields::count);
    if length != wanted {
        return Err(Fault::Length { length, wanted });
    }
    let needed = layout.iteration.max(layout.time) + 1;
    if wanted < needed {
        let length = wanted;
        return Err(Fault::Short { length, needed });
    }
    // The first pass counts, so that the second fills tables of the right size.
    let count = |kind: Kind| match kind {
        Kind::Main => wanted,
        Kind::Slow => layout.slow.as_ref().map_or(0, Fields::count),
        Kind::Gps => layout.gps.as_ref().map_or(0, Fields::count),
    };
    let (mut main, mut slow, mut gps, mut held) = (0, 0, 0, 0);
    let tally = Stream::new(data, layout).run(|kind, _| {
        *match kind {
            Kind::Main => &mut main,
            Kind::Slow => &mut slow,
            Kind::Gps => &mut gps,
        } += 1;
        held += count(kind) + 1;
        if held > limit {
            return ControlFlow::Break(());
        }
        ControlFlow::Continue(())
    });
    if held > limit {
        return Err(Fault::Values { limit });
    }
    let mut frames = Frames {
        main: Table::new(main, wanted, true),
        slow: Table::new(slow, count(Kind::Slow), false),
        gps: Table::new(gps, count(Kind::Gps), false),
        ended: tally.ended,
        damaged: tally.damaged,
        unusable: tally.unusable,
    };
    Stream::new(data, layout).run(|kind, values| {
        let so_far = frames.main.filled as u32;
        let table = match kind {
            Kind::Main => &mut frames.main,
            Kind::Slow => &mut frames.slow,
            Kind::Gps => &mut frames.gps,
        };
        table.push(values);
        if kind != Kind::Main {
            table.before.push(so_far);
        }
        ControlFlow::Continue(())
    });
    Ok(frames)
}
