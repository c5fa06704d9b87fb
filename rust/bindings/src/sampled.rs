//! Bindings of `deadtime::dde::sampled`: the poles of many sampled loops.

use deadtime::dde::sampled::{self, LoopCells};
use numpy::{IntoPyArray, PyArray1, PyReadonlyArrayDyn};
use pyo3::prelude::*;

use crate::arrays::{column, in_order};
use crate::runtime::run;

type Floats<'py> = PyReadonlyArrayDyn<'py, f64>;

/// Loops of one structure: every array holds one entry for all of them, or one a loop.
#[derive(FromPyObject)]
pub(crate) struct SampledLoops<'py> {
    cells: usize,
    states: usize,
    #[pyo3(attribute("A"))]
    a: Floats<'py>,
    #[pyo3(attribute("B"))]
    b: Floats<'py>,
    #[pyo3(attribute("K"))]
    k: Floats<'py>,
    #[pyo3(attribute("L"))]
    l: Floats<'py>,
    gain: Floats<'py>,
    delay: Floats<'py>,
    sample_time: Floats<'py>,
}

/// What is known of the poles of each loop.
#[pyclass(frozen, get_all, module = "deadtime._deadtime")]
pub(crate) struct SampledCells {
    abscissa: Py<PyArray1<f64>>,
    unstable: Py<PyArray1<i32>>,
    status: Py<PyArray1<u8>>,
}

/// Abscissa, number of poles slower than the decay and status of many sampled loops.
#[pyfunction]
#[pyo3(signature = (loops, *, decay, threads=None, progress=None))]
pub(crate) fn sampled_abscissa_grid(
    py: Python<'_>,
    loops: SampledLoops<'_>,
    decay: f64,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<SampledCells> {
    let (a, b) = (in_order(&loops.a)?, in_order(&loops.b)?);
    let (k, l) = (in_order(&loops.k)?, in_order(&loops.l)?);
    let (gain, delay) = (in_order(&loops.gain)?, in_order(&loops.delay)?);
    let sample_time = in_order(&loops.sample_time)?;
    let cells = LoopCells {
        cells: loops.cells,
        states: loops.states,
        a: &a,
        b: &b,
        k: &k,
        l: &l,
        gain: &gain,
        delay: &delay,
        sample_time: &sample_time,
    };
    let found = run(py, threads, progress.as_ref(), |task| {
        sampled::abscissa_grid(&cells, decay, task)
    })?;
    let abscissa = column(&found, |cell| cell.abscissa)?;
    let unstable = column(&found, |cell| cell.unstable)?;
    let status = column(&found, |cell| cell.status as u8)?;
    Ok(SampledCells {
        abscissa: abscissa.into_pyarray(py).unbind(),
        unstable: unstable.into_pyarray(py).unbind(),
        status: status.into_pyarray(py).unbind(),
    })
}
