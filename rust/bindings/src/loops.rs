//! Bindings of `deadtime::loops`.
//!
//! One class has every question that a loop answers, and its methods have to stand in one block: one file.

use std::sync::OnceLock;

use deadtime::Error;
use deadtime::dde::fixed_step::{self, Rest};
use deadtime::dde::{Criteria, Request};
use deadtime::loops::{
    ControlLoop, Controller, Each, Extra, Extras, Factors, Fraction, GivenPlant, HeldPlane, Input,
    Kind, Monomial, Path, Place, Plant, Rule, SampledFilter, SlopesAsked, SweptLoops, SweptMetrics,
    Symbol, Values, first_duration as duration,
};
use numpy::{
    IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arrays::{column, converted, in_order, owned};
use crate::dde::{LoopRun, PyLinearLoop};
use crate::fixed_step::{FixedStepResponse, FixedStepSettings};
use crate::inputs::drive;
use crate::quasipoly::QuasiPolynomial;
use crate::runtime::{run, run_attached, run_here};
use crate::stability::{
    ByName, MapBoundary, MapCells, MapQuestion, cells_of, curves_of, specification,
};

type Floats<'py> = PyReadonlyArrayDyn<'py, f64>;
type Vector<'py> = Bound<'py, PyArray1<f64>>;
type Pair<'py> = (Bound<'py, QuasiPolynomial>, Bound<'py, QuasiPolynomial>);

/// The form of a plant: `names` of its numbers; `num` and `den` of its factors, or the quasi-polynomials
/// of a plant with delays inside, or neither where its polynomials are given with its numbers.
#[derive(FromPyObject)]
pub(crate) struct PlantForm<'py> {
    names: Vec<String>,
    num: Option<Vec<f64>>,
    den: Option<Vec<f64>>,
    lags: usize,
    has_zero: bool,
    has_pair: bool,
    delayed: Option<Pair<'py>>,
}

impl PlantForm<'_> {
    fn read(self) -> (Plant, Vec<String>) {
        let plant = match (self.delayed, self.num, self.den) {
            (Some((num, den)), ..) => {
                Plant::Delayed(num.get().core.clone(), den.get().core.clone())
            }
            (None, Some(num), Some(den)) => Plant::Factors(Factors {
                num,
                den,
                lags: self.lags,
                has_zero: self.has_zero,
                has_pair: self.has_pair,
            }),
            _ => Plant::Given,
        };
        (plant, self.names)
    }
}

/// The form of a controller: its kind, whether its derivative is filtered, and the rule of a filter that
/// runs on samples.
#[derive(FromPyObject)]
pub(crate) struct ControllerForm {
    kind: String,
    is_filtered: bool,
    rule: Option<String>,
    /// The names of further numbers: weights, feed-forward, tracking time.
    extras: Vec<String>,
    stops: bool,
}

impl ControllerForm {
    fn read(&self) -> PyResult<Controller> {
        let unknown =
            |name: &str| PyValueError::new_err(format!("the part {name:?} does not exist"));
        let rule = match self.rule.as_deref() {
            Some(name) => Some(Rule::named(name).ok_or_else(|| unknown(name))?),
            None => None,
        };
        let mut extras = Extras::default();
        for name in &self.extras {
            extras = extras.with(Extra::named(name).ok_or_else(|| unknown(name))?);
        }
        Ok(Controller {
            kind: Kind::named(&self.kind).ok_or_else(|| unknown(&self.kind))?,
            is_filtered: self.is_filtered,
            rule,
            extras,
            stops: self.stops,
        })
    }
}

/// The greatest command, also of the modulus where there is no least one; the least; and the greatest
/// rate.
#[derive(FromPyObject)]
pub(crate) struct CommandBounds {
    limit: Option<f64>,
    low: Option<f64>,
    rate: Option<f64>,
}

/// One number for all loops, or one for each.
#[derive(FromPyObject)]
pub(crate) enum Entry<'py> {
    Shared(f64),
    Own(Floats<'py>),
}

impl Entry<'_> {
    fn read(&self) -> PyResult<Each> {
        Ok(match self {
            Self::Shared(number) => Each::from(*number),
            Self::Own(numbers) => Each::from(owned(numbers)?),
        })
    }
}

/// Numerator and denominator in any entries.
pub(crate) type Given<T> = (Vec<T>, Vec<T>);

/// Coefficient, powers of the numbers, power of s, and the delay as a constant and slopes.
type ListedTerm = (f64, Vec<u32>, u32, f64, Vec<f64>);

