//! Bindings of `deadtime::stability` for loops with a hold.

use deadtime::stability::{self, LoopRows};
use numpy::PyReadonlyArrayDyn;
use pyo3::prelude::*;

use crate::arrays::in_order;
use crate::runtime::run;
use crate::stability::{MapBoundary, MapCells, MapQuestion, cells_of, curves_of, specification};

type Floats<'py> = PyReadonlyArrayDyn<'py, f64>;

/// Loops in rows, along which a gain varies: every array holds one entry for all rows, or one a row.
#[derive(FromPyObject)]
pub(crate) struct HeldRows<'py> {
    rows: usize,
    states: usize,
    used: Floats<'py>,
    #[pyo3(attribute("A"))]
    a: Floats<'py>,
    #[pyo3(attribute("B"))]
    b: Floats<'py>,
    #[pyo3(attribute("K"))]
    k: Floats<'py>,
    #[pyo3(attribute("L"))]
    l: Floats<'py>,
    #[pyo3(attribute("K_slope"))]
    k_slope: Floats<'py>,
    #[pyo3(attribute("L_slope"))]
    l_slope: Floats<'py>,
    delay: Floats<'py>,
    sample_time: Floats<'py>,
    points: Floats<'py>,
}

impl HeldRows<'_> {
    /// Hand the rows to `work`.
    fn with<T>(&self, work: impl FnOnce(&LoopRows<'_>) -> PyResult<T>) -> PyResult<T> {
        let (a, b) = (in_order(&self.a)?, in_order(&self.b)?);
        let (k, l) = (in_order(&self.k)?, in_order(&self.l)?);
        let (k_slope, l_slope) = (in_order(&self.k_slope)?, in_order(&self.l_slope)?);
        let (delay, sample_time) = (in_order(&self.delay)?, in_order(&self.sample_time)?);
        let (points, used) = (in_order(&self.points)?, in_order(&self.used)?);
        work(&LoopRows {
            rows: self.rows,
            states: self.states,
            used: &used,
            a: &a,
            b: &b,
            k: &k,
            l: &l,
            k_slope: &k_slope,
            l_slope: &l_slope,
            delay: &delay,
            sample_time: &sample_time,
            points: &points,
        })
    }
}

/// Counts, abscissas (if asked for) and statuses of loops in rows; `shape` is that of the map, whose
/// second axis runs along the rows, or its first one with `as_columns`.
#[pyfunction]
#[pyo3(signature = (rows, column, question, *, shape, as_columns, threads=None, progress=None))]
#[expect(clippy::too_many_arguments, reason = "keywords of the Python call")]
pub(crate) fn held_map(
    py: Python<'_>,
    rows: HeldRows<'_>,
    column: Option<HeldRows<'_>>,
    question: MapQuestion,
    shape: [usize; 2],
    as_columns: bool,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<MapCells> {
    let question = question.into();
    let judged = |column: Option<&LoopRows<'_>>| {
        rows.with(|rows| {
            run(py, threads, progress.as_ref(), |task| {
                stability::held_map(rows, column, question, as_columns, task)
            })
        })
    };
    let found = match &column {
        Some(column) => column.with(|column| judged(Some(column)))?,
        None => judged(None)?,
    };
    cells_of(py, found, question.abscissa, shape)
}

/// The curves on which poles of loops in rows lie on the edge of stability, and those that `columns`
/// find besides; the parameters along both.
#[pyfunction]
#[pyo3(signature = (rows, columns, *, along, decay, damping))]
pub(crate) fn held_boundaries(
    py: Python<'_>,
    rows: HeldRows<'_>,
    columns: Option<HeldRows<'_>>,
    along: [String; 2],
    decay: f64,
    damping: Option<(f64, f64)>,
) -> PyResult<Vec<MapBoundary>> {
    let [row_curves, column_curves] = rows.with(|rows| {
        let found = |columns: Option<&LoopRows<'_>>| {
            run(py, None, None, |task| {
                stability::held_boundaries(rows, columns, specification(decay, damping), task)
            })
        };
        match &columns {
            Some(columns) => columns.with(|columns| found(Some(columns))),
            None => found(None),
        }
    })?;
    let mut curves = curves_of(py, &along[0], &row_curves)?;
    curves.extend(curves_of(py, &along[1], &column_curves)?);
    Ok(curves)
}
