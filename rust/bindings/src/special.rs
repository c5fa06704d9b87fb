//! Bindings of `deadtime::lambertw`: the table of its ufuncs, and calls with plain numbers.

use deadtime::lambertw::block;
use num_complex::{Complex32, Complex64};
use pyo3::prelude::*;

use crate::ufunc::{add, scalar, ufunc};

ufunc! {
    /// W_k(z), the solution of w e^w = z on branch k.
    Lambertw = c"lambertw", 2 -> 1;
    (z: f64, k: i64) -> (w: Complex64) = block::lambertw;
    (z: Complex32, k: i64) -> (w: Complex32) = block::lambertw;
    (z: Complex64, k: i64) -> (w: Complex64) = block::lambertw;
}

ufunc! {
    /// W_0(x) where it is real, x >= -1/e, and nan elsewhere.
    Lambertw0 = c"lambertw0", 1 -> 1;
    (x: f64) -> (w: f64) = block::lambertw0;
    (x: f32) -> (w: f32) = block::lambertw0;
}

ufunc! {
    /// W_-1(x) where it is real, -1/e <= x <= 0, and nan elsewhere.
    Lambertwm1 = c"lambertwm1", 1 -> 1;
    (x: f64) -> (w: f64) = block::lambertwm1;
    (x: f32) -> (w: f32) = block::lambertwm1;
}

ufunc! {
    /// W_k(z) from log z: the solution of w + log w = log z + 2 pi i k.
    LambertwLog = c"lambertw_log", 2 -> 1;
    (log_z: f64, k: i64) -> (w: Complex64) = block::lambertw_log;
    (log_z: Complex32, k: i64) -> (w: Complex32) = block::lambertw_log;
    (log_z: Complex64, k: i64) -> (w: Complex64) = block::lambertw_log;
}

ufunc! {
    /// The Wright omega function, the solution of w + log w = z.
    WrightOmega = c"wrightomega", 1 -> 1;
    (z: f64) -> (w: f64) = block::real_wright_omega;
    (z: f32) -> (w: f32) = block::real_wright_omega;
    (z: Complex32) -> (w: Complex32) = block::wright_omega;
    (z: Complex64) -> (w: Complex64) = block::wright_omega;
}

ufunc! {
    /// The derivative of W_k at z.
    LambertwDerivative = c"lambertw_derivative", 2 -> 1;
    (z: f64, k: i64) -> (slope: Complex64) = block::lambertw_derivative;
    (z: Complex32, k: i64) -> (slope: Complex32) = block::lambertw_derivative;
    (z: Complex64, k: i64) -> (slope: Complex64) = block::lambertw_derivative;
}

ufunc! {
    /// W_k(-1/e + delta), and 1 + W to its own relative accuracy.
    LambertwOffset = c"lambertw_offset", 2 -> 2;
    (delta: f64, k: i64) -> (w: Complex64, one_plus_w: Complex64) = block::lambertw_offset;
    (delta: Complex32, k: i64) -> (w: Complex32, one_plus_w: Complex32) = block::lambertw_offset;
    (delta: Complex64, k: i64) -> (w: Complex64, one_plus_w: Complex64) = block::lambertw_offset;
}

ufunc! {
    /// Root k of s = a0 + a1 e^(-s delay).
    DdeRoots = c"dde_roots", 4 -> 1;
    (a0: f64, a1: f64, delay: f64, k: i64) -> (s: Complex64) = block::dde_root;
}

pub(crate) fn add_ufuncs(module: &Bound<'_, PyModule>) -> PyResult<()> {
    add::<Lambertw>(module)?;
    add::<Lambertw0>(module)?;
    add::<Lambertwm1>(module)?;
    add::<LambertwLog>(module)?;
    add::<WrightOmega>(module)?;
    add::<LambertwDerivative>(module)?;
    add::<LambertwOffset>(module)?;
    add::<DdeRoots>(module)
}

/// W_k(z) of two plain numbers; None where they are anything else, which is the ufunc's work.
#[pyfunction]
pub(crate) fn lambertw_number<'py>(
    z: &Bound<'py, PyAny>,
    k: &Bound<'py, PyAny>,
) -> PyResult<Option<Bound<'py, PyAny>>> {
    let (Some(point), Some(branch)) = (scalar::complex(z), scalar::integer(k)) else {
        return Ok(None);
    };
    let mut w = [Complex64::ZERO];
    block::lambertw(&[point], &[branch], &mut w);
    scalar::complex128(z.py(), w[0]).map(Some)
}

/// W_0(x) of a plain number; None for anything else.
#[pyfunction]
pub(crate) fn lambertw0_number<'py>(x: &Bound<'py, PyAny>) -> PyResult<Option<Bound<'py, PyAny>>> {
    real_number(x, block::lambertw0)
}

/// W_-1(x) of a plain number; None for anything else.
#[pyfunction]
pub(crate) fn lambertwm1_number<'py>(x: &Bound<'py, PyAny>) -> PyResult<Option<Bound<'py, PyAny>>> {
    real_number(x, block::lambertwm1)
}

fn real_number<'py>(
    x: &Bound<'py, PyAny>,
    kernel: impl Fn(&[f64], &mut [f64]),
) -> PyResult<Option<Bound<'py, PyAny>>> {
    let Some(point) = scalar::real(x) else {
        return Ok(None);
    };
    let mut w = [0.0];
    kernel(&[point], &mut w);
    scalar::float64(x.py(), w[0]).map(Some)
}

/// A root of plain numbers that the ufunc would not refuse; None for anything else.
#[pyfunction]
pub(crate) fn dde_root_number<'py>(
    a0: &Bound<'py, PyAny>,
    a1: &Bound<'py, PyAny>,
    delay: &Bound<'py, PyAny>,
    k: &Bound<'py, PyAny>,
) -> PyResult<Option<Bound<'py, PyAny>>> {
    let (Some(own), Some(delayed), Some(lag), Some(branch)) = (
        scalar::real(a0),
        scalar::real(a1),
        scalar::real(delay),
        scalar::integer(k),
    ) else {
        return Ok(None);
    };
    if !(own.is_finite() && delayed.is_finite() && lag.is_finite() && lag >= 0.0) {
        return Ok(None);
    }
    let mut s = [Complex64::ZERO];
    block::dde_root(&[own], &[delayed], &[lag], &[branch], &mut s);
    scalar::complex128(a0.py(), s[0]).map(Some)
}
