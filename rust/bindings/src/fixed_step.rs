//! Bindings of `deadtime::dde::fixed_step`.

use deadtime::dde::Reference;
use deadtime::dde::fixed_step::{self, Blocks, Path, Rest, Settings, Solver};
use numpy::{IntoPyArray, PyArray1, PyReadonlyArrayDyn};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arrays::owned;
use crate::errors::to_python;
use crate::runtime::run_here;

type Floats<'py> = PyReadonlyArrayDyn<'py, f64>;
type Vector<'py> = Bound<'py, PyArray1<f64>>;

/// Output and command of a loop at every step.
///
/// `plant` holds A, B, C, D; `controller` F, G, H, P, p, q, M, i of the core's equations.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "one argument a setting")]
pub(crate) fn fixed_step_run<'py>(
    py: Python<'py>,
    plant: (Floats<'py>, Floats<'py>, Floats<'py>, f64),
    controller: (
        Floats<'py>,
        Floats<'py>,
        Floats<'py>,
        Floats<'py>,
        f64,
        f64,
        f64,
        f64,
    ),
    delay: f64,
    delay_path: &str,
    limit: Option<f64>,
    sample_steps: Option<usize>,
    solver: &str,
    step: f64,
    steps: usize,
    state: Floats<'py>,
    output: f64,
    command: f64,
    reference: (f64, Floats<'py>, Floats<'py>),
) -> PyResult<(Vector<'py>, Vector<'py>)> {
    let solver = Solver::named(solver).ok_or_else(|| {
        let names: Vec<&str> = Solver::NAMED.iter().map(|(name, _)| *name).collect();
        PyValueError::new_err(format!(
            "solver={solver:?}: give one of {}",
            names.join(", ")
        ))
    })?;
    let blocks = Blocks {
        plant_matrix: owned(&plant.0)?,
        plant_input: owned(&plant.1)?,
        plant_output: owned(&plant.2)?,
        plant_direct: plant.3,
        controller_matrix: owned(&controller.0)?,
        controller_input: owned(&controller.1)?,
        controller_reference: owned(&controller.2)?,
        controller_output: owned(&controller.3)?,
        proportional: controller.4,
        derivative: controller.5,
        reference: controller.6,
        reference_derivative: controller.7,
    };
    let settings = Settings {
        delay,
        path: match delay_path {
            "command" => Path::Command,
            _ => Path::Measurement,
        },
        limit,
        sample_steps,
        solver,
        step,
        steps,
    };
    let rest = Rest {
        state: owned(&state)?,
        output,
        command,
    };
    let reference = Reference::new(reference.0, owned(&reference.1)?, owned(&reference.2)?)
        .map_err(|error| to_python(py, error))?;
    let (outputs, inputs) = run_here(py, |task| {
        fixed_step::run(&blocks, &settings, &rest, &reference, task)
    })?;
    Ok((outputs.into_pyarray(py), inputs.into_pyarray(py)))
}
