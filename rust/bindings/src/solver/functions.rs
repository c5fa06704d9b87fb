//! Python functions: right-hand sides, and events and changes beside a right-hand side of any kind.

use std::ops::Range;

use deadtime::dde::spectral::{Columns, Equation};
use deadtime::{Error, Task};
use numpy::ndarray::{ArrayView2, ArrayView3};
use numpy::{PyArrayMethods, PyUntypedArrayMethods, ToPyArray};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyFloat, PyList, PyTuple};

use crate::arrays::{array_of, copy, finite, numbers, shape_text};

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
                format!(
                    "event {index} returned an array of shape {shape} at t={t}: return one \
                    number"
                )
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
            format!(
                "the change at t={t} returned an array of shape {shape}: return the {dim} new \
                values"
            )
        })?;
        finite(y, |value| {
            format!("the change at t={t} returned {value}: return finite numbers")
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

/// The right-hand side in Python.
pub(super) struct PythonEquation<'py> {
    function: Bound<'py, PyAny>,
    args: Bound<'py, PyTuple>,
    vectorized: bool,
    column: Vec<f64>,
    failure: Option<PyErr>,
}

impl<'py> PythonEquation<'py> {
    pub(super) fn new(
        function: Bound<'py, PyAny>,
        args: Bound<'py, PyTuple>,
        vectorized: bool,
    ) -> PyResult<Self> {
        if !function.is_callable() {
            return Err(PyTypeError::new_err("fun is not callable"));
        }
        Ok(Self {
            function,
            args,
            vectorized,
            column: Vec::new(),
            failure: None,
        })
    }

    /// One call for all nodes.
    fn together(&self, at: Columns<'_>, out: &mut [f64]) -> PyResult<()> {
        let py = self.function.py();
        let n = at.t.len();
        let dim = out.len() / n;
        let delays = at.z.len() / out.len().max(1);
        let head = [
            at.t.to_pyarray(py).into_any(),
            matrix(py, dim, n, at.y)?,
            cube(py, [delays, dim, n], at.z)?,
        ];
        let value = if at.dz.is_empty() {
            call(&self.function, head, &self.args)?
        } else {
            let [t, y, z] = head;
            let dz = cube(py, [delays, dim, n], at.dz)?;
            call(&self.function, [t, y, z, dz], &self.args)?
        };
        read_slopes(&value, (dim, n), at.t[0], out)
    }

    /// One call a node.
    fn single(&mut self, at: Columns<'_>, out: &mut [f64]) -> PyResult<()> {
        let py = self.function.py();
        let n = at.t.len();
        let dim = out.len() / n;
        let delays = at.z.len() / out.len().max(1);
        let mut slope = vec![0.0; dim];
        for (node, &t) in at.t.iter().enumerate() {
            let mut column = |values: &[f64]| {
                self.column.clear();
                self.column
                    .extend(values.chunks_exact(n).map(|row| row[node]));
                self.column.to_pyarray(py)
            };
            let y = column(at.y).into_any();
            let z = column(at.z).reshape([delays, dim])?.into_any();
            let t_given = PyFloat::new(py, t).into_any();
            let value = if at.dz.is_empty() {
                call(&self.function, [t_given, y, z], &self.args)?
            } else {
                let dz = column(at.dz).reshape([delays, dim])?.into_any();
                call(&self.function, [t_given, y, z, dz], &self.args)?
            };
            let who = || format!("fun at t={t}");
            numbers(&value, &mut slope, who, |shape| {
                format!(
                    "fun returned an array of shape {shape} at t={t}: return the {dim} \
                    components of dy/dt"
                )
            })?;
            for (row, slope) in out.chunks_exact_mut(n).zip(&slope) {
                row[node] = *slope;
            }
        }
        Ok(())
    }
}

impl Equation for PythonEquation<'_> {
    fn slope(&mut self, at: Columns<'_>, out: &mut [f64], task: &Task) -> Result<(), Error> {
        task.check()?;
        let result = if self.vectorized {
            self.together(at, out)
        } else {
            self.single(at, out)
        };
        result.map_err(|error| {
            self.failure = Some(error);
            Error::Caller
        })
    }

    fn is_costly(&self) -> bool {
        true
    }
}

impl Failing for PythonEquation<'_> {
    fn failure(&mut self) -> Option<PyErr> {
        self.failure.take()
    }
}

/// The slopes that a vectorized function returned: an array, or a list of rows.
fn read_slopes(
    value: &Bound<'_, PyAny>,
    (dim, n): (usize, usize),
    t: f64,
    out: &mut [f64],
) -> PyResult<()> {
    let advice = |shape: String| {
        format!(
            "fun returned an array of shape {shape} for {n} nodes from t={t} on: with \
             vectorized=True return the shape ({dim}, {n}), components by nodes. For a function \
             of one t, leave vectorized out"
        )
    };
    let who = || format!("fun for {n} nodes from t={t} on");
    let listed = value.is_instance_of::<PyList>() || value.is_instance_of::<PyTuple>();
    if listed && value.len()? == dim {
        for (row, out) in value.try_iter()?.zip(out.chunks_exact_mut(n)) {
            let array = array_of(&row?, who)?;
            match array.shape() {
                [] => out.fill(array.to_vec()?.first().copied().unwrap_or(f64::NAN)),
                [length] if *length == n => copy(&array, out)?,
                shape => return Err(PyValueError::new_err(advice(shape_text(shape)))),
            }
        }
        return Ok(());
    }
    let array = array_of(value, who)?;
    let shape = array.shape();
    if shape == [dim, n] || (dim == 1 && shape == [n]) {
        return copy(&array, out);
    }
    Err(PyValueError::new_err(advice(shape_text(shape))))
}

fn matrix<'py>(
    py: Python<'py>,
    rows: usize,
    columns: usize,
    values: &[f64],
) -> PyResult<Bound<'py, PyAny>> {
    let view = ArrayView2::from_shape((rows, columns), values);
    let view = view.map_err(|error| PyValueError::new_err(error.to_string()))?;
    Ok(view.to_pyarray(py).into_any())
}

fn cube<'py>(
    py: Python<'py>,
    [delays, rows, columns]: [usize; 3],
    values: &[f64],
) -> PyResult<Bound<'py, PyAny>> {
    let view = ArrayView3::from_shape((delays, rows, columns), values);
    let view = view.map_err(|error| PyValueError::new_err(error.to_string()))?;
    Ok(view.to_pyarray(py).into_any())
}
