//! Next to -1/e: the series of W in the square root of the distance.
//!
//! With h = 1 + e z and p = ±sqrt(2 h), w = -1 + p - p^2/3 + 11 p^3/72 - … (Corless, Gonnet, Hare,
//! Jeffrey & Knuth 1996, eq. 4.22; coefficients by the recurrence 4.23), + for W_0 and minus for
//! the branch behind the cut. The sum is 1 + w, which keeps its relative accuracy, from h = e (z +
//! 1/e) with 1/e in double-double arithmetic, because -1/e itself is not a double. Guaranteed:
//! relative error of 1 + w of a few 2^-53 for |p| < 0.02, and 1e-8 for |p| < 0.52.

use crate::simd::{Complex, Simd};

/// 1/e = INVERSE_E + INVERSE_E_LOW to 106 bits.
pub(super) const INVERSE_E: f64 = 0.367_879_441_171_442_33;
pub(super) const INVERSE_E_LOW: f64 = -1.242_875_367_278_836_3e-17;

/// Coefficients of p^2, p^3, …, p^13; that of p is 1.
pub(super) const SERIES: [f64; 12] = [
    -1.0 / 3.0,
    11.0 / 72.0,
    -43.0 / 540.0,
    769.0 / 17_280.0,
    -221.0 / 8_505.0,
    0.015_635_632_532_333_927,
    -0.009_616_892_024_299_429,
    0.006_014_543_252_956_118_5,
    -0.003_811_298_034_892,
    0.002_440_877_991_143_983,
    -0.001_576_930_344_686_784,
    0.001_026_263_320_507_607_6,
];

/// Modulus below which a square is no longer a normal number.
const DEEP: f64 = 1e-130;

/// `z + 1/e`, to full relative accuracy however close the two are.
#[inline(always)]
pub(super) fn offset<S: Simd>(z: Complex<S>) -> Complex<S> {
    Complex::new((z.re + INVERSE_E) + INVERSE_E_LOW, z.im)
}

/// `sqrt(2 (1 + e z))` in the right half plane, from `offset` = z + 1/e.
#[inline(always)]
pub(super) fn branch_root<S: Simd>(offset: Complex<S>) -> Complex<S> {
    offset.scaled(2.0 * std::f64::consts::E).sqrt()
}

/// The same for an offset of any size.
#[inline(always)]
pub(super) fn deep_branch_root<S: Simd>(offset: Complex<S>) -> Complex<S> {
    let deep = offset.re.abs().larger(offset.im.abs()).lt(DEEP);
    let one = offset.re.constant(1.0);
    let lift = deep.select(2.0_f64.powi(600), one);
    branch_root(offset.scaled(lift)).scaled(deep.select(2.0_f64.powi(-300), one))
}

/// `1 + w` from `p`.
#[inline(always)]
pub(super) fn one_plus_w<S: Simd>(p: Complex<S>) -> Complex<S> {
    let zero = p.re.constant(0.0);
    let mut tail = Complex::new(zero, zero);
    for &coefficient in SERIES.iter().rev() {
        tail = tail.mul_add(p, coefficient);
    }
    // The first term is p itself and by far the largest; it is added last.
    let tail = tail * p;
    Complex::new(
        tail.re.mul_add(p.re, tail.im.negated_mul_add(p.im, p.re)),
        tail.re.mul_add(p.im, tail.im.mul_add(p.re, p.im)),
    )
}
