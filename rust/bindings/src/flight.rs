//! Bindings of whole fits of a named plant: search, outliers, and what is searched around them.

use std::cell::RefCell;
use std::sync::Arc;

use deadtime::Error;
use deadtime::estimation::{
    Commands, Fit, FlightFit as CoreFit, FlightPlant as CorePlant, FlightRun, LEVEL_OF_TESTS,
    LONGEST_DELAY, MOST_NUMBERS, Quantity, Rows, RunCommands, Scatter, beside_noise, between_rows,
    first_numbers, fit_numbers, is_long, scatter_of, unseen_lag,
};
use numpy::{IntoPyArray, PyArray1, PyReadonlyArrayDyn};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{converted, owned};
use crate::calls::Calls;
use crate::commands::HeldCommands;
use crate::estimation::{PlantNumbers, RowLikelihood};
use crate::flight_plant::FlightPlant;
use crate::profile::{FlightProfile, FreeNumbers};
use crate::runtime::{run_attached, run_here};

type Floats<'py> = PyReadonlyArrayDyn<'py, f64>;
type Vector<'py> = Bound<'py, PyArray1<f64>>;
type Ends = Vec<(f64, f64)>;

/// The rows of one recording.
#[pyclass(frozen, from_py_object, module = "deadtime._deadtime")]
#[derive(Clone)]
pub(crate) struct FlightRows {
    pub(crate) core: FlightRun,
}

#[pymethods]
impl FlightRows {
    #[new]
    #[pyo3(signature = (time, output, used, command_time, command, unknown, offset, rounding=0.0, uncertain=Vec::new(), speed=None))]
    #[expect(clippy::too_many_arguments, reason = "given by name")]
    fn new(
        time: Floats<'_>,
        output: Floats<'_>,
        used: PyReadonlyArrayDyn<'_, bool>,
        command_time: Floats<'_>,
        command: Floats<'_>,
        unknown: Ends,
        offset: bool,
        rounding: f64,
        uncertain: Vec<(f64, f64, f64)>,
        speed: Option<Floats<'_>>,
    ) -> PyResult<Self> {
        let rows = Rows {
            time: owned(&time)?,
            output: owned(&output)?,
            used: owned(&used)?,
            speed: speed.as_ref().map_or_else(|| Ok(Vec::new()), owned)?,
            commands: Commands {
                time: owned(&command_time)?,
                value: owned(&command)?,
                unknown,
                uncertain,
            },
            offset,
            trim: false,
        };
        let core = FlightRun::new(converted(rows.checked())?, rounding);
        Ok(Self { core })
    }

    #[expect(clippy::type_complexity, reason = "the arguments of `new`")]
    fn __getnewargs__<'py>(
        &self,
        py: Python<'py>,
    ) -> (
        Vector<'py>,
        Vector<'py>,
        Bound<'py, PyArray1<bool>>,
        Vector<'py>,
        Vector<'py>,
        Ends,
        bool,
        f64,
        Vec<(f64, f64, f64)>,
        Vector<'py>,
    ) {
        let own = self.core.rows.clone();
        (
            own.time.into_pyarray(py),
            own.output.into_pyarray(py),
            own.used.into_pyarray(py),
            own.commands.time.into_pyarray(py),
            own.commands.value.into_pyarray(py),
            own.commands.unknown,
            own.offset,
            self.core.rounding,
            own.commands.uncertain,
            own.speed.into_pyarray(py),
        )
    }

    /// The rows of a recording for a first fit, without repeated ones and those that tell nothing.
    #[staticmethod]
    fn read(
        time: Floats<'_>,
        output: Floats<'_>,
        repeated: Vec<usize>,
        commands: &HeldCommands,
        start: Option<f64>,
    ) -> PyResult<Self> {
        let (time, output) = (owned(&time)?, owned(&output)?);
        let read = commands.core.read(time, &output, &repeated, start);
        Ok(Self {
            core: converted(read)?,
        })
    }

    /// The same under other commands.
    fn under(&self, time: Floats<'_>, command: Floats<'_>) -> PyResult<Self> {
        let core = converted(self.core.under(owned(&time)?, owned(&command)?))?;
        Ok(Self { core })
    }

    #[getter]
    fn used<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        self.core.rows.used.clone().into_pyarray(py)
    }

    /// Number of rows that are used.
    #[getter]
    fn count(&self) -> usize {
        self.core.count()
    }

    /// Rows left out as outliers.
    #[getter]
    fn left_out(&self) -> usize {
        self.core.left_out()
    }

    #[getter]
    fn rounding(&self) -> f64 {
        self.core.rounding
    }

    #[getter]
    fn offset(&self) -> bool {
        self.core.rows.offset
    }
}

