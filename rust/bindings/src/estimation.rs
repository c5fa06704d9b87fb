//! Bindings of `deadtime::estimation`.

use deadtime::estimation::{
    Disturbance, Entry, Evaluation, Fit, HeldPath, Left, Noise, Plant, Point, Timing,
    coarse_step as coarse, felt, follows_command as follows, held_response as response,
    most_moved as most, regular_times as regular, statistics, whiten,
};
use numpy::{IntoPyArray, PyArray1, PyReadonlyArrayDyn};
use pyo3::prelude::*;

use crate::arrays::{converted, owned};
use crate::runtime::run_here;

type Floats<'py> = PyReadonlyArrayDyn<'py, f64>;

type Array = Py<PyArray1<f64>>;

/// The noise of one recording, in deviations of the white noise.
#[pyclass(frozen, get_all, from_py_object, module = "deadtime._deadtime")]
#[derive(Clone)]
pub(crate) struct RowNoise {
    air_time: f64,
    air: f64,
    sensor_time: f64,
    sensor: f64,
    stamps: f64,
    arrivals: f64,
}

#[pymethods]
impl RowNoise {
    #[new]
    #[pyo3(signature = (air_time=1.0, air=0.0, sensor_time=1.0, sensor=0.0, stamps=0.0, arrivals=0.0))]
    fn new(
        air_time: f64,
        air: f64,
        sensor_time: f64,
        sensor: f64,
        stamps: f64,
        arrivals: f64,
    ) -> Self {
        Self {
            air_time,
            air,
            sensor_time,
            sensor,
            stamps,
            arrivals,
        }
    }

    fn __getnewargs__(&self) -> (f64, f64, f64, f64, f64, f64) {
        (
            self.air_time,
            self.air,
            self.sensor_time,
            self.sensor,
            self.stamps,
            self.arrivals,
        )
    }
}

impl RowNoise {
    fn noise(&self) -> Noise {
        Noise {
            air_time: self.air_time,
            air: self.air,
            sensor_time: self.sensor_time,
            sensor: self.sensor,
            stamps: self.stamps,
            arrivals: self.arrivals,
        }
    }
}

/// One set of numbers of plant and noise.
#[pyclass(frozen, get_all, from_py_object, module = "deadtime._deadtime")]
#[derive(Clone)]
pub(crate) struct PlantNumbers {
    delay: f64,
    lags: Vec<f64>,
    zero: f64,
    gain: f64,
    noise: Vec<RowNoise>,
    objective: f64,
}

#[pymethods]
impl PlantNumbers {
    #[new]
    #[pyo3(signature = (delay, lags, noise, gain=1.0, zero=0.0, objective=f64::INFINITY))]
    fn new(
        delay: f64,
        lags: Vec<f64>,
        noise: Vec<RowNoise>,
        gain: f64,
        zero: f64,
        objective: f64,
    ) -> Self {
        Self {
            delay,
            lags,
            zero,
            gain,
            noise,
            objective,
        }
    }

    fn __getnewargs__(&self) -> (f64, Vec<f64>, Vec<RowNoise>, f64, f64, f64) {
        (
            self.delay,
            self.lags.clone(),
            self.noise.clone(),
            self.gain,
            self.zero,
            self.objective,
        )
    }
}

impl PlantNumbers {
    pub(crate) fn fit(&self) -> Fit {
        let noise = self.noise.iter().map(RowNoise::noise);
        Fit {
            point: Point {
                timing: Timing::Delay(self.delay),
                lags: self.lags.clone(),
                zero: self.zero,
                gain: self.gain,
                noise: noise.collect(),
            },
            objective: self.objective,
        }
    }

    pub(crate) fn from_fit(fit: &Fit) -> Self {
        let noise = fit.point.noise.iter().map(|one| RowNoise {
            air_time: one.air_time,
            air: one.air,
            sensor_time: one.sensor_time,
            sensor: one.sensor,
            stamps: one.stamps,
            arrivals: one.arrivals,
        });
        Self {
            delay: fit.point.delay(),
            lags: fit.point.lags.clone(),
            zero: fit.point.zero,
            gain: fit.point.gain,
            noise: noise.collect(),
            objective: fit.objective,
        }
    }
}

/// The likelihood of one recording at one set of numbers.
#[pyclass(frozen, get_all, module = "deadtime._deadtime")]
pub(crate) struct RowLikelihood {
    objective: f64,
    log_det: f64,
    variance: f64,
    freedom: usize,
    gain: f64,
    linear: Vec<f64>,
    inverse: Array,
    score: Array,
    whitened: Array,
    residuals: Array,
    rate: Array,
}

impl RowLikelihood {
    pub(crate) fn new(py: Python<'_>, found: Evaluation) -> Self {
        let array = |values: Vec<f64>| values.into_pyarray(py).unbind();
        Self {
            objective: found.objective,
            log_det: found.log_det,
            variance: found.variance,
            freedom: found.freedom,
            gain: found.gain,
            linear: found.linear,
            inverse: array(found.inverse),
            score: array(found.score),
            whitened: array(found.whitened),
            residuals: array(found.residuals),
            rate: array(found.rate),
        }
    }
}

