//! Single numbers past NumPy: a ufunc call spends most of its time on them in NumPy's machinery.
#![allow(unsafe_code)]

use num_complex::Complex64;
use numpy::npyffi::{NpyTypes, PY_ARRAY_API, get_type_object};
use numpy::{Element, PyArrayDescrMethods, dtype};
use pyo3::prelude::*;
use pyo3::types::{PyComplex, PyComplexMethods, PyFloat, PyInt};

/// The value of a Python float or int, or of NumPy's float64 or int64; None for anything else.
///
/// Of exactly those types, as subclasses may have wishes of their own; an int of more than 64
/// bits is left to NumPy too.
#[inline]
pub(crate) fn real(value: &Bound<'_, PyAny>) -> Option<f64> {
    if value.is_exact_instance_of::<PyFloat>() || is(value, NpyTypes::PyDoubleArrType_Type) {
        value.extract().ok()
    } else {
        integer(value).map(|integer| integer as f64)
    }
}

/// The value of a number as for [`real`], or of a Python complex or NumPy's complex128.
#[inline]
pub(crate) fn complex(value: &Bound<'_, PyAny>) -> Option<Complex64> {
    if value.is_exact_instance_of::<PyComplex>() || is(value, NpyTypes::PyCDoubleArrType_Type) {
        let value = value.cast::<PyComplex>().ok()?;
        Some(Complex64::new(value.real(), value.imag()))
    } else {
        real(value).map(|re| Complex64::new(re, 0.0))
    }
}

/// The value of a Python int that fits 64 bits, or of NumPy's int64; None for anything else.
#[inline]
pub(crate) fn integer(value: &Bound<'_, PyAny>) -> Option<i64> {
    // NumPy has two types of 64 bits where C has.
    let integer = value.is_exact_instance_of::<PyInt>()
        || is(value, NpyTypes::PyLongArrType_Type)
        || is(value, NpyTypes::PyLongLongArrType_Type);
    if integer { value.extract().ok() } else { None }
}

fn is(value: &Bound<'_, PyAny>, kind: NpyTypes) -> bool {
    // SAFETY: NumPy's table of types, read while attached.
    value.get_type_ptr() == unsafe { get_type_object(value.py(), kind) }
}

/// `value` as NumPy's scalar of type float64.
pub(crate) fn float64(py: Python<'_>, value: f64) -> PyResult<Bound<'_, PyAny>> {
    scalar(py, value)
}

/// `value` as NumPy's scalar of type complex128.
pub(crate) fn complex128(py: Python<'_>, value: Complex64) -> PyResult<Bound<'_, PyAny>> {
    scalar(py, value)
}

fn scalar<T: Element>(py: Python<'_>, mut value: T) -> PyResult<Bound<'_, PyAny>> {
    let descriptor = dtype::<T>(py);
    // SAFETY: the descriptor is that of the value, which is copied.
    unsafe {
        let made = PY_ARRAY_API.PyArray_Scalar(
            py,
            (&raw mut value).cast(),
            descriptor.as_dtype_ptr(),
            std::ptr::null_mut(),
        );
        Bound::from_owned_ptr_or_err(py, made)
    }
}
