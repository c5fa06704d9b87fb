//! Bindings of `deadtime::loops`: inputs besides the reference, and figures of the responses to them.

use deadtime::loops::{ControlLoop, DeviationAsked, Drive, Figures, MOST_DELAYS};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arrays::{column, converted};
use crate::dde::PyLinearLoop;
use crate::loops::{LoopSets, PyLoop};
use crate::runtime::{run, run_here};

/// Which input steps, by how much, and how the deviation is measured.
#[derive(FromPyObject)]
pub(crate) struct DeviationQuestion {
    of: String,
    size: f64,
    band: f64,
    span: Option<f64>,
}

impl DeviationQuestion {
    fn read(&self) -> PyResult<DeviationAsked> {
        Ok(DeviationAsked {
            of: drive(&self.of)?,
            size: self.size,
            band: self.band,
            span: self.span,
            most_delays: MOST_DELAYS,
        })
    }
}

pub(crate) fn drive(name: &str) -> PyResult<Drive> {
    Drive::named(name)
        .ok_or_else(|| PyValueError::new_err(format!("the input {name:?} does not exist")))
}

/// Figures of the deviation of an output.
#[pyclass(frozen, get_all, module = "deadtime._deadtime")]
pub(crate) struct DeviationFigures {
    peak: f64,
    peak_time: f64,
    iae: f64,
    ie: f64,
    recovery_time: f64,
    rest: f64,
    span: f64,
    is_settled: bool,
}

/// Those of many loops: rows of peaks, their times, integrals of modulus and value, and recovery times.
#[pyclass(frozen, get_all, module = "deadtime._deadtime")]
pub(crate) struct SweepFigures {
    figures: Py<PyArray2<f64>>,
    status: Py<PyArray1<u8>>,
}

/// The figures in the order of the rows.
fn row(found: &Figures) -> [f64; 5] {
    let own = &found.deviation;
    [own.peak, own.peak_time, own.iae, own.ie, own.recovery_time]
}

/// The loop as the steppers take it, with inputs as further states: names and degrees.
#[pyfunction]
pub(crate) fn driven_loop(of: &PyLoop, inputs: Vec<(String, usize)>) -> PyResult<PyLinearLoop> {
    let named = inputs
        .iter()
        .map(|(name, degree)| Ok((drive(name)?, *degree)));
    let drives = named.collect::<PyResult<Vec<_>>>()?;
    let core: &ControlLoop = of.core();
    Ok(PyLinearLoop::of(
        converted(core.driven(&drives))?,
        core.output_lead(),
    ))
}

/// Figures of the deviation of the output after a step of an input from rest at zero.
#[pyfunction]
pub(crate) fn deviation_figures(
    py: Python<'_>,
    of: &PyLoop,
    asked: DeviationQuestion,
) -> PyResult<DeviationFigures> {
    let asked = asked.read()?;
    let found = run_here(py, |task| of.core().deviation(&asked, task))?;
    let [peak, peak_time, iae, ie, recovery_time] = row(&found);
    Ok(DeviationFigures {
        peak,
        peak_time,
        iae,
        ie,
        recovery_time,
        rest: found.rest,
        span: found.span,
        is_settled: found.is_settled,
    })
}

/// The same of many loops.
#[pyfunction]
#[pyo3(signature = (of, sets, asked, *, threads=None, progress=None))]
pub(crate) fn sweep_deviations(
    py: Python<'_>,
    of: &PyLoop,
    sets: LoopSets<'_>,
    asked: DeviationQuestion,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<SweepFigures> {
    let asked = asked.read()?;
    let found = of.swept(&sets, |swept| {
        run(py, threads, progress.as_ref(), |task| {
            swept.deviations(&asked, task)
        })
    })?;
    let mut figures = Vec::with_capacity(5 * found.len());
    for place in 0..5 {
        figures.extend(found.iter().map(|(figures, _)| row(figures)[place]));
    }
    let status = column(&found, |(_, outcome)| *outcome as u8)?;
    Ok(SweepFigures {
        figures: figures.into_pyarray(py).reshape([5, found.len()])?.unbind(),
        status: status.into_pyarray(py).unbind(),
    })
}
