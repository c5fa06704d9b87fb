//! Bindings of `deadtime::lambertw`.

use deadtime::{Error, Task, lambertw as core};
use num_complex::Complex64;
use numpy::{IntoPyArray, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::arrays::in_order;
use crate::runtime::{run, run_here};

/// W_k(z) for each element; k has the shape of z or one element.
#[pyfunction]
#[pyo3(signature = (z, k, threads=None))]
pub(crate) fn lambertw<'py>(
    py: Python<'py>,
    z: PyReadonlyArrayDyn<'py, Complex64>,
    k: PyReadonlyArrayDyn<'py, i64>,
    threads: Option<usize>,
) -> PyResult<Bound<'py, PyArrayDyn<Complex64>>> {
    let (points, branches) = (in_order(&z), in_order(&k));
    filled(py, z.shape(), threads, |out, task| {
        core::lambertw_array(&points, &branches, out, task)
    })
}

/// Roots of s = a0 + a1 e^(-s delay) for each element of k; the others have the shape of k or
/// one element.
#[pyfunction]
#[pyo3(signature = (a0, a1, delay, k, threads=None))]
pub(crate) fn dde_roots<'py>(
    py: Python<'py>,
    a0: PyReadonlyArrayDyn<'py, f64>,
    a1: PyReadonlyArrayDyn<'py, f64>,
    delay: PyReadonlyArrayDyn<'py, f64>,
    k: PyReadonlyArrayDyn<'py, i64>,
    threads: Option<usize>,
) -> PyResult<Bound<'py, PyArrayDyn<Complex64>>> {
    let (own, delayed, lag) = (in_order(&a0), in_order(&a1), in_order(&delay));
    let branches = in_order(&k);
    filled(py, k.shape(), threads, |out, task| {
        core::dde_root_array(&own, &delayed, &lag, &branches, out, task)
    })
}

/// A new array of `shape`, filled by `work` with the interpreter released.
fn filled<'py, F>(
    py: Python<'py>,
    shape: &[usize],
    threads: Option<usize>,
    work: F,
) -> PyResult<Bound<'py, PyArrayDyn<Complex64>>>
where
    F: FnOnce(&mut [Complex64], &Task) -> Result<(), Error> + Send,
{
    let mut out = vec![Complex64::ZERO; shape.iter().product()];
    if threads.is_none() && out.len() < core::PARALLEL_LENGTH {
        run_here(py, |task| work(&mut out, task))?;
    } else {
        run(py, threads, None, |task| work(&mut out, task))?;
    }
    out.into_pyarray(py).reshape(shape)
}
