//! Branches with |w| above several millions: fixed-point iteration on the logarithm.
//!
//! w <- log z + 2 pi i k - log w contracts by 1/|w| < 2e-7, and w is so large that its logarithm in
//! double precision is accurate enough; 2 pi k needs double-double precision. One element at a
//! time, because such branches are rare.

use num_complex::Complex64;

/// The first branch handled here; below it the reduction of Im w by pi/2 is exact.
pub(super) const HUGE_BRANCH: u64 = 1 << 20;

/// 2 pi to 106 bits.
const TURN: [f64; 2] = [std::f64::consts::TAU, 2.449_293_598_294_706_4e-16];
/// 2^64 makes a subnormal number normal.
const LIFT: f64 = 18_446_744_073_709_551_616.0;

/// `2 pi k` as a double-double.
pub(super) fn turns(k: u64) -> [f64; 2] {
    let high = k as f64;
    let low = (i128::from(k) - high as i128) as f64;
    let product = high * TURN[0];
    let rest = high.mul_add(TURN[0], -product) + (high * TURN[1] + low * TURN[0]);
    let turns = product + rest;
    [turns, rest - (turns - product)]
}

/// W_k(z) for k >= [`HUGE_BRANCH`] and finite z other than zero.
pub(super) fn lambertw(z: Complex64, k: u64) -> Complex64 {
    // The hypotenuse must not be formed from very small or very large components.
    let factor = if z.re.abs().max(z.im.abs()) < 1.0 {
        LIFT
    } else {
        1.0 / LIFT
    };
    let modulus = libm::hypot(z.re * factor, z.im * factor);
    let log = libm::log(modulus) - libm::log(factor);
    fixed_point(Complex64::new(log, libm::atan2(z.im, z.re)), 0.0, k)
}

/// The solution of `(s - shift) e^s = z` on branch `k`, given the principal `log` of z.
pub(super) fn fixed_point(log: Complex64, shift: f64, k: u64) -> Complex64 {
    let [turns, rest] = turns(k);
    (0..4).fold(Complex64::new(log.re, turns), |s, _| {
        let w = s - shift;
        let modulus = libm::log(libm::hypot(w.re, w.im));
        let angle = libm::atan2(w.im, w.re);
        Complex64::new(log.re - modulus, turns + ((log.im - angle) + rest))
    })
}
