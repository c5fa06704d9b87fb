//! Bindings of `deadtime::tuning`.

use deadtime::Error;
use deadtime::frequency::Margins;
use deadtime::loops::ControlLoop;
use deadtime::tuning::{
    self, Candidates, Demands, Found, Objective, Posed, Sought, Spot, Step, Survey, Wish,
};
use numpy::{
    IntoPyArray, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray2, PyReadonlyArrayDyn,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arrays::{converted, owned, rows};
use crate::frequency::PyMargins;
use crate::loops::PyLoop;
use crate::runtime::{run, run_here};

type Points<'py> = PyReadonlyArray2<'py, f64>;
type Floats<'py> = PyReadonlyArrayDyn<'py, f64>;

fn objective_of(name: &str) -> PyResult<Objective> {
    Objective::named(name)
        .ok_or_else(|| PyValueError::new_err(format!("the objective {name:?} does not exist")))
}

fn cores(loops: &[Bound<'_, PyLoop>]) -> Vec<ControlLoop> {
    loops.iter().map(|of| of.get().core().clone()).collect()
}

/// Loops that differ in the gains of their controller, in some scenarios.
#[pyclass(frozen, module = "deadtime._deadtime", name = "Candidates")]
pub(crate) struct PyCandidates {
    inner: Candidates,
    scenarios: usize,
}

#[pymethods]
impl PyCandidates {
    #[new]
    fn new(loops: Vec<Bound<'_, PyLoop>>, free: Vec<usize>) -> Self {
        Self {
            scenarios: loops.len(),
            inner: Candidates::new(cores(&loops), free),
        }
    }

    /// The cost of each row of gains in each scenario, by its poles.
    fn costs<'py>(
        &self,
        py: Python<'py>,
        points: Points<'py>,
        objective: &str,
        threads: Option<usize>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let objective = objective_of(objective)?;
        let found = self.of_points(py, &points, threads, |points, task| {
            self.inner.costs(objective, points, task)
        })?;
        found
            .into_pyarray(py)
            .reshape([points.as_array().nrows(), self.scenarios])
    }

    /// Margins of each row of gains in each scenario, where all of them are stable.
    fn all_margins<'py>(
        &self,
        py: Python<'py>,
        points: Points<'py>,
        threads: Option<usize>,
    ) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let found = self.of_points(py, &points, threads, |points, task| {
            self.inner.all_margins(points, task)
        })?;
        let shape = [points.as_array().nrows(), self.scenarios, 3];
        found.concat().into_pyarray(py).reshape(shape)
    }

    /// Gain, phase and delay margin, Ms and Mt of gains in each scenario.
    fn margins<'py>(
        &self,
        py: Python<'py>,
        gains: Vec<f64>,
        delay_margin: bool,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let found = run_here(py, |task| self.inner.margins(&gains, delay_margin, task))?;
        let figures = |found: &Margins| {
            [
                found.gain_margin,
                found.phase_margin,
                found.delay_margin,
                found.peaks.sensitivity.value,
                found.peaks.complementary.value,
            ]
        };
        let rows: Vec<f64> = found.iter().flat_map(figures).collect();
        rows.into_pyarray(py).reshape([found.len(), 5])
    }

    /// Least damping ratio of the dominant poles and spectral abscissa of gains in each scenario.
    fn dominant<'py>(
        &self,
        py: Python<'py>,
        gains: Vec<f64>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let found = run_here(py, |task| self.inner.all_dominant(&gains, task))?;
        let count = found.len();
        let pairs = found.iter().flat_map(|one| [one.damping, one.abscissa]);
        pairs
            .collect::<Vec<f64>>()
            .into_pyarray(py)
            .reshape([count, 2])
    }
}

impl PyCandidates {
    fn of_points<T: Send>(
        &self,
        py: Python<'_>,
        points: &Points<'_>,
        threads: Option<usize>,
        find: impl FnOnce(&[&[f64]], &deadtime::Task) -> Result<T, Error> + Send,
    ) -> PyResult<T> {
        let points = rows(points);
        let points: Vec<&[f64]> = points.iter().map(Vec::as_slice).collect();
        run(py, threads, None, |task| find(&points, task))
    }
}

/// What gains are sought for: loops in all scenarios, places of the free gains, scenarios by their places
/// (`corners` to begin with, `fine` to judge, `places` of exact margins), objective, least margins, step,
/// and the map to begin from.
#[derive(FromPyObject)]
pub(crate) struct GivenSearch<'py> {
    loops: Vec<Bound<'py, PyLoop>>,
    free: Vec<usize>,
    corners: Vec<usize>,
    fine: Vec<usize>,
    places: Option<Vec<usize>>,
    objective: String,
    required: [f64; 3],
    amplitude: f64,
    axes: Vec<Floats<'py>>,
    abscissa: Floats<'py>,
    threads: Option<usize>,
}

