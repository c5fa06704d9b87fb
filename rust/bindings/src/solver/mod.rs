//! Bindings of `deadtime::dde::spectral`.
//!
//! A right-hand side written in Python keeps the interpreter for the whole run: it runs Python
//! nearly all the time, and Python code hands the interpreter to other threads by itself. A
//! compiled one releases it.

mod compiled;
mod functions;
mod pieces;

use deadtime::dde::breaks::BreakingPoint;
use deadtime::dde::spectral::{Equation, Event, Jump, Outcome, Problem, Solution, Sparsity, solve};
use deadtime::memory::collected;
use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArray1};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use compiled::CompiledEquation;
use functions::{Callbacks, Failing, PythonEquation, WithCallbacks};
pub(crate) use pieces::DelayPieces;
use pieces::{array, read_history};

use crate::arrays::{column, converted};
use crate::runtime::{run_attached, run_here};

type Vector<'py> = PyReadonlyArray1<'py, f64>;

/// What is solved, with the names of the public function.
#[derive(FromPyObject)]
pub(crate) struct DelayProblem<'py> {
    /// A Python function, or a pair of addresses: of a C function and of its user data.
    fun: Bound<'py, PyAny>,
    t_span: (f64, f64),
    /// Numbers or a function.
    history: Bound<'py, PyAny>,
    history_derivative: Option<Bound<'py, PyAny>>,
    delays: Vector<'py>,
    y0: Vector<'py>,
    neutral: bool,
    rtol: f64,
    atol: Vector<'py>,
    t_eval: Option<Vector<'py>>,
    dense_output: bool,
    events: Vec<DelayEvent<'py>>,
    jumps: Vec<DelayJump<'py>>,
    history_breaks: Vector<'py>,
    args: Bound<'py, PyTuple>,
    vectorized: bool,
    max_step: f64,
    max_steps: Option<u64>,
    /// Rows and columns.
    jac_sparsity: Option<(Vec<usize>, Vec<usize>)>,
}

#[derive(FromPyObject)]
struct DelayEvent<'py> {
    function: Bound<'py, PyAny>,
    direction: i8,
    terminal: u32,
}

#[derive(FromPyObject)]
struct DelayJump<'py> {
    time: f64,
    change: Option<Bound<'py, PyAny>>,
}

/// Output, events and record of a run.
#[pyclass(frozen, get_all, module = "deadtime._deadtime")]
pub(crate) struct DelayRun {
    t: Py<PyArray1<f64>>,
    /// Component, time.
    y: Py<PyArray2<f64>>,
    t_events: Vec<Py<PyArray1<f64>>>,
    /// Crossing, component.
    y_events: Vec<Py<PyArray2<f64>>>,
    breaks: Py<PyArray1<f64>>,
    nfev: u64,
    n_nodes: u64,
    n_elements: u64,
    n_rejected: u64,
    /// "finished", "event", "short" elements, "not finite" or "max_steps".
    outcome: &'static str,
    /// The time at which the run ended.
    end: f64,
    pieces: Py<DelayPieces>,
}

/// Solve a delay differential equation with constant delays.
#[pyfunction]
pub(crate) fn solve_dde(py: Python<'_>, problem: DelayProblem<'_>) -> PyResult<DelayRun> {
    let mut checked = checked(&problem)?;
    let slope = problem.history_derivative.as_ref();
    let slope = slope.filter(|_| problem.neutral);
    let breaks = problem.history_breaks.as_array().to_vec();
    read_history(&mut checked, &problem.history, slope, &breaks)?;
    let events = problem.events.into_iter().map(|event| event.function);
    let changes = problem.jumps.into_iter().map(|jump| jump.change);
    let callbacks = Callbacks::new(events.collect(), changes.collect(), &problem.args);
    let (fun, checked) = (problem.fun, &checked);
    let found = match fun.extract::<(usize, usize)>() {
        Ok((function, data)) => {
            let mut equation = CompiledEquation::new(function, data);
            if callbacks.is_empty() {
                run_here(py, move |task| solve(checked, &mut equation, task))?
            } else {
                solve_attached(py, checked, equation, callbacks)?
            }
        }
        Err(_) => {
            let equation = PythonEquation::new(fun, problem.args, problem.vectorized)?;
            solve_attached(py, checked, equation, callbacks)?
        }
    };
    report(py, found, checked.dim())
}

