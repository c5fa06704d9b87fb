//! The numbers of sixteen sampled loops, one loop in each column.

use crate::simd::{Real, Simd};

use super::sets::{SETS, Sets, of};
use super::shape::Shape;
use super::transition::Matrix;

/// One number for each loop of a block.
pub(super) type Column = [f64; SETS];

/// Sets of one shape, by their indices.
pub(super) type Members<'a> = (Shape, &'a [usize]);

/// Loops of one shape.
#[derive(Debug)]
pub(super) struct Block {
    pub(super) shape: Shape,
    pub(super) states: usize,
    pub(super) amplitude: f64,
    pub(super) is_ahead: bool,
    /// The entries of a row.
    columns: Vec<Column>,
}

/// The places in a row after its matrices.
#[derive(Debug, Clone, Copy)]
pub(super) enum Number {
    L,
    M,
    D,
    Delay = 4,
    SampleTime,
    Limit,
}

impl Block {
    /// A block of at most [`SETS`] loops of one shape; the last loop fills the unused columns.
    pub(super) fn new(sets: &Sets<'_>, (shape, members): Members<'_>) -> Option<Self> {
        let &last = members.last()?;
        let entries = sets.entries().iter();
        let columns = entries.map(|entry| match entry {
            [shared] => [*shared; SETS],
            each => {
                let mut column = [of(each, last); SETS];
                for (place, &set) in column.iter_mut().zip(members) {
                    *place = of(each, set);
                }
                column
            }
        });
        Some(Self {
            shape,
            states: sets.states(),
            amplitude: sets.amplitude,
            is_ahead: sets.is_ahead,
            columns: columns.collect(),
        })
    }

    /// Entry `place` of the rows of pair number `pair` of vectors.
    #[inline(always)]
    pub(super) fn load<S: Simd>(&self, simd: S, place: usize, pair: usize) -> Real<S> {
        match self.columns.get(place) {
            Some(column) => load(simd, column, pair),
            None => Real::splat(simd, f64::NAN),
        }
    }

    /// Entries `place` and following.
    #[inline(always)]
    pub(super) fn column<S: Simd, const N: usize>(
        &self,
        simd: S,
        place: usize,
        pair: usize,
    ) -> [Real<S>; N] {
        let mut column = [Real::splat(simd, 0.0); N];
        for (i, entry) in column.iter_mut().enumerate() {
            *entry = self.load(simd, place + i, pair);
        }
        column
    }

    /// A of the loops, `N` states each.
    #[inline(always)]
    pub(super) fn matrix<S: Simd, const N: usize>(&self, simd: S, pair: usize) -> Matrix<S, N> {
        let mut a = [[Real::splat(simd, 0.0); N]; N];
        for (i, row) in a.iter_mut().enumerate() {
            *row = self.column(simd, i * N, pair);
        }
        a
    }

    /// A number of the rows.
    #[inline(always)]
    pub(super) fn number<S: Simd>(&self, simd: S, number: Number, pair: usize) -> Real<S> {
        let n = self.states;
        self.load(simd, n * n + 4 * n + number as usize, pair)
    }
}

/// Vector pair number `pair` of a column.
#[inline(always)]
pub(super) fn load<S: Simd>(simd: S, column: &Column, pair: usize) -> Real<S> {
    match S::as_simd_f64s(column).0.as_chunks().0.get(pair) {
        Some([a, b]) => Real::new(simd, [*a, *b]),
        None => Real::splat(simd, 0.0),
    }
}