/// Plant and noise that make recordings likeliest.
#[pyclass(frozen, module = "deadtime._deadtime")]
pub(crate) struct FlightFit {
    pub(crate) core: CoreFit,
    pub(crate) of: FlightPlant,
}

fn joined(runs: Vec<FlightRows>) -> Arc<[FlightRun]> {
    runs.into_iter().map(|run| run.core).collect()
}

/// The plant with numbers of it, and the rows under the commands that it gets, from a function of Python;
/// the last such plant is kept.
struct Given<'a, 'py> {
    function: &'a Bound<'py, PyAny>,
    calls: Calls<'py>,
    last: RefCell<Option<FlightPlant>>,
}

impl<'a, 'py> Given<'a, 'py> {
    fn new(function: &'a Bound<'py, PyAny>) -> Self {
        Self {
            function,
            calls: Calls::new(function.py()),
            last: RefCell::new(None),
        }
    }

    fn at(&self, values: &[f64]) -> Result<(CorePlant, Arc<[FlightRun]>), Error> {
        let found = self.function.call1((values.to_vec(),));
        let found = found.and_then(|found| found.extract::<(FlightPlant, Vec<FlightRows>)>());
        let (plant, runs) = self.calls.kept(found)?;
        let core = plant.core();
        *self.last.borrow_mut() = Some(plant);
        Ok((core, joined(runs)))
    }

    /// What came out of work with this function, with the plant of a fit.
    fn ended<T>(
        &self,
        found: PyResult<T>,
        of: impl Fn(&T) -> &CoreFit,
    ) -> PyResult<(T, FlightPlant)> {
        let found = self.calls.ended(found)?;
        let last = self.last.borrow();
        let Some(plant) = last.as_ref() else {
            return Err(PyValueError::new_err("the function was not called"));
        };
        let own = plant.of(&of(&found).plant);
        Ok((found, own))
    }
}

#[pymethods]
impl FlightFit {
    #[new]
    #[pyo3(signature = (plant, runs, trim, numbers, given_gain=None))]
    fn new(
        plant: FlightPlant,
        runs: Vec<FlightRows>,
        trim: bool,
        numbers: &PlantNumbers,
        given_gain: Option<f64>,
    ) -> PyResult<Self> {
        let fit = numbers.fit();
        let core = CoreFit::new(plant.core(), joined(runs), trim, fit, given_gain);
        Ok(Self {
            core: converted(core)?,
            of: plant,
        })
    }

    fn __getnewargs__(
        &self,
    ) -> (
        FlightPlant,
        Vec<FlightRows>,
        bool,
        PlantNumbers,
        Option<f64>,
    ) {
        let numbers = PlantNumbers::from_fit(&self.core.fit);
        (
            self.of.clone(),
            self.runs(),
            self.core.trim,
            numbers,
            self.core.given_gain,
        )
    }

