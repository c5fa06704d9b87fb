//! Bindings of `deadtime::dde::spectral`.
//!
//! A right-hand side written in Python keeps the interpreter for the whole run: it runs Python
//! nearly all the time, and Python code hands the interpreter to other threads by itself. A
//! compiled one releases it.

mod callback;
mod compiled;
mod past;

use deadtime::dde::breaks::BreakingPoint;
use deadtime::dde::history::{History, Piece};
use deadtime::dde::spectral::{Equation, Event, Jump, Outcome, Problem, Solution, Sparsity, solve};
use deadtime::memory::{collected, copied, filled, reserved};
use deadtime::{Error, Task};
use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArray1, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyTuple, PyType};

use callback::{Callbacks, PythonEquation};
use compiled::{CompiledEquation, WithEvents};

use crate::arrays::{column, converted};
use crate::errors::to_python;
use crate::runtime::{run_attached, run_here};

type Vector<'py> = PyReadonlyArray1<'py, f64>;

/// Output, events and record of a run.
#[pyclass(frozen, get_all, module = "deadtime._deadtime")]
pub(crate) struct DelayRun {
    times: Py<PyArray1<f64>>,
    /// Component, time.
    values: Py<PyArray2<f64>>,
    event_times: Vec<Py<PyArray1<f64>>>,
    /// Crossing, component.
    event_values: Vec<Py<PyArray2<f64>>>,
    breaks: Py<PyArray1<f64>>,
    calls: u64,
    nodes: u64,
    elements: u64,
    refused: u64,
    /// 0 finished, 1 terminal event, 2 elements too short, 3 not finite, 4 too many elements.
    outcome: u8,
    /// Where the last three of them happened.
    place: f64,
    pieces: Py<DelayPieces>,
}

/// The polynomials of a solution and of its history.
#[pyclass(frozen, module = "deadtime._deadtime")]
pub(crate) struct DelayPieces {
    history: History,
    dim: usize,
    end: f64,
}

/// Dimension, end of the solution; starts, ends and numbers of coefficients of the pieces; all
/// coefficients one after the other.
type Parts<'py> = (
    usize,
    f64,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<u64>>,
    Bound<'py, PyArray1<f64>>,
);

#[pymethods]
impl DelayPieces {
    /// The pieces from what [`Self::__reduce__`] takes them apart into.
    #[new]
    fn new(
        dim: usize,
        end: f64,
        starts: Vector<'_>,
        ends: Vector<'_>,
        terms: PyReadonlyArray1<'_, u64>,
        coefficients: Vector<'_>,
    ) -> PyResult<Self> {
        let refused = || PyValueError::new_err("these are no pieces of a solution");
        let spans = starts.as_array().into_iter().zip(ends.as_array());
        let (lengths, coefficients) = (terms.as_array(), coefficients.as_slice()?);
        let whole = starts.len() == ends.len() && starts.len() == terms.len();
        let mut rest = coefficients;
        let mut pieces = converted(reserved(
            "the list of pieces of the solution",
            lengths.len(),
        ))?;
        for ((start, end), terms) in spans.zip(lengths) {
            let terms = usize::try_from(*terms).map_err(|_| refused())?;
            let count = terms.checked_mul(dim).filter(|count| *count > 0);
            let (own, others) = count
                .and_then(|count| rest.split_at_checked(count))
                .ok_or_else(refused)?;
            rest = others;
            let own = converted(copied("the list of pieces of the solution", own))?;
            pieces.push(Piece::new(*start, *end, terms, own));
        }
        if !whole || !rest.is_empty() {
            return Err(refused());
        }
        Ok(Self {
            history: History::new(pieces),
            dim,
            end,
        })
    }

