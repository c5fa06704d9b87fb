//! LU factors of a complex matrix with partial pivoting and their inverse, compiled for every
//! instruction set.
//!
//! Rows are processed in blocks of [`BLOCK`] numbers, and no operation crosses lanes, so that the
//! bits do not depend on the instruction set. The loops count and index: methods of iterators and of
//! complex numbers are not inlined into functions compiled for another instruction set.

use num_complex::Complex64;
use pulp::{Simd, WithSimd};

use super::rows::{BLOCK, Rows};
use crate::simd::Instructions;

/// Moduli of pivots whose squares and reciprocals are normal numbers.
const USABLE: std::ops::Range<f64> = 1e-140..1e140;

type Block = [f64; BLOCK];

/// Real and imaginary parts of rows.
type Parts<'a> = (&'a [Block], &'a [Block]);

/// A matrix as P A = L U.
#[derive(Debug)]
pub(crate) struct Eliminated {
    /// L below its diagonal of ones.
    pub(crate) lower: Rows,
    /// U; what is below its diagonal has no meaning.
    pub(crate) upper: Rows,
    /// Product of the pivots over their moduli, with the sign of the permutation.
    pub(crate) direction: Complex64,
    /// Row of A that becomes row k.
    order: Vec<usize>,
    /// 1 over the pivots.
    reciprocals: Vec<(f64, f64)>,
}

impl Eliminated {
    /// Factor with partial pivoting; `None` where a pivot is zero or leaves the usable range.
    pub(crate) fn new(matrix: Rows) -> Option<Self> {
        Instructions::chosen().run(Elimination(matrix))
    }

    /// A⁻¹.
    pub(crate) fn inverse(&self) -> Rows {
        Instructions::chosen().run(Inversion(self))
    }

    /// Replace a right-hand side by the solution.
    pub(crate) fn solve(&self, x: &mut [Complex64]) {
        // Zero where nothing is known yet, so that whole blocks of L and U can be summed.
        let mut known = vec![([0.0; BLOCK], [0.0; BLOCK]); self.upper.blocks()];
        let right: Vec<Complex64> = self.order.iter().map(|row| x[*row]).collect();
        for (i, right) in right.into_iter().enumerate() {
            x[i] = right - sum(&self.lower, i, 0..i.div_ceil(BLOCK), &known);
            put(&mut known, i, x[i]);
        }
        known.fill(([0.0; BLOCK], [0.0; BLOCK]));
        for (i, (a, b)) in self.reciprocals.iter().enumerate().rev() {
            let left = x[i] - sum(&self.upper, i, (i + 1) / BLOCK..known.len(), &known);
            x[i] = left * Complex64::new(*a, *b);
            put(&mut known, i, x[i]);
        }
    }
}

fn put(known: &mut [(Block, Block)], i: usize, x: Complex64) {
    let (re, im) = &mut known[i / BLOCK];
    (re[i % BLOCK], im[i % BLOCK]) = (x.re, x.im);
}

/// Σ_k a_ik x_k over some blocks of row i.
fn sum(rows: &Rows, i: usize, range: std::ops::Range<usize>, x: &[(Block, Block)]) -> Complex64 {
    let (re, im) = rows.parts();
    let (mut sum_re, mut sum_im) = ([0.0; BLOCK], [0.0; BLOCK]);
    for c in range {
        let at = i * rows.blocks() + c;
        let ((a, b), (x, y)) = ((&re[at], &im[at]), &x[c]);
        for l in 0..BLOCK {
            sum_re[l] += a[l] * x[l] - b[l] * y[l];
            sum_im[l] += a[l] * y[l] + b[l] * x[l];
        }
    }
    Complex64::new(sum_re.iter().sum(), sum_im.iter().sum())
}

struct Elimination(Rows);

impl WithSimd for Elimination {
    type Output = Option<Eliminated>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Self::Output {
        let Self(mut upper) = self;
        let (n, stride) = (upper.size, upper.blocks());
        let mut lower = Rows::zeros(n);
        let mut order: Vec<usize> = (0..n).collect();
        let mut reciprocals = vec![(0.0, 0.0); n];
        let direction = factor(
            (&mut upper, &mut lower),
            (n, stride),
            (&mut order, &mut reciprocals),
        )?;
        Some(Eliminated {
            lower,
            upper,
            direction,
            order,
            reciprocals,
        })
    }
}

struct Inversion<'a>(&'a Eliminated);

impl WithSimd for Inversion<'_> {
    type Output = Rows;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Rows {
        let Self(of) = self;
        let n = of.upper.size;
        let mut inverse = Rows::zeros(n);
        invert(
            (&of.lower, &of.upper),
            (n, of.upper.blocks()),
            (&of.order, &of.reciprocals),
            &mut inverse,
        );
        inverse
    }
}