/// A factor and the powers of free numbers.
type Monomials = Vec<(f64, Vec<u32>)>;

fn fraction<T, S>(given: Given<T>, read: impl Fn(T) -> PyResult<S>) -> PyResult<Fraction<S>> {
    let read = |list: Vec<T>| list.into_iter().map(&read).collect::<PyResult<Vec<S>>>();
    Ok(Fraction {
        num: read(given.0)?,
        den: read(given.1)?,
    })
}

fn symbols(given: Given<Monomials>) -> PyResult<Fraction<Symbol>> {
    fraction(given, |monomials: Monomials| {
        let monomials = monomials.into_iter();
        let listed = monomials.map(|(factor, powers)| Monomial { factor, powers });
        Ok(Symbol(listed.collect()))
    })
}

/// Do work that asks a function of Python for the polynomials of a plant.
fn with_polynomials<T>(
    given: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&mut dyn FnMut(&[f64]) -> Result<Fraction<f64>, Error>) -> PyResult<T>,
) -> PyResult<T> {
    let mut failure = None;
    let mut polynomials = |numbers: &[f64]| {
        let found = match given {
            Some(given) => given
                .call1((numbers.to_vec(),))
                .and_then(|found| found.extract::<Given<f64>>()),
            None => Err(PyValueError::new_err(
                "the polynomials of this plant are missing",
            )),
        };
        found
            .map(|(num, den)| Fraction { num, den })
            .map_err(|error| {
                failure = Some(error);
                Error::Caller
            })
    };
    let found = work(&mut polynomials);
    match failure {
        Some(error) => Err(error),
        None => found,
    }
}

/// A loop: plant, controller and paths, with its numbers.
#[pyclass(frozen, module = "deadtime._deadtime", name = "Loop")]
pub(crate) struct PyLoop {
    inner: ControlLoop,
    linear: OnceLock<Py<PyLinearLoop>>,
}

impl PyLoop {
    fn of(inner: ControlLoop) -> Self {
        Self {
            inner,
            linear: OnceLock::new(),
        }
    }

    pub(crate) fn core(&self) -> &ControlLoop {
        &self.inner
    }

    fn places(&self, names: &[String]) -> PyResult<Vec<Place>> {
        let places = names.iter().map(|name| self.inner.place(name));
        converted(places.collect())
    }

    /// Work with many loops whose numbers differ.
    pub(crate) fn swept<T>(
        &self,
        sets: &LoopSets<'_>,
        work: impl FnOnce(&SweptLoops<'_>) -> PyResult<T>,
    ) -> PyResult<T> {
        let mut moving = Vec::new();
        for (name, values) in sets.values.items() {
            moving.push((converted(self.inner.place(name))?, owned(values)?));
        }
        let read = |list: &[Entry<'_>]| list.iter().map(Entry::read).collect::<PyResult<_>>();
        let given = match &sets.given {
            Some((num, den)) => Some(Fraction {
                num: read(num)?,
                den: read(den)?,
            }),
            None => None,
        };
        let size = (sets.size, sets.amplitude);
        work(&converted(SweptLoops::new(
            &self.inner,
            moving,
            given,
            size,
        ))?)
    }
}

/// Many loops: the numbers that differ, one for each, and the step of their reference.
#[derive(FromPyObject)]
pub(crate) struct LoopSets<'py> {
    values: ByName<Floats<'py>>,
    given: Option<(Vec<Entry<'py>>, Vec<Entry<'py>>)>,
    size: usize,
    amplitude: f64,
}

/// Metrics of step responses, a row a metric; what became of each loop; the longest response, s.
#[pyclass(frozen, get_all, module = "deadtime._deadtime")]
pub(crate) struct SweepMetrics {
    metrics: Py<PyArray2<f64>>,
    status: Py<PyArray1<u8>>,
    span: f64,
}

/// Step responses from rest, a row a loop, and what became of each.
#[pyclass(frozen, get_all, module = "deadtime._deadtime")]
pub(crate) struct SweepResponses {
    outputs: Py<PyArray2<f64>>,
    status: Py<PyArray1<u8>>,
}

/// Derivatives of outputs and inputs by parameters, a row a parameter.
#[pyclass(frozen, get_all, module = "deadtime._deadtime")]
pub(crate) struct LoopSensitivities {
    outputs: Py<PyArray2<f64>>,
    inputs: Py<PyArray2<f64>>,
}

#[pymethods]
impl PyLoop {
    #[new]
    #[pyo3(signature = (plant, controller, numbers, *, delay, sample_time, bounds, is_measured, given=None))]
    #[expect(clippy::too_many_arguments, reason = "keywords of the Python call")]
    fn new(
        plant: PlantForm<'_>,
        controller: ControllerForm,
        numbers: (Vec<f64>, Vec<f64>),
        delay: f64,
        sample_time: Option<f64>,
        bounds: CommandBounds,
        is_measured: bool,
        given: Option<Given<f64>>,
    ) -> PyResult<Self> {
        let (plant, names) = plant.read();
        let values = Values {
            plant: numbers.0,
            controller: numbers.1,
            delay,
            sample_time,
            limit: bounds.limit,
            low: bounds.low,
            rate: bounds.rate,
            given: given.map(|(num, den)| Fraction { num, den }),
        };
        let path = if is_measured {
            Path::Measurement
        } else {
            Path::Command
        };
        let made = ControlLoop::new(plant, names, controller.read()?, values, path);
        converted(made).map(Self::of)
    }