    /// For pickle and copy.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyType>, Parts<'py>)> {
        let pieces = || self.history.pieces();
        let what = "the list of pieces of the solution";
        let total = pieces().map(|piece| piece.coefficients.len()).sum();
        let mut coefficients = converted(reserved(what, total))?;
        for piece in pieces() {
            coefficients.extend_from_slice(&piece.coefficients);
        }
        let starts = converted(collected(what, pieces().map(|piece| piece.start)))?;
        let ends = converted(collected(what, pieces().map(|piece| piece.end)))?;
        let terms = converted(collected(what, pieces().map(|piece| piece.terms as u64)))?;
        let parts = (
            self.dim,
            self.end,
            starts.into_pyarray(py),
            ends.into_pyarray(py),
            terms.into_pyarray(py),
            coefficients.into_pyarray(py),
        );
        Ok((py.get_type::<Self>(), parts))
    }

    /// First and last time at which there are values.
    #[getter]
    fn span(&self) -> (f64, f64) {
        let first = self
            .history
            .pieces()
            .next()
            .map_or(self.end, |piece| piece.start);
        (first, self.end)
    }

    /// Number of polynomials.
    #[getter]
    fn count(&self) -> usize {
        self.history.len()
    }

    /// Values (`nu` 0) or derivatives (1) at the times: component, time. A joint belongs to the
    /// later piece.
    fn evaluate<'py>(
        &self,
        py: Python<'py>,
        times: Vector<'py>,
        nu: u8,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (first, last) = self.span();
        let shape = (self.dim, times.as_array().len());
        let mut values = array(0.0, shape)?;
        let mut value = vec![0.0; self.dim];
        for (mut column, &time) in values.columns_mut().into_iter().zip(times.as_array()) {
            if !(time >= first && time <= last) {
                return Err(PyValueError::new_err(format!(
                    "t={time}: the solution is known from {first} to {last} only"
                )));
            }
            let index = self.history.locate(time);
            if let Some(piece) = index.and_then(|index| self.history.piece(index)) {
                if nu == 0 {
                    piece.value(time, &mut value);
                } else {
                    piece.slope(time, &mut value);
                }
            }
            for (out, value) in column.iter_mut().zip(&value) {
                *out = *value;
            }
        }
        Ok(values.into_pyarray(py))
    }
}

