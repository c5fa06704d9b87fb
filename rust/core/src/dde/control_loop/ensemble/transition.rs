//! The change of the states over a part of a sample, for several loops at once.
//!
//! Under constant w and r, x(h) = x + F x + Γ w + g with F = A h φ(A h), Γ = h φ(A h) B, g = h φ(A h)
//! E r and φ(z) = (e^z − 1)/z. φ is summed by Taylor for ‖A‖₁ h/2^q ≤ 1/4, and F, Γ and g are
//! doubled q times as in [`crate::dde::propagator`]; q belongs to each loop alone. Units of states
//! that differ much cost doublings, but no accuracy: all sums and products are relative to their
//! own entries.

#![expect(
    clippy::needless_range_loop,
    reason = "indices as in the formulas; closures would not be compiled for the vectors"
)]

use crate::simd::{Real, Simd, outlined};

/// Largest ‖A‖₁ h for which φ is summed without doubling.
const REACH: f64 = 0.25;

/// Number of terms: 0.25^12/13! is below 1e-17.
const TERMS: u32 = 12;

/// Largest ‖A‖₁ h: the doublings that bring it to [`REACH`] are finite.
pub(super) const MOST: f64 = (1_u64 << 40) as f64;

/// A square matrix with a number for each loop in every entry.
pub(super) type Matrix<S, const N: usize> = [[Real<S>; N]; N];

/// `start` + row · x.
#[inline(always)]
pub(super) fn row<S: Simd, const N: usize>(
    row: &[Real<S>; N],
    x: &[Real<S>; N],
    start: Real<S>,
) -> Real<S> {
    let mut sum = start;
    for i in 0..N {
        sum = row[i].mul_add(x[i], sum);
    }
    sum
}

/// A column times a number.
#[inline(always)]
pub(super) fn scaled<S: Simd, const N: usize>(
    column: &[Real<S>; N],
    factor: Real<S>,
) -> [Real<S>; N] {
    let mut out = *column;
    for entry in &mut out {
        *entry = *entry * factor;
    }
    out
}

/// A matrix times a number.
#[inline(always)]
fn rescaled<S: Simd, const N: usize>(matrix: &Matrix<S, N>, factor: Real<S>) -> Matrix<S, N> {
    let mut out = *matrix;
    for row in &mut out {
        *row = scaled(row, factor);
    }
    out
}

/// x becomes x + F x + Γ w + g.
#[derive(Clone, Copy)]
pub(super) struct Held<S: Simd, const N: usize> {
    growth: Matrix<S, N>,
    drive: [Real<S>; N],
    push: [Real<S>; N],
}

impl<S: Simd, const N: usize> Held<S, N> {
    /// `h` seconds under constant w and r; `push` is E r.
    #[inline(always)]
    pub(super) fn over(
        a: &Matrix<S, N>,
        (drive, push): (&[Real<S>; N], &[Real<S>; N]),
        h: Real<S>,
    ) -> Self {
        let zero = h.constant(0.0);
        let mut norm = zero;
        for j in 0..N {
            let mut column = zero;
            for row in a {
                column = column + row[j].abs();
            }
            norm = norm.larger(column);
        }
        let (mut scale, mut doublings) = (h.constant(1.0), zero);
        loop {
            let is_long = (norm * h * scale).gt(REACH);
            if !is_long.any() {
                break;
            }
            scale = is_long.select(scale * 0.5, scale);
            doublings = is_long.select(doublings + 1.0, doublings);
        }
        let step = h * scale;
        let z = rescaled(a, step);
        let mut phi = [[zero; N]; N];
        for (i, row) in phi.iter_mut().enumerate() {
            row[i] = h.constant(1.0);
        }
        for j in (2..=TERMS).rev() {
            let part = 1.0 / f64::from(j);
            phi = rescaled(&product(&z, &phi), h.constant(part));
            for (i, row) in phi.iter_mut().enumerate() {
                row[i] = row[i] + 1.0;
            }
        }
        let mut held = Self {
            growth: product(&z, &phi),
            drive: scaled(&times(&phi, drive), step),
            push: scaled(&times(&phi, push), step),
        };
        let mut number = 0.0;
        loop {
            let is_short = doublings.gt(number);
            if !is_short.any() {
                return held;
            }
            let old = held;
            let square = product(&old.growth, &old.growth);
            for i in 0..N {
                for j in 0..N {
                    let doubled = old.growth[i][j].mul_add(2.0, square[i][j]);
                    held.growth[i][j] = is_short.select(doubled, old.growth[i][j]);
                }
                let drive = row(&old.growth[i], &old.drive, old.drive[i] * 2.0);
                held.drive[i] = is_short.select(drive, old.drive[i]);
                let push = row(&old.growth[i], &old.push, old.push[i] * 2.0);
                held.push[i] = is_short.select(push, old.push[i]);
            }
            number += 1.0;
        }
    }
}

