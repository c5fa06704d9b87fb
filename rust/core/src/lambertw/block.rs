//! Blocks of elements on the calling thread: the implementation of every array call.
//!
//! Inputs and outputs of one call have equal lengths; where they have not, the shortest counts. The
//! bits of an element depend only on its arguments.

use num_complex::Complex64;

use crate::simd::{Complex, Kernel, Mask, Real, SHORT, Simd, sweep, sweep_along};

use super::branch_sort::Order;
use super::kernel::Point;
use super::{delay, huge_branch, kernel, log_form, real, special_values};

/// Elements in a block.
const BLOCK: usize = 256;

/// 1 in the lanes where the mask is true, 0 elsewhere.
#[inline(always)]
fn marked<S: Simd>(mask: Mask<S>, like: Real<S>) -> Real<S> {
    mask.select(1.0, like.constant(0.0))
}

#[inline(always)]
fn value<S: Simd>(z: Complex<S>, k: Real<S>) -> Complex<S> {
    kernel::lambertw(Point::new(z), k).w
}

/// A kernel of a complex argument and a branch, with a mark where it does not handle them. Its
/// functions are inlined by force: in a closure they would not get the instructions of the machine.
macro_rules! by_branch {
    ($name:ident, $value:path, $out_of_reach:path) => {
        struct $name;

        impl Kernel<3, 3> for $name {
            #[inline(always)]
            fn lanes<S: Simd>(&self, [re, im, k]: [Real<S>; 3]) -> [Real<S>; 3] {
                let z = Complex::new(re, im);
                let w = $value(z, k);
                [w.re, w.im, marked($out_of_reach(z, k), re)]
            }
        }
    };
}
by_branch!(LambertW, value, kernel::out_of_reach);
by_branch!(LambertWLog, log_form::lambertw, log_form::out_of_reach);
by_branch!(Derivative, kernel::derivative, kernel::out_of_reach);

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
    if w.len() <= SHORT {
        lambertw_by::<SHORT>(z, k, w);
    } else {
        lambertw_by::<BLOCK>(z, k, w);
    }
}

fn lambertw_by<const W: usize>(z: &[Complex64], k: &[i64], w: &mut [Complex64]) {
    let mut order = Order::<W>::new();
    for ((z, k), w) in z.chunks(W).zip(k.chunks(W)).zip(w.chunks_mut(W)) {
        let sorted = W > SHORT && order.sort(z, k);
        let length = z.len().min(k.len()).min(w.len());
        let place = |i| if sorted { order.index(i) } else { Some(i) };
        let load = |i| {
            let i = place(i)?;
            let (z, k) = (z.get(i)?, k.get(i)?);
            Some([z.re, z.im, *k as f64])
        };
        let store = |i, [re, im, beyond]: [f64; 3]| {
            let i = place(i)?;
            *w.get_mut(i)? = if beyond == 0.0 {
                Complex64::new(re, im)
            } else {
                far(*z.get(i)?, *k.get(i)?)
            };
            Some(())
        };
        chunk::<_, 3, 3, W>(&LambertW, length, load, store);
    }
}

/// W for arguments that the vectorised code does not handle.
fn far(z: Complex64, k: i64) -> Complex64 {
    if !(z.re.is_finite() && z.im.is_finite()) || (z.re == 0.0 && z.im == 0.0) {
        return special_values::lambertw(z, k);
    }
    let above = if k < 0 { z.conj() } else { z };
    let w = huge_branch::lambertw(above, k.unsigned_abs());
    if k < 0 { w.conj() } else { w }
}

struct LambertW0;

impl Kernel<1, 1> for LambertW0 {
    #[inline(always)]
    fn lanes<S: Simd>(&self, [x]: [Real<S>; 1]) -> [Real<S>; 1] {
        [real::lambertw0(x)]
    }
}

/// `w[i] = W_0(x[i])` where that is real, from -1/e up, and NaN elsewhere.
pub fn lambertw0(x: &[f64], w: &mut [f64]) {
    sweep_along(&LambertW0, x, w);
}

struct LambertWm1;

impl Kernel<1, 1> for LambertWm1 {
    #[inline(always)]
    fn lanes<S: Simd>(&self, [x]: [Real<S>; 1]) -> [Real<S>; 1] {
        [real::lambertwm1(x)]
    }
}