/// Solve a delay differential equation with constant delays.
///
/// `fun` is a Python function, or a pair of addresses: of a C function and of its user data.
#[pyfunction]
#[expect(
    clippy::too_many_arguments,
    reason = "the arguments of the public function, checked"
)]
pub(crate) fn solve_delay_equation<'py>(
    py: Python<'py>,
    fun: Bound<'py, PyAny>,
    args: Bound<'py, PyTuple>,
    vectorized: bool,
    span: (f64, f64),
    initial: Vector<'py>,
    delays: Vector<'py>,
    neutral: bool,
    history: Bound<'py, PyAny>,
    history_slope: Option<Bound<'py, PyAny>>,
    history_breaks: Vector<'py>,
    tolerances: (f64, Vector<'py>),
    longest: f64,
    times: Option<Vector<'py>>,
    keep: bool,
    sparsity: Option<(Vec<usize>, Vec<usize>)>,
    most: Option<u64>,
    events: Vec<(Bound<'py, PyAny>, i8, u32)>,
    jumps: Vec<(f64, Option<Bound<'py, PyAny>>)>,
) -> PyResult<DelayRun> {
    let (start, end) = span;
    let (rtol, atol) = tolerances;
    let mut problem = Problem {
        start,
        end,
        initial: initial.as_array().to_vec(),
        delays: delays.as_array().to_vec(),
        neutral,
        rtol,
        atol: atol.as_array().to_vec(),
        longest,
        times: times
            .map(|times| {
                converted(collected(
                    "the copy of t_eval",
                    times.as_array().iter().copied(),
                ))
            })
            .transpose()?,
        keep,
        sparsity: sparsity
            .map(|(rows, columns)| Sparsity::new(initial.as_array().len(), &rows, &columns))
            .transpose()
            .map_err(|error| to_python(py, error))?,
        most,
        events: kinds(&events),
        jumps: jumps
            .iter()
            .map(|(time, change)| Jump {
                time: *time,
                changes: change.is_some(),
            })
            .collect(),
        ..Problem::default()
    };
    problem.check().map_err(|error| to_python(py, error))?;
    let slope = history_slope.as_ref().filter(|_| neutral);
    let breaks = history_breaks.as_array().to_vec();
    past::read(&mut problem, &history, slope, &breaks)?;
    let callbacks = Callbacks::new(
        events.into_iter().map(|(event, _, _)| event).collect(),
        jumps.into_iter().map(|(_, change)| change).collect(),
        &args,
    );
    let found = match fun.extract::<(usize, usize)>() {
        Ok((function, data)) => {
            let equation = CompiledEquation::new(function, data);
            if callbacks.is_empty() {
                let problem = &problem;
                run_here(py, move |task| {
                    let mut equation = equation;
                    solve(problem, &mut equation, task)
                })?
            } else {
                let mut equation = WithEvents::new(equation, callbacks);
                let found = attached(py, &problem, &mut equation);
                settle(found, equation.into_failure())?
            }
        }
        Err(_) => {
            let mut equation = PythonEquation::new(fun, args, callbacks, vectorized)?;
            let found = attached(py, &problem, &mut equation);
            settle(found, equation.into_failure())?
        }
    };
    report(py, found, problem.dim())
}

fn attached<E: Equation>(
    py: Python<'_>,
    problem: &Problem,
    equation: &mut E,
) -> PyResult<Solution> {
    run_attached(py, |task: &Task| -> Result<Solution, Error> {
        solve(problem, equation, task)
    })
}

/// An exception of the caller's function before what the run made of it.
fn settle(found: PyResult<Solution>, failure: Option<PyErr>) -> PyResult<Solution> {
    match failure {
        Some(error) => Err(error),
        None => found,
    }
}

fn kinds(events: &[(Bound<'_, PyAny>, i8, u32)]) -> Vec<Event> {
    let kind = |(_, direction, terminal): &(_, i8, u32)| Event {
        direction: *direction,
        terminal: *terminal,
    };
    events.iter().map(kind).collect()
}

/// An array of one value.
fn array(value: f64, shape: (usize, usize)) -> PyResult<Array2<f64>> {
    let values = filled(
        "the array of values of the solution",
        value,
        shape.0.saturating_mul(shape.1),
    );
    Array2::from_shape_vec(shape, converted(values)?)
        .map_err(|error| PyValueError::new_err(error.to_string()))
}

fn report(py: Python<'_>, found: Solution, dim: usize) -> PyResult<DelayRun> {
    let rows = |values: Vec<f64>| {
        Array2::from_shape_vec((values.len() / dim.max(1), dim), values)
            .map_err(|error| PyValueError::new_err(error.to_string()))
    };
    let by_time = rows(found.values)?;
    let mut values = array(0.0, (dim, by_time.nrows()))?;
    values.assign(&by_time.t());
    drop(by_time);
    let (outcome, place) = match found.outcome {
        Outcome::Finished => (0, found.end),
        Outcome::Event => (1, found.end),
        Outcome::Shrunk(place) => (2, place),
        Outcome::NotFinite(place) => (3, place),
        Outcome::TooMany(place) => (4, place),
    };
    let event_values = found.event_values.into_iter().map(rows);
    let breaks = column(&found.breaks, |point: &BreakingPoint| point.time)?;
    let pieces = DelayPieces {
        history: found.history,
        dim,
        end: found.end,
    };
    Ok(DelayRun {
        times: found.times.into_pyarray(py).unbind(),
        values: values.into_pyarray(py).unbind(),
        event_times: found
            .event_times
            .into_iter()
            .map(|times| times.into_pyarray(py).unbind())
            .collect(),
        event_values: event_values
            .map(|values| values.map(|values| values.into_pyarray(py).unbind()))
            .collect::<PyResult<_>>()?,
        breaks: breaks.into_pyarray(py).unbind(),
        calls: found.calls,
        nodes: found.nodes,
        elements: found.elements,
        refused: found.refused,
        outcome,
        place,
        pieces: Py::new(py, pieces)?,
    })
}