#[inline(always)]
fn factor(
    (upper, lower): (&mut Rows, &mut Rows),
    (n, stride): (usize, usize),
    (order, reciprocals): (&mut [usize], &mut [(f64, f64)]),
) -> Option<Complex64> {
    let (re, im) = upper.blocks_mut();
    let (low_re, low_im) = lower.blocks_mut();
    let mut direction = (1.0, 0.0);
    for k in 0..n {
        let (block, lane) = (k / BLOCK, k % BLOCK);
        let (mut best, mut largest) = (k, 0.0);
        for i in k..n {
            let (x, y) = (re[i * stride + block][lane], im[i * stride + block][lane]);
            let size = x * x + y * y;
            if size > largest {
                (best, largest) = (i, size);
            }
        }
        if best != k {
            for c in 0..stride {
                let (a, b) = (k * stride + c, best * stride + c);
                (re[a], re[b]) = (re[b], re[a]);
                (im[a], im[b]) = (im[b], im[a]);
                (low_re[a], low_re[b]) = (low_re[b], low_re[a]);
                (low_im[a], low_im[b]) = (low_im[b], low_im[a]);
            }
            (order[k], order[best]) = (order[best], order[k]);
            direction = (-direction.0, -direction.1);
        }
        let (x, y) = (re[k * stride + block][lane], im[k * stride + block][lane]);
        let square = x * x + y * y;
        let size = square.sqrt();
        if !USABLE.contains(&size) {
            return None;
        }
        let (p, q) = (x / size, y / size);
        direction = (
            direction.0 * p - direction.1 * q,
            direction.0 * q + direction.1 * p,
        );
        let reciprocal = (x / square, -y / square);
        reciprocals[k] = reciprocal;
        for i in k + 1..n {
            let (x, y) = (re[i * stride + block][lane], im[i * stride + block][lane]);
            if x == 0.0 && y == 0.0 {
                continue;
            }
            let a = x * reciprocal.0 - y * reciprocal.1;
            let b = x * reciprocal.1 + y * reciprocal.0;
            low_re[i * stride + block][lane] = a;
            low_im[i * stride + block][lane] = b;
            // Whole blocks: what is left of the diagonal is not used any more.
            for c in (k + 1) / BLOCK..stride {
                let (from_re, from_im) = (re[k * stride + c], im[k * stride + c]);
                let (mut own_re, mut own_im) = (re[i * stride + c], im[i * stride + c]);
                for l in 0..BLOCK {
                    own_re[l] -= a * from_re[l] - b * from_im[l];
                    own_im[l] -= a * from_im[l] + b * from_re[l];
                }
                re[i * stride + c] = own_re;
                im[i * stride + c] = own_im;
            }
        }
    }
    Some(Complex64::new(direction.0, direction.1))
}

/// R with L U R = P, the permuted identity.
#[inline(always)]
fn invert(
    (lower, upper): (&Rows, &Rows),
    (n, stride): (usize, usize),
    (order, reciprocals): (&[usize], &[(f64, f64)]),
    inverse: &mut Rows,
) {
    let (re, im) = inverse.blocks_mut();
    for i in 0..n {
        re[i * stride + order[i] / BLOCK][order[i] % BLOCK] = 1.0;
    }
    for i in 0..n {
        update((re, im), i, (0, i), lower.parts(), stride);
    }
    for back in 0..n {
        let i = n - 1 - back;
        update((re, im), i, (i + 1, n), upper.parts(), stride);
        let (a, b) = reciprocals[i];
        for c in 0..stride {
            let (x, y) = (re[i * stride + c], im[i * stride + c]);
            for l in 0..BLOCK {
                re[i * stride + c][l] = x[l] * a - y[l] * b;
                im[i * stride + c][l] = x[l] * b + y[l] * a;
            }
        }
    }
}

/// Subtract from row i the rows of a range, times the entries of row i of `factors`.
#[inline(always)]
fn update(
    (re, im): (&mut [Block], &mut [Block]),
    i: usize,
    range: (usize, usize),
    factors: Parts<'_>,
    stride: usize,
) {
    let mut c = 0;
    while c + 2 <= stride {
        update_blocks::<2>((re, im), (i, c), range, factors, stride);
        c += 2;
    }
    if c < stride {
        update_blocks::<1>((re, im), (i, c), range, factors, stride);
    }
}

#[inline(always)]
fn update_blocks<const W: usize>(
    (re, im): (&mut [Block], &mut [Block]),
    (i, c): (usize, usize),
    (start, end): (usize, usize),
    (factors_re, factors_im): Parts<'_>,
    stride: usize,
) {
    let (mut own_re, mut own_im) = ([[0.0; BLOCK]; W], [[0.0; BLOCK]; W]);
    for w in 0..W {
        (own_re[w], own_im[w]) = (re[i * stride + c + w], im[i * stride + c + w]);
    }
    for k in start..end {
        let place = (i * stride + k / BLOCK, k % BLOCK);
        let (a, b) = (factors_re[place.0][place.1], factors_im[place.0][place.1]);
        for w in 0..W {
            let from_re = &re[k * stride + c + w];
            let from_im = &im[k * stride + c + w];
            for l in 0..BLOCK {
                own_re[w][l] -= a * from_re[l] - b * from_im[l];
                own_im[w][l] -= a * from_im[l] + b * from_re[l];
            }
        }
    }
    for w in 0..W {
        (re[i * stride + c + w], im[i * stride + c + w]) = (own_re[w], own_im[w]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solutions_are_those_of_the_inverse() {
        for n in [1, 2, 7, 8, 9, 30] {
            let mut matrix = Rows::zeros(n);
            for k in 0..n * n {
                let x = (k * k + 1) as f64;
                // A zero in the first place forces an exchange.
                let entry = if k == 0 && n > 1 { 0.0 } else { x.sin() };
                matrix.add(k / n, k % n, Complex64::new(entry, entry * x.cos()));
            }
            let known: Vec<_> = (0..n).map(|i| Complex64::new(i as f64, 1.0)).collect();
            let times = |rows: &Rows, x: &[Complex64]| -> Vec<Complex64> {
                let row = |i| (0..n).map(|k| rows.get(i, k) * x[k]).sum();
                (0..n).map(row).collect()
            };
            let right = times(&matrix, &known);
            let factors = Eliminated::new(matrix).unwrap();
            let mut x = right.clone();
            factors.solve(&mut x);
            let others = times(&factors.inverse(), &right);
            for ((x, other), known) in x.iter().zip(others).zip(&known) {
                assert!(
                    (x - known).norm().max((other - known).norm()) < 1e-10,
                    "{n}"
                );
            }
        }
    }
}
