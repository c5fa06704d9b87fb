//! Complex matrices by rows, in blocks as wide as registers.

use num_complex::Complex64;

/// Numbers that are processed at once: one register of the widest instruction set.
pub(crate) const BLOCK: usize = 8;

/// A complex matrix by rows, real and imaginary parts apart.
///
/// Rows are filled up with zeros to whole blocks.
#[derive(Debug, Clone, Default)]
pub(crate) struct Rows {
    pub(crate) size: usize,
    pub(crate) re: Vec<f64>,
    pub(crate) im: Vec<f64>,
}

impl Rows {
    pub(crate) fn zeros(size: usize) -> Self {
        Self::of(size, size)
    }

    /// One row of `size` columns.
    pub(crate) fn one(size: usize) -> Self {
        Self::of(1, size)
    }

    fn of(rows: usize, size: usize) -> Self {
        let whole = rows * size.div_ceil(BLOCK) * BLOCK;
        Self {
            size,
            re: vec![0.0; whole],
            im: vec![0.0; whole],
        }
    }

    /// Numbers from one row to the next.
    pub(crate) fn stride(&self) -> usize {
        self.blocks() * BLOCK
    }

    /// Blocks of a row.
    pub(crate) fn blocks(&self) -> usize {
        self.size.div_ceil(BLOCK)
    }

    /// Blocks of all rows.
    pub(crate) fn parts(&self) -> (&[[f64; BLOCK]], &[[f64; BLOCK]]) {
        (self.re.as_chunks().0, self.im.as_chunks().0)
    }

    pub(crate) fn blocks_mut(&mut self) -> (&mut [[f64; BLOCK]], &mut [[f64; BLOCK]]) {
        (self.re.as_chunks_mut().0, self.im.as_chunks_mut().0)
    }

    pub(crate) fn get(&self, row: usize, column: usize) -> Complex64 {
        let at = row * self.stride() + column;
        match (self.re.get(at), self.im.get(at)) {
            (Some(re), Some(im)) => Complex64::new(*re, *im),
            _ => Complex64::ZERO,
        }
    }

    pub(crate) fn add(&mut self, row: usize, column: usize, x: Complex64) {
        let at = row * self.stride() + column;
        if let (Some(re), Some(im)) = (self.re.get_mut(at), self.im.get_mut(at)) {
            *re += x.re;
            *im += x.im;
        }
    }

    pub(crate) fn row(&self, row: usize) -> (&[f64], &[f64]) {
        let start = row * self.stride();
        let range = start..start + self.size;
        (
            self.re.get(range.clone()).unwrap_or(&[]),
            self.im.get(range).unwrap_or(&[]),
        )
    }

    /// Euclidean norms of the rows.
    pub(crate) fn norms(&self) -> Vec<f64> {
        (0..self.size).map(|row| norm(self.row(row))).collect()
    }
}

/// Euclidean norm with a relative error of n u; infinite or NaN where squares overflow.
pub(crate) fn norm((re, im): (&[f64], &[f64])) -> f64 {
    let mut sums = [0.0; BLOCK];
    let mut rest = 0.0;
    for part in [re, im] {
        let (blocks, others) = part.as_chunks::<BLOCK>();
        for block in blocks {
            for (sum, x) in sums.iter_mut().zip(block) {
                *sum += x * x;
            }
        }
        rest += others.iter().map(|x| x * x).sum::<f64>();
    }
    (sums.iter().sum::<f64>() + rest).sqrt()
}
