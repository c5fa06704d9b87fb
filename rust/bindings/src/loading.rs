//! Loading what cannot be interrupted.
//!
//! The `numpy` crate looks up NumPy's tables of functions at their first use, by Python code, and
//! panics where that raises an exception. So they are all looked up while the module is loaded, and
//! a Ctrl-C that arrives meanwhile counts when they are there.

use numpy::{PyArray1, PyArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyCFunction, PyList};

/// Look up the tables of arrays and of borrows, and run `work`, which looks up those it needs.
pub(crate) fn load_numpy(py: Python<'_>, work: impl FnOnce() -> PyResult<()>) -> PyResult<()> {
    py.import("numpy")?;
    uninterrupted(py, || {
        PyArray1::<f64>::zeros(py, 1, false).try_readonly()?;
        work()
    })
}

/// Run `work`; Ctrl-C is handled after it.
fn uninterrupted(py: Python<'_>, work: impl FnOnce() -> PyResult<()>) -> PyResult<()> {
    let signal = py.import("signal")?;
    let number = signal.getattr("SIGINT")?;
    let before = signal.call_method1("getsignal", (&number,))?;
    if before.is_none() {
        // A handler that is not Python's own raises nothing here.
        return work();
    }
    let came = PyList::empty(py);
    let list = came.clone().unbind();
    let keep = PyCFunction::new_closure(py, None, None, move |args, _| {
        list.bind(args.py()).append(true)
    })?;
    let holds = match signal.call_method1("signal", (&number, keep)) {
        Ok(_) => true,
        // Signals are handled in the main thread: no other is interrupted.
        Err(error) if error.is_instance_of::<PyValueError>(py) => false,
        Err(error) => return Err(error),
    };
    let done = work();
    if holds {
        signal.call_method1("signal", (&number, before))?;
        if !came.is_empty() {
            signal.call_method1("raise_signal", (&number,))?;
            py.check_signals()?;
        }
    }
    done
}
