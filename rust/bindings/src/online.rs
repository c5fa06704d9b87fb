//! Bindings of the estimators that take rows as they come.

use deadtime::estimation::{Answer, Known, Lags, Online, Plant, Settings, online};
use numpy::{IntoPyArray, PyArray2, PyReadonlyArrayDyn};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arrays::{converted, owned};
use crate::estimation::GivenDisturbance;
use crate::runtime::run_here;

/// Numbers of an answer, in the order of `OnlineBank.rows`.
const COLUMNS: usize = 23;

/// What is known before the first row.
#[derive(FromPyObject)]
struct GivenSettings {
    num: Vec<f64>,
    den: Vec<f64>,
    air_behind_lags: bool,
    own_lag: f64,
    delays: Vec<f64>,
    follow: bool,
    layers: Vec<(Vec<f64>, f64, Vec<f64>)>,
    disturbances: Vec<GivenDisturbance>,
    gain: (f64, f64),
    trim: f64,
    white: f64,
    freedom: f64,
    memory: f64,
    drift: f64,
    gain_walk: f64,
    width: f64,
    alarm: f64,
    every: usize,
    at_rest: bool,
    level: f64,
}

impl GivenSettings {
    fn settings(self) -> PyResult<Settings> {
        let plant = converted(Plant::new(&self.num, &self.den))?;
        let layers = self.layers.into_iter();
        Ok(Settings {
            plant: plant.with_air_behind_lags(self.air_behind_lags),
            own_lag: self.own_lag,
            delays: self.delays,
            follow: self.follow,
            layers: layers
                .map(|(lags, zero, log_prior)| Lags {
                    lags,
                    zero,
                    log_prior,
                })
                .collect(),
            disturbances: self
                .disturbances
                .iter()
                .map(GivenDisturbance::disturbance)
                .collect(),
            gain: self.gain,
            trim: self.trim,
            white: self.white,
            freedom: self.freedom,
            memory: self.memory,
            drift: self.drift,
            gain_walk: self.gain_walk,
            width: self.width,
            alarm: self.alarm,
            every: self.every,
            at_rest: self.at_rest,
            level: self.level,
        })
    }
}

/// A bank of Kalman filters over delays and lags that takes rows as they come.
#[pyclass(module = "deadtime._deadtime")]
pub(crate) struct OnlineBank {
    bank: Box<dyn Online>,
}

#[pymethods]
impl OnlineBank {
    #[new]
    fn new(settings: GivenSettings) -> PyResult<Self> {
        let bank = converted(online(settings.settings()?))?;
        Ok(Self { bank })
    }

    /// A command that holds from `time` on.
    fn command(&mut self, time: f64, value: f64) -> PyResult<()> {
        converted(self.bank.command(time, value))
    }

    /// A row: its output, or None where that was lost. The numbers of the answer.
    #[pyo3(signature = (time, output=None))]
    fn row(&mut self, time: f64, output: Option<f64>) -> PyResult<Vec<f64>> {
        Ok(numbers(&converted(self.bank.row(time, output))?).to_vec())
    }

    /// Many rows, each with the command that is sent after it; NaN where one was lost.
    fn rows<'py>(
        &mut self,
        py: Python<'py>,
        time: PyReadonlyArrayDyn<'py, f64>,
        output: PyReadonlyArrayDyn<'py, f64>,
        command: PyReadonlyArrayDyn<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (time, output, command) = (owned(&time)?, owned(&output)?, owned(&command)?);
        if time.len() != output.len() || time.len() != command.len() {
            return Err(PyValueError::new_err(format!(
                "{} times, {} outputs and {} commands: give equally many",
                time.len(),
                output.len(),
                command.len()
            )));
        }
        let bank = &mut self.bank;
        let found = run_here(py, |task| {
            let mut found = Vec::with_capacity(time.len() * COLUMNS);
            for (row, ((time, output), command)) in
                time.iter().zip(&output).zip(&command).enumerate()
            {
                if row % 256 == 255 {
                    task.check()?;
                }
                let output = Some(*output).filter(|output| !output.is_nan());
                found.extend(numbers(&bank.row(*time, output)?));
                if !command.is_nan() {
                    bank.command(*time, *command)?;
                }
            }
            Ok(found)
        })?;
        let rows = found.len() / COLUMNS;
        let shaped = numpy::ndarray::Array2::from_shape_vec((rows, COLUMNS), found)
            .map_err(|error| PyValueError::new_err(error.to_string()))?;
        Ok(shaped.into_pyarray(py))
    }
}

fn numbers(answer: &Answer) -> [f64; COLUMNS] {
    let of = |known: Known| [known.mean, known.deviation, known.low, known.high];
    let ([a, b, c, d], [e, f, g, h]) = (of(answer.delay), of(answer.together));
    let is = |so: bool| f64::from(u8::from(so));
    [
        answer.time,
        is(answer.started),
        a,
        b,
        c,
        d,
        e,
        f,
        g,
        h,
        answer.lag,
        answer.gain,
        answer.gain_deviation,
        answer.rate,
        answer.gate,
        is(answer.changed),
        answer.change_ratio,
        answer.white,
        answer.colour,
        answer.unexplained,
        answer.lowest,
        answer.highest,
        answer.evidence,
    ]
}
