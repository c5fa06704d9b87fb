//! Bindings of `deadtime::tuning`.

use deadtime::Error;
use deadtime::tuning::{
    self, Candidates, Decisive, Demands, Goal, Loops, Objective, Posed, Scenario, Wish, Within,
};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::arrays::{converted, rows};
use crate::dde::PyLinearLoop;
use crate::frequency::PyMargins;
use crate::loops::PyLoop;
use crate::runtime::{run, run_here};
use crate::stability::PyFamily;

type Points<'py> = PyReadonlyArray2<'py, f64>;
type Vector<'py> = Bound<'py, PyArray1<f64>>;

/// What the gains act on: the characteristic function, or of each kind of scenario the loops with one
/// gain of one and the others of zero.
#[derive(FromPyObject)]
pub(crate) enum GivenLoops<'py> {
    Continuous(Bound<'py, PyFamily>),
    Sampled(Vec<Vec<Bound<'py, PyLinearLoop>>>),
}

/// The numbers of a loop besides its free gains, the kind of a sampled loop, and lag and sample time.
#[derive(FromPyObject)]
pub(crate) struct GivenScenario(Vec<f64>, usize, f64);

/// What is made best, the least margins, and the size of the objective.
#[derive(FromPyObject)]
pub(crate) struct GivenGoal {
    objective: String,
    required: [f64; 3],
    scale: f64,
}

impl From<GivenGoal> for Goal {
    fn from(given: GivenGoal) -> Self {
        Self {
            objective: objective_of(&given.objective),
            required: given.required,
            scale: given.scale,
        }
    }
}

fn objective_of(name: &str) -> Objective {
    match name {
        "damping" => Objective::Damping,
        _ => Objective::Abscissa,
    }
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
    fn new(
        loops: GivenLoops<'_>,
        gains: usize,
        delay: usize,
        scenarios: Vec<GivenScenario>,
    ) -> PyResult<Self> {
        let loops = match loops {
            GivenLoops::Continuous(function) => {
                converted(Loops::continuous(&function.get().inner, gains))?
            }
            GivenLoops::Sampled(kinds) => {
                let kind = |loops: &Vec<Bound<'_, PyLinearLoop>>| {
                    let loops = loops.iter();
                    loops.map(|one| one.get().core().clone()).collect()
                };
                Loops::Sampled(kinds.iter().map(kind).collect())
            }
        };
        let scenario = |GivenScenario(numbers, kind, time)| Scenario {
            numbers,
            kind,
            time,
        };
        let scenarios: Vec<Scenario> = scenarios.into_iter().map(scenario).collect();
        let count = scenarios.len();
        let inner = Candidates::new(loops, delay, scenarios);
        Ok(Self {
            inner,
            scenarios: count,
        })
    }

    /// The cost of each row of gains in each scenario.
    fn costs<'py>(
        &self,
        py: Python<'py>,
        points: Points<'py>,
        objective: &str,
        threads: Option<usize>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let objective = objective_of(objective);
        let found = self.of_points(py, &points, threads, |points, task| {
            self.inner.costs(objective, points, task)
        })?;
        found
            .into_pyarray(py)
            .reshape([points.as_array().nrows(), self.scenarios])
    }

    /// The worst spectral abscissa of each row of gains, infinite where a loop is not stable.
    fn stable_abscissae<'py>(
        &self,
        py: Python<'py>,
        points: Points<'py>,
        threads: Option<usize>,
    ) -> PyResult<Vector<'py>> {
        let found = self.of_points(py, &points, threads, |points, task| {
            self.inner.stable_abscissae(points, task)
        })?;
        Ok(found.into_pyarray(py))
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

    /// By how much rows of gains of stable loops fall short of margins; where it is more than `most`
    /// it may be too small.
    fn shortfalls<'py>(
        &self,
        py: Python<'py>,
        points: Points<'py>,
        required: [f64; 3],
        most: f64,
        threads: Option<usize>,
    ) -> PyResult<Vector<'py>> {
        let goal = Goal {
            objective: Objective::Abscissa,
            required,
            scale: 1.0,
        };
        let found = self.of_points(py, &points, threads, |points, task| {
            self.inner.shortfalls(&goal, points, most, task)
        })?;
        Ok(found.into_pyarray(py))
    }

    /// Place and cost of the best row of gains.
    fn least(&self, py: Python<'_>, points: Points<'_>, goal: GivenGoal) -> PyResult<(usize, f64)> {
        let (goal, points) = (goal.into(), rows(&points));
        let points: Vec<&[f64]> = points.iter().map(Vec::as_slice).collect();
        run_here(py, |task| tuning::least(&self.inner, &goal, &points, task))
    }

    /// The cost of gains with what they miss of the margins.
    fn total(&self, py: Python<'_>, gains: Vec<f64>, goal: GivenGoal) -> PyResult<f64> {
        let goal = Goal::from(goal);
        let mut last = Decisive::default();
        run_here(py, |task| {
            goal.total(&self.inner, &gains, f64::INFINITY, &mut last, task)
        })
    }

    /// The best gains within reach of a start, between the bounds in the rows of a matrix.
    fn best_within<'py>(
        &self,
        py: Python<'py>,
        goal: GivenGoal,
        start: Vec<f64>,
        reach: Vec<f64>,
        bounds: Vec<(f64, f64)>,
    ) -> PyResult<Vector<'py>> {
        let (goal, within) = (
            goal.into(),
            Within {
                start,
                reach,
                bounds,
            },
        );
        let found = run_here(py, |task| {
            tuning::best_within(&self.inner, &goal, &within, task)
        })?;
        Ok(found.into_pyarray(py))
    }

    /// The delay at which gains cost most in a scenario, and that cost.
    fn worst_delay(
        &self,
        py: Python<'_>,
        gains: Vec<f64>,
        objective: &str,
        scenario: usize,
        ends: (f64, f64),
    ) -> PyResult<(f64, f64)> {
        let objective = objective_of(objective);
        run_here(py, |task| {
            tuning::worst_delay(&self.inner, objective, &gains, scenario, ends, task)
        })
    }

    /// Gain, phase and delay margin, Ms and Mt of gains in each scenario, NaN where a loop is not stable.
    fn margins<'py>(
        &self,
        py: Python<'py>,
        gains: Vec<f64>,
        delay_margin: bool,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let found = run_here(py, |task| self.inner.margins(&gains, delay_margin, task))?;
        let count = found.len();
        found.concat().into_pyarray(py).reshape([count, 5])
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
    worst: usize,
    margins: Vec<Py<PyMargins>>,
    neighbours: Vec<(Vec<f64>, Vec<f64>, f64)>,
}

/// The best of the gains in `free`, of which the search begins with the `first` loops.
#[pyfunction]
#[pyo3(signature = (loops, first, free, wish, demands, bounds=None, threads=None, *, shape=None, slack=0.0))]
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
    shape: Option<Vec<f64>>,
    slack: f64,
) -> PyResult<RobustGains> {
    let loops = loops.iter();
    let posed = Posed {
        loops: loops.map(|of| of.get().core().clone()).collect(),
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
        shape,
        slack,
    };
    let found = run(py, threads, None, |task| tuning::best(&posed, task))?;
    let margins = found.margins.into_iter();
    let margins = margins.map(|each| Py::new(py, PyMargins::new(py, each)));
    Ok(RobustGains {
        gains: found.gains,
        value: found.value,
        worst: found.worst,
        neighbours: found
            .neighbours
            .into_iter()
            .map(|near| (near.shape, near.gains, near.value))
            .collect(),
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
