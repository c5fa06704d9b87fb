//! Right-hand sides, events and changes that are Python functions.

use std::ops::Range;

use deadtime::dde::spectral::{Columns, Equation};
use deadtime::{Error, Task};
use numpy::ndarray::{ArrayView2, ArrayView3};
use numpy::{PyArrayDyn, PyArrayMethods, PyUntypedArrayMethods, ToPyArray};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyFloat, PyList, PyTuple};

/// Events and changes, and the exception that one of them, or the right-hand side, raised.
pub(super) struct Callbacks<'py> {
    events: Vec<Bound<'py, PyAny>>,
    changes: Vec<Option<Bound<'py, PyAny>>>,
    args: Bound<'py, PyTuple>,
    pub(super) failure: Option<PyErr>,
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

    pub(super) fn events(
        &mut self,
        t: f64,
        y: &[f64],
        which: Range<usize>,
        out: &mut [f64],
    ) -> Result<(), Error> {
        let result = self.read_events(t, y, which, out);
        self.keep(result)
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

    pub(super) fn change(&mut self, jump: usize, t: f64, y: &mut [f64]) -> Result<(), Error> {
        let Some(Some(change)) = self.changes.get(jump) else {
            return Ok(());
        };
        let given = y.to_pyarray(change.py());
        let dim = y.len();
        let result = change.call1((t, given)).and_then(|value| {
            let who = || format!("the change at t={t}");
            numbers(&value, y, who, |shape| {
                format!("the change at t={t} returned shape {shape}: give the {dim} new values")
            })
        });
        let result = result.and_then(|()| match y.iter().find(|value| !value.is_finite()) {
            None => Ok(()),
            Some(value) => Err(PyValueError::new_err(format!(
                "the change at t={t} returned {}: give finite numbers",
                shown(*value)
            ))),
        });
        self.keep(result)
    }
}

/// Call with some arguments and the caller's own after them.
fn call<'py, const N: usize>(
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
    callbacks: Callbacks<'py>,
    vectorized: bool,
    column: Vec<f64>,
}

impl<'py> PythonEquation<'py> {
    pub(super) fn new(
        function: Bound<'py, PyAny>,
        args: Bound<'py, PyTuple>,
        callbacks: Callbacks<'py>,
        vectorized: bool,
    ) -> PyResult<Self> {
        if !function.is_callable() {
            return Err(PyTypeError::new_err("fun is not callable"));
        }
        Ok(Self {
            function,
            args,
            callbacks,
            vectorized,
            column: Vec::new(),
        })
    }

    pub(super) fn into_failure(self) -> Option<PyErr> {
        self.callbacks.failure
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
        if let Ok(array) = value.cast::<PyArrayDyn<f64>>() {
            let shape = array.shape();
            if shape == [dim, n] || (dim == 1 && shape == [n]) {
                copy(array, out)?;
                return Ok(());
            }
        }
        self.rows(&value, dim, n, at.t[0], out)
    }

    /// Slopes that are no array of floats in the expected shape: a list of rows, other types.
    fn rows(
        &self,
        value: &Bound<'py, PyAny>,
        dim: usize,
        n: usize,
        t: f64,
        out: &mut [f64],
    ) -> PyResult<()> {
        let advice = |shape: String| {
            format!(
                "fun returned shape {shape} for {n} nodes from t={t} on: with vectorized=True give \
                 (component, node) = ({dim}, {n}); leave vectorized out for a function of one t"
            )
        };
        let who = || format!("fun for {n} nodes from t={t} on");
        let listed = value.is_instance_of::<PyList>() || value.is_instance_of::<PyTuple>();
        if listed && value.len()? == dim {
            for (row, out) in value.try_iter()?.zip(out.chunks_exact_mut(n)) {
                let array = as_array(&row?, who)?;
                match array.shape() {
                    [] => out.fill(array.to_vec()?.first().copied().unwrap_or(f64::NAN)),
                    [length] if *length == n => copy(&array, out)?,
                    shape => return Err(PyValueError::new_err(advice(words(shape)))),
                }
            }
            return Ok(());
        }
        let array = as_array(value, who)?;
        let shape = array.shape();
        if shape == [dim, n] || (dim == 1 && shape == [n]) {
            return copy(&array, out);
        }
        Err(PyValueError::new_err(advice(words(shape))))
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
                format!("fun returned shape {shape} at t={t}: give the {dim} components of dy/dt")
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
        self.callbacks.keep(result)
    }

    fn is_costly(&self) -> bool {
        true
    }

    fn events(
        &mut self,
        t: f64,
        y: &[f64],
        which: Range<usize>,
        out: &mut [f64],
    ) -> Result<(), Error> {
        self.callbacks.events(t, y, which, out)
    }

    fn change(&mut self, jump: usize, t: f64, y: &mut [f64]) -> Result<(), Error> {
        self.callbacks.change(jump, t, y)
    }
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
    let array = match value.cast::<PyArrayDyn<f64>>() {
        Ok(array) => array.clone(),
        Err(_) => as_array(value, who)?,
    };
    let shape = array.shape();
    let single = out.len() == 1 && array.len() == 1 && shape.len() <= 1;
    if shape == [out.len()] || single {
        return copy(&array, out);
    }
    Err(PyValueError::new_err(advice(words(shape))))
}

/// Whatever NumPy makes an array of real numbers of; `who` returned it.
fn as_array<'py>(
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
fn copy(array: &Bound<'_, PyArrayDyn<f64>>, out: &mut [f64]) -> PyResult<()> {
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

/// A number as Python writes it.
pub(super) fn shown(value: f64) -> String {
    if value.is_nan() {
        "nan".to_owned()
    } else {
        value.to_string()
    }
}

/// A shape as Python writes it.
fn words(shape: &[usize]) -> String {
    match shape {
        [one] => format!("({one},)"),
        _ => {
            let sizes: Vec<String> = shape.iter().map(usize::to_string).collect();
            format!("({})", sizes.join(", "))
        }
    }
}
