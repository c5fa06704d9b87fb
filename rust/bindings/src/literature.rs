//! Bindings of the methods of the literature.

use deadtime::estimation::{self as core, Extreme, HeldPath, TailReading, Tangent, Weighting};
use numpy::{
    IntoPyArray, PyArray1, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods,
};
use pyo3::prelude::*;

use crate::arrays::{in_order, owned};
use crate::runtime::run_here;

type Floats<'py> = PyReadonlyArrayDyn<'py, f64>;
type Vector<'py> = Bound<'py, PyArray1<f64>>;

/// Time, height, and their standard errors.
type Peak = (f64, f64, f64, f64);

fn extreme((time, height, time_error, height_error): Peak) -> Extreme {
    Extreme {
        time,
        height,
        time_error,
        height_error,
    }
}

/// Peaks and valleys of a response around its reference, at times since its step.
#[pyfunction]
pub(crate) fn step_extremes(
    since: Floats<'_>,
    beyond: Floats<'_>,
    noise: f64,
) -> PyResult<Vec<Peak>> {
    let found = core::extremes(&in_order(&since)?, &in_order(&beyond)?, noise);
    let listed = found.iter();
    Ok(listed
        .map(|e| (e.time, e.height, e.time_error, e.height_error))
        .collect())
}

/// Do peaks and valleys decay?
#[pyfunction]
pub(crate) fn extremes_decay(extremes: Vec<Peak>) -> bool {
    core::decay(&extremes.into_iter().map(extreme).collect::<Vec<_>>())
}

/// σ and ω of the oscillation that leaves these extremes; delay and K of the loop that has it, and their
/// covariance, if there is one.
#[pyfunction]
#[expect(clippy::type_complexity, reason = "a tuple for Python")]
pub(crate) fn loop_of_extremes(
    extremes: Vec<Peak>,
    lag: f64,
    sample_time: Option<f64>,
) -> ((f64, f64), Option<([f64; 2], [f64; 4])>) {
    let extremes: Vec<_> = extremes.into_iter().map(extreme).collect();
    let found = core::ringing(&extremes);
    let made = (found.sigma > 0.0)
        .then(|| core::loop_with_ringing(&found, lag, sample_time))
        .flatten();
    ((found.sigma, found.omega), made)
}

/// Samples of the tail of a step response, and height, rate and the standard error of the rate of the
/// exponential through them, none of too few. It begins where this share of the step is left, and no more
/// than `most`; `clear` is a movement that stands out of the noise.
#[pyfunction]
#[expect(clippy::type_complexity, reason = "a tuple for Python")]
pub(crate) fn step_tail(
    since: Floats<'_>,
    travelled: Floats<'_>,
    share: f64,
    most: f64,
    clear: f64,
    fewest: usize,
) -> PyResult<(usize, Option<(f64, f64, f64)>)> {
    let reading = TailReading {
        share,
        most,
        clear,
        fewest,
    };
    let (count, tail) = core::step_tail(&in_order(&since)?, &in_order(&travelled)?, reading);
    Ok((count, tail.map(|own| (own.height, own.rate, own.error))))
}

/// The first sample from which on a step response stays above `least`, if there is one after the first.
#[pyfunction]
pub(crate) fn first_movement(travelled: Floats<'_>, least: f64) -> PyResult<Option<usize>> {
    Ok(core::first_movement(&in_order(&travelled)?, least))
}

/// Where the line through two shares of a step response meets the initial output.
#[pyfunction]
pub(crate) fn line_through(
    since: Floats<'_>,
    travelled: Floats<'_>,
    shares: (f64, f64),
) -> PyResult<f64> {
    let (since, travelled) = (in_order(&since)?, in_order(&travelled)?);
    Ok(core::line_through(&since, &travelled, shares))
}

/// Delay of the loop with the root −rate, and its slope.
#[pyfunction]
pub(crate) fn delay_of_rate(
    rate: f64,
    stiffness: f64,
    lag: f64,
    sample_time: Option<f64>,
) -> (f64, f64) {
    core::delay_of_rate(rate, stiffness, lag, sample_time)
}

/// K Td of an overshoot, if that says it.
#[pyfunction]
pub(crate) fn x_of_overshoot(overshoot: f64) -> Option<f64> {
    core::exact_x(overshoot)
}

