//! log x within 4 u (1 + |log x|), u = 2⁻⁵³, by the series of the inverse hyperbolic tangent.
//!
//! x = 2^e f with √½ ≤ f < √2 (to rounding), z = (f − 1)/(f + 1), |z| < 0.1716, log f = 2 artanh z.
//! f − 1 is exact, f + 1 and the quotient lose u each: z is within 2.01 u |z|. The series to z¹⁹ is
//! cut by 2|z|²¹/21 · 1.04 < 0.08 u. Rounding its part behind the first term (below 0.004) costs
//! 0.05 u, the sum u |log f|: in all 0.35 · 3.1 u + 0.13 u < 1.3 u. e ln 2 loses 2.1 u |e ln 2|,
//! and |e ln 2| ≤ |log x| + 0.347; the last sum u |log x|: less than 2.1 u + 3.2 u |log x|.

use std::f64::consts::{LN_2, SQRT_2};

/// 2/3, 2/5, …, 2/19.
const PAIRS: [[f64; 2]; 5] = [
    [2.0 / 3.0, 2.0 / 5.0],
    [2.0 / 7.0, 2.0 / 9.0],
    [2.0 / 11.0, 2.0 / 13.0],
    [2.0 / 15.0, 2.0 / 17.0],
    [2.0 / 19.0, 0.0],
];

/// log x for x > 0 within 2⁻⁵¹ (1 + |log x|); −∞ at 0, NaN below.
///
/// ```
/// use deadtime::elementary::log;
/// assert_eq!(log(1.0), 0.0);
/// assert!((log(5e-324) + 744.4400719213812).abs() < 1e-12);
/// ```
pub fn log(x: f64) -> f64 {
    if x == 0.0 {
        return f64::NEG_INFINITY;
    }
    if x.is_nan() || x < 0.0 {
        return f64::NAN;
    }
    if x == f64::INFINITY {
        return x;
    }
    // Subnormal numbers are made normal by an exact factor.
    let (x, below) = if x < f64::MIN_POSITIVE {
        (x * 18_014_398_509_481_984.0, 54)
    } else {
        (x, 0)
    };
    let bits = x.to_bits();
    let mut exponent = (bits >> 52) as i64 - 1023 - below;
    let mut f = f64::from_bits((bits & ((1 << 52) - 1)) | (1023 << 52));
    if f > SQRT_2 {
        f *= 0.5;
        exponent += 1;
    }
    let z = (f - 1.0) / (f + 1.0);
    let square = z * z;
    let fourth = square * square;
    // Summed in pairs, which halves the chain of dependent operations.
    let tail = PAIRS
        .iter()
        .rev()
        .fold(0.0, |sum, [even, odd]| sum * fourth + (even + odd * square));
    exponent as f64 * LN_2 + (2.0 * z + (z * square) * tail)
}