/// `w[i] = W_-1(x[i])` where that is real, from -1/e to zero, and NaN elsewhere.
pub fn lambertwm1(x: &[f64], w: &mut [f64]) {
    sweep_along(&LambertWm1, x, w);
}

/// `w[i] = W_k[i](e^log_z[i])`: the solution of w + log w = log z + 2 pi i k, also where
/// |Im log z| exceeds pi.
pub fn lambertw_log(log_z: &[Complex64], k: &[i64], w: &mut [Complex64]) {
    by_branch(&LambertWLog, log_z, k, w, log_form::far);
}

/// `w[i]`, the Wright omega function of `z[i]`: the solution of w + log w = z.
pub fn wright_omega(z: &[Complex64], w: &mut [Complex64]) {
    let load = |i| z.get(i).map(|z: &Complex64| [z.re, z.im, 0.0]);
    let far = |i| Some(log_form::far(*z.get(i)?, 0));
    complex_values(&LambertWLog, w, z.len(), load, far);
}

/// `w[i]`, the Wright omega function of a real number.
pub fn real_wright_omega(x: &[f64], w: &mut [f64]) {
    let load = |i| x.get(i).map(|x| [*x, 0.0, 0.0]);
    run(
        &LambertWLog,
        x.len().min(w.len()),
        load,
        |i, [re, _, beyond]: [f64; 3]| {
            *w.get_mut(i)? = if beyond == 0.0 {
                re
            } else {
                log_form::far(Complex64::new(*x.get(i)?, 0.0), 0).re
            };
            Some(())
        },
    );
}

/// `slope[i]`, the derivative of `W_k[i]` at `z[i]`.
pub fn lambertw_derivative(z: &[Complex64], k: &[i64], slope: &mut [Complex64]) {
    by_branch(&Derivative, z, k, slope, far_derivative);
}

/// The derivative for arguments that the vectorised code does not handle.
fn far_derivative(z: Complex64, k: i64) -> Complex64 {
    if z.re.is_nan() || z.im.is_nan() {
        return Complex64::new(f64::NAN, f64::NAN);
    }
    if z.re == 0.0 && z.im == 0.0 {
        // The pole of log z, along the direction of the signed zero.
        return match k {
            0 => Complex64::ONE,
            _ => Complex64::new(f64::INFINITY.copysign(z.re), -z.im),
        };
    }
    if !(z.re.is_finite() && z.im.is_finite()) {
        return Complex64::new(0.0_f64.copysign(z.re), 0.0_f64.copysign(-z.im));
    }
    // W is in the millions there: W/(1 + W) is 1 - 1/W up to a relative error of 1e-13, which the
    // division takes into account.
    let w = far(z, k);
    let scale = z.re.abs().max(z.im.abs());
    (w / (w + 1.0)) / (z / scale) / scale
}

struct Offset;

impl Kernel<3, 5> for Offset {
    #[inline(always)]
    fn lanes<S: Simd>(&self, [re, im, k]: [Real<S>; 3]) -> [Real<S>; 5] {
        let point = Point::from_offset(Complex::new(re, im));
        // -1/e is not a double, so that only infinite, NaN and very large arguments are not
        // handled.
        let unit = Complex::new(re.constant(1.0) + re.abs(), im);
        let beyond = marked(kernel::out_of_reach(unit, k), re);
        let answer = kernel::lambertw(point, k);
        let (w, u) = (answer.w, answer.one_plus_w);
        [w.re, w.im, u.re, u.im, beyond]
    }
}

/// `w[i] = W_k[i](-1/e + delta[i])` and `one_plus_w[i]`, which keeps its relative accuracy where
/// it is small.
pub fn lambertw_offset(
    delta: &[Complex64],
    k: &[i64],
    w: &mut [Complex64],
    one_plus_w: &mut [Complex64],
) {
    let load = |i| {
        let (delta, k): (&Complex64, &i64) = (delta.get(i)?, k.get(i)?);
        Some([delta.re, delta.im, *k as f64])
    };
    let length = delta.len().min(k.len()).min(w.len()).min(one_plus_w.len());
    run(
        &Offset,
        length,
        load,
        |i, [re, im, u_re, u_im, beyond]: [f64; 5]| {
            let (w, u) = (w.get_mut(i)?, one_plus_w.get_mut(i)?);
            if beyond == 0.0 {
                (*w, *u) = (Complex64::new(re, im), Complex64::new(u_re, u_im));
            } else {
                *w = far(*delta.get(i)? - super::branch_point::INVERSE_E, *k.get(i)?);
                *u = *w + 1.0;
            }
            Some(())
        },
    );
}