/// Where the straight part of a rise meets the initial output, with its standard error; or the samples on
/// it where they are too few, none where it does not rise, with its ends.
#[pyfunction]
#[expect(clippy::type_complexity, reason = "a tuple for Python")]
pub(crate) fn rise_tangent(
    since: Floats<'_>,
    travelled: Floats<'_>,
    guess: f64,
    held: Option<f64>,
    noise: f64,
) -> PyResult<(Option<(f64, f64)>, Option<(usize, f64, f64)>)> {
    let (since, travelled) = (in_order(&since)?, in_order(&travelled)?);
    Ok(
        match core::tangent(&since, &travelled, guess, held, noise) {
            Tangent::Meets(place, error) => (Some((place, error)), None),
            Tangent::Few(count, from, until) => (None, Some((count, from, until))),
            Tangent::Falls => (None, None),
        },
    )
}

/// A limit cycle around the reference.
#[pyclass(frozen, module = "deadtime._deadtime")]
pub(crate) struct LimitCycle {
    time: Vec<f64>,
    output: Vec<f64>,
    reference: Vec<f64>,
    error: Vec<f64>,
    crossings: Vec<f64>,
}

#[pymethods]
impl LimitCycle {
    /// That of an output beside noise, after its first crossings.
    #[new]
    fn new(
        time: Floats<'_>,
        output: Floats<'_>,
        reference: Floats<'_>,
        noise: f64,
        left_out: usize,
    ) -> PyResult<Self> {
        let (time, output, reference) = (owned(&time)?, owned(&output)?, owned(&reference)?);
        let error: Vec<f64> = output.iter().zip(&reference).map(|(y, r)| y - r).collect();
        let crossings = core::crossings(&time, &error, noise);
        Ok(Self {
            crossings: crossings.into_iter().skip(left_out).collect(),
            time,
            output,
            reference,
            error,
        })
    }

    /// When the output crosses the reference.
    #[getter]
    fn crossings<'py>(&self, py: Python<'py>) -> Vector<'py> {
        self.crossings.clone().into_pyarray(py)
    }

    /// Largest error between each crossing and the next.
    #[getter]
    fn peaks<'py>(&self, py: Python<'py>) -> Vector<'py> {
        core::peaks(&self.time, &self.error, &self.crossings).into_pyarray(py)
    }

    /// How often the command switches around each crossing but the last, and the time of one switch with
    /// the same effect.
    fn switches(&self, signs: Floats<'_>) -> PyResult<(Vec<usize>, Vec<f64>)> {
        let found = core::switches(&self.time, &in_order(&signs)?, &self.crossings);
        Ok(found.iter().map(|own| (own.count, own.time)).unzip())
    }

    /// Number of cycles, their mean delay by the switches, and its standard error.
    fn delays(&self, switches: Floats<'_>) -> PyResult<(usize, f64, f64)> {
        let found = core::cycles(&self.crossings, &in_order(&switches)?);
        Ok((found.count, found.delay, found.error))
    }

    /// First and last row of the cycle where its switches arrive after a delay, the path of unit speed there
    /// and the output, both about their means, and the speed along the path.
    #[expect(clippy::type_complexity, reason = "a tuple for Python")]
    fn path<'py>(
        &self,
        py: Python<'py>,
        switches: Floats<'_>,
        delay: f64,
        lag: f64,
    ) -> PyResult<Option<([usize; 2], Vector<'py>, Vector<'py>, f64)>> {
        let rows = (&*self.time, &*self.output, &*self.reference);
        let found = core::cycle_path(rows, &in_order(&switches)?, delay, lag);
        Ok(found.map(|own| {
            let ends = [own.rows.start, own.rows.end - 1];
            let (path, output) = (own.path.into_pyarray(py), own.output.into_pyarray(py));
            (ends, path, output, own.speed)
        }))
    }

    /// Increase of a quarter of a period, half of which is `half`, by a lag.
    #[staticmethod]
    fn delay_by_lag(lag: f64, half: f64) -> f64 {
        core::delay_by_lag(lag, half)
    }
}

