//! Bindings of a plant as it is fitted, with the names of its numbers.

use deadtime::estimation::{FlightPlant as CorePlant, Free, Quantity};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// A plant as it is fitted: num/den of unit gain behind named lags, and the names of what is free.
#[pyclass(frozen, get_all, from_py_object, module = "deadtime._deadtime")]
#[derive(Clone)]
pub(crate) struct FlightPlant {
    pub(crate) num: Vec<f64>,
    pub(crate) den: Vec<f64>,
    lag_names: Vec<String>,
    lags: Vec<f64>,
    pub(crate) names: Vec<String>,
    zero: f64,
    pub(crate) own_lag: f64,
    pub(crate) air_behind_lags: bool,
}

#[pymethods]
impl FlightPlant {
    #[new]
    #[pyo3(signature = (num, den, lag_names, lags, names, zero=0.0, own_lag=0.0, air_behind_lags=false))]
    #[expect(clippy::too_many_arguments, reason = "given by name")]
    fn new(
        num: Vec<f64>,
        den: Vec<f64>,
        lag_names: Vec<String>,
        lags: Vec<f64>,
        names: Vec<String>,
        zero: f64,
        own_lag: f64,
        air_behind_lags: bool,
    ) -> Self {
        Self {
            num,
            den,
            lag_names,
            lags,
            names,
            zero,
            own_lag,
            air_behind_lags,
        }
    }

    #[expect(clippy::type_complexity, reason = "the arguments of `new`")]
    fn __getnewargs__(
        &self,
    ) -> (
        Vec<f64>,
        Vec<f64>,
        Vec<String>,
        Vec<f64>,
        Vec<String>,
        f64,
        f64,
        bool,
    ) {
        let own = self.clone();
        (
            own.num,
            own.den,
            own.lag_names,
            own.lags,
            own.names,
            own.zero,
            own.own_lag,
            own.air_behind_lags,
        )
    }

    /// Does a constant input let the output grow?
    #[getter]
    fn integrates(&self) -> bool {
        self.core().integrates()
    }
}

impl FlightPlant {
    pub(crate) fn core(&self) -> CorePlant {
        let is_free = |name: &str| self.names.iter().any(|own| own == name);
        CorePlant {
            num: self.num.clone(),
            den: self.den.clone(),
            lags: self.lags.clone(),
            free: Free {
                delay: is_free("delay"),
                gain: is_free("gain"),
                lags: self.lag_names.iter().map(|name| is_free(name)).collect(),
                zero: is_free("zero"),
            },
            zero: self.zero,
            own_lag: self.own_lag,
            air_behind_lags: self.air_behind_lags,
            time_constant: is_free("time_constant"),
        }
    }

    /// The same with the numbers of another.
    pub(crate) fn of(&self, core: &CorePlant) -> Self {
        Self {
            num: core.num.clone(),
            den: core.den.clone(),
            lags: core.lags.clone(),
            zero: core.zero,
            own_lag: core.own_lag,
            ..self.clone()
        }
    }

    /// What a name means here.
    pub(crate) fn quantity(&self, name: &str) -> PyResult<Quantity> {
        let lag = self.lag_names.iter().position(|own| own == name);
        Ok(match (name, lag) {
            ("delay", _) => Quantity::Delay,
            ("gain", _) => Quantity::Gain,
            ("zero", _) => Quantity::Zero,
            ("delay+lag" | "delay+time_constant", _) => Quantity::Total,
            (_, Some(place)) => Quantity::Lag(place),
            _ => {
                return Err(PyValueError::new_err(format!(
                    "{name:?} was not fitted: give one of {}",
                    self.names.join(", ")
                )));
            }
        })
    }

    /// The names of what has an interval: what is free, and delay and lags together.
    pub(crate) fn known(&self) -> Vec<String> {
        let mut known = self.names.clone();
        let has = |name: &str| self.names.iter().any(|own| own == name);
        if has("delay") {
            let slow = if has("time_constant") {
                "time_constant"
            } else {
                "lag"
            };
            known.push(format!("delay+{slow}"));
        }
        known
    }
}