/// A scenario: the place of a loop, and a delay.
type GivenSpot = (usize, f64);

/// The figures of a step that is proved to rest: settling time in s, and overshoot in %.
type ProvedStep = (f64, f64);

/// A search for gains that are best in the worst of many scenarios.
#[pyclass(frozen, module = "deadtime._deadtime")]
pub(crate) struct GainSearch {
    inner: Sought,
    threads: Option<usize>,
}

/// Gains, the scenarios they are best for, their cost in the worst of all, that one, and their value
/// there.
#[pyclass(frozen, get_all, module = "deadtime._deadtime")]
pub(crate) struct FoundGains {
    gains: Vec<f64>,
    scenarios: Vec<GivenSpot>,
    cost: f64,
    worst: GivenSpot,
    checked: usize,
    value: f64,
}

/// What of each margin is to be had alone; the gains that miss them least, and their least margins.
#[pyclass(frozen, get_all, module = "deadtime._deadtime")]
pub(crate) struct UnmetMargins {
    alone: Vec<f64>,
    gains: Vec<f64>,
    together: Vec<f64>,
}

#[pymethods]
impl GainSearch {
    #[new]
    fn new(question: GivenSearch<'_>) -> PyResult<Self> {
        let axes = question.axes.iter().map(owned).collect::<PyResult<_>>()?;
        let inner = Sought {
            loops: cores(&question.loops),
            free: question.free,
            corners: question.corners,
            fine: question.fine,
            places: question.places,
            objective: objective_of(&question.objective)?,
            required: question.required,
            amplitude: question.amplitude,
            survey: Survey {
                axes,
                abscissa: owned(&question.abscissa)?,
            },
        };
        Ok(Self {
            inner,
            threads: question.threads,
        })
    }

    /// The best gains in the worst scenario of all, from the map or from around a start.
    #[pyo3(signature = (start=None))]
    fn best(&self, py: Python<'_>, start: Option<Vec<f64>>) -> PyResult<Py<PyAny>> {
        let found = run(py, self.threads, None, |task| {
            self.inner.best(start.as_deref(), task)
        })?;
        let spot = |one: &Spot| (one.place, one.delay);
        match found {
            Found::Gains(found) => Ok(Py::new(
                py,
                FoundGains {
                    scenarios: found.scenarios.iter().map(spot).collect(),
                    worst: spot(&found.worst),
                    gains: found.gains,
                    cost: found.cost,
                    checked: found.checked,
                    value: found.value,
                },
            )?
            .into_any()),
            Found::Unmet(alone, gains, together) => Ok(Py::new(
                py,
                UnmetMargins {
                    alone: alone.to_vec(),
                    gains,
                    together: together.to_vec(),
                },
            )?
            .into_any()),
        }
    }

    /// The value of the best gains for some scenarios alone.
    fn best_in(
        &self,
        py: Python<'_>,
        scenarios: Vec<GivenSpot>,
        required: [f64; 3],
    ) -> PyResult<f64> {
        let found = run(py, self.threads, None, |task| {
            self.inner.best_in(&spots(scenarios), required, task)
        })?;
        Ok(found.1)
    }

    /// Steps with gains in scenarios, proved to rest; none where that fails.
    fn proved_steps(
        &self,
        py: Python<'_>,
        scenarios: Vec<GivenSpot>,
        gains: Vec<f64>,
    ) -> PyResult<Vec<Option<ProvedStep>>> {
        let found = run(py, self.threads, None, |task| {
            self.inner.proved_steps(&spots(scenarios), &gains, task)
        })?;
        Ok(found.into_iter().map(|step| step.map(figures)).collect())
    }
}

fn spots(given: Vec<GivenSpot>) -> Vec<Spot> {
    let spot = |(place, delay)| Spot { place, delay };
    given.into_iter().map(spot).collect()
}

fn figures(step: Step) -> ProvedStep {
    (step.settling_time, step.overshoot)
}

/// A step of the reference that is proved to rest; none where that fails.
#[pyfunction]
pub(crate) fn proved_step(
    py: Python<'_>,
    of: &PyLoop,
    amplitude: f64,
) -> PyResult<Option<ProvedStep>> {
    let found = run_here(py, |task| tuning::proved_step(of.core(), amplitude, task))?;
    Ok(found.map(figures))
}

