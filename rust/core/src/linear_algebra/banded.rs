//! LU factors with partial pivoting of a complex matrix whose entries lie near its diagonal.
//!
//! Row i holds the columns i − b … i + 2 b, because exchanges of rows widen U to 2 b. The
//! multipliers are stored separately, and exchanges are made during the solution (as in LAPACK's
//! `gbtrf`).

use num_complex::Complex64;

const ZERO: Complex64 = Complex64::new(0.0, 0.0);

/// A matrix to be filled, or its factors.
#[derive(Debug)]
pub(crate) struct Banded {
    n: usize,
    band: usize,
    rows: Vec<Complex64>,
    multipliers: Vec<Complex64>,
    pivots: Vec<usize>,
}

impl Banded {
    /// Number of entries in factors of this size.
    pub(crate) fn size(n: usize, band: usize) -> usize {
        n * (4 * band + 1)
    }

    /// The zero matrix.
    pub(crate) fn new(n: usize, band: usize) -> Self {
        Self {
            n,
            band,
            rows: vec![ZERO; n * (3 * band + 1)],
            multipliers: vec![ZERO; n * band],
            pivots: vec![0; n],
        }
    }

    /// An entry within the band.
    pub(crate) fn entry(&mut self, row: usize, column: usize) -> &mut Complex64 {
        let width = 3 * self.band + 1;
        &mut self.rows[row * width + (column + self.band - row)]
    }

    /// Replace the matrix by its factors; `false` where it is singular.
    pub(crate) fn factorise(&mut self) -> bool {
        let (n, band, width) = (self.n, self.band, 3 * self.band + 1);
        for k in 0..n {
            let below = (k + band).min(n - 1);
            let mut pivot = k;
            for row in k + 1..=below {
                if self.entry(row, k).l1_norm() > self.entry(pivot, k).l1_norm() {
                    pivot = row;
                }
            }
            self.pivots[k] = pivot;
            let last = (k + 2 * band).min(n - 1);
            if pivot != k {
                for column in k..=last {
                    let swapped = *self.entry(k, column);
                    *self.entry(k, column) = std::mem::replace(self.entry(pivot, column), swapped);
                }
            }
            let top = *self.entry(k, k);
            if top == ZERO || !top.is_finite() {
                return false;
            }
            let inverse = top.inv();
            let (known, rest) = self.rows.split_at_mut((k + 1) * width);
            let upper = &known[k * width + band + 1..][..last - k];
            for (i, row) in rest.chunks_exact_mut(width).take(below - k).enumerate() {
                // Column k is at band − 1 − i of the i-th row below.
                let at = band - 1 - i;
                let factor = row[at] * inverse;
                self.multipliers[k * band + i] = factor;
                if factor != ZERO {
                    for (entry, above) in row[at + 1..].iter_mut().zip(upper) {
                        *entry -= factor * above;
                    }
                }
            }
        }
        true
    }

    /// Solve in place.
    pub(crate) fn solve(&self, x: &mut [Complex64]) {
        let (n, band, width) = (self.n, self.band, 3 * self.band + 1);
        for k in 0..n {
            x.swap(k, self.pivots[k]);
            let (known, rest) = x.split_at_mut(k + 1);
            let head = known[k];
            for (x, factor) in rest
                .iter_mut()
                .zip(&self.multipliers[k * band..(k + 1) * band])
            {
                *x -= factor * head;
            }
        }
        for k in (0..n).rev() {
            let (head, known) = x.split_at_mut(k + 1);
            let row = &self.rows[k * width + band..(k + 1) * width];
            let sum: Complex64 = row[1..].iter().zip(known).map(|(a, x)| *a * *x).sum();
            head[k] = (head[k] - sum) / row[0];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solves_bands_that_need_exchanges() {
        for (n, band) in [(1, 0), (7, 1), (12, 3), (5, 4), (30, 2)] {
            let mut matrix = Banded::new(n, band);
            let mut full = vec![ZERO; n * n];
            let mut state = 7_u64;
            for row in 0..n {
                for column in row.saturating_sub(band)..(row + band + 1).min(n) {
                    state = state
                        .wrapping_mul(6_364_136_223_846_793_005)
                        .wrapping_add(1);
                    let value = Complex64::new((state >> 33) as f64 / 2e9 - 1.0, 0.3);
                    // A small diagonal makes rows change places.
                    let value = if row == column { 1e-3 * value } else { value };
                    *matrix.entry(row, column) = value;
                    full[row * n + column] = value;
                }
            }
            let known: Vec<_> = (0..n).map(|i| Complex64::new(i as f64, 1.0)).collect();
            let mut x: Vec<Complex64> = full
                .chunks_exact(n)
                .map(|row| row.iter().zip(&known).map(|(a, x)| a * x).sum())
                .collect();
            assert!(matrix.factorise());
            matrix.solve(&mut x);
            for (x, known) in x.iter().zip(&known) {
                assert!((x - known).norm() < 1e-10, "{n} {band}");
            }
        }
        assert!(!Banded::new(3, 1).factorise());
    }
}