/// The problem without its history.
fn checked(given: &DelayProblem<'_>) -> PyResult<Problem> {
    let (start, end) = given.t_span;
    let times = given.t_eval.as_ref().map(|times| {
        let times = times.as_array();
        converted(collected("the copy of t_eval", times.iter().copied()))
    });
    let initial = given.y0.as_array().to_vec();
    let sparsity = given.jac_sparsity.as_ref();
    let sparsity = sparsity.map(|(rows, columns)| Sparsity::new(initial.len(), rows, columns));
    let event = |event: &DelayEvent<'_>| Event {
        direction: event.direction,
        terminal: event.terminal,
    };
    let jump = |jump: &DelayJump<'_>| Jump {
        time: jump.time,
        changes: jump.change.is_some(),
    };
    let problem = Problem {
        start,
        end,
        y0: initial,
        delays: given.delays.as_array().to_vec(),
        neutral: given.neutral,
        rtol: given.rtol,
        atol: given.atol.as_array().to_vec(),
        max_step: given.max_step,
        t_eval: times.transpose()?,
        dense_output: given.dense_output,
        jac_sparsity: converted(sparsity.transpose())?,
        max_steps: given.max_steps,
        events: given.events.iter().map(event).collect(),
        jumps: given.jumps.iter().map(jump).collect(),
        ..Problem::default()
    };
    converted(problem.check())?;
    Ok(problem)
}

/// Solve with the interpreter kept; an exception of the caller's functions comes through.
fn solve_attached<E: Equation + Failing>(
    py: Python<'_>,
    problem: &Problem,
    equation: E,
    callbacks: Callbacks<'_>,
) -> PyResult<Solution> {
    let mut equation = WithCallbacks {
        equation,
        callbacks,
    };
    let found = run_attached(py, |task| solve(problem, &mut equation, task));
    match equation.into_failure() {
        Some(error) => Err(error),
        None => found,
    }
}

fn report(py: Python<'_>, found: Solution, dim: usize) -> PyResult<DelayRun> {
    let rows = |values: Vec<f64>| {
        Array2::from_shape_vec((values.len() / dim.max(1), dim), values)
            .map_err(|error| PyValueError::new_err(error.to_string()))
    };
    let by_time = rows(found.y)?;
    let mut values = array(0.0, (dim, by_time.nrows()))?;
    values.assign(&by_time.t());
    drop(by_time);
    let (outcome, end) = match found.outcome {
        Outcome::Finished => ("finished", found.end),
        Outcome::Event => ("event", found.end),
        Outcome::Shrunk(time) => ("short", time),
        Outcome::NotFinite(time) => ("not finite", time),
        Outcome::TooMany(time) => ("max_steps", time),
    };
    let event_values = found.y_events.into_iter().map(rows);
    let breaks = column(&found.breaks, |point: &BreakingPoint| point.time)?;
    let pieces = DelayPieces {
        history: found.history,
        dim,
        end: found.end,
    };
    Ok(DelayRun {
        t: found.t.into_pyarray(py).unbind(),
        y: values.into_pyarray(py).unbind(),
        t_events: found
            .t_events
            .into_iter()
            .map(|times| times.into_pyarray(py).unbind())
            .collect(),
        y_events: event_values
            .map(|values| values.map(|values| values.into_pyarray(py).unbind()))
            .collect::<PyResult<_>>()?,
        breaks: breaks.into_pyarray(py).unbind(),
        nfev: found.nfev,
        n_nodes: found.n_nodes,
        n_elements: found.n_elements,
        n_rejected: found.n_rejected,
        outcome,
        end,
        pieces: Py::new(py, pieces)?,
    })
}