    /// The same loop with other numbers; `given` are the polynomials of a plant that is given by them.
    #[pyo3(signature = (numbers, given=None))]
    fn at(&self, numbers: ByName<f64>, given: Option<Given<f64>>) -> PyResult<Self> {
        let mut values = self.inner.values().clone();
        for (name, value) in numbers.items() {
            values.set(converted(self.inner.place(name))?, *value);
        }
        if let Some((num, den)) = given {
            values.given = Some(Fraction { num, den });
        }
        Ok(Self::of(self.inner.with(values)))
    }

    /// The same loop with other numbers, many times.
    fn at_each(
        &self,
        numbers: Vec<ByName<f64>>,
        given: Vec<Option<Given<f64>>>,
    ) -> PyResult<Vec<Self>> {
        let each = numbers.into_iter().zip(given);
        each.map(|(numbers, given)| self.at(numbers, given))
            .collect()
    }

    /// Raise where the parts do not fit.
    fn check(&self) -> PyResult<()> {
        let values = self.inner.values();
        converted(self.inner.equations(values, Input::Reference, None)).map(|_| ())
    }

    /// The loop as the steppers take it.
    #[getter]
    fn linear(&self, py: Python<'_>) -> PyResult<Py<PyLinearLoop>> {
        if let Some(known) = self.linear.get() {
            return Ok(known.clone_ref(py));
        }
        let linear = converted(self.inner.linear(Input::Reference))?;
        let made = Py::new(py, PyLinearLoop::of(linear, self.inner.output_lead()))?;
        Ok(self.linear.get_or_init(|| made).clone_ref(py))
    }

    /// Output and command at rest under a unit reference, limit left out; NaN without such a rest.
    fn rest_gains(&self) -> PyResult<(f64, f64)> {
        converted(self.inner.rest_gains())
    }

    /// The state in which the loop rests, and the command that holds it there.
    fn rest<'py>(
        &self,
        py: Python<'py>,
        output: f64,
        reference: f64,
    ) -> PyResult<(Vector<'py>, f64)> {
        let values = self.inner.values();
        let start = converted(self.inner.start_at_rest(values, output, reference))?;
        Ok((start.state.into_pyarray(py), start.command))
    }

    /// Upper bound in s on 1/|root| of plant and controller, except for roots at zero.
    fn slowest_time(&self) -> PyResult<f64> {
        converted(self.inner.slowest_time())
    }

    /// The characteristic function.
    fn characteristic(&self) -> PyResult<QuasiPolynomial> {
        converted(self.inner.characteristic()).map(|core| QuasiPolynomial { core })
    }

    /// Numerator and denominator of the loop gain.
    fn gain(&self) -> PyResult<(QuasiPolynomial, QuasiPolynomial)> {
        let (num, den) = converted(self.inner.loop_gain())?;
        Ok((QuasiPolynomial { core: num }, QuasiPolynomial { core: den }))
    }

    /// Numerators of the transfer functions from an input (`reference`, `load`, `output` or `noise`) to
    /// output and command, over the characteristic function.
    fn transfer(&self, of: &str) -> PyResult<(QuasiPolynomial, QuasiPolynomial)> {
        let [output, command] = converted(self.inner.from_input(drive(of)?))?;
        Ok((
            QuasiPolynomial { core: output },
            QuasiPolynomial { core: command },
        ))
    }

