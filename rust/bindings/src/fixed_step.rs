//! Bindings of `deadtime::dde::fixed_step`.

use deadtime::dde::fixed_step::{self, Blocks, Path, Rest, Settings, Solver};
use numpy::{IntoPyArray, PyArray1, PyReadonlyArrayDyn};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arrays::owned;
use crate::dde::LoopRun;
use crate::runtime::run_here;

type Floats<'py> = PyReadonlyArrayDyn<'py, f64>;

/// The plant: x' = A x + B w, y = C x + D w.
#[derive(FromPyObject)]
pub(crate) struct StateSpace<'py> {
    #[pyo3(attribute("A"))]
    a: Floats<'py>,
    #[pyo3(attribute("B"))]
    b: Floats<'py>,
    #[pyo3(attribute("C"))]
    c: Floats<'py>,
    #[pyo3(attribute("D"))]
    d: f64,
}

/// The controller: x' = A x + B y + E r, u = C x + p y + q y' + M r, and an impulse where r jumps.
#[derive(FromPyObject)]
pub(crate) struct ControllerEquations<'py> {
    #[pyo3(attribute("A"))]
    a: Floats<'py>,
    #[pyo3(attribute("B"))]
    b: Floats<'py>,
    #[pyo3(attribute("E"))]
    e: Floats<'py>,
    #[pyo3(attribute("C"))]
    c: Floats<'py>,
    p: f64,
    q: f64,
    #[pyo3(attribute("M"))]
    m: f64,
    impulse: f64,
}

/// What surrounds the two, and how the run is made.
#[derive(FromPyObject)]
pub(crate) struct FixedStepSettings {
    delay: f64,
    delay_path: String,
    limit: Option<f64>,
    sample_steps: Option<usize>,
    solver: String,
    step: f64,
    steps: usize,
    initial_output: f64,
}

/// Output and command of a loop at every step.
#[pyclass(frozen, get_all, module = "deadtime._deadtime")]
pub(crate) struct FixedStepResponse {
    outputs: Py<PyArray1<f64>>,
    inputs: Py<PyArray1<f64>>,
}

/// Run a loop in fixed steps.
#[pyfunction]
pub(crate) fn fixed_step_run(
    py: Python<'_>,
    plant: StateSpace<'_>,
    controller: ControllerEquations<'_>,
    run: LoopRun<'_>,
    settings: FixedStepSettings,
) -> PyResult<FixedStepResponse> {
    let blocks = Blocks {
        plant_matrix: owned(&plant.a)?,
        plant_input: owned(&plant.b)?,
        plant_output: owned(&plant.c)?,
        plant_direct: plant.d,
        controller_matrix: owned(&controller.a)?,
        controller_input: owned(&controller.b)?,
        controller_reference: owned(&controller.e)?,
        controller_output: owned(&controller.c)?,
        proportional: controller.p,
        derivative: controller.q,
        reference: controller.m,
        reference_derivative: controller.impulse,
    };
    let rest = Rest {
        state: run.state()?,
        output: settings.initial_output,
        command: run.command,
    };
    let reference = run.reference()?;
    let settings = settings.read()?;
    let (outputs, inputs) = run_here(py, |task| {
        fixed_step::run(&blocks, &settings, &rest, &reference, task)
    })?;
    Ok(FixedStepResponse {
        outputs: outputs.into_pyarray(py).unbind(),
        inputs: inputs.into_pyarray(py).unbind(),
    })
}

impl FixedStepSettings {
    fn read(&self) -> PyResult<Settings> {
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
            limit: self.limit,
            sample_steps: self.sample_steps,
            solver,
            step: self.step,
            steps: self.steps,
        })
    }
}
