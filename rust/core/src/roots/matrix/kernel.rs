//! Elimination, inversion and products of rows, compiled for every instruction set.
//!
//! Rows are processed in blocks of [`BLOCK`] numbers, and no operation crosses lanes, so that the
//! bits do not depend on the instruction set. The loops count and index: methods of iterators and of
//! complex numbers are not inlined into functions compiled for another instruction set.

#![expect(
    clippy::needless_range_loop,
    reason = "indices as in the formulas; closures would not be compiled for the vectors"
)]

use num_complex::Complex64;
use pulp::{Simd, WithSimd};

use super::rows::{BLOCK, Rows};
use super::system::Entry;
use crate::simd::Instructions;

/// Moduli of pivots whose squares and reciprocals are normal numbers.
const USABLE: std::ops::Range<f64> = 1e-140..1e140;

type Block = [f64; BLOCK];

/// Real and imaginary parts of rows.
type Parts<'a> = (&'a [Block], &'a [Block]);

/// A factored matrix and its inverse.
pub(super) struct Eliminated {
    pub(super) lower: Rows,
    pub(super) upper: Rows,
    pub(super) inverse: Rows,
    /// Product of the pivots over their moduli, with the sign of the permutation.
    pub(super) direction: Complex64,
}

/// Factor with partial pivoting and invert; `None` where a pivot is zero or leaves the usable range.
pub(super) fn eliminate(g: Rows) -> Option<Eliminated> {
    Instructions::chosen().run(Elimination(g))
}

/// The sums of `slope` and of `value` times rows of `from`, over entries. The values are left out
/// without `with_values`.
pub(super) fn combine(entries: &[Entry], with_values: bool, from: &Rows, to: [&mut Rows; 2]) {
    Instructions::chosen().run(Combination {
        entries,
        with_values,
        from,
        to,
    });
}

struct Elimination(Rows);

impl WithSimd for Elimination {
    type Output = Option<Eliminated>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Self::Output {
        let Self(mut upper) = self;
        let (n, stride) = (upper.size, upper.blocks());
        let (mut lower, mut inverse) = (Rows::zeros(n), Rows::zeros(n));
        let mut order: Vec<usize> = (0..n).collect();
        let mut reciprocals = vec![(0.0, 0.0); n];
        let direction = factor(
            (&mut upper, &mut lower),
            (n, stride),
            (&mut order, &mut reciprocals),
        )?;
        invert(
            (&lower, &upper),
            (n, stride),
            (&order, &reciprocals),
            &mut inverse,
        );
        Some(Eliminated {
            lower,
            upper,
            inverse,
            direction,
        })
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

struct Combination<'a> {
    entries: &'a [Entry],
    with_values: bool,
    from: &'a Rows,
    to: [&'a mut Rows; 2],
}

impl WithSimd for Combination<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self {
            entries,
            with_values,
            from,
            to: [slopes, values],
        } = self;
        let stride = from.blocks();
        let (re, im) = from.parts();
        let (slope_re, slope_im) = slopes.blocks_mut();
        let (value_re, value_im) = values.blocks_mut();
        for c in 0..stride {
            let (mut sr, mut si) = ([0.0; BLOCK], [0.0; BLOCK]);
            let (mut vr, mut vi) = ([0.0; BLOCK], [0.0; BLOCK]);
            for k in 0..entries.len() {
                let Entry {
                    column,
                    slope,
                    value,
                } = entries[k];
                let (from_re, from_im) = (&re[column * stride + c], &im[column * stride + c]);
                if slope != 0.0 {
                    for l in 0..BLOCK {
                        sr[l] += slope * from_re[l];
                        si[l] += slope * from_im[l];
                    }
                }
                if with_values && value != 0.0 {
                    for l in 0..BLOCK {
                        vr[l] += value * from_re[l];
                        vi[l] += value * from_im[l];
                    }
                }
            }
            (slope_re[c], slope_im[c]) = (sr, si);
            (value_re[c], value_im[c]) = (vr, vi);
        }
    }
}
