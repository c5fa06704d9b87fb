//! Bindings of the tests of a fit of `deadtime::estimation`.

use deadtime::estimation::{Finding, Judgement, Whiteness, whiteness as tested};
use numpy::PyReadonlyArrayDyn;
use pyo3::prelude::*;

use crate::arrays::owned;

/// Statistic, probability, number of autocorrelations, and the first of them.
type Portmanteau = (f64, f64, usize, f64);

fn portmanteau(found: Whiteness) -> Portmanteau {
    let Whiteness {
        statistic,
        p_value,
        lags,
        autocorrelation,
    } = found;
    (statistic, p_value, lags, autocorrelation)
}

/// What one test of a fit says.
#[pyclass(frozen, get_all, module = "deadtime._deadtime")]
#[derive(Clone)]
pub(crate) struct FlightFinding {
    cause: &'static str,
    run: Option<usize>,
    sizes: Vec<f64>,
    p_value: f64,
    is_against: bool,
    plant_lacks: bool,
}

impl From<Finding> for FlightFinding {
    fn from(found: Finding) -> Self {
        Self {
            cause: found.cause.name(),
            run: found.run,
            sizes: found.sizes,
            p_value: found.p_value,
            is_against: found.is_against,
            plant_lacks: found.plant_lacks,
        }
    }
}

/// What the tests of a fit say.
#[pyclass(frozen, get_all, module = "deadtime._deadtime")]
pub(crate) struct FlightJudgement {
    whiteness: Portmanteau,
    is_coloured: bool,
    findings: Vec<FlightFinding>,
}

impl From<Judgement> for FlightJudgement {
    fn from(found: Judgement) -> Self {
        let findings = found.findings.into_iter().map(FlightFinding::from);
        Self {
            whiteness: portmanteau(found.whiteness),
            is_coloured: found.is_coloured,
            findings: findings.collect(),
        }
    }
}

/// Test the residuals of each recording after a fit of so many parameters for whiteness.
#[pyfunction]
pub(crate) fn whiteness(
    pieces: Vec<PyReadonlyArrayDyn<'_, f64>>,
    parameters: usize,
) -> PyResult<Portmanteau> {
    let pieces: Vec<Vec<f64>> = pieces.iter().map(owned).collect::<PyResult<_>>()?;
    let borrowed: Vec<&[f64]> = pieces.iter().map(Vec::as_slice).collect();
    Ok(portmanteau(tested(&borrowed, parameters)))
}