struct DdeRoot;

impl Kernel<4, 3> for DdeRoot {
    #[inline(always)]
    fn lanes<S: Simd>(&self, arguments: [Real<S>; 4]) -> [Real<S>; 3] {
        let s = delay::root(arguments);
        let [like, ..] = arguments;
        [s.re, s.im, marked(delay::out_of_reach(arguments), like)]
    }
}

/// `s[i] = dde_root(a0[i], a1[i], delay[i], k[i])`.
pub fn dde_root(a0: &[f64], a1: &[f64], delay: &[f64], k: &[i64], s: &mut [Complex64]) {
    let load = |i| {
        let k: &i64 = k.get(i)?;
        Some([*a0.get(i)?, *a1.get(i)?, *delay.get(i)?, *k as f64])
    };
    let far = |i| {
        let (a0, a1, delay, k) = (a0.get(i)?, a1.get(i)?, delay.get(i)?, k.get(i)?);
        Some(delay::far_root(*a0, *a1, *delay, *k))
    };
    let length = a0.len().min(a1.len()).min(delay.len()).min(k.len());
    complex_values(&DdeRoot, s, length, load, far);
}

/// `out[i] = kernel(z[i], k[i])`, or `far` where the kernel marks that it does not handle the
/// argument.
fn by_branch<K: Kernel<3, 3>>(
    kernel: &K,
    z: &[Complex64],
    k: &[i64],
    out: &mut [Complex64],
    far: impl Fn(Complex64, i64) -> Complex64,
) {
    let load = |i| {
        let (z, k): (&Complex64, &i64) = (z.get(i)?, k.get(i)?);
        Some([z.re, z.im, *k as f64])
    };
    let far = |i| Some(far(*z.get(i)?, *k.get(i)?));
    complex_values(kernel, out, z.len().min(k.len()), load, far);
}

/// `out[i] = kernel(load(i))` for all i below `length`, or `far(i)` where the kernel marks that it
/// does not handle the argument.
fn complex_values<K: Kernel<IN, 3>, const IN: usize>(
    kernel: &K,
    out: &mut [Complex64],
    length: usize,
    load: impl Fn(usize) -> Option<[f64; IN]>,
    far: impl Fn(usize) -> Option<Complex64>,
) {
    let length = length.min(out.len());
    run(kernel, length, load, |i, [re, im, beyond]: [f64; 3]| {
        *out.get_mut(i)? = if beyond == 0.0 {
            Complex64::new(re, im)
        } else {
            far(i)?
        };
        Some(())
    });
}

/// `store(i, kernel(load(i)))` for all i below `length`.
fn run<K, const IN: usize, const OUT: usize>(
    kernel: &K,
    length: usize,
    load: impl Fn(usize) -> Option<[f64; IN]>,
    mut store: impl FnMut(usize, [f64; OUT]) -> Option<()>,
) where
    K: Kernel<IN, OUT>,
{
    if length <= SHORT {
        return chunk::<K, IN, OUT, SHORT>(kernel, length, load, store);
    }
    for start in (0..length).step_by(BLOCK) {
        let load = |i| load(start + i);
        let store = |i, values| store(start + i, values);
        chunk::<K, IN, OUT, BLOCK>(kernel, BLOCK.min(length - start), load, store);
    }
}

#[inline]
fn chunk<K, const IN: usize, const OUT: usize, const W: usize>(
    kernel: &K,
    length: usize,
    load: impl Fn(usize) -> Option<[f64; IN]>,
    mut store: impl FnMut(usize, [f64; OUT]) -> Option<()>,
) where
    K: Kernel<IN, OUT>,
{
    let mut arguments = [[0.0; W]; IN];
    let mut values = [[0.0; W]; OUT];
    for i in 0..length.min(W) {
        for (column, value) in arguments.iter_mut().zip(load(i).unwrap_or([0.0; IN])) {
            if let Some(place) = column.get_mut(i) {
                *place = value;
            }
        }
    }
    sweep(kernel, &arguments, &mut values, length);
    for i in 0..length.min(W) {
        let mut value = [0.0; OUT];
        for (value, column) in value.iter_mut().zip(&values) {
            *value = column.get(i).copied().unwrap_or_default();
        }
        store(i, value);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BRANCH_POINT: f64 = -super::super::branch_point::INVERSE_E;

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
