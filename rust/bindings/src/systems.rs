//! Bindings of `deadtime::dde::system`.

use deadtime::Error;
use deadtime::dde::system::{self, Term};
use deadtime::dde::{LinearSystem, Past, Signal, SystemEquations};
use numpy::{
    IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods,
};
use pyo3::prelude::*;

use crate::arrays::{in_order, owned};
use crate::errors::to_python;
use crate::runtime::run_here;

type Floats<'py> = PyReadonlyArrayDyn<'py, f64>;
type Vector<'py> = Bound<'py, PyArray1<f64>>;

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
    fn new(
        py: Python<'_>,
        edges: Floats<'_>,
        series: Floats<'_>,
        breaks: Vec<usize>,
    ) -> PyResult<Self> {
        let made = match series.shape() {
            [_, width, terms] => Signal::new(
                *width,
                &in_order(&edges)?,
                *terms,
                &in_order(&series)?,
                breaks,
            ),
            _ => Err(Error::argument("the series of a signal have three axes")),
        };
        made.map(|inner| Self { inner })
            .map_err(|error| to_python(py, error))
    }
}

/// Gauss nodes, and the matrix that takes values at them (first axis) to Legendre coefficients.
#[pyfunction]
pub(crate) fn legendre_tables(py: Python<'_>) -> PyResult<(Vector<'_>, Bound<'_, PyArray2<f64>>)> {
    let (nodes, transform) = system::legendre_tables();
    let size = nodes.len();
    let transform = transform.into_pyarray(py).reshape([size, size])?;
    Ok((nodes.into_pyarray(py), transform))
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
    /// Every group is a list of pairs of a delay and a matrix.
    #[new]
    #[expect(
        clippy::too_many_arguments,
        reason = "one argument a symbol of the equations"
    )]
    fn new(
        py: Python<'_>,
        states: usize,
        inputs: usize,
        outputs: usize,
        a: Terms<'_>,
        n: Terms<'_>,
        b: Terms<'_>,
        c: Terms<'_>,
        f: Terms<'_>,
        d: Terms<'_>,
    ) -> PyResult<Self> {
        let equations = SystemEquations {
            states,
            inputs,
            outputs,
            state: terms(&a)?,
            derivative: terms(&n)?,
            input: terms(&b)?,
            output: terms(&c)?,
            output_derivative: terms(&f)?,
            direct: terms(&d)?,
        };
        LinearSystem::new(equations)
            .map(|inner| Self { inner })
            .map_err(|error| to_python(py, error))
    }

    /// Outputs, states and inputs at the times, one time after the other, and the breaking points.
    #[pyo3(signature = (times, state, history, slopes, inputs))]
    fn simulate<'py>(
        &self,
        py: Python<'py>,
        times: Floats<'py>,
        state: Floats<'py>,
        history: &PySignal,
        slopes: Option<&PySignal>,
        inputs: &PySignal,
    ) -> PyResult<(Vector<'py>, Vector<'py>, Vector<'py>, Vector<'py>)> {
        let times = in_order(&times)?;
        let past = Past {
            state: owned(&state)?,
            history: history.inner.clone(),
            slopes: slopes.map(|signal| signal.inner.clone()),
        };
        let (system, inputs) = (&self.inner, &inputs.inner);
        let found = run_here(py, |task| system.simulate(past, inputs, &times, task))?;
        Ok((
            found.outputs.into_pyarray(py),
            found.states.into_pyarray(py),
            found.inputs.into_pyarray(py),
            found.breaks.into_pyarray(py),
        ))
    }
}
