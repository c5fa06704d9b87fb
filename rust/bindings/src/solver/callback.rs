//! Events and changes, which are Python functions, beside a right-hand side of any kind.

use std::ops::Range;

use deadtime::dde::spectral::{Columns, Equation};
use deadtime::{Error, Task};
use numpy::ToPyArray;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyFloat, PyTuple};

use super::numbers::{finite, numbers};

/// A right-hand side that may have stopped the run with an exception.
pub(super) trait Failing {
    fn failure(&mut self) -> Option<PyErr>;
}

/// A right-hand side with its events and changes.
pub(super) struct WithCallbacks<'py, E> {
    pub(super) equation: E,
    pub(super) callbacks: Callbacks<'py>,
}

impl<E: Failing> WithCallbacks<'_, E> {
    pub(super) fn into_failure(mut self) -> Option<PyErr> {
        self.callbacks.failure.or_else(|| self.equation.failure())
    }
}

impl<E: Equation> Equation for WithCallbacks<'_, E> {
    fn slope(&mut self, at: Columns<'_>, out: &mut [f64], task: &Task) -> Result<(), Error> {
        self.equation.slope(at, out, task)
    }

    fn is_costly(&self) -> bool {
        self.equation.is_costly()
    }

    fn events(
        &mut self,
        t: f64,
        y: &[f64],
        which: Range<usize>,
        out: &mut [f64],
    ) -> Result<(), Error> {
        let result = self.callbacks.read_events(t, y, which, out);
        self.callbacks.keep(result)
    }

    fn change(&mut self, jump: usize, t: f64, y: &mut [f64]) -> Result<(), Error> {
        let result = self.callbacks.read_change(jump, t, y);
        self.callbacks.keep(result)
    }
}

/// Events and changes, and the exception that one of them raised.
pub(super) struct Callbacks<'py> {
    events: Vec<Bound<'py, PyAny>>,
    changes: Vec<Option<Bound<'py, PyAny>>>,
    args: Bound<'py, PyTuple>,
    failure: Option<PyErr>,
}

impl<'py> Callbacks<'py> {
    pub(super) fn new(
        events: Vec<Bound<'py, PyAny>>,
        changes: Vec<Option<Bound<'py, PyAny>>>,
        args: &Bound<'py, PyTuple>,
    ) -> Self {
        Self {
            events,
            changes,
            args: args.clone(),
            failure: None,
        }
    }

    /// Whether nothing of it is ever called.
    pub(super) fn is_empty(&self) -> bool {
        self.events.is_empty() && self.changes.iter().all(Option::is_none)
    }

    fn keep<T>(&mut self, result: PyResult<T>) -> Result<T, Error> {
        result.map_err(|error| {
            self.failure = Some(error);
            Error::Caller
        })
    }

    fn read_events(&self, t: f64, y: &[f64], which: Range<usize>, out: &mut [f64]) -> PyResult<()> {
        for (index, out) in which.zip(out) {
            let Some(event) = self.events.get(index) else {
                continue;
            };
            let py = event.py();
            let head = [PyFloat::new(py, t).into_any(), y.to_pyarray(py).into_any()];
            let value = call(event, head, &self.args)?;
            let who = || format!("event {index} at t={t}");
            numbers(&value, std::slice::from_mut(out), who, |shape| {
                format!("event {index} returned shape {shape} at t={t}: give one number")
            })?;
            if out.is_nan() {
                return Err(PyValueError::new_err(format!(
                    "event {index} is nan at t={t}, y={y:?}: give a number"
                )));
            }
        }
        Ok(())
    }

    fn read_change(&self, jump: usize, t: f64, y: &mut [f64]) -> PyResult<()> {
        let Some(Some(change)) = self.changes.get(jump) else {
            return Ok(());
        };
        let dim = y.len();
        let value = change.call1((t, y.to_pyarray(change.py())))?;
        let who = || format!("the change at t={t}");
        numbers(&value, y, who, |shape| {
            format!("the change at t={t} returned shape {shape}: give the {dim} new values")
        })?;
        finite(y, |value| {
            format!("the change at t={t} returned {value}: give finite numbers")
        })
    }
}

/// Call with some arguments and those of the caller after them.
pub(super) fn call<'py, const N: usize>(
    function: &Bound<'py, PyAny>,
    head: [Bound<'py, PyAny>; N],
    args: &Bound<'py, PyTuple>,
) -> PyResult<Bound<'py, PyAny>> {
    if args.is_empty() {
        return function.call1(PyTuple::new(function.py(), head)?);
    }
    let all: Vec<_> = head.into_iter().chain(args.iter()).collect();
    function.call1(PyTuple::new(function.py(), all)?)
}
