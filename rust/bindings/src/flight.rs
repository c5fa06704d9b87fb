//! Bindings of whole fits of a named plant: search, outliers, and intervals.

use deadtime::estimation::{
    Fit, FlightFit as CoreFit, FlightPlant as CorePlant, FlightProfile as CoreProfile, FlightRun,
    Free, LAG_FACTORS, LEVEL_OF_TESTS, LONGEST_DELAY, Quantity, SEARCHED_ROWS, SHORTEST_LAG,
    Scatter, beside_noise, excited_part as part_of, fit_flight, least_squares, scatter_of,
};
use numpy::{IntoPyArray, PyArray1, PyReadonlyArrayDyn};
use pyo3::prelude::*;

use crate::arrays::{converted, owned};
use crate::estimation::{PlantNumbers, RecordedRows, RowLikelihood, read};
use crate::runtime::run_here;

type Floats<'py> = PyReadonlyArrayDyn<'py, f64>;

/// Marks of rows, and numbers of rows.
type Marks<'py> = (Bound<'py, PyArray1<bool>>, Bound<'py, PyArray1<f64>>);

/// A plant as it is fitted: num/den of unit gain behind lags, and what of it is free.
#[pyclass(frozen, module = "deadtime._deadtime")]
pub(crate) struct FlightPlant {
    core: CorePlant,
}

#[pymethods]
impl FlightPlant {
    #[new]
    #[pyo3(signature = (num, den, lags, *, delay, gain, free_lags, zero_is_free, zero=0.0, own_lag=0.0, air_behind_lags=false, time_constant=false))]
    #[expect(clippy::too_many_arguments, reason = "given by name")]
    fn new(
        num: Vec<f64>,
        den: Vec<f64>,
        lags: Vec<f64>,
        delay: bool,
        gain: bool,
        free_lags: Vec<bool>,
        zero_is_free: bool,
        zero: f64,
        own_lag: f64,
        air_behind_lags: bool,
        time_constant: bool,
    ) -> Self {
        let free = Free {
            delay,
            gain,
            lags: free_lags,
            zero: zero_is_free,
        };
        Self {
            core: CorePlant {
                num,
                den,
                lags,
                free,
                zero,
                own_lag,
                air_behind_lags,
                time_constant,
            },
        }
    }
}

/// Plant and noise that make recordings likeliest.
#[pyclass(frozen, module = "deadtime._deadtime")]
pub(crate) struct FlightFit {
    pub(crate) core: CoreFit,
}

fn given(runs: &[RecordedRows<'_>]) -> PyResult<std::sync::Arc<[FlightRun]>> {
    runs.iter().map(RecordedRows::run).collect()
}

#[pymethods]
impl FlightFit {
    #[new]
    #[pyo3(signature = (plant, runs, trim, numbers, given_gain=None))]
    fn new(
        plant: &FlightPlant,
        runs: Vec<RecordedRows<'_>>,
        trim: bool,
        numbers: &PlantNumbers,
        given_gain: Option<f64>,
    ) -> PyResult<Self> {
        let (plant, fit) = (plant.core.clone(), numbers.fit());
        let core = converted(CoreFit::new(plant, given(&runs)?, trim, fit, given_gain))?;
        Ok(Self { core })
    }

    /// The fit under white noise alone, from a delay and a gain where they are known.
    #[staticmethod]
    fn least_squares(
        py: Python<'_>,
        plant: &FlightPlant,
        runs: Vec<RecordedRows<'_>>,
        delay: f64,
        gain: f64,
    ) -> PyResult<Self> {
        let (plant, runs) = (&plant.core, given(&runs)?);
        let core = run_here(py, |task| least_squares(plant, runs, (delay, gain), task))?;
        Ok(Self { core })
    }

    /// The likeliest plant and noise from these numbers of least squares, without what spikes from them.
    fn beside_noise(&self, py: Python<'_>) -> PyResult<Self> {
        let core = run_here(py, |task| beside_noise(&self.core, task))?;
        Ok(Self { core })
    }

    /// The likeliest plant and noise without outliers, from numbers under white noise.
    #[staticmethod]
    fn fitted(
        py: Python<'_>,
        plant: &FlightPlant,
        runs: Vec<RecordedRows<'_>>,
        first: &PlantNumbers,
    ) -> PyResult<Self> {
        let (plant, runs, first) = (&plant.core, given(&runs)?, first.fit().point);
        let core = run_here(py, |task| fit_flight(plant, &runs, &first, task))?;
        Ok(Self { core })
    }

    #[getter]
    fn numbers(&self) -> PlantNumbers {
        PlantNumbers::from_fit(&self.core.fit)
    }

    #[getter]
    fn trim(&self) -> bool {
        self.core.trim
    }

    #[getter]
    fn gain(&self, py: Python<'_>) -> PyResult<f64> {
        run_here(py, |task| self.core.gain(task))
    }

    #[getter]
    fn with_gain(&self, py: Python<'_>) -> PyResult<PlantNumbers> {
        let found: Fit = run_here(py, |task| self.core.with_gain(task))?;
        Ok(PlantNumbers::from_fit(&found))
    }

    #[getter]
    fn criterion(&self, py: Python<'_>) -> PyResult<f64> {
        run_here(py, |task| self.core.criterion(task))
    }

    #[getter]
    fn parts(&self, py: Python<'_>) -> PyResult<Vec<RowLikelihood>> {
        let parts = run_here(py, |task| self.core.parts(task).map(<[_]>::to_vec))?;
        Ok(parts
            .into_iter()
            .map(|part| RowLikelihood::new(py, part))
            .collect())
    }

    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let found = run_here(py, |task| self.core.covariance(task))?;
        Ok(found.into_pyarray(py))
    }

    /// −2 ln L at other numbers.
    fn objective(&self, py: Python<'_>, numbers: &PlantNumbers) -> PyResult<f64> {
        let point = numbers.fit().point;
        run_here(py, |task| self.core.model().objective(&point, task))
    }

    /// Which rows of a recording are used, and the slope of the response by which their times count.
    fn rows<'py>(&self, py: Python<'py>, run: usize) -> PyResult<Marks<'py>> {
        let Some(found) = self.core.runs.get(run) else {
            return converted(Err(deadtime::Error::argument(format!(
                "recording {run} of {}: give the number of one of them, from zero",
                self.core.runs.len()
            ))));
        };
        let (used, speed) = (found.rows.used.clone(), found.rows.speed.clone());
        Ok((used.into_pyarray(py), speed.into_pyarray(py)))
    }

    /// The maximum near these numbers, and from slow air where there is none, unless noise is white.
    fn refit(&self, py: Python<'_>, tolerance: f64, white: bool) -> PyResult<Self> {
        let core = run_here(py, |task| self.core.refit(tolerance, white, task))?;
        Ok(Self { core })
    }

    /// The same at other numbers.
    fn moved(&self, numbers: &PlantNumbers) -> Self {
        Self {
            core: self.core.moved(numbers.fit()),
        }
    }

    /// Scatter of the times of rows (`stamps`) or of commands, s.
    fn scatter(&self, py: Python<'_>, run: usize, stamps: bool) -> PyResult<f64> {
        let part = if stamps {
            Scatter::Stamps
        } else {
            Scatter::Arrivals
        };
        run_here(py, |task| scatter_of(&self.core, run, part, task))
    }

    /// The profile over quantities, or that of a better minimum which the intervals of the `first`
    /// find.
    fn profile(
        &self,
        py: Python<'_>,
        quantities: Vec<String>,
        first: Vec<String>,
        level: f64,
    ) -> PyResult<FlightProfile> {
        let (quantities, first) = (all(&quantities)?, all(&first)?);
        let fit = self.core.clone();
        let core = run_here(py, |task| {
            CoreProfile::best(fit, &quantities, &first, level, task)
        })?;
        Ok(FlightProfile { core })
    }
}

