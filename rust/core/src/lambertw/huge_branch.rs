//! Branches so far out that |w| exceeds millions: iterate on the logarithm.
//!
//! w <- log z + 2 pi i k - log w contracts by 1/|w| < 2e-7, and w is so large that its logarithm
//! in one word is exact enough; 2 pi k needs two.

use num_complex::Complex64;

use super::refine::Scaled;
use super::two_word::{TwoWord, product, sum};

/// The first branch treated here; below it the reduction of Im w by pi/2 is exact.
pub(super) const HUGE_BRANCH: u64 = 1 << 20;

/// 2 pi to 106 bits.
const TURN: TwoWord = TwoWord::new(std::f64::consts::TAU, 2.449_293_598_294_706_4e-16);

/// `2 pi k`.
fn turns(k: u64) -> TwoWord {
    let high = k as f64;
    let low = (i128::from(k) - high as i128) as f64;
    let turns = product(high, TURN.hi);
    sum(turns.hi, turns.lo + (high * TURN.lo + low * TURN.hi))
}

/// W_k(z) for k >= [`HUGE_BRANCH`].
pub(super) fn lambertw(z: Scaled, k: u64) -> Complex64 {
    let log = Complex64::new(z.log_modulus(), libm::atan2(z.im, z.re));
    fixed_point(log, 0.0, k)
}

/// The solution of `(s - shift) e^s = z` on branch `k`, given the principal `log` of z.
pub(super) fn fixed_point(log: Complex64, shift: f64, k: u64) -> Complex64 {
    let turns = turns(k);
    (0..4).fold(Complex64::new(log.re, turns.hi), |s, _| {
        let w = s - shift;
        let modulus = libm::log(libm::hypot(w.re, w.im));
        let angle = libm::atan2(w.im, w.re);
        Complex64::new(log.re - modulus, turns.hi + ((log.im - angle) + turns.lo))
    })
}
