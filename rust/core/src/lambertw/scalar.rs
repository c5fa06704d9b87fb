//! One element at a time.

use num_complex::Complex64;

use super::block;

/// W_k(z), the solution of w e^w = z on branch `k`.
///
/// ```
/// use deadtime::lambertw::lambertw;
/// use num_complex::Complex64;
///
/// let omega = lambertw(Complex64::ONE, 0);
/// assert_eq!(omega, Complex64::new(0.567_143_290_409_783_8, 0.0));
/// ```
#[inline]
pub fn lambertw(z: Complex64, k: i64) -> Complex64 {
    let mut w = [z];
    block::lambertw(&[z], &[k], &mut w);
    let [w] = w;
    w
}

/// Root `k` of `s = a0 + a1 e^(-s delay)`, in 1/s when `delay` is in s.
///
/// Root 0 has the largest real part; roots `k` and `-k` are conjugate unless `a1 < 0`, where
/// `0` and `-1` are the rightmost pair (conjugate, or both real). `delay = 0` leaves one root,
/// `a0 + a1`, and so does `a1 = 0`; the others have real part `-inf` then.
/// NaN for arguments that are not finite, a negative delay, or products beyond 1e300.
///
/// ```
/// use deadtime::lambertw::dde_root;
///
/// // x'(t) = -x(t - pi/2) is marginally stable: s = i.
/// let s = dde_root(0.0, -1.0, std::f64::consts::FRAC_PI_2, 0);
/// assert!(s.re.abs() < 1e-16 && (s.im - 1.0).abs() < 1e-15);
///
/// // e^(-a0 T) would overflow; the root does not care.
/// let s = dde_root(-1000.0, 500.0, 1.0, 0);
/// assert!((s - (-1000.0 + 500.0 * (-s).exp()) + 0.0).norm() < 1e-9);
/// assert_eq!(dde_root(-1.0, 0.5, 0.0, 0).re, -0.5);
/// ```
pub fn dde_root(a0: f64, a1: f64, delay: f64, k: i64) -> Complex64 {
    let mut s = [Complex64::ZERO];
    block::dde_root(&[a0], &[a1], &[delay], &[k], &mut s);
    let [s] = s;
    s
}

/// W_k(z) for z given by its logarithm, which may be any size: the solution of
/// w + log w = log z + 2 pi i k.
///
/// ```
/// use deadtime::lambertw::{lambertw, lambertw_log};
/// use num_complex::Complex64;
///
/// let far = lambertw_log(Complex64::new(1e6, 0.0), 0); // W_0(e^1000000)
/// assert!((far.re + far.re.ln() - 1e6).abs() < 1e-9 && far.im == 0.0);
/// assert_eq!(lambertw_log(Complex64::ZERO, -3), lambertw(Complex64::ONE, -3));
/// ```
pub fn lambertw_log(log_z: Complex64, k: i64) -> Complex64 {
    let mut w = [Complex64::ZERO];
    block::lambertw_log(&[log_z], &[k], &mut w);
    let [w] = w;
    w
}
