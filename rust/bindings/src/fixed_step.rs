//! Bindings of `deadtime::dde::fixed_step`.

use deadtime::dde::fixed_step::{Path, Settings, Solver};
use numpy::PyArray1;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// What surrounds the two, and how the run is made.
#[derive(FromPyObject)]
pub(crate) struct FixedStepSettings {
    delay: f64,
    delay_path: String,
    /// The least and the greatest command.
    bounds: Option<(f64, f64)>,
    sample_steps: Option<usize>,
    solver: String,
    step: f64,
    steps: usize,
    pub(crate) initial_output: f64,
}

/// Output and command of a loop at every step.
#[pyclass(frozen, get_all, module = "deadtime._deadtime")]
pub(crate) struct FixedStepResponse {
    pub(crate) outputs: Py<PyArray1<f64>>,
    pub(crate) inputs: Py<PyArray1<f64>>,
}

impl FixedStepSettings {
    pub(crate) fn read(&self) -> PyResult<Settings> {
        let solver = Solver::named(&self.solver).ok_or_else(|| {
            let names: Vec<&str> = Solver::NAMED.iter().map(|(name, _)| *name).collect();
            PyValueError::new_err(format!(
                "solver={:?}: give one of {}",
                self.solver,
                names.join(", ")
            ))
        })?;
        let path = match self.delay_path.as_str() {
            "command" => Path::Command,
            _ => Path::Measurement,
        };
        Ok(Settings {
            delay: self.delay,
            path,
            bounds: self.bounds,
            sample_steps: self.sample_steps,
            solver,
            step: self.step,
            steps: self.steps,
        })
    }
}
