//! Bindings of `deadtime::dde::{ensemble, sensitivity}`.

use std::borrow::Cow;

use deadtime::dde::Criteria;
use deadtime::dde::ensemble::{self, Measures, Sets};
use deadtime::dde::sensitivity::{self, Sloped};
use deadtime::stability::{abscissae, decay};
use numpy::{
    IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArrayDyn, PyReadwriteArray1,
};
use pyo3::prelude::*;

use crate::arrays::{column, converted, in_order};
use crate::dde::LoopRun;
use crate::runtime::{run, run_here};

type Floats<'py> = PyReadonlyArrayDyn<'py, f64>;

type Columns<'py> = Vec<PyReadwriteArray1<'py, f64>>;

/// Write the first of `values` to the places of `sets`, which increase.
fn put(column: &mut [f64], sets: &[usize], values: &[f64]) {
    let (Some(&first), Some(&last)) = (sets.first(), sets.last()) else {
        return;
    };
    if last - first + 1 == sets.len()
        && let (Some(places), Some(values)) =
            (column.get_mut(first..=last), values.get(..sets.len()))
    {
        places.copy_from_slice(values);
        return;
    }
    for (&set, value) in sets.iter().zip(values) {
        if let Some(place) = column.get_mut(set) {
            *place = *value;
        }
    }
}

/// Loops of one structure, and the step of their reference.
#[derive(FromPyObject)]
pub(crate) struct LoopSets<'py> {
    states: usize,
    /// How many loops.
    size: usize,
    /// Numbers in the order of a row: one number for all loops, or an array of one for each.
    entries: Vec<Entry<'py>>,
    amplitude: f64,
    is_ahead: bool,
}

/// One number for all loops, or one for each.
#[derive(FromPyObject)]
pub(crate) enum Entry<'py> {
    Shared(f64),
    Each(Floats<'py>),
}

impl<'py> Entry<'py> {
    fn numbers(&self) -> PyResult<Cow<'_, [f64]>> {
        match self {
            Self::Shared(number) => Ok(Cow::Borrowed(std::slice::from_ref(number))),
            Self::Each(numbers) => in_order(numbers),
        }
    }
}

impl LoopSets<'_> {
    fn numbers(&self) -> PyResult<Vec<Cow<'_, [f64]>>> {
        self.entries.iter().map(Entry::numbers).collect()
    }

    fn read<'a>(&self, entries: &'a [&'a [f64]]) -> PyResult<Sets<'a>> {
        converted(Sets::new(
            self.states,
            self.size,
            entries,
            self.amplitude,
            self.is_ahead,
        ))
    }
}

/// Step responses from rest, a row a loop, and what became of each.
#[pyclass(frozen, get_all, module = "deadtime._deadtime")]
pub(crate) struct SweepResponses {
    outputs: Py<PyArray2<f64>>,
    status: Py<PyArray1<u8>>,
}

/// Derivatives of outputs and inputs by parameters, a row a parameter.
#[pyclass(frozen, get_all, module = "deadtime._deadtime")]
pub(crate) struct LoopSensitivities {
    outputs: Py<PyArray2<f64>>,
    inputs: Py<PyArray2<f64>>,
}

/// Measure step responses of `span` seconds. Metrics, with the last times at which commands were at
/// their limits behind them, and status are written to `columns` and `status`, one element for each
/// loop.
#[pyfunction]
#[pyo3(signature = (sets, *, columns, status, steady_state, slowest_time, span, settling, rise, threads=None, progress=None))]
#[expect(
    clippy::too_many_arguments,
    reason = "keywords with the names of the public function"
)]
pub(crate) fn sweep_metrics<'py>(
    py: Python<'py>,
    sets: LoopSets<'py>,
    mut columns: Columns<'py>,
    mut status: PyReadwriteArray1<'py, u8>,
    steady_state: Entry<'py>,
    slowest_time: Entry<'py>,
    span: f64,
    settling: f64,
    rise: (f64, f64),
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<()> {
    let (numbers, steady) = (sets.numbers()?, steady_state.numbers()?);
    let slowest = slowest_time.numbers()?;
    let entries: Vec<&[f64]> = numbers.iter().map(|entry| &**entry).collect();
    let sets = sets.read(&entries)?;
    let criteria = Criteria { rise, settling };
    let columns = columns.iter_mut().map(|column| column.as_slice_mut());
    let mut columns = columns.collect::<Result<Vec<_>, _>>()?;
    let status = status.as_slice_mut()?;
    run(py, threads, progress.as_ref(), |task| {
        let keep = |sets: &[usize], measures: &Measures| {
            for (column, metrics) in columns.iter_mut().zip(measures.columns()) {
                put(column, sets, metrics);
            }
            for (&set, outcome) in sets.iter().zip(measures.outcomes()) {
                if let Some(place) = status.get_mut(set) {
                    *place = outcome as u8;
                }
            }
        };
        ensemble::metrics(&sets, (&steady, &slowest), span, &criteria, task, keep)
    })
}

