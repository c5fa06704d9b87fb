//! sin y and cos y, each within u = 2⁻⁵³, by a table of 64 angles.
//!
//! y = n P + r with P = π/32, |r| ≤ 0.0492; sin y = S + (C sin r + S (cos r − 1)) with S, C the
//! sine and cosine of n P from the table, S = S₁ + S₂ within 2⁻¹⁰⁶; cos y is the same 16 on.
//! *Reduction, |y| < 2²⁰.* |n| < 2²⁴; P = P₁ + P₂ + P₃ with P₁, P₂ of 29 bits (multiples of 2⁻³²
//! and 2⁻⁶¹), |P₃| < 2⁻⁶³: n P₁, n P₂ are exact. y is a multiple of 2⁻⁵⁷ unless n = 0, y − n P₁
//! below 2⁻⁴: exact. Each of the next two differences, below 2⁻⁴, loses 2⁻⁵⁸; the rest is below
//! 2⁻⁹⁰. r is within 2⁻⁵⁷ = 0.063 u. For larger y (Payne and Hanek 1983, in integers): y = M 2^E,
//! and M times 192 bits of the fraction of 2^E/(2π) gives the fraction of a turn within 2⁻¹³⁹; its
//! first 64 bits, cut off, are within 2⁻⁶⁴ turns = 2⁻⁶¹·³ rad; made a double and multiplied by
//! 2π/2⁶⁴ they lose 3 u |r| = 0.15 u. Either way r is within 0.16 u, as are its sine and cosine.
//! *Series.* sin r to r⁷ is cut by |r|⁹/9! < 0.045 u, cos r − 1 to r⁸ by |r|¹⁰/10! < 0.001 u.
//! Rounding costs sin r at most 1.02 u |r| = 0.051 u and, times C, another 0.05 u; cos r − 1, at
//! most 0.00121, less than 0.005 u with the product by S. *Result.* The two inner sums, below 0.06,
//! lose 0.06 u together; the last sum, below 1 but for rounding, u/2. In all 0.16 + 0.045 + 0.001 +
//! 0.101 + 0.005 + 0.06 + 0.5 < 0.9 u.

use super::nearest::nearest;
use super::tables::{INVERSE_TURN, SINES};

pub(super) const STEPS_PER_UNIT: f64 = 10.185_916_357_881_302;
/// π/32 in pieces.
pub(super) const STEP: [f64; 3] = [
    0.098_174_770_362_675_19,
    6.200_584_880_614_035e-11,
    -7.610_657_361_233_729e-20,
];
/// Largest argument for the reduction in three pieces.
pub(super) const LARGE: f64 = 1_048_576.0;
/// 2π/2⁶⁴: from units of 2⁻⁶⁴ turns to radians.
const UNIT: f64 = std::f64::consts::TAU / 18_446_744_073_709_551_616.0;

/// (sin y, cos y), each within 2⁻⁵³ of its value; NaN where y is not finite.
///
/// ```
/// use deadtime::elementary::sin_cos;
/// assert_eq!(sin_cos(0.0), (0.0, 1.0));
/// // The double next to a multiple of π/2.
/// let (_, cosine) = sin_cos(6381956970095103.0 * 2f64.powi(797));
/// assert!((cosine + 4.687165924254624e-19).abs() < 2f64.powi(-53));
/// ```
#[inline]
pub fn sin_cos(y: f64) -> (f64, f64) {
    let (n, r) = if y.abs() < LARGE {
        let n = nearest(y * STEPS_PER_UNIT);
        let r = ((y - n * STEP[0]) - n * STEP[1]) - n * STEP[2];
        (n as i64, r)
    } else {
        reduce(y)
    };
    let square = r * r;
    let sine = r
        + (r * square)
            * ((-1.0 / 6.0 + square * (1.0 / 120.0)) + (square * square) * (-1.0 / 5040.0));
    let drop = square
        * ((-0.5 + square * (1.0 / 24.0))
            + (square * square) * (-1.0 / 720.0 + square * (1.0 / 40_320.0)));
    let (s, s_low) = SINES[(n & 63) as usize];
    let (c, c_low) = SINES[((n + 16) & 63) as usize];
    (
        s + (s_low + (c * sine + s * drop)),
        c + (c_low + (c * drop - s * sine)),
    )
}

/// n modulo 64 and r for large arguments.
#[cold]
fn reduce(y: f64) -> (i64, f64) {
    if !y.is_finite() {
        return (0, f64::NAN);
    }
    let bits = y.abs().to_bits();
    let mantissa = u128::from((bits & ((1 << 52) - 1)) | (1 << 52));
    // |y| = M 2^E with E ≥ 20 − 52.
    let exponent = (bits >> 52) as i64 - 1075;
    let word = |index: i64| {
        usize::try_from(index)
            .ok()
            .and_then(|index| INVERSE_TURN.get(index))
            .copied()
            .unwrap_or(0)
    };
    // 64 bits of the fraction of 2^E/(2π), from bit `exponent + 64 i` on.
    let window = |i: i64| {
        let from = exponent + 64 * i;
        let (index, shift) = (from.div_euclid(64), from.rem_euclid(64));
        let pair = (u128::from(word(index)) << 64) | u128::from(word(index + 1));
        (pair >> (64 - shift)) as u64
    };
    // M times the fraction, modulo 1; of the lowest product only the carry is used.
    let products = [0, 1, 2].map(|i| mantissa * u128::from(window(i)));
    let middle = products[1].wrapping_add(products[2] >> 64);
    let fraction = (products[0] as u64).wrapping_add((middle >> 64) as u64);
    let n = fraction.wrapping_add(1 << 57) >> 58;
    let rest = fraction.wrapping_sub(n << 58) as i64;
    let (n, r) = (n as i64, rest as f64 * UNIT);
    if y < 0.0 { (-n, -r) } else { (n, r) }
}
