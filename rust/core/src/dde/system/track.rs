//! Vector functions of time in pieces of Legendre series: state, derivative of the state and
//! inputs.

use std::collections::VecDeque;

use super::legendre;
use super::legendre::{DEGREE, Series, TERMS};

/// Largest difference between a series through several pieces and these pieces between its nodes,
/// as a share of the size to which their rounding errors are relative. With a smaller one, rounding
/// errors at joints end elements, and the number of elements grows with every delay: with 1e-11 a
/// run of a stiff neutral system with three delays does not end, with 1e-9 its cost is linear in
/// time.
const UNREAD: f64 = 1e-9;

/// Stretches of a piece shorter than this many times the rounding error of times are not compared.
const THIN: f64 = 16.0;

/// Values so close to the smallest number that they are not resolved relative to their size.
pub(super) const NEGLIGIBLE: f64 = f64::MIN_POSITIVE / f64::EPSILON;

/// Kinds of sizes.
pub(super) const KINDS: usize = 4;

/// One piece: coefficient k of column j at `series[j (degree + 1) + k]`.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Piece {
    pub(super) start: f64,
    pub(super) end: f64,
    pub(super) degree: usize,
    pub(super) series: Vec<f64>,
    /// Sizes of each column, see [`super::element`].
    pub(super) size: Vec<Sizes>,
    /// Exact values at the start, where they are known: the series gives them up to rounding
    /// errors.
    first: Vec<f64>,
}

/// The size of a signal; then the sizes to which its rounding error is relative, with the rounding
/// errors of what drives it, of what drives that, and so on.
pub(super) type Sizes = [f64; KINDS];

impl Piece {
    /// From series of equal length, one for each column.
    pub(super) fn new(start: f64, end: f64, degree: usize, series: Vec<f64>) -> Self {
        let size = series
            .chunks_exact(degree + 1)
            .map(|column| [column.iter().map(|c| c.abs()).sum(); KINDS])
            .collect();
        Self {
            start,
            end,
            degree,
            series,
            size,
            first: Vec::new(),
        }
    }

    pub(super) fn constant(start: f64, end: f64, values: Vec<f64>) -> Self {
        Self::new(start, end, 0, values)
    }

    pub(super) fn column(&self, column: usize) -> &[f64] {
        let terms = self.degree + 1;
        &self.series[column * terms..(column + 1) * terms]
    }

    fn length(&self) -> f64 {
        self.end - self.start
    }

    /// ξ of time `s`.
    fn local(&self, s: f64) -> f64 {
        ((s - self.start) - (self.end - s)) / self.length()
    }

    /// Value of a column at time `s`.
    pub(super) fn at(&self, s: f64, column: usize) -> f64 {
        if s == self.start
            && let Some(first) = self.first.get(column)
        {
            return *first;
        }
        match self.column(column) {
            [c] => *c,
            series => legendre::at(series, self.local(s)),
        }
    }

    /// Bounds of h^k/k! times the k-th derivative of a column, for all k up to [`DEGREE`].
    ///
    /// Exact for lines. A series that is resolved up to rounding errors represents a function whose
    /// rates are below 8 over the length of the piece.
    pub(super) fn taylor_bounds(&self, s: f64, column: usize, h: f64) -> Series {
        let mut bounds = [0.0; TERMS];
        bounds[0] = self.at(s, column).abs();
        match self.column(column) {
            [] | [_] => {}
            [_, slope] => bounds[1] = (2.0 * slope * h / self.length()).abs(),
            series => {
                let mut bound = series.iter().map(|c| c.abs()).sum::<f64>();
                for (k, out) in bounds.iter_mut().enumerate().skip(1) {
                    bound *= 8.0 * h / (self.length() * k as f64);
                    *out = bound;
                }
            }
        }
        bounds
    }
}

/// Give all pieces of a curve the rounding error of its largest values: next to a pulse its tail
/// must not be resolved like a signal.
pub(super) fn share_rounding(pieces: &mut [Piece]) {
    let curved = |piece: &&mut Piece| piece.degree > 1;
    let mut largest: Vec<f64> = Vec::new();
    for piece in pieces.iter_mut().filter(curved) {
        largest.resize(piece.size.len(), 0.0);
        for (largest, size) in largest.iter_mut().zip(&piece.size) {
            *largest = largest.max(size[0]);
        }
    }
    for piece in pieces.iter_mut().filter(curved) {
        for (size, largest) in piece.size.iter_mut().zip(&largest) {
            size[1..].fill(*largest);
        }
    }
}

