//! Bindings of `deadtime::dde`: linear loops.

use std::slice;

use deadtime::dde::sampled;
use deadtime::dde::{
    Equations, Kick, LinearLoop, RateLimits, Reference, Request, Response, Start, Update, on_sample,
};
use deadtime::frequency;
use deadtime::roots::Region;
use deadtime::stability::HeldLoop;
use num_complex::Complex64;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArrayDyn};
use pyo3::prelude::*;
use pyo3::types::PyFloat;

use crate::arrays::{column, converted, frozen, in_order, owned, part_of};
use crate::frequency::PyMargins;
use crate::quasipoly::{Range, RootSet};
use crate::runtime::run_here;

type Floats<'py> = PyReadonlyArrayDyn<'py, f64>;
type Vector<'py> = Bound<'py, PyArray1<f64>>;
type Matrix<'py> = Bound<'py, PyArray2<f64>>;

/// The matrices of x' = A x + B w + E r, u = K x + L w + M r, y = C x + D w, w(t) = sat(u(t - Td)).
#[derive(FromPyObject)]
struct LoopEquations<'py> {
    #[pyo3(attribute("A"))]
    a: Floats<'py>,
    #[pyo3(attribute("B"))]
    b: Floats<'py>,
    #[pyo3(attribute("E"))]
    e: Floats<'py>,
    #[pyo3(attribute("K"))]
    k: Floats<'py>,
    #[pyo3(attribute("L"))]
    l: f64,
    #[pyo3(attribute("M"))]
    m: f64,
    #[pyo3(attribute("C"))]
    c: Floats<'py>,
    #[pyo3(attribute("D"))]
    d: f64,
    impulse: f64,
    update: Option<SampleUpdate<'py>>,
}

/// What a sample does to the states.
#[derive(FromPyObject)]
struct SampleUpdate<'py> {
    states: Floats<'py>,
    command: Floats<'py>,
    reference: Floats<'py>,
}

/// The jumps of a reference.
enum Jumps {
    /// To a number, where the run starts.
    AtStart(f64),
    /// Times and values.
    Later(Vec<f64>, Vec<f64>),
}

/// The state in which a run starts, and its reference: a tuple, which takes a third of the time of
/// attributes.
pub(crate) struct LoopRun<'py> {
    state: Floats<'py>,
    pub(crate) command: f64,
    pub(crate) reference_before: f64,
    /// A number, to which the reference steps at the start, or values that hold from their times on.
    reference: Bound<'py, PyAny>,
    reference_time: Option<Floats<'py>>,
    command_history: Option<Floats<'py>>,
    pub(crate) sample_phase: f64,
    /// Jumps of inputs: times since the start, which inputs, and to what.
    kicks: Option<(Floats<'py>, Vec<usize>, Floats<'py>)>,
}

impl<'a, 'py> FromPyObject<'a, 'py> for LoopRun<'py> {
    type Error = PyErr;

    fn extract(run: Borrowed<'a, 'py, PyAny>) -> PyResult<Self> {
        let (
            state,
            command,
            reference_before,
            reference,
            reference_time,
            command_history,
            phase,
            kicks,
        ) = run.extract()?;
        Ok(Self {
            state,
            command,
            reference_before,
            reference,
            reference_time,
            command_history,
            sample_phase: phase,
            kicks,
        })
    }
}

