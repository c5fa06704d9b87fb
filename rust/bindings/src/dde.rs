//! Bindings of `deadtime::dde`.

use deadtime::dde::sampled::{self, LoopCells};
use deadtime::dde::{Equations, LinearLoop, Reference, Request, Start, Update, on_sample};
use num_complex::Complex64;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArrayDyn};
use pyo3::prelude::*;

use crate::arrays::{column, in_order, owned};
use crate::errors::to_python;
use crate::runtime::{run, run_here};

type Floats<'py> = PyReadonlyArrayDyn<'py, f64>;
type Vector<'py> = Bound<'py, PyArray1<f64>>;

/// A reference: one number, or times and values.
#[derive(FromPyObject)]
enum Jumps<'py> {
    Step(f64),
    Held(Floats<'py>, Floats<'py>),
}

/// The linear loop x' = A x + B w + E r, u = K x + L w + M r, y = C x + D w, w(t) = sat(u(t - Td)).
#[pyclass(frozen, module = "deadtime._deadtime", name = "LinearLoop")]
pub(crate) struct PyLinearLoop {
    inner: LinearLoop,
}

#[pymethods]
impl PyLinearLoop {
    #[new]
    #[pyo3(signature = (a, b, e, k, l, m, c, d, delay, sample_time=None, limit=None, impulse=0.0,
        update=None))]
    #[expect(
        clippy::too_many_arguments,
        reason = "one argument a symbol of the equations"
    )]
    fn new(
        py: Python<'_>,
        a: Floats<'_>,
        b: Floats<'_>,
        e: Floats<'_>,
        k: Floats<'_>,
        l: f64,
        m: f64,
        c: Floats<'_>,
        d: f64,
        delay: f64,
        sample_time: Option<f64>,
        limit: Option<f64>,
        impulse: f64,
        update: Option<(Floats<'_>, Floats<'_>, Floats<'_>)>,
    ) -> PyResult<Self> {
        let equations = Equations {
            a: owned(&a)?,
            b: owned(&b)?,
            e: owned(&e)?,
            k: owned(&k)?,
            l,
            m,
            c: owned(&c)?,
            d,
            impulse,
        };
        let update = match update {
            Some((states, command, reference)) => Some(Update {
                states: owned(&states)?,
                command: owned(&command)?,
                reference: owned(&reference)?,
            }),
            None => None,
        };
        LinearLoop::new(equations, delay, sample_time, limit)
            .and_then(|plain| match update {
                Some(update) => plain.with_update(update),
                None => Ok(plain),
            })
            .map(|inner| Self { inner })
            .map_err(|error| to_python(py, error))
    }

    /// Outputs, inputs and the breaking points of both; times count from the start of the run.
    #[pyo3(signature = (
        output_times, input_times, state, command, reference_before, reference_times,
        reference_values, command_history, sample_phase
    ))]
    #[expect(
        clippy::too_many_arguments,
        reason = "the start of a run and its reference"
    )]
    fn simulate<'py>(
        &self,
        py: Python<'py>,
        output_times: Floats<'py>,
        input_times: Floats<'py>,
        state: Floats<'py>,
        command: f64,
        reference_before: f64,
        reference_times: Floats<'py>,
        reference_values: Floats<'py>,
        command_history: Floats<'py>,
        sample_phase: f64,
    ) -> PyResult<(Vector<'py>, Vector<'py>, Vector<'py>, Vector<'py>)> {
        let (output_times, input_times) = (in_order(&output_times)?, in_order(&input_times)?);
        let reference = Reference::new(
            reference_before,
            owned(&reference_times)?,
            owned(&reference_values)?,
        )
        .map_err(|error| to_python(py, error))?;
        let start = Start {
            state: owned(&state)?,
            command,
            command_history: owned(&command_history)?,
            sample_phase,
        };
        let plant = &self.inner;
        let found = run_here(py, |task| {
            plant.simulate(&start, &reference, &output_times, &input_times, task)
        })?;
        Ok((
            found.outputs.into_pyarray(py),
            found.inputs.into_pyarray(py),
            found.output_breaks.into_pyarray(py),
            found.input_breaks.into_pyarray(py),
        ))
    }

    /// Output, command, breaking points of both and reference at `time`, in the caller's clock.
    ///
    /// The reference is a number, to which it steps at the first of the times, or times and the
    /// values that hold from them on.
    #[expect(
        clippy::too_many_arguments,
        reason = "the start of a run and its reference"
    )]
    fn respond<'py>(
        &self,
        py: Python<'py>,
        time: Floats<'py>,
        ahead: f64,
        state: Floats<'py>,
        command: f64,
        before: f64,
        reference: Jumps<'py>,
        command_history: Option<Floats<'py>>,
        sample_phase: f64,
    ) -> PyResult<(Vector<'py>, Vector<'py>, Vector<'py>, Vector<'py>)> {
        let start = Start {
            state: owned(&state)?,
            command,
            command_history: command_history
                .map(|history| owned(&history))
                .transpose()?
                .unwrap_or_default(),
            sample_phase,
        };
        let times = in_order(&time)?;
        let (step, jumps);
        let (reference_times, reference_values) = match &reference {
            Jumps::Step(value) => {
                step = [*value];
                (times.get(..1).unwrap_or_default(), &step[..])
            }
            Jumps::Held(at, values) => {
                jumps = (in_order(at)?, in_order(values)?);
                (&*jumps.0, &*jumps.1)
            }
        };
        let request = Request {
            times: &times,
            ahead,
            before,
            reference_times,
            reference_values,
        };
        let found = run_here(py, |task| self.inner.respond(&start, &request, task))?;
        Ok((
            found.outputs.into_pyarray(py),
            found.inputs.into_pyarray(py),
            found.breaks.into_pyarray(py),
            found.reference.into_pyarray(py),
        ))
    }

    /// The transition matrix of a sampled loop, limit left out.
    fn transition_matrix<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (matrix, size) = run_here(py, |_| sampled::transition_matrix(&self.inner))?;
        matrix.into_pyarray(py).reshape([size, size])
    }

    /// The transition matrix in units of states and commands that make its norm small.
    fn balanced_matrix<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (matrix, size) = run_here(py, |_| sampled::balanced_matrix(&self.inner))?;
        matrix.into_pyarray(py).reshape([size, size])
    }

    /// Poles s = ln(z)/Ts of a sampled loop, limit left out, rightmost first.
    fn poles<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<Complex64>>> {
        Ok(run_here(py, |_| sampled::poles(&self.inner))?.into_pyarray(py))
    }
}