/// F, dF/dt and dF/dlag of a plant under commands at some times.
#[pyclass(frozen, get_all, module = "deadtime._deadtime")]
pub(crate) struct PathAt {
    value: Py<PyArrayDyn<f64>>,
    rate: Py<PyArrayDyn<f64>>,
    by_lag: Py<PyArrayDyn<f64>>,
}

/// The response of an integrator of unit gain to commands, each of which holds from its time to the next.
#[pyclass(frozen, module = "deadtime._deadtime")]
pub(crate) struct HeldResponse {
    path: HeldPath,
}

#[pymethods]
impl HeldResponse {
    #[new]
    fn new(time: Floats<'_>, command: Floats<'_>) -> PyResult<Self> {
        let path = HeldPath::new(owned(&time)?, owned(&command)?);
        Ok(Self { path })
    }

    /// At times of any shape, behind a lag.
    #[pyo3(signature = (times, lag=0.0))]
    fn at(&self, py: Python<'_>, times: Floats<'_>, lag: f64) -> PyResult<PathAt> {
        let (shape, at) = (times.shape().to_vec(), in_order(&times)?);
        let found = run_here(py, |_| Ok(self.path.at(&at, lag)))?;
        let array = |part: Vec<f64>| part.into_pyarray(py).reshape(shape.clone());
        Ok(PathAt {
            value: array(found.value)?.unbind(),
            rate: array(found.rate)?.unbind(),
            by_lag: array(found.by_lag)?.unbind(),
        })
    }
}

/// Losses of ARX models of orders `na`, `nb` at every delay from `least` on; that of the best, and that
/// without a command.
#[pyfunction]
pub(crate) fn arx_losses<'py>(
    py: Python<'py>,
    output: Floats<'_>,
    command: Floats<'_>,
    orders: (usize, usize),
    delays: (usize, usize),
) -> PyResult<(Vector<'py>, f64, f64)> {
    let (output, command) = (in_order(&output)?, in_order(&command)?);
    let (losses, best, none) = run_here(py, |task| {
        core::arx_losses(&output, &command, orders, delays, task)
    })?;
    Ok((losses.into_pyarray(py), best, none))
}

/// Delay in samples of a held command in a response, the losses at whole numbers of them, and that without
/// a command.
#[pyfunction]
pub(crate) fn held_losses<'py>(
    py: Python<'py>,
    response: Floats<'_>,
    command: Floats<'_>,
    delays: (usize, usize),
) -> PyResult<(f64, Vector<'py>, f64)> {
    let (response, command) = (in_order(&response)?, in_order(&command)?);
    let (samples, losses, none) = run_here(py, |task| {
        core::held_losses(&response, &command, delays, task)
    })?;
    Ok((samples, losses.into_pyarray(py), none))
}

/// Correlation coefficient of a response and an earlier command, and the variance of one by chance, times
/// the samples.
#[pyfunction]
pub(crate) fn correlation_coefficient(
    command: Floats<'_>,
    response: Floats<'_>,
    shift: usize,
) -> PyResult<(f64, f64)> {
    let (command, response) = (in_order(&command)?, in_order(&response)?);
    Ok(core::coefficient(&command, &response, shift))
}

/// Statistic and degrees of freedom of the test that the command depends on the output.
#[pyfunction]
pub(crate) fn feedback_test(
    command: Floats<'_>,
    reference: Floats<'_>,
    output: Floats<'_>,
) -> PyResult<Option<(f64, usize, usize)>> {
    let (command, reference) = (in_order(&command)?, in_order(&reference)?);
    Ok(core::feedback(&command, &reference, &in_order(&output)?))
}

/// The shift in samples at which the weighted correlation of a command and a response is largest, and where
/// between samples its peak is.
#[pyfunction]
pub(crate) fn correlation_peak(
    command: Floats<'_>,
    response: Floats<'_>,
    weighting: &str,
    shifts: (usize, usize),
) -> PyResult<(usize, f64)> {
    let weighting = match weighting {
        "scot" => Weighting::Scot,
        "phat" => Weighting::Phat,
        "prewhitened" => Weighting::Prewhitened,
        _ => Weighting::None,
    };
    let (command, response) = (in_order(&command)?, in_order(&response)?);
    Ok(core::peak(&command, &response, weighting, shifts))
}