impl LoopRun<'_> {
    pub(crate) fn state(&self) -> PyResult<Vec<f64>> {
        owned(&self.state)
    }

    pub(crate) fn start(&self) -> PyResult<Start> {
        Ok(Start {
            state: self.state()?,
            command: self.command,
            command_history: self.command_history()?,
            sample_phase: self.sample_phase,
            kicks: self.kicks()?,
        })
    }

    pub(crate) fn command_history(&self) -> PyResult<Vec<f64>> {
        self.command_history
            .as_ref()
            .map_or(Ok(Vec::new()), |history| owned(history))
    }

    fn kicks(&self) -> PyResult<Vec<Kick>> {
        let Some((times, inputs, values)) = &self.kicks else {
            return Ok(Vec::new());
        };
        let (times, values) = (in_order(times)?, in_order(values)?);
        let jumps = times.iter().zip(inputs).zip(values.iter());
        let kick = |((&time, &input), &to)| Kick { time, input, to };
        Ok(jumps.map(kick).collect())
    }

    fn jumps(&self) -> PyResult<Jumps> {
        Ok(match &self.reference_time {
            None => Jumps::AtStart(self.reference.extract()?),
            Some(times) => {
                let values = self.reference.extract::<Floats<'_>>()?;
                Jumps::Later(owned(times)?, owned(&values)?)
            }
        })
    }

    /// The reference of a run from time 0 on.
    pub(crate) fn reference(&self) -> PyResult<Reference> {
        let before = self.reference_before;
        converted(match self.jumps()? {
            Jumps::AtStart(value) => Reference::step(before, value),
            Jumps::Later(times, values) => Reference::new(before, times, values),
        })
    }
}

/// A loop with numbers in the place of all parameters.
#[pyclass(frozen, module = "deadtime._deadtime", name = "LinearLoop")]
pub(crate) struct PyLinearLoop {
    inner: LinearLoop,
    /// How much earlier than its measurement the output is, s.
    output_lead: f64,
}

impl PyLinearLoop {
    pub(crate) fn of(inner: LinearLoop, output_lead: f64) -> Self {
        Self { inner, output_lead }
    }
}

#[pymethods]
impl PyLinearLoop {
    #[new]
    #[pyo3(signature = (equations, delay, sample_time=None, limit=None, delay_in_measurement=false))]
    fn new(
        equations: LoopEquations<'_>,
        delay: f64,
        sample_time: Option<f64>,
        limit: Option<f64>,
        delay_in_measurement: bool,
    ) -> PyResult<Self> {
        let matrices = Equations {
            a: owned(&equations.a)?,
            b: owned(&equations.b)?,
            e: owned(&equations.e)?,
            k: owned(&equations.k)?,
            l: equations.l,
            m: equations.m,
            c: owned(&equations.c)?,
            d: equations.d,
            impulse: equations.impulse,
            ..Equations::default()
        };
        let update = match &equations.update {
            Some(update) => Some(Update {
                states: owned(&update.states)?,
                command: owned(&update.command)?,
                reference: owned(&update.reference)?,
            }),
            None => None,
        };
        let made = LinearLoop::new(matrices, delay, sample_time, limit);
        let made = made.and_then(|plain| match update {
            Some(update) => plain.with_update(update),
            None => Ok(plain),
        });
        let output_lead = if delay_in_measurement { delay } else { 0.0 };
        converted(made).map(|inner| Self { inner, output_lead })
    }

