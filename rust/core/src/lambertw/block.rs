//! Blocks of elements on the calling thread: what every array call comes down to.
//!
//! Inputs and outputs of one call have equal lengths; where they have not, the shortest counts.
//! An element's bits depend on nothing but its arguments.

use num_complex::Complex64;

use super::{delay, kernel};

/// The double next to -1/e, and 1.2e-17 below it: the real branches meet there as if it were.
const BRANCH_POINT: f64 = -0.367_879_441_171_442_33;

/// `w[i] = W_k[i](z[i])`.
///
/// ```
/// use deadtime::lambertw::{block, lambertw};
/// use num_complex::Complex64;
///
/// let z = [Complex64::new(1.0, 0.0), Complex64::new(-0.2, 0.0)];
/// let mut w = [Complex64::ZERO; 2];
/// block::lambertw(&z, &[0, -1], &mut w);
/// assert_eq!(w, [lambertw(z[0], 0), lambertw(z[1], -1)]);
/// ```
pub fn lambertw(z: &[Complex64], k: &[i64], w: &mut [Complex64]) {
    for ((w, z), k) in w.iter_mut().zip(z).zip(k) {
        *w = kernel::lambertw(*z, *k);
    }
}

/// `w[i] = W_0(x[i])` where that is real, from -1/e up, and NaN elsewhere.
pub fn lambertw0(x: &[f64], w: &mut [f64]) {
    for (w, x) in w.iter_mut().zip(x) {
        *w = real_branch(*x, 0);
    }
}

/// `w[i] = W_-1(x[i])` where that is real, from -1/e to zero, and NaN elsewhere.
pub fn lambertwm1(x: &[f64], w: &mut [f64]) {
    for (w, x) in w.iter_mut().zip(x) {
        *w = match *x {
            // The limit: the real branch ends at the logarithmic pole.
            0.0 => f64::NEG_INFINITY,
            x if x < 0.0 => real_branch(x, -1),
            _ => f64::NAN,
        };
    }
}

fn real_branch(x: f64, k: i64) -> f64 {
    if x == BRANCH_POINT {
        return -1.0;
    }
    let w = kernel::lambertw(Complex64::new(x, 0.0), k);
    if w.im == 0.0 { w.re } else { f64::NAN }
}

/// `s[i] = dde_root(a0[i], a1[i], delay[i], k[i])`.
pub fn dde_root(a0: &[f64], a1: &[f64], delay: &[f64], k: &[i64], s: &mut [Complex64]) {
    let arguments = a0.iter().zip(a1).zip(delay).zip(k);
    for (s, (((a0, a1), delay), k)) in s.iter_mut().zip(arguments) {
        *s = delay::dde_root(*a0, *a1, *delay, *k);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_real_branches_end_where_they_turn_complex() {
        let mut w = [0.0; 5];
        lambertw0(
            &[-1.0, -0.367_879_441_171_442_3, 0.0, 1.0, f64::INFINITY],
            &mut w,
        );
        assert!(w[0].is_nan() && w[1] > -1.0 && w[2] == 0.0);
        assert_eq!(w[3..], [0.567_143_290_409_783_8, f64::INFINITY]);
        lambertwm1(&[BRANCH_POINT; 5], &mut w);
        assert_eq!(w, [-1.0; 5]);
        lambertwm1(
            &[-1.0, -0.367_879_441_171_442_3, -0.0, 1.0, f64::NAN],
            &mut w,
        );
        assert!(w[0].is_nan() && w[1] < -1.0 && w[2] == f64::NEG_INFINITY);
        assert!(w[3].is_nan() && w[4].is_nan());
    }
}