/// x becomes x + F x + G₁ w₁ + G₀ w₀ + g, with the commands w₁ and w₀ that reach the plant before
/// and after the arrival within a sample.
#[derive(Clone, Copy)]
pub(super) struct Map<S: Simd, const N: usize> {
    pub(super) growth: Matrix<S, N>,
    pub(super) before: [Real<S>; N],
    pub(super) after: [Real<S>; N],
    pub(super) push: [Real<S>; N],
}

impl<S: Simd, const N: usize> Map<S, N> {
    /// No change.
    #[inline(always)]
    pub(super) fn nothing(zero: Real<S>) -> Self {
        Self {
            growth: [[zero; N]; N],
            before: [zero; N],
            after: [zero; N],
            push: [zero; N],
        }
    }

    /// This change, and that of a part under w₁ or w₀ after it.
    pub(super) fn then(&self, part: &Held<S, N>, is_before: bool) -> Self {
        outlined(
            part.drive[0].simd(),
            #[inline(always)]
            || self.continued(part, is_before),
        )
    }

    #[inline(always)]
    fn continued(&self, part: &Held<S, N>, is_before: bool) -> Self {
        let mut out = *self;
        let grown = product(&part.growth, &self.growth);
        for i in 0..N {
            for j in 0..N {
                out.growth[i][j] = self.growth[i][j] + (part.growth[i][j] + grown[i][j]);
            }
            let growth = &part.growth[i];
            out.before[i] = row(growth, &self.before, self.before[i]);
            out.after[i] = row(growth, &self.after, self.after[i]);
            out.push[i] = row(growth, &self.push, self.push[i]) + part.push[i];
            let reached = if is_before {
                &mut out.before
            } else {
                &mut out.after
            };
            reached[i] = reached[i] + part.drive[i];
        }
        out
    }

    #[inline(always)]
    pub(super) fn apply(&self, x: &[Real<S>; N], before: Real<S>, after: Real<S>) -> [Real<S>; N] {
        let mut out = *x;
        for (i, out) in out.iter_mut().enumerate() {
            let forced = self.before[i].mul_add(before, self.push[i]);
            let forced = self.after[i].mul_add(after, forced);
            *out = x[i] + row(&self.growth[i], x, forced);
        }
        out
    }
}

/// The product of two matrices.
#[inline(always)]
pub(super) fn product<S: Simd, const N: usize>(a: &Matrix<S, N>, b: &Matrix<S, N>) -> Matrix<S, N> {
    let mut out = *a;
    for (i, out) in out.iter_mut().enumerate() {
        for (j, out) in out.iter_mut().enumerate() {
            let mut sum = a[i][0] * b[0][j];
            for inner in 1..N {
                sum = a[i][inner].mul_add(b[inner][j], sum);
            }
            *out = sum;
        }
    }
    out
}

#[inline(always)]
fn times<S: Simd, const N: usize>(a: &Matrix<S, N>, x: &[Real<S>; N]) -> [Real<S>; N] {
    let mut out = *x;
    for (out, a) in out.iter_mut().zip(a) {
        *out = row(a, x, x[0].constant(0.0));
    }
    out
}
