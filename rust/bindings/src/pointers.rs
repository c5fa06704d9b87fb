//! C functions for callers that compile: `scipy.LowLevelCallable`, numba, Cython.
//!
//! The dictionary `__pyx_capi__` of the module holds a capsule for each, named by its signature,
//! as a module of Cython's would. They hold no state and need no interpreter.
#![allow(unsafe_code)]

use std::ffi::{CStr, c_void};
use std::ptr::NonNull;

use deadtime::lambertw::block;
use num_complex::Complex64;
use pyo3::prelude::*;
use pyo3::types::{PyCapsule, PyDict};

const REAL: &CStr = c"double (double)";
const BRANCH: &CStr = c"void (double, double, int64_t, double *)";

extern "C" fn lambertw0(x: f64) -> f64 {
    let mut w = [0.0];
    block::lambertw0(&[x], &mut w);
    w[0]
}

extern "C" fn lambertwm1(x: f64) -> f64 {
    let mut w = [0.0];
    block::lambertwm1(&[x], &mut w);
    w[0]
}

/// Real and imaginary part of W_k(re + i im) to `out`.
///
/// # Safety
/// `out` points to two writable doubles.
unsafe extern "C" fn lambertw(re: f64, im: f64, k: i64, out: *mut f64) {
    let mut w = [Complex64::ZERO];
    block::lambertw(&[Complex64::new(re, im)], &[k], &mut w);
    // SAFETY: two doubles, as the signature says.
    unsafe { out.cast::<Complex64>().write_unaligned(w[0]) };
}

pub(crate) fn add_pointers(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let capsules = PyDict::new(module.py());
    let table = [
        ("lambertw", lambertw as *mut c_void, BRANCH),
        ("lambertw0", lambertw0 as *mut c_void, REAL),
        ("lambertwm1", lambertwm1 as *mut c_void, REAL),
    ];
    for (name, function, signature) in table {
        if let Some(function) = NonNull::new(function) {
            // SAFETY: functions stay where they are, and have the signature named.
            let capsule = unsafe { PyCapsule::new_with_pointer(module.py(), function, signature)? };
            capsules.set_item(name, capsule)?;
        }
    }
    module.add("__pyx_capi__", capsules)
}
