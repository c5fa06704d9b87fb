//! Numbers that a Python function returned: arrays, lists and plain numbers, checked.

use numpy::{PyArrayDyn, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyFloat, PyList};

/// The numbers that a function returned, as many as `out` has places: an array, a list, or for one
/// place a plain number.
pub(super) fn numbers(
    value: &Bound<'_, PyAny>,
    out: &mut [f64],
    who: impl Fn() -> String,
    advice: impl Fn(String) -> String,
) -> PyResult<()> {
    if let (Ok(number), [place]) = (value.cast_exact::<PyFloat>(), &mut *out) {
        *place = number.value();
        return Ok(());
    }
    if let Ok(list) = value.cast_exact::<PyList>()
        && list.len() == out.len()
    {
        let mut all = true;
        for (item, place) in list.iter().zip(out.iter_mut()) {
            match item.cast::<PyFloat>() {
                Ok(number) => *place = number.value(),
                Err(_) => {
                    all = false;
                    break;
                }
            }
        }
        if all {
            return Ok(());
        }
    }
    let array = array_of(value, who)?;
    let shape = array.shape();
    let single = out.len() == 1 && array.len() == 1 && shape.len() <= 1;
    if shape == [out.len()] || single {
        return copy(&array, out);
    }
    Err(PyValueError::new_err(advice(shape_text(shape))))
}

/// An array of floats as it is, or whatever NumPy makes one of; `who` returned it.
pub(super) fn array_of<'py>(
    value: &Bound<'py, PyAny>,
    who: impl Fn() -> String,
) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    match value.cast::<PyArrayDyn<f64>>() {
        Ok(array) => Ok(array.clone()),
        Err(_) => converted_array(value, who),
    }
}

fn converted_array<'py>(
    value: &Bound<'py, PyAny>,
    who: impl Fn() -> String,
) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    let numpy = value.py().import("numpy")?;
    let refuse = |what: &str| Err(PyTypeError::new_err(format!("{} returned {what}", who())));
    if value.is_none() {
        return refuse("None: end it with a return statement that gives the values");
    }
    let array = numpy.call_method1("asarray", (value,))?;
    let dtype = array.getattr("dtype")?;
    match dtype.getattr("kind")?.extract::<char>()? {
        'b' | 'i' | 'u' | 'f' => {}
        'c' => {
            return refuse(
                "complex numbers: give real ones, the real and the imaginary part as components \
                 of their own",
            );
        }
        // NumPy would read None as nan.
        'O' => {
            for item in array.getattr("flat")?.try_iter()? {
                if item?.is_none() {
                    return refuse("None in place of a number: give real numbers");
                }
            }
        }
        _ => return refuse(&format!("values of dtype {dtype}: give real numbers")),
    }
    let floats = numpy.call_method1("asarray", (array, "d"))?;
    Ok(floats.cast_into::<PyArrayDyn<f64>>()?)
}

/// The elements in C order.
pub(super) fn copy(array: &Bound<'_, PyArrayDyn<f64>>, out: &mut [f64]) -> PyResult<()> {
    let array = array.try_readonly()?;
    match array.as_slice() {
        Ok(slice) if array.is_c_contiguous() && slice.len() == out.len() => {
            out.copy_from_slice(slice);
        }
        _ => {
            for (out, value) in out.iter_mut().zip(array.as_array()) {
                *out = *value;
            }
        }
    }
    Ok(())
}

/// Refuse values that are not finite; `message` gets the first of them as Python writes it.
pub(super) fn finite(values: &[f64], message: impl Fn(&str) -> String) -> PyResult<()> {
    match values.iter().find(|value| !value.is_finite()) {
        None => Ok(()),
        Some(value) if value.is_nan() => Err(PyValueError::new_err(message("nan"))),
        Some(value) => Err(PyValueError::new_err(message(&value.to_string()))),
    }
}

/// A shape as Python writes it.
pub(super) fn shape_text(shape: &[usize]) -> String {
    match shape {
        [one] => format!("({one},)"),
        _ => {
            let sizes: Vec<String> = shape.iter().map(usize::to_string).collect();
            format!("({})", sizes.join(", "))
        }
    }
}
