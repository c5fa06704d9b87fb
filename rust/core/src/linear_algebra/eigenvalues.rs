//! Eigenvalues of a real matrix, by the double-shift QR algorithm (Francis 1961, 1962).
//!
//! The matrix is balanced and reduced to Hessenberg form H; then sweeps of 3 × 3 reflections, each
//! equal to two QR steps with a conjugate pair of shifts, make subdiagonal entries small. The
//! arrangement is that of `hqr` (Martin, Peters and Wilkinson 1970) and of LAPACK's `dlahqr`: shifts
//! from the trailing block, where it has real eigenvalues twice the one closer to the last entry;
//! every tenth sweep without a result an exceptional shift; a start at two small subdiagonal
//! entries in a row. An entry is zero where it is below u (|h_kk| + |h_k+1,k+1|) and a test of Ahues
//! and Tisseur (LAPACK Working Note 122, 1997) says that this moves the eigenvalues of its 2 × 2
//! block no more than rounding does.
//!
//! Guaranteed: an end, after at most 30 sweeps a row. Expected, not proved: the eigenvalues are those
//! of a matrix within a few n u of the balanced one. Defective ones of order m are then found
//! within the m-th root of that.

use num_complex::Complex64;

use super::balance::balanced_above;
use super::hessenberg::{TINY, reduce, reflector};

/// Sweeps for each row, of at least [`FEWEST_ROWS`].
const SWEEPS: usize = 30;
const FEWEST_ROWS: usize = 10;

/// Sweeps without a result until an exceptional shift, at the end and the start in turn.
const PATIENCE: usize = 10;

/// The exceptional block is (x, b s; s, x) with x = h + a s, s the size of nearby entries: the
/// numbers of Martin, Peters and Wilkinson, chosen because they fit no matrix that stagnates.
const EXCEPTIONAL: (f64, f64) = (0.75, -0.4375);

/// Sizes of the largest entry whose squares are in the range of numbers.
const USABLE: std::ops::Range<f64> = 1e-100..1e100;

/// Size of an entry that is zero beside its neighbours, relative to them.
const UNIT: f64 = f64::EPSILON;

/// The eigenvalues of a matrix with `n` rows, conjugates beside each other; `None` where an entry
/// or an eigenvalue is not finite, or the algorithm does not converge.
pub(crate) fn eigenvalues(matrix: &[f64], n: usize) -> Option<Vec<Complex64>> {
    let largest = matrix.iter().try_fold(0.0_f64, |largest, entry| {
        entry.is_finite().then(|| largest.max(entry.abs()))
    })?;
    let exponent = if largest == 0.0 || USABLE.contains(&largest) {
        0
    } else {
        libm::ilogb(largest)
    };
    let scaled: Vec<f64>;
    let matrix = if exponent == 0 {
        matrix
    } else {
        let entries = matrix.iter().map(|x| libm::ldexp(*x, -exponent));
        scaled = entries.collect();
        &scaled
    };
    // For two rows there is a formula, which needs no balancing.
    let mut entries = if n > 2 {
        balanced_above(matrix, n, 0.0).0
    } else {
        matrix.to_vec()
    };
    reduce(&mut entries, n);
    let mut found = Hessenberg { entries, n }.eigenvalues()?;
    for z in found.iter_mut().filter(|_| exponent != 0) {
        (z.re, z.im) = (libm::ldexp(z.re, exponent), libm::ldexp(z.im, exponent));
    }
    found.iter().all(|z| z.is_finite()).then_some(found)
}

struct Hessenberg {
    entries: Vec<f64>,
    n: usize,
}

impl Hessenberg {
    fn at(&self, i: usize, j: usize) -> f64 {
        self.entries[i * self.n + j]
    }

    /// (h_kk, h_kl; h_lk, h_ll) with l = k + 1.
    fn block(&self, k: usize) -> [f64; 4] {
        let at = k * self.n + k;
        let (upper, lower) = (&self.entries[at..][..2], &self.entries[at + self.n..][..2]);
        [upper[0], upper[1], lower[0], lower[1]]
    }

    fn eigenvalues(mut self) -> Option<Vec<Complex64>> {
        let n = self.n;
        let mut found = vec![Complex64::ZERO; n];
        let (mut end, mut turns) = (n, 0);
        let mut left = SWEEPS * n.max(FEWEST_ROWS);
        while end > 0 {
            let last = end - 1;
            let start = self.deflated(last);
            match last - start {
                0 => found[last] = Complex64::from(self.at(last, last)),
                1 => (found[start], found[last]) = pair(self.block(start)),
                _ => {
                    left = left.checked_sub(1)?;
                    turns += 1;
                    let shift = self.shift(start, last, turns);
                    self.sweep(start, last, shift);
                    continue;
                }
            }
            (end, turns) = (start, 0);
        }
        Some(found)
    }

    /// The first row of the block that ends with row `last`: the entry before it becomes zero.
    fn deflated(&mut self, last: usize) -> usize {
        let start = (1..=last).rev().find(|k| self.is_zero(*k, last));
        if let Some(start) = start {
            self.entries[start * self.n + start - 1] = 0.0;
        }
        start.unwrap_or(0)
    }