/// What moves the output besides the command, in deviations of the white noise.
#[derive(FromPyObject)]
pub(crate) struct GivenDisturbance {
    at_input: bool,
    time_constant: f64,
    deviation: f64,
}

impl GivenDisturbance {
    pub(crate) fn disturbance(&self) -> Disturbance {
        Disturbance {
            entry: if self.at_input {
                Entry::Input
            } else {
                Entry::Output
            },
            time_constant: self.time_constant,
            deviation: self.deviation,
        }
    }
}

/// Columns, one after the other, whitened by the covariance of their rows: that of disturbances of
/// the plant num/den, and of white noise of variance one.
#[pyfunction]
pub(crate) fn whitened_columns<'py>(
    py: Python<'py>,
    num: Vec<f64>,
    den: Vec<f64>,
    disturbances: Vec<GivenDisturbance>,
    time: Floats<'py>,
    columns: Floats<'py>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let plant = converted(Plant::new(&num, &den))?;
    let disturbances: Vec<Disturbance> = disturbances
        .iter()
        .map(GivenDisturbance::disturbance)
        .collect();
    let (time, columns) = (owned(&time)?, owned(&columns)?);
    let found = run_here(py, |task| {
        whiten(&time, columns, &plant, &disturbances, task)
    })?;
    Ok(found.into_pyarray(py))
}

/// The output of the plant num/den under inputs that hold from their times on, at `times`.
#[pyfunction]
pub(crate) fn held_response<'py>(
    py: Python<'py>,
    num: Vec<f64>,
    den: Vec<f64>,
    input_time: Floats<'py>,
    inputs: Floats<'py>,
    times: Floats<'py>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let plant = converted(Plant::new(&num, &den))?;
    let (input_time, inputs, times) = (owned(&input_time)?, owned(&inputs)?, owned(&times)?);
    let found = run_here(py, |task| {
        response(&plant, &input_time, &inputs, &times, task)
    })?;
    Ok(found.into_pyarray(py))
}

/// Does the command, at its times, explain what a fit leaves of rows beyond chance and a lead in BIC? The
/// rows are times, residuals and the time between two; `own` is the delay and the lag of the fit.
#[pyfunction]
pub(crate) fn follows_command<'py>(
    py: Python<'py>,
    command: (Floats<'py>, Floats<'py>),
    rows: (Floats<'py>, Floats<'py>, f64),
    own: (f64, f64),
    plant: (Vec<f64>, Vec<f64>),
    noise: Option<RowNoise>,
    lead: f64,
) -> PyResult<bool> {
    let plant = converted(Plant::new(&plant.0, &plant.1))?;
    let path = HeldPath::new(owned(&command.0)?, owned(&command.1)?);
    let (time, residuals) = (owned(&rows.0)?, owned(&rows.1)?);
    let left = Left {
        time: &time,
        residuals: &residuals,
        row_time: rows.2,
        delay: own.0,
        lag: own.1,
    };
    let noise = noise.map(|own| own.noise());
    run_here(py, |task| {
        follows(&path, left, &plant, noise.as_ref(), lead, task)
    })
}

/// Number of independent samples that hold as much as so many of this lag-1 autocorrelation.
#[pyfunction]
pub(crate) fn independent_samples(samples: f64, autocorrelation: f64) -> f64 {
    statistics::independent_samples(samples, autocorrelation)
}

/// Logarithm of the size of the plant num/den behind a delay, its angle and its equivalent delay at
/// frequencies.
#[pyfunction]
pub(crate) fn felt_plant<'py>(
    py: Python<'py>,
    num: Vec<f64>,
    den: Vec<f64>,
    delay: f64,
    omega: Vec<f64>,
) -> [Bound<'py, PyArray1<f64>>; 3] {
    let found = felt(&num, &den, delay, &omega);
    [found.size, found.angle, found.delay].map(|one| one.into_pyarray(py))
}

/// The regular times that time stamps scatter around, about so far from each other, if there are some.
#[pyfunction]
pub(crate) fn regular_times<'py>(
    py: Python<'py>,
    time: Floats<'py>,
    between: f64,
) -> PyResult<Option<Bound<'py, PyArray1<f64>>>> {
    let found = regular(&owned(&time)?, between);
    Ok(found.map(|own| own.into_pyarray(py)))
}

/// The step of a sensor that is coarse for how far its output moves, and beside noise of this deviation;
/// zero of others.
#[pyfunction]
pub(crate) fn coarse_step(output: Floats<'_>, noise: f64) -> PyResult<f64> {
    Ok(coarse(&owned(&output)?, noise))
}

/// The first of so many neighbouring rows in which values change most.
#[pyfunction]
pub(crate) fn most_moved(values: Floats<'_>, count: usize) -> PyResult<usize> {
    Ok(most(&owned(&values)?, count))
}
