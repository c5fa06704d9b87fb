//! Numbers from Python: arrays of NumPy, borrowed where their memory allows it and copied in C order
//! where it does not, and what a Python function returned, checked.

use std::borrow::Cow;

use deadtime::{Error, memory};
use numpy::ndarray::{ArrayView1, ArrayViewD};
use numpy::npyffi::NPY_ARRAY_WRITEABLE;
use numpy::{
    Element, IntoPyArray, PyArray1, PyArrayDyn, PyArrayMethods, PyReadonlyArray2,
    PyReadonlyArrayDyn, PyUntypedArray, PyUntypedArrayMethods,
};
use pyo3::PyClass;
use pyo3::PyTypeInfo;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::pyclass::boolean_struct::True;
use pyo3::types::{PyFloat, PyList, PyTuple};

use crate::errors::to_python;

/// What memory is asked for.
const COPY: &str = "the copy of an array";

/// Number of values up to which an array copies them.
const SHORT: usize = 1024;

/// The elements in C order: borrowed where they lie so in memory, copied otherwise.
pub(crate) fn in_order<'a, T: Element + Copy>(
    array: &'a PyReadonlyArrayDyn<'_, T>,
) -> PyResult<Cow<'a, [T]>> {
    // `as_slice` also serves Fortran order, where memory order is not C order.
    match array.as_slice() {
        Ok(slice) if array.is_c_contiguous() => Ok(Cow::Borrowed(slice)),
        _ => converted(memory::collected(COPY, view(array).iter().copied())).map(Cow::Owned),
    }
}

/// A copy of the elements in C order.
pub(crate) fn owned<T: Element + Copy>(array: &PyReadonlyArrayDyn<'_, T>) -> PyResult<Vec<T>> {
    match in_order(array)? {
        Cow::Borrowed(slice) => converted(memory::copied(COPY, slice)),
        Cow::Owned(copy) => Ok(copy),
    }
}

/// The rows of a matrix.
pub(crate) fn rows(matrix: &PyReadonlyArray2<'_, f64>) -> Vec<Vec<f64>> {
    let rows = matrix.as_array();
    rows.rows().into_iter().map(|row| row.to_vec()).collect()
}

/// An array of the values that nobody can write to. Short ones are copied, since NumPy then frees
/// one object instead of two.
pub(crate) fn frozen(py: Python<'_>, values: Vec<f64>) -> Bound<'_, PyArray1<f64>> {
    read_only(if values.len() <= SHORT {
        PyArray1::from_slice(py, &values)
    } else {
        values.into_pyarray(py)
    })
}

/// An array of numbers in an object that does not change, which nobody can write to. Short ones are
/// copied; longer ones keep the object.
pub(crate) fn part_of<'py, T: PyClass<Frozen = True> + Sync>(
    object: &Bound<'py, T>,
    numbers: impl Fn(&T) -> &[f64],
) -> Bound<'py, PyArray1<f64>> {
    let values = numbers(object.get());
    if values.len() <= SHORT {
        return read_only(PyArray1::from_slice(object.py(), values));
    }
    // SAFETY: a frozen object does not change, and the array keeps it.
    #[allow(unsafe_code)]
    let array = unsafe {
        PyArray1::borrow_from_array(&ArrayView1::from(values), object.clone().into_any())
    };
    read_only(array)
}