    /// The terms of the characteristic function with these numbers free: coefficient, powers of the
    /// numbers, power of s, and the delay as a constant and a slope for each number.
    #[pyo3(signature = (names, given=None))]
    fn terms(
        &self,
        names: Vec<String>,
        given: Option<Given<Monomials>>,
    ) -> PyResult<Vec<ListedTerm>> {
        let places = self.places(&names)?;
        let mut values = self.inner.free(&places);
        values.given = given.map(symbols).transpose()?;
        let terms = converted(self.inner.terms(&places, &values))?;
        let listed = terms.into_iter().map(|term| {
            let delay = term.delay;
            (
                term.coefficient,
                term.exponents,
                term.power,
                delay.constant,
                delay.slopes,
            )
        });
        Ok(listed.collect())
    }

    /// A map over the points of two numbers; `given` finds the polynomials of a plant that is given by
    /// its numbers.
    #[pyo3(signature = (axes, given=None))]
    fn plane(
        &self,
        axes: ByName<Floats<'_>>,
        given: Option<Bound<'_, PyAny>>,
    ) -> PyResult<PyHeldPlane> {
        let names: Vec<String> = axes.items().map(|(name, _)| name.clone()).collect();
        let points = axes.values().map(in_order).collect::<PyResult<Vec<_>>>()?;
        let ([first, second], [x, y]) = (&self.places(&names)?[..], &points[..]) else {
            return Err(PyValueError::new_err(format!(
                "a map has two axes, but {} were given",
                names.len()
            )));
        };
        let axes = [(*first, &x[..]), (*second, &y[..])];
        let made = with_polynomials(given.as_ref(), |polynomials| {
            converted(HeldPlane::new(&self.inner, axes, polynomials))
        })?;
        Ok(PyHeldPlane {
            inner: made,
            names,
            shape: [x.len(), y.len()],
        })
    }

    /// The stable range of a number around its present value; of a plant that is given by its
    /// polynomials, these with the number free, or what finds them.
    #[pyo3(signature = (name, free=None, given=None))]
    fn stable_range(
        &self,
        py: Python<'_>,
        name: &str,
        free: Option<Given<Monomials>>,
        given: Option<Bound<'_, PyAny>>,
    ) -> PyResult<(f64, f64)> {
        let place = converted(self.inner.place(name))?;
        let free = free.map(symbols).transpose()?;
        with_polynomials(given.as_ref(), |at| {
            run_attached(py, |task| {
                self.inner
                    .stable_range(place, GivenPlant { free, at }, task)
            })
        })
    }

