//! Functions of Python within work of the kernel.

use std::cell::RefCell;

use deadtime::Error;
use pyo3::prelude::*;

/// A function of Python fails: its error is kept until the work has ended.
pub(crate) struct Calls<'py> {
    pub(crate) py: Python<'py>,
    failure: RefCell<Option<PyErr>>,
}

impl<'py> Calls<'py> {
    pub(crate) fn new(py: Python<'py>) -> Self {
        Self {
            py,
            failure: RefCell::new(None),
        }
    }

    /// The result of a call, or an end of the work.
    pub(crate) fn kept<T>(&self, found: PyResult<T>) -> Result<T, Error> {
        found.map_err(|error| {
            *self.failure.borrow_mut() = Some(error);
            Error::Caller
        })
    }

    /// What came out of the work, or the error that ended it.
    pub(crate) fn ended<T>(&self, found: PyResult<T>) -> PyResult<T> {
        match self.failure.take() {
            Some(error) => Err(error),
            None => found,
        }
    }
}