    /// A, B, E, K, L, M, C, D, the impulse, and what a sample does to the states.
    #[expect(clippy::type_complexity, reason = "a tuple of arrays for Python")]
    fn equations<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(
        (
            Matrix<'py>,
            Vector<'py>,
            Vector<'py>,
            Vector<'py>,
            f64,
            f64,
            Vector<'py>,
            f64,
            f64,
        ),
        Option<(Matrix<'py>, Vector<'py>, Vector<'py>)>,
    )> {
        let own = self.inner.equations();
        let n = own.states();
        let row = |values: &[f64]| PyArray1::from_slice(py, values);
        let square = |values: &[f64]| row(values).reshape([n, n]);
        let update = match self.inner.update() {
            Some(update) => Some((
                square(&update.states)?,
                row(&update.command),
                row(&update.reference),
            )),
            None => None,
        };
        let (l, m, d) = (own.l, own.m, own.d);
        Ok((
            (
                square(&own.a)?,
                row(&own.b),
                row(&own.e),
                row(&own.k),
                l,
                m,
                row(&own.c),
                d,
                own.impulse,
            ),
            update,
        ))
    }

    /// Outputs at some times; these and those of the run count from its start.
    fn outputs<'py>(
        &self,
        py: Python<'py>,
        time: Floats<'py>,
        run: LoopRun<'py>,
    ) -> PyResult<Vector<'py>> {
        let times = in_order(&time)?;
        let (start, reference) = (run.start()?, run.reference()?);
        let found = run_here(py, |task| {
            self.inner.simulate(&start, &reference, &times, &[], task)
        })?;
        Ok(found.outputs.into_pyarray(py))
    }

    /// The response at `time`, in the clock of the caller; the first of the times is the start.
    ///
    /// `run` is a tuple, or the height of a step of the reference from rest at zero. Outputs are
    /// earlier by the delay where that is in the measurement.
    fn respond(
        &self,
        py: Python<'_>,
        time: Floats<'_>,
        run: Bound<'_, PyAny>,
    ) -> PyResult<PyLoopResponse> {
        let time = owned(&time)?;
        let (start, reference_before, jumps) = if let Ok(height) = run.cast::<PyFloat>() {
            let start = Start {
                state: vec![0.0; self.inner.equations().states()],
                ..Start::default()
            };
            (start, 0.0, Jumps::AtStart(height.value()))
        } else {
            let run = run.extract::<LoopRun<'_>>()?;
            (run.start()?, run.reference_before, run.jumps()?)
        };
        let mut made = PyLoopResponse {
            time,
            output_lead: self.output_lead,
            reference_before,
            jumps,
            found: Response::default(),
        };
        made.found = run_here(py, |task| self.inner.respond(&start, &made.request(), task))?;
        Ok(made)
    }

    /// The transition matrix of a sampled loop, limit left out.
    fn transition_matrix<'py>(&self, py: Python<'py>) -> PyResult<Matrix<'py>> {
        let (matrix, size) = run_here(py, |_| sampled::transition_matrix(&self.inner))?;
        matrix.into_pyarray(py).reshape([size, size])
    }

    /// Poles s = ln(z)/Ts of a sampled loop, limit left out, rightmost first.
    fn poles<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<Complex64>>> {
        Ok(run_here(py, |_| sampled::poles(&self.inner))?.into_pyarray(py))
    }

    /// Poles of a sampled loop in a region, with discs proved to hold them.
    fn poles_in(&self, py: Python<'_>, re: Range, im: Range) -> PyResult<RootSet> {
        let found = run_here(py, |_| {
            HeldLoop::new(&self.inner)?.poles_in(&Region::new(re, im)?)
        })?;
        Ok(RootSet::new(py, found))
    }

    /// The `n` rightmost of them and their mirror images.
    fn rightmost(&self, py: Python<'_>, n: usize) -> PyResult<RootSet> {
        let found = run_here(py, |_| HeldLoop::new(&self.inner)?.rightmost_poles(n))?;
        Ok(RootSet::new(py, found))
    }

    /// Are all poles of a sampled loop inside the unit circle, proved? None where rounding decides.
    fn is_stable(&self, py: Python<'_>) -> PyResult<Option<bool>> {
        run_here(py, |task| HeldLoop::new(&self.inner)?.is_stable(task))
    }

    /// The gain of a sampled loop at frequencies in rad/s, in C order.
    fn held_gain<'py>(
        &self,
        py: Python<'py>,
        omega: Floats<'py>,
    ) -> PyResult<Bound<'py, PyArray1<Complex64>>> {
        let omega = in_order(&omega)?;
        let found = run_here(py, |_| {
            frequency::held_gain(HeldLoop::new(&self.inner)?, &omega)
        })?;
        Ok(found.into_pyarray(py))
    }

    /// Its argument in rad, continuous from zero on.
    fn held_phase<'py>(&self, py: Python<'py>, omega: Floats<'py>) -> PyResult<Vector<'py>> {
        let omega = in_order(&omega)?;
        let found = run_here(py, |_| {
            frequency::held_phase(HeldLoop::new(&self.inner)?, &omega)
        })?;
        Ok(found.into_pyarray(py))
    }

    /// ln(ρ)/Ts of a sampled loop, ρ its spectral radius.
    fn abscissa(&self, py: Python<'_>) -> PyResult<f64> {
        run_here(py, |task| HeldLoop::new(&self.inner)?.abscissa(task))
    }

    /// Margins of a sampled loop; the delay margin is NaN where it is not asked for.
    fn held_margins(&self, py: Python<'_>, delay_margin: bool) -> PyResult<PyMargins> {
        let found = run_here(py, |task| {
            frequency::held_margins(HeldLoop::new(&self.inner)?, delay_margin, task)
        })?;
        Ok(PyMargins::new(py, found))
    }

    /// The further delay in s with which a stable sampled loop loses stability, and the frequency.
    fn further_delay(&self, py: Python<'_>) -> PyResult<(f64, f64)> {
        run_here(py, |task| {
            frequency::further_delay(HeldLoop::new(&self.inner)?, task)
        })
    }
}

