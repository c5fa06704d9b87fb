//! Bindings of what is fitted to the response of a plant to its commands, and of rounded rows of it.

use std::collections::HashMap;

use deadtime::estimation::{Commanded, Peak, Plant, Readings, UnitPlant};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArrayDyn};
use pyo3::prelude::*;

use crate::arrays::{converted, owned};
use crate::flight::FlightRows;
use crate::least_squares::places;

type Floats<'py> = PyReadonlyArrayDyn<'py, f64>;
type Vector<'py> = Bound<'py, PyArray1<f64>>;
type Matrix<'py> = Bound<'py, PyArray2<f64>>;

/// Misfit of the response of a plant to its commands.
#[pyclass(frozen, module = "deadtime._deadtime")]
pub(crate) struct CommandedMisfit {
    pub(crate) inner: Commanded,
}

#[pymethods]
impl CommandedMisfit {
    /// `plant` is num/den of unit gain; without it, an integrator, or a lag whose number is
    /// `time_constant`. `slow` is the name of that number, `names` are those that are fitted, and `known`
    /// has the others: delay, gain, this time, and the limits of the rate and of its rate.
    #[new]
    #[pyo3(signature = (time, output, commands, *, plant, slow, is_limited, names, known, start))]
    #[expect(clippy::too_many_arguments, reason = "keywords of the Python call")]
    fn new(
        time: Floats<'_>,
        output: Floats<'_>,
        commands: (Floats<'_>, Floats<'_>),
        plant: Option<(Vec<f64>, Vec<f64>)>,
        slow: &str,
        is_limited: bool,
        names: Vec<String>,
        known: HashMap<String, f64>,
        start: Option<f64>,
    ) -> PyResult<Self> {
        let plant = match plant {
            Some((num, den)) => UnitPlant::Known(converted(Plant::new(&num, &den))?),
            None if slow == "time_constant" => UnitPlant::Lag,
            None => UnitPlant::Integrator,
        };
        let numbers = ["delay", "gain", slow, "rate", "rate_of_rate"];
        Ok(Self {
            inner: Commanded {
                time: owned(&time)?,
                output: owned(&output)?,
                commands: (owned(&commands.0)?, owned(&commands.1)?),
                plant,
                is_limited,
                known: numbers.map(|name| known.get(name).copied().unwrap_or(f64::INFINITY)),
                places: places(&names, numbers)?,
                start,
            },
        })
    }
}

/// Rounded rows of recordings, one after the other.
#[pyclass(frozen, module = "deadtime._deadtime")]
pub(crate) struct RoundedReadings {
    pub(crate) core: Readings,
}

#[pymethods]
impl RoundedReadings {
    #[new]
    fn new(output: Vec<f64>, recording: Vec<usize>, used: Vec<bool>, steps: Vec<f64>) -> Self {
        let core = Readings {
            output,
            recording,
            used,
            steps,
        };
        Self { core }
    }

    fn __getnewargs__(&self) -> (Vec<f64>, Vec<usize>, Vec<bool>, Vec<f64>) {
        let own = self.core.clone();
        (own.output, own.recording, own.used, own.steps)
    }

    /// The rows of recordings as they were first and as they were fitted, without those that repeat others.
    #[staticmethod]
    fn of_rows(first: Vec<FlightRows>, fitted: Vec<FlightRows>, repeated: Vec<Vec<usize>>) -> Self {
        let core = |rows: Vec<FlightRows>| rows.into_iter().map(|one| one.core).collect::<Vec<_>>();
        let core = Readings::of_rows(&core(first), &core(fitted), &repeated);
        Self { core }
    }

    /// Number of rows that count.
    #[getter]
    fn count(&self) -> usize {
        self.core.used.iter().filter(|used| **used).count()
    }
}

/// Where the likelihood of rounded rows is largest.
#[pyclass(frozen, module = "deadtime._deadtime")]
pub(crate) struct RoundedPeak {
    pub(crate) peak: Peak,
    pub(crate) cov: Vec<f64>,
}

#[pymethods]
impl RoundedPeak {
    #[new]
    fn new(value: f64, point: Vec<f64>, logs: Vec<f64>, cov: Vec<f64>) -> Self {
        let peak = Peak { value, point, logs };
        Self { peak, cov }
    }

    fn __getnewargs__(&self) -> (f64, Vec<f64>, Vec<f64>, Vec<f64>) {
        let Peak { value, point, logs } = self.peak.clone();
        (value, point, logs, self.cov.clone())
    }

    /// −2 ln L.
    #[getter]
    fn value(&self) -> f64 {
        self.peak.value
    }

    #[getter]
    fn point<'py>(&self, py: Python<'py>) -> Vector<'py> {
        self.peak.point.clone().into_pyarray(py)
    }

    /// Deviation of the noise of each recording.
    #[getter]
    fn noise(&self) -> Vec<f64> {
        self.peak.deviations()
    }

    #[getter]
    fn cov<'py>(&self, py: Python<'py>) -> PyResult<Matrix<'py>> {
        let size = self.peak.point.len();
        self.cov.clone().into_pyarray(py).reshape([size, size])
    }
}
