//! Where a run of a loop starts and which reference it follows.

use deadtime::dde::{Reference, Start};
use numpy::PyReadonlyArrayDyn;
use pyo3::prelude::*;

use crate::arrays::{converted, owned};

type Floats<'py> = PyReadonlyArrayDyn<'py, f64>;

/// The state in which a run starts, and its reference.
#[derive(FromPyObject)]
pub(crate) struct LoopRun<'py> {
    state: Floats<'py>,
    pub(crate) command: f64,
    pub(crate) reference_before: f64,
    /// A number, to which the reference steps at the start, or values that hold from their times on.
    reference: Bound<'py, PyAny>,
    reference_time: Option<Floats<'py>>,
    command_history: Option<Floats<'py>>,
    pub(crate) sample_phase: f64,
}

impl LoopRun<'_> {
    pub(crate) fn state(&self) -> PyResult<Vec<f64>> {
        owned(&self.state)
    }

    pub(crate) fn start(&self) -> PyResult<Start> {
        Ok(Start {
            state: self.state()?,
            command: self.command,
            command_history: self.command_history()?,
            sample_phase: self.sample_phase,
        })
    }

    pub(crate) fn command_history(&self) -> PyResult<Vec<f64>> {
        self.command_history
            .as_ref()
            .map_or(Ok(Vec::new()), |history| owned(history))
    }

    /// Times and values of the jumps of the reference in a run from `start` on.
    pub(crate) fn jumps(&self, start: Option<f64>) -> PyResult<(Vec<f64>, Vec<f64>)> {
        let Some(times) = &self.reference_time else {
            let value = self.reference.extract::<f64>()?;
            return Ok(start
                .map(|start| (vec![start], vec![value]))
                .unwrap_or_default());
        };
        let values = self.reference.extract::<Floats<'_>>()?;
        Ok((owned(times)?, owned(&values)?))
    }

    /// The reference of a run from time 0 on.
    pub(crate) fn reference(&self) -> PyResult<Reference> {
        let (times, values) = self.jumps(Some(0.0))?;
        converted(Reference::new(self.reference_before, times, values))
    }
}
