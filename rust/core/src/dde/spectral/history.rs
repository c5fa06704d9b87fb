//! The past of a solution: polynomial pieces in a row, each with its time interval.
//!
//! Every piece holds Chebyshev coefficients of all components on [start, end]; before the first
//! start nothing is defined. A value at a joint belongs to one of the two pieces, and the caller
//! states which, so that values at a breaking point are never averaged. Old pieces may be dropped
//! as time goes on.

use std::collections::VecDeque;

use super::chebyshev;
use crate::Error;
use crate::memory::push_back;

/// One polynomial on an interval.
#[derive(Debug, Clone, PartialEq)]
pub struct Piece {
    /// Where it starts.
    pub start: f64,
    /// Where it ends.
    pub end: f64,
    /// Number of coefficients of a component.
    pub terms: usize,
    /// Coefficients, component by component.
    pub coefficients: Vec<f64>,
    /// Those of the derivative; empty where delayed derivatives are not needed.
    pub slopes: Vec<f64>,
}

impl Piece {
    /// A piece without its derivative.
    pub fn new(start: f64, end: f64, terms: usize, coefficients: Vec<f64>) -> Self {
        Self {
            start,
            end,
            terms,
            coefficients,
            slopes: Vec::new(),
        }
    }

    /// The same piece together with the coefficients of its derivative.
    #[must_use]
    pub fn with_slopes(mut self) -> Self {
        self.slopes = self.derivative();
        self
    }

    /// Coordinate of a time in [−1, 1].
    pub(super) fn place(&self, time: f64) -> f64 {
        ((time - self.start) - (self.end - time)) / (self.end - self.start)
    }

    /// Values of all components at a time.
    pub fn value(&self, time: f64, out: &mut [f64]) {
        let x = self.place(time);
        for (out, c) in out
            .iter_mut()
            .zip(self.coefficients.chunks_exact(self.terms))
        {
            *out = chebyshev::value(c, x);
        }
    }

    /// Derivatives of all components at a time.
    pub fn slope(&self, time: f64, out: &mut [f64]) {
        let x = self.place(time);
        let slopes = self.derivative();
        for (out, d) in out.iter_mut().zip(slopes.chunks_exact(self.terms)) {
            *out = chebyshev::value(d, x);
        }
    }

    /// Coefficients of the derivative in time.
    pub fn derivative(&self) -> Vec<f64> {
        let mut slopes = vec![0.0; self.coefficients.len()];
        let scale = 2.0 / (self.end - self.start);
        let pairs = self.coefficients.chunks_exact(self.terms);
        for (c, d) in pairs.zip(slopes.chunks_exact_mut(self.terms)) {
            chebyshev::derivative(c, scale, d);
        }
        slopes
    }
}

/// Pieces in the order of time, without gaps.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct History {
    pieces: VecDeque<Piece>,
    /// Number of stored pieces before the start of the solution.
    past_pieces: usize,
}

impl History {
    /// The given past of a solution.
    pub fn new(pieces: Vec<Piece>) -> Self {
        Self {
            past_pieces: pieces.len(),
            pieces: pieces.into(),
        }
    }

    /// All stored pieces.
    pub fn pieces(&self) -> impl ExactSizeIterator<Item = &Piece> {
        self.pieces.iter()
    }

    /// Number of stored pieces.
    pub fn len(&self) -> usize {
        self.pieces.len()
    }

    /// Is there no past at all?
    pub fn is_empty(&self) -> bool {
        self.pieces.is_empty()
    }

    /// The piece at an index from [`History::locate`].
    pub fn piece(&self, index: usize) -> Option<&Piece> {
        self.pieces.get(index)
    }

    /// The last piece of the solution itself; none before its first element is accepted.
    pub(super) fn latest(&self) -> Option<&Piece> {
        if self.pieces.len() > self.past_pieces {
            self.pieces.back()
        } else {
            None
        }
    }

    /// Index of the piece that contains a time; at a joint, of the later one.
    pub fn locate(&self, time: f64) -> Option<usize> {
        let index = self.pieces.partition_point(|piece| piece.end <= time);
        Some(index.min(self.pieces.len().checked_sub(1)?))
    }

    /// Append a piece.
    pub(super) fn push(&mut self, piece: Piece) -> Result<(), Error> {
        push_back(
            "the list of pieces of the solution",
            &mut self.pieces,
            piece,
        )
    }

    /// Remove pieces that end before `time`.
    pub(super) fn forget(&mut self, time: f64) {
        while self.pieces.len() > 1 && self.pieces.front().is_some_and(|piece| piece.end < time) {
            self.pieces.pop_front();
            self.past_pieces = self.past_pieces.saturating_sub(1);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn two() -> History {
        // 1 on [0, 1]; t on [1, 3], that is 2 + x.
        let mut history = History::new(vec![Piece::new(0.0, 1.0, 1, vec![1.0])]);
        let piece = Piece::new(1.0, 3.0, 2, vec![2.0, 1.0]).with_slopes();
        history.push(piece).unwrap();
        history
    }

    #[test]
    fn a_joint_belongs_to_the_later_piece() {
        let history = two();
        assert_eq!(history.locate(1.0), Some(1));
        assert_eq!(history.locate(0.99), Some(0));
        assert_eq!(history.locate(5.0), Some(1));
        let mut value = [0.0];
        history.piece(1).unwrap().value(2.5, &mut value);
        assert!((value[0] - 2.5).abs() < 1e-15);
        assert_eq!(history.piece(1).unwrap().slopes, [1.0, 0.0]);
    }

    #[test]
    fn what_is_forgotten_is_gone_and_the_latest_stays() {
        let mut history = two();
        history.forget(1.5);
        assert_eq!(history.len(), 1);
        history.forget(10.0);
        assert_eq!(history.len(), 1);
        assert!(history.latest().is_some());
    }
}
