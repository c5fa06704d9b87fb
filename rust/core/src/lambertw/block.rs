//! Slices of equal length through the kernels, on the calling thread.
//!
//! An element's bits depend on nothing but its arguments; where slices differ in length, the
//! shortest decides.

use num_complex::Complex64;

use crate::lanes::{Complex, Real, Simd};

use super::columns::{BLOCK, Kernel, SHORT, sweep};
use super::kernel::Point;
use super::route::Order;
use super::{delay, huge_branch, kernel, special_values};

struct LambertW;

impl Kernel<3, 3> for LambertW {
    #[inline(always)]
    fn lanes<S: Simd>(&self, [re, im, k]: [Real<S>; 3]) -> [Real<S>; 3] {
        let z = Complex::new(re, im);
        let w = kernel::lambertw(Point::new(z), k).w;
        let far = kernel::out_of_reach(z, k);
        [w.re, w.im, far.select(1.0, re.constant(0.0))]
    }
}

struct DdeRoot;

impl Kernel<4, 3> for DdeRoot {
    #[inline(always)]
    fn lanes<S: Simd>(&self, arguments: [Real<S>; 4]) -> [Real<S>; 3] {
        let [a0, a1, delay, k] = arguments;
        let (zero, one) = (a0.constant(0.0), a0.constant(1.0));
        let far = delay::out_of_reach(arguments);
        let s = delay::root([
            far.select(zero, a0),
            far.select(one, a1),
            far.select(one, delay),
            far.select(zero, k),
        ]);
        [s.re, s.im, far.select(one, zero)]
    }
}

/// `w[i] = W_k[i](z[i])`.
pub fn lambertw(z: &[Complex64], k: &[i64], w: &mut [Complex64]) {
    if w.len() <= SHORT {
        lambertw_by::<SHORT>(z, k, w);
    } else {
        lambertw_by::<BLOCK>(z, k, w);
    }
}

fn lambertw_by<const W: usize>(z: &[Complex64], k: &[i64], w: &mut [Complex64]) {
    let mut arguments = [[0.0; W]; 3];
    let mut values = [[0.0; W]; 3];
    let mut order = Order::<W>::new();
    for ((z, k), w) in z.chunks(W).zip(k.chunks(W)).zip(w.chunks_mut(W)) {
        let [re, im, branch] = &mut arguments;
        let places = re.iter_mut().zip(im).zip(branch);
        if order.sort(z, k) {
            for (i, ((re, im), branch)) in order.indices(w.len()).zip(places) {
                if let (Some(z), Some(k)) = (z.get(i), k.get(i)) {
                    (*re, *im, *branch) = (z.re, z.im, *k as f64);
                }
            }
            sweep(&LambertW, &arguments, &mut values, w.len());
            let [re, im, beyond] = &values;
            let results = re.iter().zip(im).zip(beyond);
            for (i, ((re, im), beyond)) in order.indices(w.len()).zip(results) {
                if let Some(w) = w.get_mut(i) {
                    *w = Complex64::new(*re, *im);
                    if *beyond != 0.0
                        && let (Some(z), Some(k)) = (z.get(i), k.get(i))
                    {
                        *w = far(*z, *k);
                    }
                }
            }
        } else {
            for ((z, k), ((re, im), branch)) in z.iter().zip(k).zip(places) {
                (*re, *im, *branch) = (z.re, z.im, *k as f64);
            }
            sweep(&LambertW, &arguments, &mut values, w.len());
            gather(&values, w, |i| Some(far(*z.get(i)?, *k.get(i)?)));
        }
    }
}

/// W where the kernel in lanes does not reach.
fn far(z: Complex64, k: i64) -> Complex64 {
    if !(z.re.is_finite() && z.im.is_finite()) || (z.re == 0.0 && z.im == 0.0) {
        return special_values::lambertw(z, k);
    }
    let above = if k < 0 { z.conj() } else { z };
    let w = huge_branch::lambertw(above, k.unsigned_abs());
    if k < 0 { w.conj() } else { w }
}

/// `s[i] = dde_root(a0[i], a1[i], delay[i], k[i])`.
pub fn dde_root(a0: &[f64], a1: &[f64], delay: &[f64], k: &[i64], s: &mut [Complex64]) {
    if s.len() <= SHORT {
        dde_root_by::<SHORT>(a0, a1, delay, k, s);
    } else {
        dde_root_by::<BLOCK>(a0, a1, delay, k, s);
    }
}

fn dde_root_by<const W: usize>(
    a0: &[f64],
    a1: &[f64],
    delay: &[f64],
    k: &[i64],
    s: &mut [Complex64],
) {
    let mut arguments = [[0.0; W]; 4];
    let mut values = [[0.0; W]; 3];
    let inputs = a0
        .chunks(W)
        .zip(a1.chunks(W))
        .zip(delay.chunks(W))
        .zip(k.chunks(W));
    for ((((a0, a1), lag), k), s) in inputs.zip(s.chunks_mut(W)) {
        let [first, second, third, branch] = &mut arguments;
        for (column, values) in [(first, a0), (second, a1), (third, lag)] {
            for (place, value) in column.iter_mut().zip(values) {
                *place = *value;
            }
        }
        for (place, k) in branch.iter_mut().zip(k) {
            *place = *k as f64;
        }
        sweep(&DdeRoot, &arguments, &mut values, s.len());
        gather(&values, s, |i| {
            Some(delay::far_root(
                *a0.get(i)?,
                *a1.get(i)?,
                *lag.get(i)?,
                *k.get(i)?,
            ))
        });
    }
}

/// Columns of real and imaginary parts as complex numbers; where the third is set, `far(i)`.
fn gather<const W: usize>(
    [re, im, beyond]: &[[f64; W]; 3],
    out: &mut [Complex64],
    far: impl Fn(usize) -> Option<Complex64>,
) {
    for (out, (re, im)) in out.iter_mut().zip(re.iter().zip(im)) {
        *out = Complex64::new(*re, *im);
    }
    if beyond.iter().take(out.len()).any(|&beyond| beyond != 0.0) {
        for (i, (out, &beyond)) in out.iter_mut().zip(beyond).enumerate() {
            if beyond != 0.0
                && let Some(value) = far(i)
            {
                *out = value;
            }
        }
    }
}
