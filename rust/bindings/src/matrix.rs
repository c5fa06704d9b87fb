//! Bindings of `deadtime::roots::matrix`.

use deadtime::Task;
use deadtime::roots::Region;
use deadtime::roots::matrix::{self, CharacteristicMatrix as Core};
use numpy::PyReadonlyArray2;
use pyo3::prelude::*;

use crate::arrays::rows;
use crate::errors::to_python;
use crate::quasipoly::{Range, RootSet, side};
use crate::runtime::{run, run_here};

type ByDelay<'py> = Vec<(f64, PyReadonlyArray2<'py, f64>)>;

/// A characteristic matrix of the core.
#[pyclass(frozen, module = "deadtime._deadtime")]
pub(crate) struct CharacteristicMatrix {
    core: Core,
}

fn by_delay(group: &ByDelay<'_>) -> Vec<(f64, Vec<Vec<f64>>)> {
    group
        .iter()
        .map(|(delay, matrix)| (*delay, rows(matrix)))
        .collect()
}

#[pymethods]
impl CharacteristicMatrix {
    #[new]
    fn new(
        py: Python<'_>,
        e: PyReadonlyArray2<'_, f64>,
        n: ByDelay<'_>,
        a: ByDelay<'_>,
    ) -> PyResult<Self> {
        Core::new(rows(&e), by_delay(&n), by_delay(&a))
            .map(|core| Self { core })
            .map_err(|error| to_python(py, error))
    }

    fn is_invertible(&self) -> bool {
        matrix::is_invertible(&self.core)
    }

    fn count(&self, py: Python<'_>, re: Range, im: Range, edge: &str) -> PyResult<u64> {
        let edge = side(edge)?;
        run(py, None, None, |task: &Task| {
            matrix::count(&self.core, &Region { re, im }, edge, task)
        })
    }

    fn roots(&self, py: Python<'_>, re: Range, im: Range, edge: &str) -> PyResult<RootSet> {
        let edge = side(edge)?;
        let set = run(py, None, None, |task: &Task| {
            matrix::roots(&self.core, &Region { re, im }, edge, task)
        })?;
        Ok(RootSet::new(py, set))
    }

    fn rightmost(&self, py: Python<'_>, n: usize) -> PyResult<RootSet> {
        let set = run_here(py, |task: &Task| matrix::rightmost(&self.core, n, task))?;
        Ok(RootSet::new(py, set))
    }

    fn spectral_abscissa(&self, py: Python<'_>, strong: bool) -> PyResult<f64> {
        run_here(py, |task: &Task| {
            matrix::spectral_abscissa(&self.core, strong, task)
        })
    }

    /// Lower and upper bound.
    fn chain_abscissa(&self, py: Python<'_>, strong: bool) -> PyResult<(f64, f64)> {
        run(py, None, None, |task: &Task| {
            matrix::chain_abscissa(&self.core, strong, task)
        })
    }

    fn is_stable(&self, py: Python<'_>, strong: bool) -> PyResult<bool> {
        run(py, None, None, |task: &Task| {
            matrix::is_stable(&self.core, strong, task)
        })
    }
}
