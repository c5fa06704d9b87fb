//! The values of a run that are returned.

use super::history::Piece;
use crate::Error;
use crate::memory::{append, push};

/// What memory is requested for, in errors.
const SOLUTION: &str = "the solution";

/// Values at requested times, or at all nodes.
#[derive(Debug)]
pub(super) struct Output<'a> {
    wanted: Option<&'a [f64]>,
    next: usize,
    pub(super) times: Vec<f64>,
    /// One time after the other.
    pub(super) values: Vec<f64>,
}

impl<'a> Output<'a> {
    /// No values yet.
    pub(super) fn new(wanted: Option<&'a [f64]>) -> Self {
        Self {
            wanted,
            next: 0,
            times: Vec::new(),
            values: Vec::new(),
        }
    }

    /// The state at the start, or after it was changed. Requested times receive it from the element
    /// that follows.
    pub(super) fn start(&mut self, time: f64, state: &[f64]) -> Result<(), Error> {
        if self.wanted.is_none() {
            push(SOLUTION, &mut self.times, time)?;
            append(SOLUTION, &mut self.values, state)?;
        }
        Ok(())
    }

    /// The state after a change at which the run ends.
    pub(super) fn end(&mut self, time: f64, state: &[f64]) {
        let wanted = self.wanted.unwrap_or_default();
        while wanted.get(self.next).is_some_and(|wanted| *wanted <= time) {
            self.next += 1;
            self.times.push(time);
            self.values.extend_from_slice(state);
        }
    }

    /// An element up to `until`, with its nodes: values (component, node) and times. A requested
    /// time at its end belongs to the next element, unless this is the last one.
    pub(super) fn give(
        &mut self,
        piece: &Piece,
        (y, t): (&[f64], &[f64]),
        until: f64,
        last: bool,
    ) -> Result<(), Error> {
        if let Some(wanted) = self.wanted {
            while let Some(&time) = wanted.get(self.next) {
                if time > until || (time == until && !last) {
                    break;
                }
                self.next += 1;
                self.value(piece, time)?;
            }
            return Ok(());
        }
        let n = t.len();
        for node in (1..n).filter(|node| t[*node] < until && node + 1 < n) {
            push(SOLUTION, &mut self.times, t[node])?;
            for row in y.chunks_exact(n) {
                push(SOLUTION, &mut self.values, row[node])?;
            }
        }
        // The last node may have been moved off a jump, or lie beyond a terminal event.
        self.value(piece, until)
    }

    fn value(&mut self, piece: &Piece, time: f64) -> Result<(), Error> {
        let begin = self.values.len();
        let dim = piece.coefficients.len() / piece.terms;
        for _ in 0..dim {
            push(SOLUTION, &mut self.values, 0.0)?;
        }
        piece.value(time, &mut self.values[begin..]);
        push(SOLUTION, &mut self.times, time)
    }
}
