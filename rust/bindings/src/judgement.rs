//! Bindings of the tests of a fit of `deadtime::estimation`.

use deadtime::estimation::{
    Asked, Finding, FlightFit, FlightPlant, FlightProfile, FlightRun, Free, Judgement, Quantity,
    Whiteness as Found, colour_factors as colours, judge as judged, unseen_lag as unseen,
    whiteness as tested,
};
use numpy::PyReadonlyArrayDyn;
use pyo3::prelude::*;

use crate::arrays::{converted, owned};
use crate::estimation::{PlantNumbers, RecordedRows, read};
use crate::runtime::run_here;

/// A plant as it is fitted.
#[derive(FromPyObject)]
struct GivenPlant {
    num: Vec<f64>,
    den: Vec<f64>,
    names: Vec<String>,
    lag_names: Vec<String>,
    lags: Vec<f64>,
    free_lags: Vec<bool>,
    zero: f64,
    own_lag: f64,
    air_behind_lags: bool,
}

impl GivenPlant {
    fn plant(&self) -> FlightPlant {
        let has = |name: &str| self.names.iter().any(|one| one == name);
        let mut lags = self.lags.clone();
        lags.resize(self.free_lags.len(), 0.0);
        FlightPlant {
            num: self.num.clone(),
            den: self.den.clone(),
            lags,
            free: Free {
                delay: has("delay"),
                gain: has("gain"),
                lags: self.free_lags.clone(),
                zero: has("zero"),
            },
            zero: self.zero,
            own_lag: self.own_lag,
            air_behind_lags: self.air_behind_lags,
            time_constant: self.lag_names.iter().any(|name| name == "time_constant"),
        }
    }
}

/// What a recording has beside its rows.
#[derive(FromPyObject)]
struct Steps {
    row_time: f64,
    rounding: f64,
}

/// A fit.
#[derive(FromPyObject)]
pub(crate) struct GivenFit<'py> {
    model: GivenPlant,
    runs: Vec<Bound<'py, PyAny>>,
    trim: bool,
    numbers: PlantNumbers,
    given_gain: Option<f64>,
}

impl GivenFit<'_> {
    fn fit(&self) -> PyResult<FlightFit> {
        let run = |one: &Bound<'_, PyAny>| -> PyResult<FlightRun> {
            let steps: Steps = one.extract()?;
            let rows: RecordedRows<'_> = one.extract()?;
            Ok(FlightRun {
                rows: rows.rows()?,
                row_time: steps.row_time,
                rounding: steps.rounding,
            })
        };
        let runs = self.runs.iter().map(run).collect::<PyResult<_>>()?;
        let (plant, fit) = (self.model.plant(), self.numbers.fit());
        converted(FlightFit::new(plant, runs, self.trim, fit, self.given_gain))
    }
}

/// A test of residuals for whiteness.
#[pyclass(frozen, get_all, module = "deadtime._deadtime")]
#[derive(Clone)]
pub(crate) struct FlightWhiteness {
    statistic: f64,
    p_value: f64,
    lags: usize,
    autocorrelation: f64,
}

impl From<Found> for FlightWhiteness {
    fn from(found: Found) -> Self {
        Self {
            statistic: found.statistic,
            p_value: found.p_value,
            lags: found.lags,
            autocorrelation: found.autocorrelation,
        }
    }
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

/// What the tests of a fit say.
#[pyclass(frozen, get_all, module = "deadtime._deadtime")]
pub(crate) struct FlightJudgement {
    whiteness: FlightWhiteness,
    is_coloured: bool,
    findings: Vec<FlightFinding>,
}

impl From<Judgement> for FlightJudgement {
    fn from(found: Judgement) -> Self {
        let findings = found
            .findings
            .into_iter()
            .map(|one: Finding| FlightFinding {
                cause: one.cause.name(),
                run: one.run,
                sizes: one.sizes,
                p_value: one.p_value,
                is_against: one.is_against,
                plant_lacks: one.plant_lacks,
            });
        Self {
            whiteness: found.whiteness.into(),
            is_coloured: found.is_coloured,
            findings: findings.collect(),
        }
    }
}

/// Test a fit with intervals of these quantities; `total` is the interval out of which a further lag
/// may not move delay and lags.
#[pyfunction]
#[pyo3(signature = (fit, quantities, *, commands_given, widens, total=None))]
pub(crate) fn judge(
    py: Python<'_>,
    fit: GivenFit<'_>,
    quantities: Vec<String>,
    commands_given: bool,
    widens: bool,
    total: Option<(f64, f64)>,
) -> PyResult<FlightJudgement> {
    let (fit, quantities) = (fit.fit()?, read_all(&quantities)?);
    let asked = Asked {
        quantities: &quantities,
        commands_given,
        widens,
        total,
    };
    Ok(run_here(py, |task| judged(&fit, &asked, task))?.into())
}

/// The further lag below which the test for one finds it in less than 90 % of such recordings, s.
#[pyfunction]
pub(crate) fn unseen_lag(py: Python<'_>, fit: GivenFit<'_>) -> PyResult<f64> {
    let fit = fit.fit()?;
    run_here(py, |task| unseen(&fit, task))
}

/// The variance of each quantity for coloured residuals, over that for white ones.
#[pyfunction]
pub(crate) fn colour_factors(
    py: Python<'_>,
    fit: GivenFit<'_>,
    quantities: Vec<String>,
) -> PyResult<Vec<f64>> {
    let (fit, quantities) = (fit.fit()?, read_all(&quantities)?);
    run_here(py, |task| {
        colours(&FlightProfile::new(fit, &quantities, task)?, task)
    })
}

fn read_all(names: &[String]) -> PyResult<Vec<Quantity>> {
    names.iter().map(|name| read(name)).collect()
}

/// Test the residuals of each recording after a fit of so many parameters for whiteness.
#[pyfunction]
pub(crate) fn whiteness(
    pieces: Vec<PyReadonlyArrayDyn<'_, f64>>,
    parameters: usize,
) -> PyResult<FlightWhiteness> {
    let pieces: Vec<Vec<f64>> = pieces.iter().map(owned).collect::<PyResult<_>>()?;
    let borrowed: Vec<&[f64]> = pieces.iter().map(Vec::as_slice).collect();
    Ok(tested(&borrowed, parameters).into())
}
