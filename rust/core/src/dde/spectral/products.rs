//! Products of many short rows with one small matrix: from values at nodes to coefficients, to
//! integrals and back.
//!
//! Every component of a solution is a row. A sum Σ_j x_j m_ji is taken for eight columns i at once,
//! in the order of j, with a product and a sum each rounded, so that its bits depend neither on the
//! instruction set nor on the number of rows and columns beside it.

use pulp::{Simd, WithSimd};

use crate::simd::Instructions;

/// Columns that are summed together.
const LANES: usize = 8;

/// Rows within an array: the number `skip` of entries in front of each, and their distance.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rows {
    pub(super) skip: usize,
    pub(super) stride: usize,
}

impl Rows {
    /// Rows that touch each other.
    pub(super) const fn of(stride: usize) -> Self {
        Self { skip: 0, stride }
    }

    /// Rows without the first entry of each.
    pub(super) const fn after_first(stride: usize) -> Self {
        Self { skip: 1, stride }
    }
}

/// Multiply rows of `from` by a matrix with rows of `columns` entries, as far as both go.
pub(super) fn multiply(
    (from, rows): (&[f64], Rows),
    matrix: &[f64],
    columns: usize,
    (into, places): (&mut [f64], Rows),
) {
    Instructions::chosen().run(Product {
        from,
        rows,
        matrix,
        columns,
        into,
        places,
    });
}

struct Product<'a> {
    from: &'a [f64],
    rows: Rows,
    matrix: &'a [f64],
    columns: usize,
    into: &'a mut [f64],
    places: Rows,
}

impl WithSimd for Product<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let rows = self.from.chunks(self.rows.stride.max(1));
        let places = self.into.chunks_mut(self.places.stride.max(1));
        for (row, place) in rows.zip(places) {
            let row = row.get(self.rows.skip..).unwrap_or_default();
            let end = self.places.skip + self.columns;
            if let Some(place) = place.get_mut(self.places.skip..end) {
                one(row, self.matrix, place);
            }
        }
    }
}

/// The product of one row.
#[inline(always)]
fn one(row: &[f64], matrix: &[f64], out: &mut [f64]) {
    let columns = out.len();
    if columns < LANES {
        out.fill(0.0);
        for (x, line) in row.iter().zip(matrix.chunks_exact(columns.max(1))) {
            for (out, entry) in out.iter_mut().zip(line) {
                *out += x * entry;
            }
        }
        return;
    }
    // The last eight columns may overlap those before them.
    let last = columns - LANES;
    let mut first = 0;
    while first < columns {
        let place = |index: usize| (first + index * LANES).min(last);
        match (columns - first).div_ceil(LANES) {
            1 => some([place(0)], row, matrix, out),
            2 => some([place(0), place(1)], row, matrix, out),
            3 => some([place(0), place(1), place(2)], row, matrix, out),
            _ => some([place(0), place(1), place(2), place(3)], row, matrix, out),
        }
        first += 4 * LANES;
    }
}

/// Eight columns from each of the places on.
#[inline(always)]
fn some<const N: usize>(places: [usize; N], row: &[f64], matrix: &[f64], out: &mut [f64]) {
    let mut sums = [[0.0; LANES]; N];
    for (x, line) in row.iter().zip(matrix.chunks_exact(out.len())) {
        for (sums, place) in sums.iter_mut().zip(places) {
            let entries = line.get(place..place + LANES).unwrap_or_default();
            for (sum, entry) in sums.iter_mut().zip(entries) {
                *sum += x * entry;
            }
        }
    }
    for (sums, place) in sums.iter().zip(places) {
        if let Some(out) = out.get_mut(place..place + LANES) {
            out.copy_from_slice(sums);
        }
    }
}

/// The transpose of a matrix with rows of `columns` entries.
pub(super) fn transposed(matrix: &[f64], columns: usize) -> Vec<f64> {
    let rows = matrix.len() / columns.max(1);
    let mut out = vec![0.0; matrix.len()];
    for (index, row) in matrix.chunks_exact(columns.max(1)).enumerate() {
        for (at, value) in row.iter().enumerate() {
            out[at * rows + index] = *value;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_are_sums_in_order_for_every_instruction_set() {
        for (terms, columns) in [
            (3, 1),
            (5, 7),
            (8, 8),
            (25, 25),
            (24, 33),
            (49, 48),
            (2, 70),
        ] {
            let (rows, places) = (
                Rows::after_first(terms + 1),
                Rows {
                    skip: 2,
                    stride: columns + 3,
                },
            );
            let from: Vec<f64> = (0..3 * (terms + 1)).map(|i| (i as f64).sin()).collect();
            let matrix: Vec<f64> = (0..terms * columns).map(|i| (i as f64).cos()).collect();
            for set in Instructions::available() {
                let mut into = vec![7.0; 3 * places.stride];
                set.run(Product {
                    from: &from,
                    rows,
                    matrix: &matrix,
                    columns,
                    into: &mut into,
                    places,
                });
                for (row, found) in from.chunks(terms + 1).zip(into.chunks(places.stride)) {
                    for i in 0..columns {
                        let known = (0..terms)
                            .fold(0.0, |sum, j| sum + row[j + 1] * matrix[j * columns + i]);
                        assert_eq!(found[2 + i], known, "{terms} {columns} {i} {}", set.name());
                    }
                    assert_eq!((found[0], found[1], found[columns + 2]), (7.0, 7.0, 7.0));
                }
            }
        }
    }
}
