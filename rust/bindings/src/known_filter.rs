//! Bindings of known digital filters of an output.

use deadtime::estimation::{KnownFilter as Core, NoInverse};
use numpy::{IntoPyArray, PyArray1, PyReadonlyArrayDyn};
use pyo3::prelude::*;

use crate::arrays::in_order;

/// A filter y = B/A x in ascending powers of 1/z, with a part C for B that can be inverted.
#[pyclass(frozen, module = "deadtime._deadtime")]
pub(crate) struct KnownFilter {
    core: Core,
}

#[pymethods]
impl KnownFilter {
    /// The filter; or whether it is at least stable, where it has no inverse.
    #[staticmethod]
    fn inverted(b: Vec<f64>, a: Vec<f64>) -> (Option<Self>, bool) {
        match Core::new(b, a) {
            Ok(core) => (Some(Self { core }), true),
            Err(why) => (None, why != NoInverse::Unstable),
        }
    }

    /// How late the filter follows a slow signal, in rows.
    #[getter]
    fn late(&self) -> f64 {
        self.core.late()
    }

    /// How late B/C follows, in rows.
    #[getter]
    fn remaining(&self) -> f64 {
        self.core.remaining()
    }

    /// Rows until what is computed does not depend on rows before the log.
    #[getter]
    fn start(&self) -> usize {
        self.core.start()
    }

    /// Rows that are averaged.
    #[getter]
    fn together(&self) -> usize {
        self.core.together()
    }

    /// B/C x of the filtered rows.
    fn undone<'py>(
        &self,
        py: Python<'py>,
        output: PyReadonlyArrayDyn<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        Ok(self.core.undone(&in_order(&output)?).into_pyarray(py))
    }
}
