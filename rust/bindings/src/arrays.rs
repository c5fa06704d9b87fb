//! Arrays of NumPy: borrowed where their memory allows it, copied in C order where it does not.

use std::borrow::Cow;

use deadtime::{Error, memory};
use numpy::ndarray::ArrayViewD;
use numpy::{Element, PyReadonlyArray2, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::errors::to_python;

/// What memory is asked for.
const COPY: &str = "the copy of an array";

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