fn read_only(array: Bound<'_, PyArray1<f64>>) -> Bound<'_, PyArray1<f64>> {
    // SAFETY: the array is new and nobody else has it.
    #[allow(unsafe_code)]
    unsafe {
        (*array.as_array_ptr()).fields.flags &= !NPY_ARRAY_WRITEABLE;
    }
    array
}

/// One column of a list of results.
pub(crate) fn column<S, T>(list: &[S], of: impl Fn(&S) -> T) -> PyResult<Vec<T>> {
    converted(memory::collected(
        "the list of results",
        list.iter().map(of),
    ))
}

/// A result of the core as one of Python, for work that is done without a task.
pub(crate) fn converted<T>(outcome: Result<T, Error>) -> PyResult<T> {
    outcome.map_err(|error| Python::attach(|py| to_python(py, error)))
}

fn view<'a, T: Element>(array: &'a PyReadonlyArrayDyn<'_, T>) -> ArrayViewD<'a, T> {
    array.as_array()
}

/// The numbers that a function returned, as many as `out` has places: an array, a list, or for one
/// place a plain number.
pub(crate) fn numbers(
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
pub(crate) fn array_of<'py>(
    value: &Bound<'py, PyAny>,
    who: impl Fn() -> String,
) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    if value.get_type().is(PyUntypedArray::type_object(value.py())) {
        if let Ok(array) = value.cast::<PyArrayDyn<f64>>() {
            return Ok(array.clone());
        }
    } else if is_masked(value)? {
        return Err(PyValueError::new_err(format!(
            "{} returned a masked value, which is not a number: return numbers only, or fill \
             masked entries",
            who()
        )));
    }
    converted_array(value, who)
}

/// Is an entry of an array, or of one in a list, masked? NumPy drops the mask as it converts.
fn is_masked(value: &Bound<'_, PyAny>) -> PyResult<bool> {
    let py = value.py();
    // Without numpy.ma there are no masked arrays, and it is slow to load.
    let modules = py.import("sys")?.getattr("modules")?;
    let Ok(masked) = modules.get_item("numpy.ma") else {
        return Ok(false);
    };
    if value.is_instance(&masked.getattr("MaskedArray")?)? {
        let any = masked.call_method1("is_masked", (value,))?;
        return any.extract();
    }
    if value.is_instance_of::<PyList>() || value.is_instance_of::<PyTuple>() {
        for item in value.try_iter()? {
            if is_masked(&item?)? {
                return Ok(true);
            }
        }
    }
    Ok(false)
}

fn converted_array<'py>(
    value: &Bound<'py, PyAny>,
    who: impl Fn() -> String,
) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    let numpy = value.py().import("numpy")?;
    let refuse = |what: &str| Err(PyTypeError::new_err(format!("{} returned {what}", who())));
    if value.is_none() {
        return refuse("None: let the function return its values");
    }
    let array = numpy.call_method1("asarray", (value,))?;
    let dtype = array.getattr("dtype")?;
    match dtype.getattr("kind")?.extract::<char>()? {
        'b' | 'i' | 'u' | 'f' => {}
        'c' => {
            return refuse(
                "complex numbers: return real numbers, with the real and the imaginary part as \
                 separate components",
            );
        }
        // NumPy would read None as nan.
        'O' => {
            for item in array.getattr("flat")?.try_iter()? {
                if item?.is_none() {
                    return refuse("None instead of a number: return real numbers");
                }
            }
        }
        _ => return refuse(&format!("values of the dtype {dtype}: return real numbers")),
    }
    let floats = numpy.call_method1("asarray", (array, "d"))?;
    Ok(floats.cast_into::<PyArrayDyn<f64>>()?)
}

/// The elements in C order.
pub(crate) fn copy(array: &Bound<'_, PyArrayDyn<f64>>, out: &mut [f64]) -> PyResult<()> {
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
pub(crate) fn finite(values: &[f64], message: impl Fn(&str) -> String) -> PyResult<()> {
    match values.iter().find(|value| !value.is_finite()) {
        None => Ok(()),
        Some(value) if value.is_nan() => Err(PyValueError::new_err(message("nan"))),
        Some(value) => Err(PyValueError::new_err(message(&value.to_string()))),
    }
}

/// A shape as Python writes it.
pub(crate) fn shape_text(shape: &[usize]) -> String {
    match shape {
        [one] => format!("({one},)"),
        _ => {
            let sizes: Vec<String> = shape.iter().map(usize::to_string).collect();
            format!("({})", sizes.join(", "))
        }
    }
}