/// Pieces one after the other; indices count from the first piece, including removed ones.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Track {
    width: usize,
    pieces: VecDeque<Piece>,
    dropped: usize,
    spare: Vec<Piece>,
}

impl Track {
    pub(super) fn new(width: usize, pieces: Vec<Piece>) -> Self {
        Self {
            width,
            pieces: pieces.into(),
            dropped: 0,
            spare: Vec::new(),
        }
    }

    /// Remove what comes after `end`.
    pub(super) fn close(&mut self, end: f64) {
        while self.pieces.len() > 1 && self.pieces.back().is_some_and(|last| last.start >= end) {
            self.pieces.pop_back();
        }
        if let Some(last) = self.pieces.back_mut()
            && last.degree == 0
        {
            last.end = end;
        }
    }

    pub(super) fn width(&self) -> usize {
        self.width
    }

    pub(super) fn pieces(&self) -> impl DoubleEndedIterator<Item = &Piece> {
        self.pieces.iter()
    }

    /// Append a piece from series of [`TERMS`] coefficients for each column; those above `degree`
    /// are zero.
    pub(super) fn push(
        &mut self,
        start: f64,
        end: f64,
        degree: usize,
        series: &[f64],
        size: &[Sizes],
    ) {
        let mut piece = self.spare.pop().unwrap_or_default();
        (piece.start, piece.end, piece.degree) = (start, end, degree);
        piece.series.clear();
        for column in series.chunks_exact(TERMS) {
            piece.series.extend_from_slice(&column[..=degree]);
        }
        piece.size.clear();
        piece.size.extend_from_slice(size);
        piece.first.clear();
        self.pieces.push_back(piece);
    }

    /// Set the exact values at the start of the last piece.
    pub(super) fn begin(&mut self, values: &[f64]) {
        if let Some(piece) = self.pieces.back_mut() {
            piece.first.extend_from_slice(values);
        }
    }

    /// Remove pieces that end before `s`, except the last one.
    pub(super) fn forget(&mut self, s: f64) {
        while self.pieces.len() > 1 && self.pieces.front().is_some_and(|piece| piece.end < s) {
            self.dropped += 1;
            if let Some(piece) = self.pieces.pop_front() {
                self.spare.push(piece);
            }
        }
    }

    fn get(&self, place: usize) -> Option<&Piece> {
        self.pieces.get(place.saturating_sub(self.dropped))
    }

    /// Advance `place` to the piece that contains the time just after `s`.
    pub(super) fn seek(&self, place: &mut usize, s: f64, slack: f64) {
        *place = (*place).max(self.dropped);
        let last = (self.dropped + self.pieces.len()).saturating_sub(1);
        while *place < last && self.get(*place).is_some_and(|piece| piece.end <= s + slack) {
            *place += 1;
        }
    }

    /// Value of a column at `s`, which lies in the piece at `place`.
    pub(super) fn at(&self, place: usize, s: f64, column: usize) -> f64 {
        self.get(place).map_or(0.0, |piece| piece.at(s, column))
    }

    /// Sizes of a column at `place`.
    pub(super) fn size(&self, place: usize, column: usize) -> Sizes {
        self.get(place)
            .map_or([0.0; KINDS], |piece| piece.size[column])
    }

    /// [`Piece::taylor_bounds`] of the piece at `place`.
    pub(super) fn taylor_bounds(&self, place: usize, s: f64, column: usize, h: f64) -> Series {
        self.get(place)
            .map_or([0.0; TERMS], |piece| piece.taylor_bounds(s, column, h))
    }