/// Abscissa, number of poles slower than the decay and status of many sampled loops.
///
/// Every array holds one entry for all cells or one entry a cell.
#[pyfunction]
#[pyo3(signature = (cells, states, a, b, k, l, scale, delay, sample_time, decay, threads=None,
    progress=None))]
#[expect(
    clippy::too_many_arguments,
    reason = "one array a symbol of the equations"
)]
#[expect(clippy::type_complexity, reason = "three arrays")]
pub(crate) fn sampled_abscissa_grid<'py>(
    py: Python<'py>,
    cells: usize,
    states: usize,
    a: Floats<'py>,
    b: Floats<'py>,
    k: Floats<'py>,
    l: Floats<'py>,
    scale: Floats<'py>,
    delay: Floats<'py>,
    sample_time: Floats<'py>,
    decay: f64,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<(
    Vector<'py>,
    Bound<'py, PyArray1<i32>>,
    Bound<'py, PyArray1<u8>>,
)> {
    let (a, b, k, l) = (in_order(&a)?, in_order(&b)?, in_order(&k)?, in_order(&l)?);
    let (scale, delay, sample_time) = (
        in_order(&scale)?,
        in_order(&delay)?,
        in_order(&sample_time)?,
    );
    let models = LoopCells {
        cells,
        states,
        a: &a,
        b: &b,
        k: &k,
        l: &l,
        scale: &scale,
        delay: &delay,
        sample_time: &sample_time,
    };
    let found = run(py, threads, progress.as_ref(), |task| {
        sampled::abscissa_grid(&models, decay, task)
    })?;
    let abscissa = column(&found, |cell| cell.abscissa)?;
    let unstable = column(&found, |cell| cell.unstable)?;
    let status = column(&found, |cell| cell.status as u8)?;
    Ok((
        abscissa.into_pyarray(py),
        unstable.into_pyarray(py),
        status.into_pyarray(py),
    ))
}

/// Times since the start of a run at `start`, moved onto samples they miss by rounding only.
#[pyfunction]
pub(crate) fn on_samples<'py>(
    py: Python<'py>,
    since: Floats<'py>,
    start: f64,
    sample_time: f64,
    sample_phase: f64,
) -> PyResult<Vector<'py>> {
    let sample = Some((sample_time, sample_phase));
    let moved = column(&in_order(&since)?, |&t| on_sample(t, start, sample))?;
    Ok(moved.into_pyarray(py))
}