/// Weight of the load, and whether the integral of its error and the settling time of a set point are
/// what counts.
#[derive(FromPyObject)]
pub(crate) struct GivenWish(f64, bool, bool);

/// Bounds on the figures of a loop, in the order of `Demands`.
#[derive(FromPyObject)]
pub(crate) struct GivenDemands(f64, f64, f64, f64, f64, f64, f64);

/// Gains with the best response under a largest Ms over many loops.
#[pyclass(frozen, get_all, module = "deadtime._deadtime")]
pub(crate) struct RobustGains {
    gains: Vec<f64>,
    value: f64,
    /// The value without slack.
    least: f64,
    worst: usize,
    margins: Vec<Py<PyMargins>>,
    /// The weight of the reference, where one was chosen.
    weight: Option<f64>,
}

/// The best of the gains in `free`, of which the search begins with the `first` loops. With a slack for
/// a step of the reference that settles earlier, its weight too; one that is given stays.
#[pyfunction]
#[pyo3(signature = (loops, first, free, wish, demands, bounds=None, threads=None, *, slack=None, weight=None))]
#[expect(clippy::too_many_arguments, reason = "arguments of the Python call")]
pub(crate) fn robust_gains(
    py: Python<'_>,
    loops: Vec<Bound<'_, PyLoop>>,
    first: usize,
    free: Vec<usize>,
    wish: GivenWish,
    demands: GivenDemands,
    bounds: Option<Vec<(f64, f64)>>,
    threads: Option<usize>,
    slack: Option<f64>,
    weight: Option<f64>,
) -> PyResult<RobustGains> {
    let posed = Posed {
        loops: cores(&loops),
        first,
        free,
        wish: Wish {
            load: wish.0,
            by_integral: wish.1,
            by_settling: wish.2,
        },
        demands: Demands {
            max_sensitivity: demands.0,
            gain_margin: demands.1,
            phase_margin: demands.2,
            delay_margin: demands.3,
            noise_gain: demands.4,
            bandwidth: demands.5,
            settling_time: demands.6,
        },
        bounds,
        shape: None,
        slack: slack.unwrap_or(0.0),
    };
    let (found, least, weight) = run(py, threads, None, |task| {
        if slack.is_none() {
            let found = tuning::best(&posed, task)?;
            let least = found.value;
            return Ok((found, least, None));
        }
        let found = tuning::settled_first(&posed, weight, task)?;
        Ok((found.best, found.least, found.weight))
    })?;
    let margins = found.margins.into_iter();
    let margins = margins.map(|each| Py::new(py, PyMargins::new(py, each)));
    Ok(RobustGains {
        gains: found.gains,
        value: found.value,
        least,
        worst: found.worst,
        weight,
        margins: margins.collect::<PyResult<_>>()?,
    })
}

/// Standard deviation of the command over that of measurement noise that is white up to a bandwidth.
#[pyfunction]
pub(crate) fn noise_gain(py: Python<'_>, of: &PyLoop, bandwidth: f64) -> PyResult<f64> {
    run_here(py, |task| tuning::noise_gain(of.core(), bandwidth, task))
}

/// What a unit load leaves: the integral of the error, or without an integral the deviation at rest.
#[pyfunction]
pub(crate) fn lasting_load(of: &PyLoop) -> PyResult<f64> {
    converted(tuning::lasting(of.core()))
}

/// Name, gains, Ms, integral of the modulus after a load, settling time and overshoot.
type RuleRow = (&'static str, Option<Vec<f64>>, f64, f64, f64, f64);

/// The gains of a loop and those by rules, with what they give.
#[pyfunction]
pub(crate) fn tuning_rules(py: Python<'_>, of: &PyLoop) -> PyResult<Vec<RuleRow>> {
    let found = run_here(py, |task| tuning::rules(of.core(), task))?;
    let rows = found.into_iter().map(|row| {
        (
            row.rule,
            row.gains,
            row.max_sensitivity,
            row.load_iae,
            row.settling_time,
            row.overshoot,
        )
    });
    Ok(rows.collect())
}

/// Gain, lag, second lag and dead time in s of the plant of a loop by the half rule.
#[pyfunction]
pub(crate) fn half_rule(of: &PyLoop, with_second: bool) -> PyResult<Option<(f64, f64, f64, f64)>> {
    let found = converted(tuning::reduced(of.core(), with_second))?;
    Ok(found.map(|plant| (plant.gain, plant.lag, plant.second, plant.dead_time)))
}