/// The response of a loop: read-only arrays of a `Response`, made when they are read.
#[pyclass(frozen, module = "deadtime._deadtime", name = "LoopResponse")]
pub(crate) struct PyLoopResponse {
    time: Vec<f64>,
    output_lead: f64,
    reference_before: f64,
    jumps: Jumps,
    found: Response,
}

impl PyLoopResponse {
    fn request(&self) -> Request<'_> {
        let (reference_time, reference) = match &self.jumps {
            Jumps::AtStart(value) => {
                let start = self.time.get(..1).unwrap_or_default();
                (start, &slice::from_ref(value)[..start.len()])
            }
            Jumps::Later(times, values) => (&times[..], &values[..]),
        };
        Request {
            time: &self.time,
            output_lead: self.output_lead,
            reference_before: self.reference_before,
            reference_time,
            reference,
        }
    }
}

#[pymethods]
impl PyLoopResponse {
    /// The first of the times.
    #[getter]
    fn start(&self) -> Option<f64> {
        self.time.first().copied()
    }

    #[getter]
    fn time<'py>(this: &Bound<'py, Self>) -> Vector<'py> {
        part_of(this, |response| &response.time[..])
    }

    #[getter]
    fn outputs<'py>(this: &Bound<'py, Self>) -> Vector<'py> {
        part_of(this, |response| &response.found.outputs[..])
    }

    #[getter]
    fn inputs<'py>(this: &Bound<'py, Self>) -> Vector<'py> {
        part_of(this, |response| &response.found.inputs[..])
    }

    #[getter]
    fn breaks<'py>(&self, py: Python<'py>) -> PyResult<Vector<'py>> {
        let found = converted(self.found.breaks(&self.request()))?;
        Ok(frozen(py, found))
    }

    #[getter]
    fn reference<'py>(&self, py: Python<'py>) -> PyResult<Vector<'py>> {
        let found = converted(self.request().reference_at_times())?;
        Ok(frozen(py, found))
    }
}

/// Times since the start of a run at `start`, moved onto samples they miss by rounding only.
#[pyfunction]
pub(crate) fn on_samples<'py>(
    py: Python<'py>,
    since: Floats<'py>,
    start: f64,
    sample_time: f64,
    sample_phase: f64,
) -> PyResult<Vector<'py>> {
    let sample = Some((sample_time, sample_phase));
    let moved = column(&in_order(&since)?, |&t| on_sample(t, start, sample))?;
    Ok(moved.into_pyarray(py))
}

/// A held command within limits of its rate and of the rate of that, as one that is held: times and
/// commands, `parts` of them for each that is given but the last.
#[pyfunction]
pub(crate) fn rate_limited<'py>(
    py: Python<'py>,
    time: Floats<'py>,
    command: Floats<'py>,
    rate: f64,
    rate_of_rate: f64,
) -> PyResult<(Vector<'py>, Vector<'py>)> {
    let (time, command) = (owned(&time)?, owned(&command)?);
    let limits = converted(RateLimits::new(rate, rate_of_rate))?;
    let (times, held) = run_here(py, |_| limits.held(&time, &command, RateLimits::PIECES))?;
    Ok((times.into_pyarray(py), held.into_pyarray(py)))
}