    /// Series of a column over [s, s + h], where `place` is the index of the piece at s; its
    /// degree; and the part of h on which it represents the column, see [`stretch_is_read`].
    pub(super) fn read(
        &self,
        place: usize,
        s: f64,
        h: f64,
        slack: f64,
        column: usize,
    ) -> (Series, usize, f64) {
        let Some(piece) = self.get(place) else {
            return ([0.0; TERMS], 0, h);
        };
        if self.is_last(place) || s + h <= piece.end + slack {
            return (part(piece, s, h, slack, column), piece.degree, h);
        }
        let mut values = [0.0; TERMS];
        let (mut at, mut from) = (place, 0);
        while let Some(piece) = self.get(at) {
            let nodes = &legendre::nodes()[from..];
            let last = self.is_last(at);
            let inside = |node: &&f64| last || s + 0.5 * h * (1.0 + **node) < piece.end;
            let until = from + nodes.iter().take_while(inside).count();
            if piece.degree == 0 {
                values[from..until].fill(piece.at(s, column));
            } else if until > from {
                let (offset, ratio) = window(piece, s, h);
                legendre::at_nodes(
                    piece.column(column),
                    offset,
                    ratio,
                    from..until,
                    &mut values,
                );
            }
            if until == TERMS {
                break;
            }
            from = until;
            at += 1;
        }
        let series = legendre::from_values(&values);
        let size = values.iter().fold(0.0, |m, value| f64::max(m, value.abs()));
        let until = self.read_until(place, (s, h), slack, column, (&series, size));
        (series, DEGREE, until)
    }

    fn is_last(&self, place: usize) -> bool {
        self.dropped + self.pieces.len() <= place + 1
    }

    /// The length from s on which a series through several pieces represents all of them: up to the
    /// start of the first one that it does not represent, or through that one where it is the
    /// first.
    fn read_until(
        &self,
        place: usize,
        (s, h): (f64, f64),
        slack: f64,
        column: usize,
        (series, size): (&Series, f64),
    ) -> f64 {
        let end = s + h;
        let (mut place, mut low) = (place, s);
        while let Some(piece) = self.get(place) {
            let last = self.is_last(place) || piece.end + slack >= end;
            let high = if last { end } else { piece.end };
            if high - low > THIN * slack
                && !stretch_is_read(piece, column, (low, high), (s, h), (series, size))
            {
                if low - s > THIN * slack {
                    return low - s;
                }
                if end - high > THIN * slack {
                    return high - s;
                }
            }
            if last {
                break;
            }
            low = high;
            place += 1;
        }
        h
    }
}

/// Does a series over [s, s + h] equal the piece on [low, high]? Two polynomials that agree at all
/// Gauss nodes of the stretch, up to rounding errors, are equal. `size` is that of the series.
fn stretch_is_read(
    piece: &Piece,
    column: usize,
    (low, high): (f64, f64),
    (s, h): (f64, f64),
    (series, size): (&Series, f64),
) -> bool {
    let length = high - low;
    let (mut found, mut stored) = ([0.0; TERMS], [0.0; TERMS]);
    let offset = ((low - s) - (s + h - high)) / h;
    legendre::at_nodes(series, offset, length / h, 0..TERMS, &mut found);
    if piece.degree == 0 {
        stored.fill(piece.column(column)[0]);
    } else {
        let (offset, ratio) = window(piece, low, length);
        legendre::at_nodes(piece.column(column), offset, ratio, 0..TERMS, &mut stored);
    }
    let rounding = piece.size[column].iter().fold(size, |m, size| m.max(*size));
    let pairs = found.iter().zip(&stored);
    let off = pairs.fold(0.0, |off, (a, b)| f64::max(off, (a - b).abs()));
    off <= (UNREAD * rounding).max(NEGLIGIBLE)
}

/// Series of a column of one piece over [s, s + h].
fn part(piece: &Piece, s: f64, h: f64, slack: f64, column: usize) -> Series {
    let series = piece.column(column);
    if piece.degree == 0 {
        return legendre::restricted(series, 0.0, 1.0);
    }
    if (s - piece.start).abs() <= slack && (h - piece.length()).abs() <= slack {
        let mut out = [0.0; TERMS];
        out[..series.len()].copy_from_slice(series);
        return out;
    }
    let (offset, ratio) = window(piece, s, h);
    legendre::restricted(series, offset, ratio)
}

/// Offset and ratio that map ξ of [s, s + h] to that of the piece.
fn window(piece: &Piece, s: f64, h: f64) -> (f64, f64) {
    (piece.local(s + 0.5 * h), h / piece.length())
}
