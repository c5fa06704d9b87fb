//! The one table from the core's errors to Python's exceptions.
//!
//! The exception classes themselves are Python (`deadtime._base.errors`), so that they carry
//! docstrings and attributes like any other class of the package.

use deadtime::Error;
use pyo3::exceptions::{PyKeyboardInterrupt, PyMemoryError, PyRuntimeError, PyValueError};
use pyo3::prelude::*;

/// The Python exception for a core error.
pub(crate) fn to_python(py: Python<'_>, error: Error) -> PyErr {
    let message = error.to_string();
    match error {
        Error::Argument(_) | Error::TooMuch { .. } | Error::Diverges { .. } => {
            PyValueError::new_err(message)
        }
        Error::NotIdentifiable(_) => own(py, "NotIdentifiableError", (message,)),
        Error::Interrupted => PyKeyboardInterrupt::new_err(message),
        Error::Memory { .. } => PyMemoryError::new_err(message),
        Error::Caller => PyRuntimeError::new_err(message),
        Error::Convergence { best, .. } => own(py, "ConvergenceError", (message, best)),
        Error::Contour {
            place, distance, ..
        } => own(py, "ContourError", (message, place, distance)),
        Error::OnEdge { inside, roots } => {
            let Some((place, radius, _)) = roots.first().copied() else {
                return own(py, "DeadtimeError", (message,));
            };
            // How far the edge has to move so that the first of them is no longer on it.
            let distance = (4.0 * radius)
                .max(16.0 * f64::EPSILON * place.norm())
                .max(f64::MIN_POSITIVE);
            own(
                py,
                "ContourError",
                (message, place, distance, inside, roots),
            )
        }
        Error::CountMismatch { counted, found, .. } => {
            own(py, "CountMismatchError", (message, counted, found))
        }
    }
}

/// An exception of a class of `deadtime._base.errors`.
pub(crate) fn own<'py, A>(py: Python<'py>, class: &str, arguments: A) -> PyErr
where
    A: pyo3::call::PyCallArgs<'py>,
{
    let instance = py
        .import("deadtime._base.errors")
        .and_then(|module| module.getattr(class))
        .and_then(|class| class.call1(arguments));
    match instance {
        Ok(exception) => PyErr::from_value(exception),
        Err(error) => error,
    }
}