pub(crate) fn all(names: &[String]) -> PyResult<Vec<Quantity>> {
    names.iter().map(|name| read(name)).collect()
}

/// The profile of one fit.
#[pyclass(frozen, module = "deadtime._deadtime")]
pub(crate) struct FlightProfile {
    pub(crate) core: CoreProfile,
}

#[pymethods]
impl FlightProfile {
    #[getter]
    fn fit(&self) -> FlightFit {
        FlightFit {
            core: self.core.fit.clone(),
        }
    }

    #[getter]
    fn is_long(&self) -> bool {
        self.core.is_long()
    }

    /// Each quantity as a sum of gain, delay, lags, and zero, where they are free.
    #[getter]
    fn weights(&self) -> Vec<Vec<f64>> {
        self.core.weights.clone()
    }

    /// Of each quantity: standard error for the fitted noise, factor on its square for air that is not
    /// seen, degrees of freedom.
    #[getter]
    fn known(&self) -> Vec<(f64, f64, f64)> {
        let known = self.core.known.iter();
        known
            .map(|one| (one.bound, one.unseen, one.freedom))
            .collect()
    }

    /// The same with factors on the variances.
    fn widened(&self, factors: Vec<f64>) -> PyResult<Self> {
        let core = converted(self.core.widened(&factors))?;
        Ok(Self { core })
    }

    /// The squared t for which a value is the end of an interval.
    fn statistic(&self, py: Python<'_>, quantity: &str, value: f64) -> PyResult<f64> {
        let quantity = read(quantity)?;
        run_here(py, |task| self.core.statistic(quantity, value, task))
    }

    /// Ends of an interval; of a long recording from the curvature.
    fn interval(&self, py: Python<'_>, quantity: &str, level: f64) -> PyResult<(f64, f64)> {
        let quantity = read(quantity)?;
        run_here(py, |task| self.core.interval(quantity, level, task))
    }
}

/// First and last of the rows and of the commands of the part of a long recording in which the command
/// changes most; none of one that is not long.
#[pyfunction]
pub(crate) fn excited_part(
    time: Floats<'_>,
    command_time: Floats<'_>,
    command: Floats<'_>,
) -> PyResult<Option<(usize, usize, usize, usize)>> {
    let commands = (owned(&command_time)?, owned(&command)?);
    let found = part_of(&owned(&time)?, &commands.0, &commands.1);
    Ok(found.map(|(rows, sent)| (rows.start, rows.end, sent.start, sent.end)))
}

/// Numbers of the search that stages around it need.
pub(crate) fn add_constants(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("LAG_FACTORS", LAG_FACTORS)?;
    module.add("LEVEL_OF_TESTS", LEVEL_OF_TESTS)?;
    module.add("LONGEST_DELAY", LONGEST_DELAY)?;
    module.add("SEARCHED_ROWS", SEARCHED_ROWS)?;
    module.add("SHORTEST_LAG", SHORTEST_LAG)
}
