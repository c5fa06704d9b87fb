//! Bindings of the estimators that take rows as they come.

use deadtime::estimation::{Answer, Lags, Online, Plant, Settings, online};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::converted;
use crate::estimation::GivenDisturbance;
use crate::flight_plant::FlightPlant;

/// What is known before the first row.
#[derive(FromPyObject)]
struct GivenSettings {
    plant: FlightPlant,
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
        let given = &self.plant;
        let plant = converted(Plant::new(&given.num, &given.den))?;
        let layers = self.layers.into_iter();
        Ok(Settings {
            plant: plant.with_air_behind_lags(given.air_behind_lags),
            own_lag: given.own_lag,
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

    /// A row: its output, or None where that was lost.
    #[pyo3(signature = (time, output=None))]
    fn row(&mut self, time: f64, output: Option<f64>) -> PyResult<BankAnswer> {
        Ok(BankAnswer::from(&converted(self.bank.row(time, output))?))
    }
}

/// What is known after a row.
#[pyclass(frozen, get_all, module = "deadtime._deadtime")]
pub(crate) struct BankAnswer {
    time: f64,
    started: bool,
    delay: f64,
    delay_deviation: f64,
    low: f64,
    high: f64,
    together: f64,
    together_low: f64,
    together_high: f64,
    lag: f64,
    gain: f64,
    gain_deviation: f64,
    gate: f64,
    informed: bool,
    changed: bool,
    white: f64,
    colour: f64,
    unexplained: f64,
    lowest: f64,
    highest: f64,
    evidence: f64,
}

impl From<&Answer> for BankAnswer {
    fn from(answer: &Answer) -> Self {
        Self {
            time: answer.time,
            started: answer.started,
            delay: answer.delay.mean,
            delay_deviation: answer.delay.deviation,
            low: answer.delay.low,
            high: answer.delay.high,
            together: answer.together.mean,
            together_low: answer.together.low,
            together_high: answer.together.high,
            lag: answer.lag,
            gain: answer.gain,
            gain_deviation: answer.gain_deviation,
            gate: answer.gate,
            informed: answer.is_informed(),
            changed: answer.changed,
            white: answer.white,
            colour: answer.colour,
            unexplained: answer.unexplained,
            lowest: answer.lowest,
            highest: answer.highest,
            evidence: answer.evidence,
        }
    }
}

#[pymethods]
impl BankAnswer {
    /// The numbers that an estimate shows, by their names there.
    #[getter]
    fn shown<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let found = PyDict::new(py);
        let numbers = [
            ("time", self.time),
            ("delay", self.delay),
            ("stderr", self.delay_deviation),
            ("lag", self.lag),
            ("delay_plus_lag", self.together),
            ("gain", self.gain),
            ("gain_stderr", self.gain_deviation),
        ];
        for (name, value) in numbers {
            found.set_item(name, value)?;
        }
        found.set_item("ci", (self.low.max(0.0), self.high))?;
        let together = (self.together_low.max(0.0), self.together_high);
        found.set_item("delay_plus_lag_ci", together)?;
        found.set_item("informed", self.informed)?;
        found.set_item("changed", self.changed)?;
        Ok(found)
    }
}