    /// Is h_{k,k−1} zero to rounding?
    fn is_zero(&self, k: usize, last: usize) -> bool {
        let [a, b, c, d] = self.block(k - 1);
        let size = c.abs();
        if size <= TINY {
            return true;
        }
        let mut near = a.abs() + d.abs();
        if near == 0.0 {
            let before = if k >= 2 { self.at(k - 1, k - 2) } else { 0.0 };
            let after = if k < last { self.at(k + 1, k) } else { 0.0 };
            near = before.abs() + after.abs();
        }
        if size > UNIT * near {
            return false;
        }
        let (more, less) = (size.max(b.abs()), size.min(b.abs()));
        let gap = (a - d).abs();
        let (high, low) = (d.abs().max(gap), d.abs().min(gap));
        let sum = high + more;
        less * (more / sum) <= (UNIT * (low * (high / sum))).max(TINY)
    }

    /// One of the pair of shifts for the block of these rows, in the sweep with this number.
    fn shift(&self, start: usize, last: usize, turns: usize) -> Complex64 {
        let block = if turns.is_multiple_of(PATIENCE) {
            let at_end = turns.is_multiple_of(2 * PATIENCE);
            let (k, place) = if at_end {
                (last - 1, last)
            } else {
                (start + 1, start)
            };
            let size = self.at(k, k - 1).abs() + self.at(k + 1, k).abs();
            let x = self.at(place, place) + EXCEPTIONAL.0 * size;
            [x, EXCEPTIONAL.1 * size, size, x]
        } else {
            self.block(last - 1)
        };
        let (first, second) = pair(block);
        let far = |z: Complex64| (z.re - block[3]).abs();
        if first.im == 0.0 && far(second) < far(first) {
            second
        } else {
            first
        }
    }

    /// One sweep over the rows from `start` to `last` with the shifts z and its conjugate.
    fn sweep(&mut self, start: usize, last: usize, z: Complex64) {
        let (first, mut v) = self.bulge(start, last, z);
        let n = self.n;
        for k in first..last {
            let size = (last - k + 1).min(3);
            if k > first {
                for (i, v) in v.iter_mut().enumerate().take(size) {
                    *v = self.at(k + i, k - 1);
                }
            }
            let (head, tau) = reflector(&mut v[..size]);
            if k > first {
                for i in 0..size {
                    self.entries[(k + i) * n + k - 1] = if i == 0 { head } else { 0.0 };
                }
            } else if k > start {
                // Only to rounding are the entries below zero after the reflection.
                self.entries[k * n + k - 1] *= 1.0 - tau;
            }
            if size == 3 {
                self.reflect(v, tau, k, start..(k + 4).min(last + 1), last);
            } else {
                self.reflect([v[0], v[1]], tau, k, start..last + 1, last);
            }
        }
    }

    /// Multiply by I − τ v vᵀ at row and column k: from the left up to column `last`, from the right
    /// the rows of a range.
    #[inline(always)]
    fn reflect<const N: usize>(
        &mut self,
        v: [f64; N],
        tau: f64,
        k: usize,
        range: std::ops::Range<usize>,
        last: usize,
    ) {
        let n = self.n;
        let weights = v.map(|v| tau * v);
        let places = std::array::from_fn::<_, N, _>(|i| (k + i) * n + k..(k + i) * n + last + 1);
        if let Ok(mut rows) = self.entries.get_disjoint_mut(places) {
            for j in 0..=last - k {
                let sum: f64 = rows.iter().zip(v).map(|(row, v)| v * row[j]).sum();
                for (row, weight) in rows.iter_mut().zip(weights) {
                    row[j] -= sum * weight;
                }
            }
        }
        for row in self.entries[range.start * n..range.end * n].chunks_exact_mut(n) {
            let row = &mut row[k..k + N];
            let sum: f64 = row.iter().zip(v).map(|(x, v)| x * v).sum();
            for (x, weight) in row.iter_mut().zip(weights) {
                *x -= sum * weight;
            }
        }
    }

    /// Where a sweep starts, and the first column of (H − z)(H − z̄) there, scaled: not before the
    /// last row at which two subdiagonal entries in a row are small enough.
    fn bulge(&self, start: usize, last: usize, z: Complex64) -> (usize, [f64; 3]) {
        let mut k = last - 2;
        loop {
            let [a, b, c, d] = self.block(k);
            let size = (a - z.re).abs() + z.im.abs() + c.abs();
            let c = c / size;
            let column = [
                c * b + (a - z.re) * ((a - z.re) / size) + z.im * (z.im / size),
                c * (a + d - 2.0 * z.re),
                c * self.at(k + 2, k + 1),
            ];
            let sum = column.iter().map(|x| x.abs()).sum::<f64>();
            let column = column.map(|x| x / sum);
            if k == start {
                return (k, column);
            }
            let near = self.at(k - 1, k - 1).abs() + a.abs() + d.abs();
            let moved = self.at(k, k - 1).abs() * (column[1].abs() + column[2].abs());
            if moved <= UNIT * column[0].abs() * near {
                return (k, column);
            }
            k -= 1;
        }
    }
}

/// The eigenvalues of (a, b; c, d), with numbers that neither overflow nor cancel.
fn pair([a, b, c, d]: [f64; 4]) -> (Complex64, Complex64) {
    let half = 0.5 * (a - d);
    let size = half.abs().max(b.abs()).max(c.abs());
    if size == 0.0 {
        return (Complex64::from(a), Complex64::from(d));
    }
    let square = (half / size) * (half / size) + (b / size) * (c / size);
    let root = size * square.abs().sqrt();
    if square < 0.0 {
        let z = Complex64::new(d + half, root);
        return (z, z.conj());
    }
    let more = half + root.copysign(half);
    let second = if more == 0.0 { d } else { d - b / more * c };
    (Complex64::from(d + more), Complex64::from(second))
}

#[cfg(test)]
mod tests;