    /// The fit under white noise alone to parts of long recordings, and the numbers under which it is best;
    /// from a delay and a gain where they are known. `given` makes plant and rows of the numbers.
    #[staticmethod]
    fn first(
        given: &Bound<'_, PyAny>,
        numbers: Vec<f64>,
        delay: f64,
        gain: f64,
    ) -> PyResult<(Self, Vec<f64>)> {
        let (py, start) = (given.py(), (delay, gain));
        if numbers.is_empty() {
            let (of, runs) = given.call1((numbers,))?.extract::<(FlightPlant, _)>()?;
            let (plant, runs) = (of.core(), joined(runs));
            let known = |_: &[f64]| Ok((plant.clone(), Arc::clone(&runs)));
            let (core, values) = run_here(py, |task| first_numbers(&known, &[], start, task))?;
            return Ok((Self { core, of }, values));
        }
        let made = Given::new(given);
        let found = run_attached(py, |task| {
            first_numbers(&|at| made.at(at), &numbers, start, task)
        });
        let ((core, values), of) = made.ended(found, |(fit, _)| fit)?;
        Ok((Self { core, of }, values))
    }

    /// The likeliest plant and noise from these numbers of least squares, without what spikes from them.
    fn beside_noise(&self, py: Python<'_>) -> PyResult<Self> {
        let core = run_here(py, |task| beside_noise(&self.core, task))?;
        Ok(self.with(core))
    }

    /// The likeliest numbers around the fit, from named ones; none of them where the recordings do not
    /// tell them. `given` makes plant and rows of the numbers.
    fn with_numbers(
        &self,
        given: &Bound<'_, PyAny>,
        numbers: Vec<(String, f64)>,
    ) -> PyResult<(Self, Option<FreeNumbers>)> {
        let made = Given::new(given);
        let (names, first): (Vec<String>, Vec<f64>) = numbers.into_iter().unzip();
        let found = run_attached(given.py(), |task| {
            fit_numbers(&self.core, &|at| made.at(at), &first, task)
        });
        let ((core, numbers), of) = made.ended(found, |(fit, _)| fit)?;
        let numbers = numbers.map(|core| FreeNumbers { core, names });
        Ok((Self { core, of }, numbers))
    }

    /// The fit with the commands between rows that its plant predicts, whether the recording leaves open
    /// when the reference changes, and the covariance where commands are functions of the plant.
    fn between_rows(
        &self,
        py: Python<'_>,
        commands: Vec<PyRef<'_, HeldCommands>>,
        searches: bool,
    ) -> PyResult<(Self, bool, Option<Vec<f64>>)> {
        let runs: Vec<RunCommands> = commands.iter().map(|one| one.core.clone()).collect();
        let fit = self.core.clone();
        let found = run_here(py, |task| between_rows(fit, &runs, searches, task))?;
        Ok((self.with(found.fit), found.is_unclear, found.covariance))
    }

    /// The same numbers on other rows.
    fn on(&self, runs: Vec<FlightRows>) -> PyResult<Self> {
        Ok(self.with(converted(self.core.on(joined(runs)))?))
    }

    #[getter]
    fn plant(&self) -> FlightPlant {
        self.of.clone()
    }

    #[getter]
    fn runs(&self) -> Vec<FlightRows> {
        let runs = self.core.runs.iter().cloned();
        runs.map(|core| FlightRows { core }).collect()
    }

    #[getter]
    fn numbers(&self) -> PlantNumbers {
        PlantNumbers::from_fit(&self.core.fit)
    }

    #[getter]
    fn trim(&self) -> bool {
        self.core.trim
    }

