//! Tables in text: bytes to columns. What is wrong with them is a `RecordingError`.

use crate::errors::own;
use crate::runtime;
use deadtime::Error;
use deadtime_wire::csv::{self, Columns, Fault, Layout};
use numpy::{IntoPyArray, PyArray1};
use pyo3::prelude::*;

/// Columns of a table; and line, time before and time where the time goes back, and where it first
/// repeats.
#[pyclass(frozen, get_all, module = "deadtime._deadtime")]
pub(crate) struct CsvColumns {
    values: Vec<Py<PyArray1<f64>>>,
    backward: Option<(usize, f64, f64)>,
    repeated: Option<(usize, f64, f64)>,
}

/// What a table in text holds, and what of it is read.
#[derive(FromPyObject)]
pub(crate) struct CsvLayout {
    start: usize,
    delimiter: u8,
    width: usize,
    columns: Vec<(usize, String)>,
    window: (f64, f64),
    line: usize,
}

/// Why reading ended early.
enum Ended {
    Fault(Fault),
    Task(Error),
}

impl From<Fault> for Ended {
    fn from(fault: Fault) -> Self {
        Self::Fault(fault)
    }
}

/// The columns of a table in text.
#[pyfunction]
pub(crate) fn csv_columns(py: Python<'_>, table: &[u8], layout: CsvLayout) -> PyResult<CsvColumns> {
    let body = table.get(layout.start..).unwrap_or_default();
    let layout = Layout {
        delimiter: layout.delimiter,
        width: layout.width,
        columns: layout.columns,
        window: layout.window,
        line: layout.line,
    };
    let found: Result<Columns, Fault> = runtime::run_here(py, |task| {
        match csv::read(body, &layout, || task.check().map_err(Ended::Task)) {
            Ok(columns) => Ok(Ok(columns)),
            Err(Ended::Fault(fault)) => Ok(Err(fault)),
            Err(Ended::Task(error)) => Err(error),
        }
    })?;
    let found = found.map_err(|fault| own(py, "RecordingError", (fault.to_string(),)))?;
    let arrays = found.values.into_iter();
    Ok(CsvColumns {
        values: arrays.map(|one| one.into_pyarray(py).unbind()).collect(),
        backward: found.backward.map(|at| (at.line, at.before, at.now)),
        repeated: found.repeated.map(|at| (at.line, at.before, at.now)),
    })
}
