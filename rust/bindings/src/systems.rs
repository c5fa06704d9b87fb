//! Bindings of `deadtime::dde::system`.

use deadtime::Error;
use deadtime::dde::spectral;
use deadtime::dde::system::Term;
use deadtime::dde::{LinearSystem, Past, Signal, SystemEquations};
use numpy::{
    IntoPyArray, PyArray1, PyArray3, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods,
};
use pyo3::prelude::*;

use crate::arrays::{converted, in_order, owned};
use crate::runtime::run_here;

type Floats<'py> = PyReadonlyArrayDyn<'py, f64>;

/// A function of time by pieces, each a Legendre series.
#[pyclass(frozen, module = "deadtime._deadtime", name = "Signal")]
pub(crate) struct PySignal {
    inner: Signal,
}

#[pymethods]
impl PySignal {
    /// `series` has the shape (pieces, columns, coefficients); `breaks` numbers the pieces that
    /// start with a break.
    #[new]
    fn new(edges: Floats<'_>, series: Floats<'_>, breaks: Vec<usize>) -> PyResult<Self> {
        let made = match series.shape() {
            [_, width, terms] => Signal::new(
                *width,
                &in_order(&edges)?,
                *terms,
                &in_order(&series)?,
                breaks,
            ),
            _ => Err(Error::argument("the series of a signal need three axes")),
        };
        converted(made).map(|inner| Self { inner })
    }
}

/// A fitted function: edges of its pieces, series of the shape (pieces, columns, coefficients), and the
/// pieces that start with a break.
#[pyclass(frozen, get_all, module = "deadtime._deadtime")]
pub(crate) struct FittedSeries {
    edges: Py<PyArray1<f64>>,
    series: Py<PyArray3<f64>>,
    breaks: Vec<usize>,
}

/// Fit the function of this name between its breaks; `sample` gives its values, of the shape (width,
/// m), at m times.
#[pyfunction]
#[pyo3(signature = (name, sample, *, span, breaks, gap, width))]
pub(crate) fn fitted_series(
    py: Python<'_>,
    name: &str,
    sample: &Bound<'_, PyAny>,
    span: (f64, f64),
    breaks: Vec<f64>,
    gap: f64,
    width: usize,
) -> PyResult<FittedSeries> {
    let mut failure = None;
    let read = |times: &[f64], out: &mut [f64]| -> PyResult<()> {
        let found = sample.call1((PyArray1::from_slice(py, times),))?;
        let values = found.extract::<Floats<'_>>()?;
        let values = in_order(&values)?;
        for (i, row) in values.chunks_exact(times.len().max(1)).enumerate() {
            for (out, value) in out.iter_mut().skip(i).step_by(width).zip(row) {
                *out = *value;
            }
        }
        Ok(())
    };
    let found = spectral::series(name, span, gap, &breaks, width, |times, out| {
        read(times, out).map_err(|error| {
            failure = Some(error);
            Error::Caller
        })
    });
    if let Some(error) = failure {
        return Err(error);
    }
    let found = converted(found)?;
    let shape = [found.edges.len() - 1, width, found.terms];
    Ok(FittedSeries {
        edges: found.edges.into_pyarray(py).unbind(),
        series: found.series.into_pyarray(py).reshape(shape)?.unbind(),
        breaks: found.breaks,
    })
}

/// The sizes of a system, and its matrices with the delay of each.
#[derive(FromPyObject)]
struct SystemMatrices<'py> {
    states: usize,
    inputs: usize,
    outputs: usize,
    #[pyo3(attribute("A"))]
    a: Terms<'py>,
    #[pyo3(attribute("N"))]
    n: Terms<'py>,
    #[pyo3(attribute("B"))]
    b: Terms<'py>,
    #[pyo3(attribute("C"))]
    c: Terms<'py>,
    #[pyo3(attribute("F"))]
    f: Terms<'py>,
    #[pyo3(attribute("D"))]
    d: Terms<'py>,
}

/// The response of a system at some times, one time after the other.
#[pyclass(frozen, get_all, module = "deadtime._deadtime")]
pub(crate) struct LinearSystemResponse {
    outputs: Py<PyArray1<f64>>,
    states: Py<PyArray1<f64>>,
    inputs: Py<PyArray1<f64>>,
    breaks: Py<PyArray1<f64>>,
}

/// The system x' + sum N x'(t - tau) = sum A x(t - tau) + sum B u(t - tau),
/// y = sum C x(t - tau) + sum F x'(t - tau) + sum D u(t - tau).
#[pyclass(frozen, module = "deadtime._deadtime", name = "LinearSystem")]
pub(crate) struct PyLinearSystem {
    inner: LinearSystem,
}

type Terms<'py> = Vec<(f64, Floats<'py>)>;

fn terms(given: &Terms<'_>) -> PyResult<Vec<Term>> {
    let term = |(delay, matrix): &(f64, Floats<'_>)| {
        Ok(Term {
            delay: *delay,
            matrix: owned(matrix)?,
        })
    };
    given.iter().map(term).collect()
}

#[pymethods]
impl PyLinearSystem {
    #[new]
    fn new(matrices: SystemMatrices<'_>) -> PyResult<Self> {
        let equations = SystemEquations {
            states: matrices.states,
            inputs: matrices.inputs,
            outputs: matrices.outputs,
            state: terms(&matrices.a)?,
            derivative: terms(&matrices.n)?,
            input: terms(&matrices.b)?,
            output: terms(&matrices.c)?,
            output_derivative: terms(&matrices.f)?,
            direct: terms(&matrices.d)?,
        };
        converted(LinearSystem::new(equations)).map(|inner| Self { inner })
    }

    /// The response at times since the start, from a state with its history.
    fn simulate<'py>(
        &self,
        py: Python<'py>,
        time: Floats<'py>,
        state: Floats<'py>,
        history: &PySignal,
        history_derivative: Option<&PySignal>,
        inputs: &PySignal,
    ) -> PyResult<LinearSystemResponse> {
        let times = in_order(&time)?;
        let past = Past {
            state: owned(&state)?,
            history: history.inner.clone(),
            slopes: history_derivative.map(|signal| signal.inner.clone()),
        };
        let (system, inputs) = (&self.inner, &inputs.inner);
        let found = run_here(py, |task| system.simulate(past, inputs, &times, task))?;
        Ok(LinearSystemResponse {
            outputs: found.outputs.into_pyarray(py).unbind(),
            states: found.states.into_pyarray(py).unbind(),
            inputs: found.inputs.into_pyarray(py).unbind(),
            breaks: found.breaks.into_pyarray(py).unbind(),
        })
    }
}