    /// Are the recordings so long that the search was made on parts of them?
    #[getter]
    fn is_long(&self) -> bool {
        is_long(&self.core.runs)
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

    /// Akaike's criterion.
    #[getter]
    fn criterion(&self, py: Python<'_>) -> PyResult<f64> {
        run_here(py, |task| self.core.criterion(task))
    }

    /// Schwarz's criterion for so many unknown numbers of the plant.
    fn schwarz(&self, py: Python<'_>, unknown: usize) -> PyResult<f64> {
        run_here(py, |task| self.core.schwarz(unknown, task))
    }

    #[getter]
    fn parts(&self, py: Python<'_>) -> PyResult<Vec<RowLikelihood>> {
        let parts = run_here(py, |task| self.core.parts(task).map(<[_]>::to_vec))?;
        Ok(parts
            .into_iter()
            .map(|part| RowLikelihood::new(py, part))
            .collect())
    }

    /// The fitted output at the start of the first recording.
    #[getter]
    fn initial_output(&self, py: Python<'_>) -> PyResult<f64> {
        run_here(py, |task| self.core.initial_output(task))
    }

    /// A further lag below which the test for one would not see it, s.
    #[getter]
    fn unseen_lag(&self, py: Python<'_>) -> PyResult<f64> {
        run_here(py, |task| unseen_lag(&self.core, task))
    }

    /// The fitted numbers of the loop by their names, and the delay.
    #[getter]
    fn values<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let found = run_here(py, |task| self.core.loop_numbers(task))?;
        let values = PyDict::new(py);
        for name in &self.of.names {
            let value = match self.of.quantity(name)? {
                Quantity::Gain => found.gain,
                Quantity::Zero => found.zero,
                Quantity::Lag(place) => found.lags[place],
                Quantity::Delay | Quantity::Total => found.delay,
            };
            values.set_item(name, value)?;
        }
        values.set_item("delay", found.delay)?;
        Ok(values)
    }

    /// Does the plant beside the noise explain far less of a recording than a fit of least squares?
    fn explains_less(&self, py: Python<'_>, white: &Self) -> PyResult<bool> {
        run_here(py, |task| self.core.explains_less(&white.core, task))
    }

    /// Is every recording rounded, and has no other noise than white beside?
    #[getter]
    fn is_rounding_alone(&self) -> bool {
        self.core.is_rounding_alone()
    }

    /// Is what is left of each recording below this share of the range of its output?
    fn leaves_less_than(&self, py: Python<'_>, share: f64) -> PyResult<bool> {
        run_here(py, |task| self.core.leaves_less_than(share, task))
    }

    /// The noise of a recording in the units of its output: white noise, air and its time constant, trim,
    /// coloured noise of the sensor and its time constant.
    fn noise_in_units(&self, py: Python<'_>, run: usize) -> PyResult<[f64; 6]> {
        let found = run_here(py, |task| self.core.noise_in_units(run, task))?;
        let ((air, air_time), (sensor, sensor_time)) = (found.air, found.sensor);
        Ok([found.white, air, air_time, found.trim, sensor, sensor_time])
    }

    /// Largest scatter of the times of rows (`stamps`) or of commands, s.
    fn scatter(&self, py: Python<'_>, stamps: bool) -> PyResult<f64> {
        let part = if stamps {
            Scatter::Stamps
        } else {
            Scatter::Arrivals
        };
        run_here(py, |task| {
            let mut most: f64 = 0.0;
            for run in 0..self.core.runs.len() {
                most = most.max(scatter_of(&self.core, run, part, task)?);
            }
            Ok(most)
        })
    }

    /// The profile, or that of a better minimum which the intervals of the `first` quantities find.
    /// With a covariance, that of a fit whose commands are functions of its plant.
    #[pyo3(signature = (first=None, covariance=None, numbers=None))]
    fn profile(
        &self,
        py: Python<'_>,
        first: Option<Vec<String>>,
        covariance: Option<Vec<f64>>,
        numbers: Option<FreeNumbers>,
    ) -> PyResult<FlightProfile> {
        FlightProfile::of(py, self, first, covariance, numbers)
    }
}

impl FlightFit {
    fn with(&self, core: CoreFit) -> Self {
        let of = self.of.of(&core.plant);
        Self { core, of }
    }
}

/// Numbers of the search that stages around it need.
pub(crate) fn add_constants(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("LEVEL_OF_TESTS", LEVEL_OF_TESTS)?;
    module.add("LONGEST_DELAY", LONGEST_DELAY)?;
    module.add("MOST_NUMBERS", MOST_NUMBERS)
}
