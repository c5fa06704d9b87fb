//! Bindings of `deadtime::dde::fixed_step`.

use deadtime::dde::Reference;
use deadtime::dde::fixed_step::{Driven, Path, Settings, Solver};
use numpy::{PyArray1, PyReadonlyArrayDyn};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arrays::{converted, owned};

/// What surrounds the two, and how the run is made.
#[derive(FromPyObject)]
pub(crate) struct FixedStepSettings<'py> {
    delay: f64,
    delay_path: String,
    /// The least and the greatest command.
    bounds: Option<(f64, f64)>,
    sample_steps: Option<usize>,
    solver: String,
    step: f64,
    steps: usize,
    pub(crate) initial_output: f64,
    /// Load, disturbance of the output and noise: times and the values that hold from them on.
    inputs: Vec<Jumps<'py>>,
}

/// Times and values.
type Jumps<'py> = (PyReadonlyArrayDyn<'py, f64>, PyReadonlyArrayDyn<'py, f64>);

/// Output and command of a loop at every step.
#[pyclass(frozen, get_all, module = "deadtime._deadtime")]
pub(crate) struct FixedStepResponse {
    pub(crate) outputs: Py<PyArray1<f64>>,
    pub(crate) inputs: Py<PyArray1<f64>>,
}

impl FixedStepSettings<'_> {
    /// Everything that drives the loop, with this reference.
    pub(crate) fn driven(&self, reference: Reference) -> PyResult<Driven> {
        let input = |place: usize| match self.inputs.get(place) {
            Some((times, values)) => converted(Reference::new(0.0, owned(times)?, owned(values)?)),
            None => converted(Reference::new(0.0, Vec::new(), Vec::new())),
        };
        Ok(Driven {
            reference,
            load: input(0)?,
            output: input(1)?,
            noise: input(2)?,
        })
    }

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