/// Spectral abscissae of loops without their limits, 1/s; NaN where none is found.
#[pyfunction]
#[pyo3(signature = (sets, *, threads=None))]
pub(crate) fn sweep_abscissae<'py>(
    py: Python<'py>,
    sets: LoopSets<'py>,
    threads: Option<usize>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let numbers = sets.numbers()?;
    let entries: Vec<&[f64]> = numbers.iter().map(|entry| &**entry).collect();
    let sets = sets.read(&entries)?;
    let found = run(py, threads, None, |task| abscissae(&sets, task))?;
    Ok(found.into_pyarray(py))
}

/// Whether continuous loops without their limits decay at `rates` in 1/s at least; one for each loop.
#[pyfunction]
#[pyo3(signature = (sets, rates, *, threads=None))]
pub(crate) fn sweep_decay<'py>(
    py: Python<'py>,
    sets: LoopSets<'py>,
    rates: Floats<'py>,
    threads: Option<usize>,
) -> PyResult<Bound<'py, PyArray1<bool>>> {
    let (numbers, rates) = (sets.numbers()?, in_order(&rates)?);
    let entries: Vec<&[f64]> = numbers.iter().map(|entry| &**entry).collect();
    let sets = sets.read(&entries)?;
    let found = run(py, threads, None, |task| decay(&sets, &rates, task))?;
    Ok(found.into_pyarray(py))
}

/// Step responses at times after the start.
#[pyfunction]
#[pyo3(signature = (sets, time, *, threads=None, progress=None))]
pub(crate) fn sweep_responses<'py>(
    py: Python<'py>,
    sets: LoopSets<'py>,
    time: Floats<'py>,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<SweepResponses> {
    let (numbers, times) = (sets.numbers()?, in_order(&time)?);
    let entries: Vec<&[f64]> = numbers.iter().map(|entry| &**entry).collect();
    let sets = sets.read(&entries)?;
    let (outputs, found) = run(py, threads, progress.as_ref(), |task| {
        ensemble::responses(&sets, &times, task)
    })?;
    let status = column(&found, |outcome| *outcome as u8)?;
    let shape = [found.len(), times.len()];
    Ok(SweepResponses {
        outputs: outputs.into_pyarray(py).reshape(shape)?.unbind(),
        status: status.into_pyarray(py).unbind(),
    })
}

/// A loop and its start as derivatives by parameters, a row a parameter.
#[derive(FromPyObject)]
pub(crate) struct LoopSlopes<'py> {
    row: Floats<'py>,
    row_slopes: Floats<'py>,
    state_slopes: Floats<'py>,
    command_slopes: Floats<'py>,
    output_lead_slopes: Floats<'py>,
}

/// Derivatives of outputs and inputs by parameters, at times since the start of the run.
#[pyfunction]
pub(crate) fn loop_sensitivities<'py>(
    py: Python<'py>,
    slopes: LoopSlopes<'py>,
    run: LoopRun<'py>,
    output_time: Floats<'py>,
    input_time: Floats<'py>,
) -> PyResult<LoopSensitivities> {
    let (row, row_slopes) = (in_order(&slopes.row)?, in_order(&slopes.row_slopes)?);
    let (state, history) = (run.state()?, run.command_history()?);
    let state_slopes = in_order(&slopes.state_slopes)?;
    let command_slopes = in_order(&slopes.command_slopes)?;
    let ahead = in_order(&slopes.output_lead_slopes)?;
    let (output_times, input_times) = (in_order(&output_time)?, in_order(&input_time)?);
    let reference = run.reference()?;
    let of = Sloped {
        states: state.len(),
        row: &row,
        row_slopes: &row_slopes,
        state: &state,
        state_slopes: &state_slopes,
        command: run.command,
        command_slopes: &command_slopes,
        ahead: &ahead,
    };
    let phase = run.sample_phase;
    let (outputs, inputs) = run_here(py, |task| {
        sensitivity::sensitivities(
            &of,
            &history,
            phase,
            &reference,
            &output_times,
            &input_times,
            task,
        )
    })?;
    let count = command_slopes.len();
    let table = |values: Vec<f64>, times: usize| {
        let table = values.into_pyarray(py).reshape([count, times])?;
        Ok::<_, PyErr>(table.unbind())
    };
    Ok(LoopSensitivities {
        outputs: table(outputs, output_times.len())?,
        inputs: table(inputs, input_times.len())?,
    })
}
