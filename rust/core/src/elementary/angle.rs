//! The angle of a vector within 8 u, u = 2⁻⁵³, by a table of 17 arctangents.
//!
//! Let b ≤ a be the moduli of the coordinates, c = j/16 next to b/a, so that atan(b/a) = atan c +
//! atan z, z = (b − c a)/(a + c b), |z| ≤ 0.0313 (the quotient b/a only chooses j). The errors are
//! u a of c a, u |b − c a| of the difference, 2.01 u (relative) of the denominator and u of the
//! quotient: z is within u + 4.1 u |z| < 1.13 u. The series to z⁹ has the truncation error |z|¹¹/11
//! < 0.03 u and the rounding error 0.04 u. The sum with the table, at most 0.79, has the error 0.5
//! u. In the other octants π/2 or π, whose doubles have an error of at most 1.11 u, is added: at
//! most 2 u for rounding a sum below 4. The total is 4.9 u. Holds as long as no product underflows
//! or overflows: coordinates between 1e-290 and 1e300 or 0.

use std::f64::consts::{FRAC_PI_2, PI};

use super::nearest::nearest;
use super::tables::ANGLES;

/// The angle of (x, y) in (−π, π] within 2⁻⁵⁰; 0 for the zero vector.
///
/// ```
/// use deadtime::elementary::angle;
/// assert_eq!(angle(0.0, 2.0), 0.0);
/// assert_eq!(angle(1.0, 0.0), std::f64::consts::FRAC_PI_2);
/// assert_eq!(angle(0.0, -1.0), std::f64::consts::PI);
/// ```
pub fn angle(y: f64, x: f64) -> f64 {
    let (across, up) = (x.abs(), y.abs());
    let (a, b) = (across.max(up), across.min(up));
    if a == 0.0 || x.is_nan() || y.is_nan() {
        return x + y;
    }
    let j = nearest(16.0 * (b / a));
    let c = j / 16.0;
    let z = (b - c * a) / (a + c * b);
    let square = z * z;
    let series = z
        - (z * square)
            * ((1.0 / 3.0 - square * (1.0 / 5.0))
                + square * square * (1.0 / 7.0 - square * (1.0 / 9.0)));
    let (high, low) = ANGLES[(j as usize).min(16)];
    let first = high + (low + series);
    let angle = match (up > across, x < 0.0) {
        (false, false) => first,
        (false, true) => PI - first,
        (true, false) => FRAC_PI_2 - first,
        (true, true) => FRAC_PI_2 + first,
    };
    if y < 0.0 { -angle } else { angle }
}
