//! Bindings of the tests of a fit of `deadtime::estimation`.

use deadtime::estimation::{
    Asked, Finding, Judgement, Whiteness, colour_factors as factors, judge as judged,
    unseen_lag as unseen, whiteness as tested,
};
use numpy::PyReadonlyArrayDyn;
use pyo3::prelude::*;

use crate::arrays::owned;
use crate::flight::{FlightFit, FlightProfile, all};
use crate::runtime::run_here;

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

/// Test a fit with intervals of these quantities; `total` is the interval out of which a further lag
/// may not move delay and lags.
#[pyfunction]
#[pyo3(signature = (fit, quantities, *, commands_given, widens, total))]
pub(crate) fn judge(
    py: Python<'_>,
    fit: &FlightFit,
    quantities: Vec<String>,
    commands_given: bool,
    widens: bool,
    total: Option<(f64, f64)>,
) -> PyResult<FlightJudgement> {
    let asked = Asked {
        commands_given,
        widens,
        total,
        quantities: &all(&quantities)?,
    };
    Ok(run_here(py, |task| judged(&fit.core, &asked, task))?.into())
}

/// The further lag below which the test for one finds it in less than 90 % of such recordings, s.
#[pyfunction]
pub(crate) fn unseen_lag(py: Python<'_>, fit: &FlightFit) -> PyResult<f64> {
    run_here(py, |task| unseen(&fit.core, task))
}

/// The variance of each quantity of a profile for coloured residuals, over that for white ones.
#[pyfunction]
pub(crate) fn colour_factors(py: Python<'_>, profile: &FlightProfile) -> PyResult<Vec<f64>> {
    run_here(py, |task| factors(&profile.core, task))
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