    /// Outputs with other numbers at times after a rest at `initial_output`, under references that hold from
    /// their times on; `given` as in `at`.
    #[pyo3(signature = (numbers, time, reference, reference_time, initial_output, *, command_history, sample_phase, given=None))]
    #[expect(clippy::too_many_arguments, reason = "keywords of the Python call")]
    fn outputs<'py>(
        &self,
        py: Python<'py>,
        numbers: ByName<f64>,
        time: Floats<'_>,
        reference: Floats<'_>,
        reference_time: Floats<'_>,
        initial_output: f64,
        command_history: Floats<'_>,
        sample_phase: f64,
        given: Option<Given<f64>>,
    ) -> PyResult<Vector<'py>> {
        let changed = self.at(numbers, given)?.inner;
        let (time, reference) = (in_order(&time)?, in_order(&reference)?);
        let (reference_time, history) = (in_order(&reference_time)?, owned(&command_history)?);
        let asked = Request {
            time: &time,
            output_lead: changed.output_lead(),
            reference_before: initial_output,
            reference_time: &reference_time,
            reference: &reference,
        };
        let found = run_here(py, |task| {
            changed.outputs_after_rest(initial_output, (history, sample_phase), &asked, task)
        })?;
        Ok(found.into_pyarray(py))
    }

    /// Derivatives of outputs and inputs by numbers of the loop, at times since the start of the run;
    /// `rest` are output and reference before it, `given` value and slope of the polynomials of a plant
    /// that is given by them, for each number.
    #[pyo3(signature = (names, run, rest, output_time, input_time, given=None))]
    #[expect(clippy::too_many_arguments, reason = "keywords of the Python call")]
    fn sensitivities(
        &self,
        py: Python<'_>,
        names: Vec<String>,
        run: LoopRun<'_>,
        rest: (f64, f64),
        output_time: Floats<'_>,
        input_time: Floats<'_>,
        given: Option<Vec<Given<(f64, f64)>>>,
    ) -> PyResult<LoopSensitivities> {
        let places = self.places(&names)?;
        let dual = |(value, slope)| Ok(deadtime::dde::Dual::new(value, slope));
        let given = given.unwrap_or_default().into_iter();
        let given = given
            .map(|given| fraction(given, dual))
            .collect::<PyResult<Vec<_>>>()?;
        let (output_times, input_times) = (in_order(&output_time)?, in_order(&input_time)?);
        let (reference, history) = (run.reference()?, run.command_history()?);
        let asked = SlopesAsked {
            rest,
            command_history: &history,
            sample_phase: run.sample_phase,
            output_times: &output_times,
            input_times: &input_times,
        };
        let (outputs, inputs) = run_here(py, |task| {
            self.inner
                .sensitivities(&places, &given, &asked, &reference, task)
        })?;
        let table = |values: Vec<f64>, times: usize| {
            let table = values.into_pyarray(py).reshape([places.len(), times])?;
            Ok::<_, PyErr>(table.unbind())
        };
        Ok(LoopSensitivities {
            outputs: table(outputs, output_times.len())?,
            inputs: table(inputs, input_times.len())?,
        })
    }

    /// Run the loop in fixed steps.
    fn fixed_step(
        &self,
        py: Python<'_>,
        run: LoopRun<'_>,
        settings: FixedStepSettings<'_>,
    ) -> PyResult<FixedStepResponse> {
        let blocks = converted(self.inner.blocks())?;
        let rest = Rest {
            state: run.state()?,
            output: settings.initial_output,
            command: run.command,
        };
        let driven = settings.driven(run.reference()?)?;
        let settings = settings.read()?;
        let (outputs, inputs) = run_here(py, |task| {
            fixed_step::run(&blocks, &settings, &rest, &driven, task)
        })?;
        Ok(FixedStepResponse {
            outputs: outputs.into_pyarray(py).unbind(),
            inputs: inputs.into_pyarray(py).unbind(),
        })
    }

    /// Measure step responses over `span` seconds, or without that until they have settled.
    #[pyo3(signature = (sets, *, span, settling, rise, threads=None, progress=None))]
    #[expect(
        clippy::too_many_arguments,
        reason = "keywords with the names of the public function"
    )]
    fn sweep_metrics(
        &self,
        py: Python<'_>,
        sets: LoopSets<'_>,
        span: Option<f64>,
        settling: f64,
        rise: (f64, f64),
        threads: Option<usize>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<SweepMetrics> {
        let criteria = Criteria { rise, settling };
        let found = self.swept(&sets, |swept| {
            run(py, threads, progress.as_ref(), |task| {
                swept.measured(span, &criteria, task)
            })
        })?;
        let status = column(&found.outcomes, |outcome| *outcome as u8)?;
        let shape = [SweptMetrics::METRICS, status.len()];
        Ok(SweepMetrics {
            span: found.span,
            metrics: found
                .into_metrics()
                .into_pyarray(py)
                .reshape(shape)?
                .unbind(),
            status: status.into_pyarray(py).unbind(),
        })
    }

    /// Whether a simulated response stays in the band in which it is since `settled`, s; `command` is
    /// that at rest without limits, NaN without a rest.
    fn stays_settled(
        &self,
        py: Python<'_>,
        times: Floats<'_>,
        commands: Floats<'_>,
        command: f64,
        settled: f64,
    ) -> PyResult<bool> {
        let (times, commands) = (in_order(&times)?, in_order(&commands)?);
        run_here(py, |task| {
            self.inner
                .stays_settled(&times, &commands, command, settled, task)
        })
    }

    /// Step responses at times after the start.
    #[pyo3(signature = (sets, time, *, threads=None, progress=None))]
    fn sweep_responses(
        &self,
        py: Python<'_>,
        sets: LoopSets<'_>,
        time: Floats<'_>,
        threads: Option<usize>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<SweepResponses> {
        let times = in_order(&time)?;
        let (outputs, found) = self.swept(&sets, |swept| {
            run(py, threads, progress.as_ref(), |task| {
                swept.responses(&times, task)
            })
        })?;
        let status = column(&found, |outcome| *outcome as u8)?;
        let shape = [found.len(), times.len()];
        Ok(SweepResponses {
            outputs: outputs.into_pyarray(py).reshape(shape)?.unbind(),
            status: status.into_pyarray(py).unbind(),
        })
    }
}

/// A map of a sampled loop over two of its numbers.
#[pyclass(frozen, module = "deadtime._deadtime", name = "HeldPlane")]
pub(crate) struct PyHeldPlane {
    inner: HeldPlane,
    names: Vec<String>,
    shape: [usize; 2],
}

#[pymethods]
impl PyHeldPlane {
    /// Counts, abscissas (if asked for) and statuses of all cells.
    #[pyo3(signature = (question, *, threads=None, progress=None))]
    fn cells(
        &self,
        py: Python<'_>,
        question: MapQuestion,
        threads: Option<usize>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<MapCells> {
        let question: deadtime::stability::Question = question.into();
        let found = run(py, threads, progress.as_ref(), |task| {
            self.inner.cells(question, task)
        })?;
        cells_of(py, found, question.abscissa, self.shape)
    }

    /// The curves on which poles lie on the edge of stability, along each gain of the axes.
    fn boundaries(
        &self,
        py: Python<'_>,
        decay: f64,
        damping: Option<(f64, f64)>,
    ) -> PyResult<Vec<MapBoundary>> {
        let specification = specification(decay, damping);
        let found = run(py, None, None, |task| {
            self.inner.boundaries(specification, task)
        })?;
        let mut curves = Vec::new();
        for part in &found {
            curves.extend(curves_of(
                py,
                self.names.get(part.along).map_or("", String::as_str),
                &part.curves,
            )?);
        }
        Ok(curves)
    }
}

/// Numerator and denominator of a plant by its factors, descending.
#[pyfunction]
pub(crate) fn plant_polynomials(
    plant: PlantForm<'_>,
    numbers: Vec<f64>,
) -> PyResult<(Vec<f64>, Vec<f64>)> {
    let (plant, _) = plant.read();
    let found = converted(plant.fraction(&numbers, None))?;
    Ok((found.num, found.den))
}

/// A, B and D of the observable canonical form of num/den (descending), and with `output` the state in
/// which it rests and the command that holds it there.
#[pyfunction]
#[pyo3(signature = (num, den, output=0.0))]
#[expect(clippy::type_complexity, reason = "a tuple of arrays for Python")]
pub(crate) fn canonical_form<'py>(
    py: Python<'py>,
    num: Vec<f64>,
    den: Vec<f64>,
    output: f64,
) -> PyResult<(
    Bound<'py, PyArray2<f64>>,
    Vector<'py>,
    f64,
    Vector<'py>,
    f64,
)> {
    let fraction = Fraction { num, den };
    let space = converted(fraction.state_space())?;
    let (state, command) = converted(fraction.rest(&space, output))?;
    let n = space.b.len();
    Ok((
        space.a.into_pyarray(py).reshape([n, n])?,
        space.b.into_pyarray(py),
        space.d,
        state.into_pyarray(py),
        command,
    ))
}

/// Numerator and denominator of the feedback of a controller, descending.
#[pyfunction]
pub(crate) fn feedback_polynomials(
    controller: ControllerForm,
    numbers: Vec<f64>,
) -> PyResult<(Vec<f64>, Vec<f64>)> {
    Ok(controller.read()?.feedback(&numbers))
}

/// Fd, Gd, Cd and Dd of the filter x' = F x + G v, d = C x on samples.
#[pyfunction]
pub(crate) fn sampled_filter<'py>(
    py: Python<'py>,
    f: Floats<'py>,
    g: Floats<'py>,
    c: Floats<'py>,
    sample_time: f64,
    rule: &str,
) -> PyResult<(Bound<'py, PyArray2<f64>>, Vector<'py>, Vector<'py>, f64)> {
    let (f, g, c) = (in_order(&f)?, in_order(&g)?, in_order(&c)?);
    let rule = Rule::named(rule).ok_or_else(|| {
        PyValueError::new_err(format!(
            "method={rule:?}: give 'hold', 'tustin' or 'backward'"
        ))
    })?;
    let n = g.len();
    let found = converted(SampledFilter::new(&f, &g, &c, sample_time, rule))?;
    Ok((
        found.f.into_pyarray(py).reshape([n, n])?,
        found.g.into_pyarray(py),
        found.c.into_pyarray(py),
        found.d,
    ))
}

/// First duration of a step response in s, by its longest delay and the poles of A.
#[pyfunction]
pub(crate) fn first_duration(a: Floats<'_>, delay: f64) -> PyResult<f64> {
    let side = a.shape().first().copied().unwrap_or(0);
    converted(duration(&in_order(&a)?, side, delay))
}
