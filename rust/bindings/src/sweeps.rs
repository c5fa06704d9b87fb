//! Bindings of `deadtime::dde::{ensemble, sensitivity}`.

use deadtime::dde::ensemble::{self, Sets};
use deadtime::dde::sensitivity::{self, Sloped};
use deadtime::dde::{Criteria, Reference};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArrayDyn};
use pyo3::prelude::*;

use crate::arrays::{column, in_order, owned};
use crate::errors::to_python;
use crate::runtime::{run, run_here};

type Floats<'py> = PyReadonlyArrayDyn<'py, f64>;
type Table<'py> = Bound<'py, PyArray2<f64>>;
type Outcomes<'py> = Bound<'py, PyArray1<u8>>;

/// Figures of step responses from rest, a row a set, and what became of each set.
#[pyfunction]
#[pyo3(signature = (states, rows, amplitude, is_ahead, steady, span, settling, rise, threads=None,
    progress=None))]
#[expect(clippy::too_many_arguments, reason = "the sets and what is measured")]
pub(crate) fn sweep_figures<'py>(
    py: Python<'py>,
    states: usize,
    rows: Floats<'py>,
    amplitude: f64,
    is_ahead: bool,
    steady: Floats<'py>,
    span: f64,
    settling: f64,
    rise: (f64, f64),
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<(Table<'py>, Outcomes<'py>)> {
    let (rows, steady) = (in_order(&rows)?, in_order(&steady)?);
    let sets = Sets {
        states,
        rows: &rows,
        amplitude,
        is_ahead,
    };
    let criteria = Criteria { rise, settling };
    let found = run(py, threads, progress.as_ref(), |task| {
        ensemble::metrics(&sets, &steady, span, &criteria, task)
    })?;
    let figures = column(&found, |(figures, _)| figures.to_array())?;
    let outcomes = column(&found, |(_, outcome)| *outcome as u8)?;
    let figures = figures.into_flattened().into_pyarray(py);
    let figures = figures.reshape([found.len(), 9])?;
    Ok((figures, outcomes.into_pyarray(py)))
}

/// Step responses from rest at given times after the start, a row a set, and what became of each.
#[pyfunction]
#[pyo3(signature = (states, rows, amplitude, is_ahead, times, threads=None, progress=None))]
#[expect(clippy::too_many_arguments, reason = "the sets and what is asked for")]
pub(crate) fn sweep_responses<'py>(
    py: Python<'py>,
    states: usize,
    rows: Floats<'py>,
    amplitude: f64,
    is_ahead: bool,
    times: Floats<'py>,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<(Table<'py>, Outcomes<'py>)> {
    let (rows, times) = (in_order(&rows)?, in_order(&times)?);
    let sets = Sets {
        states,
        rows: &rows,
        amplitude,
        is_ahead,
    };
    let (outputs, found) = run(py, threads, progress.as_ref(), |task| {
        ensemble::responses(&sets, &times, task)
    })?;
    let outcomes = column(&found, |outcome| *outcome as u8)?;
    let outputs = outputs
        .into_pyarray(py)
        .reshape([found.len(), times.len()])?;
    Ok((outputs, outcomes.into_pyarray(py)))
}

/// Slopes of outputs and inputs with respect to parameters, a row a parameter.
#[pyfunction]
#[pyo3(signature = (
    states, row, row_slopes, state, state_slopes, command, command_slopes, ahead, output_times,
    input_times, reference_before, reference_times, reference_values, command_history, sample_phase
))]
#[expect(
    clippy::too_many_arguments,
    reason = "a loop, the start of a run, its reference, and slopes"
)]
pub(crate) fn loop_sensitivities<'py>(
    py: Python<'py>,
    states: usize,
    row: Floats<'py>,
    row_slopes: Floats<'py>,
    state: Floats<'py>,
    state_slopes: Floats<'py>,
    command: f64,
    command_slopes: Floats<'py>,
    ahead: Floats<'py>,
    output_times: Floats<'py>,
    input_times: Floats<'py>,
    reference_before: f64,
    reference_times: Floats<'py>,
    reference_values: Floats<'py>,
    command_history: Floats<'py>,
    sample_phase: f64,
) -> PyResult<(Table<'py>, Table<'py>)> {
    let (row, row_slopes) = (in_order(&row)?, in_order(&row_slopes)?);
    let (state, state_slopes) = (in_order(&state)?, in_order(&state_slopes)?);
    let (command_slopes, ahead) = (in_order(&command_slopes)?, in_order(&ahead)?);
    let (output_times, input_times) = (in_order(&output_times)?, in_order(&input_times)?);
    let history = in_order(&command_history)?;
    let reference = Reference::new(
        reference_before,
        owned(&reference_times)?,
        owned(&reference_values)?,
    )
    .map_err(|error| to_python(py, error))?;
    let of = Sloped {
        states,
        row: &row,
        row_slopes: &row_slopes,
        state: &state,
        state_slopes: &state_slopes,
        command,
        command_slopes: &command_slopes,
        ahead: &ahead,
    };
    let (outputs, inputs) = run_here(py, |task| {
        sensitivity::sensitivities(
            &of,
            &history,
            sample_phase,
            &reference,
            &output_times,
            &input_times,
            task,
        )
    })?;
    let count = command_slopes.len();
    let outputs = outputs
        .into_pyarray(py)
        .reshape([count, output_times.len()])?;
    Ok((
        outputs,
        inputs
            .into_pyarray(py)
            .reshape([count, input_times.len()])?,
    ))
}
