//! Bindings of least squares on simulated loops.
//!
//! Its classes are short, and share what they read from Python and give to it: one file.

use std::collections::HashMap;

use deadtime::estimation::{
    self as core, Chebyshev, ClosedLoop, Fitted, FittedNumber, HeldPath, Joint, Minimum, Part,
    PeriodicLines, Plain, RecordLines, Rounded, Simulated, Vanishing,
};
use deadtime::loops::Fraction;
use deadtime::{Error, Task};
use numpy::{
    IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods,
};
use pyo3::exceptions::{PyKeyError, PyValueError};
use pyo3::prelude::*;

use crate::arrays::{converted, in_order, owned};
use crate::calls::Calls;
use crate::commanded::{CommandedMisfit, RoundedPeak, RoundedReadings};
use crate::loops::{Given, PyLoop};
use crate::runtime::run_attached;

type Floats<'py> = PyReadonlyArrayDyn<'py, f64>;
type Vector<'py> = Bound<'py, PyArray1<f64>>;
type Matrix<'py> = Bound<'py, PyArray2<f64>>;

/// Time stamps, reference, output and commands before the window; time between two rows, size of the
/// excitation, and bound of the misfit.
type SimulatedRows<'py> = ([Floats<'py>; 4], [f64; 3]);

/// Misfit of a simulated loop.
#[pyclass(frozen, module = "deadtime._deadtime")]
pub(crate) struct LoopMisfit {
    inner: ClosedLoop,
    polynomials: Option<Py<PyAny>>,
}

#[pymethods]
impl LoopMisfit {
    #[new]
    #[pyo3(signature = (control, rows, names, start, *, is_smooth, polynomials=None))]
    fn new(
        control: &PyLoop,
        rows: SimulatedRows<'_>,
        names: Vec<String>,
        start: Option<f64>,
        is_smooth: bool,
        polynomials: Option<Py<PyAny>>,
    ) -> PyResult<Self> {
        let control = control.core().clone();
        let ([time, reference, output, past], [row, size, bound]) = rows;
        let mut numbers = Vec::new();
        for name in &names {
            numbers.push(match name.as_str() {
                "start" => FittedNumber::Start,
                "lag" => FittedNumber::Lag(converted(control.place(name))?),
                _ => FittedNumber::Other(converted(control.place(name))?),
            });
        }
        Ok(Self {
            inner: ClosedLoop {
                control,
                time: owned(&time)?,
                reference: owned(&reference)?,
                output: owned(&output)?,
                past: owned(&past)?,
                numbers,
                start,
                row,
                size,
                bound,
                is_smooth,
            },
            polynomials,
        })
    }
}

/// Misfit of a loop whose delay is approximated by a polynomial.
#[pyclass(frozen, module = "deadtime._deadtime")]
pub(crate) struct ChebyshevMisfit {
    inner: Chebyshev,
}

#[pymethods]
impl ChebyshevMisfit {
    /// `names` are those of the numbers that are fitted, `known` has gain, lag and Kp.
    #[new]
    #[pyo3(signature = (time, output, steps, *, names, known, start, intervals, is_late, units))]
    #[expect(clippy::too_many_arguments, reason = "keywords of the Python call")]
    fn new(
        time: Floats<'_>,
        output: Floats<'_>,
        steps: Vec<(f64, f64)>,
        names: Vec<String>,
        known: HashMap<String, f64>,
        start: Option<f64>,
        intervals: usize,
        is_late: bool,
        units: Vec<f64>,
    ) -> PyResult<Self> {
        Ok(Self {
            inner: Chebyshev {
                time: owned(&time)?,
                output: owned(&output)?,
                steps,
                known: known_beside(&known, &names, ["delay", "gain", "lag", "Kp"])?,
                places: places(&names, ["delay", "gain", "lag"])?,
                start,
                intervals,
                is_late,
                units,
            },
        })
    }
}

/// Misfit at the lines of a spectrum.
#[pyclass(frozen, module = "deadtime._deadtime")]
pub(crate) struct LinesMisfit {
    inner: Lines,
}

#[derive(Clone)]
enum Lines {
    Record(RecordLines),
    Periodic(PeriodicLines),
}

/// Names of the numbers that are fitted, delay, gain and lag by name, and the time between two rows.
type LineNumbers = (Vec<String>, HashMap<String, f64>, f64);

fn plain((names, known, row): LineNumbers) -> PyResult<Plain> {
    let numbers = ["delay", "gain", "lag"];
    Ok(Plain {
        known: known_beside(&known, &names, numbers)?,
        places: places(&names, numbers)?,
        row,
    })
}

/// The numbers that are known, zero for those that are fitted.
fn known_beside<const N: usize>(
    known: &HashMap<String, f64>,
    names: &[String],
    of: [&str; N],
) -> PyResult<[f64; N]> {
    let mut out = [0.0; N];
    for (value, name) in out.iter_mut().zip(of) {
        *value = match known.get(name) {
            Some(own) => *own,
            None if names.iter().any(|fitted| fitted == name) => 0.0,
            None => return Err(PyKeyError::new_err(name.to_owned())),
        };
    }
    Ok(out)
}

/// The places of numbers among those that are fitted, which have no others.
pub(crate) fn places<const N: usize>(
    names: &[String],
    of: [&str; N],
) -> PyResult<[Option<usize>; N]> {
    match names.iter().find(|name| !of.contains(&name.as_str())) {
        Some(other) => Err(PyValueError::new_err(format!(
            "{other:?} cannot be fitted: the numbers are {}",
            of.join(", ")
        ))),
        None => Ok(of.map(|wanted| names.iter().position(|name| name == wanted))),
    }
}

#[pymethods]
impl LinesMisfit {
    /// Of one record under commands that hold from their times on: lines up to the last, or all.
    #[staticmethod]
    fn of_record(
        numbers: LineNumbers,
        commands: (Floats<'_>, Floats<'_>),
        time: Floats<'_>,
        output: Floats<'_>,
        last: Option<usize>,
    ) -> PyResult<Self> {
        Ok(Self {
            inner: Lines::Record(RecordLines {
                numbers: plain(numbers)?,
                path: HeldPath::new(owned(&commands.0)?, owned(&commands.1)?),
                time: owned(&time)?,
                output: owned(&output)?,
                last,
            }),
        })
    }

    /// Of whole periods of this many samples.
    #[staticmethod]
    fn of_periods(
        numbers: LineNumbers,
        command: Floats<'_>,
        output: Floats<'_>,
        samples: usize,
        lines: Vec<usize>,
    ) -> PyResult<Self> {
        let (command, output) = (in_order(&command)?, in_order(&output)?);
        let made = PeriodicLines::new(plain(numbers)?, &command, &output, samples, &lines);
        Ok(Self {
            inner: Lines::Periodic(made),
        })
    }
}

/// What gives the misfit of one recording.
enum Source {
    Loop(Py<LoopMisfit>),
    Lines(Py<LinesMisfit>),
    Chebyshev(Py<ChebyshevMisfit>),
    Commanded(Py<CommandedMisfit>),
    /// An object of Python with `misfit` and `jacobian`.
    Given(Py<PyAny>),
}

/// One recording: its misfit, rows, bounds, and the points at which searches start.
#[derive(FromPyObject)]
struct FittedPart<'py> {
    kernel: Bound<'py, PyAny>,
    length: usize,
    /// Low and high end of each parameter, and its values at the starts.
    every_end: Vec<(f64, f64, Vec<f64>)>,
}

/// Misfit and derivatives by methods of an object of Python.
struct Called<'a, 'py> {
    of: &'a Py<PyAny>,
    calls: &'a Calls<'py>,
}

impl Part for Called<'_, '_> {
    fn misfit(&self, point: &[f64], _: &Task) -> Result<Vec<f64>, Error> {
        let py = self.calls.py;
        let at = PyArray1::from_slice(py, point);
        self.calls.kept((|| {
            let found = self.of.bind(py).call_method1("misfit", (at,))?;
            owned(&found.extract::<Floats<'_>>()?)
        })())
    }

    fn slopes(&self, point: &[f64], _: &Task) -> Result<Vec<Vec<f64>>, Error> {
        let py = self.calls.py;
        let at = PyArray1::from_slice(py, point);
        self.calls.kept((|| {
            let found = self.of.bind(py).call_method1("jacobian", (at,))?;
            let rows = owned(&found.extract::<Floats<'_>>()?)?;
            let count = point.len();
            let column = |j: usize| rows[j..].iter().step_by(count).copied().collect();
            Ok((0..count).map(column).collect())
        })())
    }
}

/// Least squares over common parameters of recordings.
#[pyclass(frozen, module = "deadtime._deadtime")]
pub(crate) struct LeastSquares {
    sources: Vec<Source>,
    sizes: Vec<usize>,
    low: Vec<Vec<f64>>,
    high: Vec<Vec<f64>>,
    axes: Vec<Vec<Vec<f64>>>,
    weights: Vec<f64>,
    common: usize,
    /// The places of the delay and of a lag, which acts like it.
    delay: Option<usize>,
    lag: Option<usize>,
}

/// Where a sum of squares is least.
#[pyclass(frozen, get_all, module = "deadtime._deadtime")]
pub(crate) struct LeastSquaresMinimum {
    point: Py<PyArray1<f64>>,
    misfit: Py<PyArray1<f64>>,
    jacobian: Py<PyArray2<f64>>,
}

impl LeastSquaresMinimum {
    fn of(py: Python<'_>, found: Minimum) -> PyResult<Self> {
        let rows = found.misfit.len();
        Ok(Self {
            point: found.point.into_pyarray(py).unbind(),
            misfit: found.misfit.into_pyarray(py).unbind(),
            jacobian: table(py, found.slopes, rows)?.unbind(),
        })
    }
}

/// Point, misfit and derivatives.
type MinimumParts = (Py<PyArray1<f64>>, Py<PyArray1<f64>>, Py<PyArray2<f64>>);

/// Columns as the table of numpy.
fn table(py: Python<'_>, columns: Vec<Vec<f64>>, rows: usize) -> PyResult<Matrix<'_>> {
    let count = columns.len();
    let at = |place: usize| columns[place % count][place / count];
    let entries: Vec<f64> = (0..rows * count).map(at).collect();
    entries.into_pyarray(py).reshape([rows, count])
}

/// The columns of a table of numpy.
fn columns(matrix: &Floats<'_>) -> PyResult<Vec<Vec<f64>>> {
    let count = matrix.shape().get(1).copied().unwrap_or(0);
    let entries = owned(matrix)?;
    let column = |j: usize| entries[j..].iter().step_by(count).copied().collect();
    Ok((0..count).map(column).collect())
}

impl LeastSquares {
    fn with<T>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut Joint<'_>, &Task) -> Result<T, Error>,
    ) -> PyResult<T> {
        let calls = Calls::new(py);
        let polynomials: Vec<_> = self
            .sources
            .iter()
            .map(|source| polynomials_of(source, &calls))
            .collect();
        let parts = self.sources.iter().zip(&polynomials).enumerate();
        let parts = parts.map(|(index, (source, given))| {
            let part: Box<dyn Part + '_> = match source {
                Source::Loop(own) => Box::new(Simulated {
                    of: &own.get().inner,
                    given: given.as_deref(),
                }),
                Source::Lines(own) => match &own.get().inner {
                    Lines::Record(lines) => Box::new(lines.clone()),
                    Lines::Periodic(lines) => Box::new(lines.clone()),
                },
                Source::Chebyshev(own) => Box::new(own.get().inner.clone()),
                Source::Commanded(own) => Box::new(own.get().inner.clone()),
                Source::Given(of) => Box::new(Called { of, calls: &calls }),
            };
            Fitted {
                part,
                rows: self.sizes[index],
                low: self.low[index].clone(),
                high: self.high[index].clone(),
                axes: self.axes[index].clone(),
            }
        });
        let mut joint = Joint::new(parts.collect(), self.weights.clone(), self.common);
        joint.trade = self.delay.zip(self.lag);
        let found = run_attached(py, |task| work(&mut joint, task));
        calls.ended(found)
    }
}

type Finder<'a> = Box<dyn Fn(&[f64]) -> Result<Fraction<f64>, Error> + 'a>;

/// What finds the polynomials of a plant that is given by them.
fn polynomials_of<'a>(source: &'a Source, calls: &'a Calls<'_>) -> Option<Finder<'a>> {
    let Source::Loop(own) = source else {
        return None;
    };
    let given = own.get().polynomials.as_ref()?;
    Some(Box::new(move |numbers: &[f64]| {
        let (num, den) = calls.kept(
            given
                .bind(calls.py)
                .call1((numbers.to_vec(),))
                .and_then(|found| found.extract::<Given<f64>>()),
        )?;
        Ok(Fraction { num, den })
    }))
}

#[pymethods]
impl LeastSquares {
    #[new]
    fn new(parts: Vec<FittedPart<'_>>, weights: Vec<f64>, names: Vec<String>) -> PyResult<Self> {
        let [delay, lag] =
            ["delay", "lag"].map(|wanted| names.iter().position(|name| name == wanted));
        let mut made = Self {
            sources: Vec::new(),
            sizes: Vec::new(),
            low: Vec::new(),
            high: Vec::new(),
            axes: Vec::new(),
            weights,
            common: names.len(),
            delay,
            lag,
        };
        for part in parts {
            made.sources
                .push(if let Ok(own) = part.kernel.cast::<LoopMisfit>() {
                    Source::Loop(own.clone().unbind())
                } else if let Ok(own) = part.kernel.cast::<LinesMisfit>() {
                    Source::Lines(own.clone().unbind())
                } else if let Ok(own) = part.kernel.cast::<ChebyshevMisfit>() {
                    Source::Chebyshev(own.clone().unbind())
                } else if let Ok(own) = part.kernel.cast::<CommandedMisfit>() {
                    Source::Commanded(own.clone().unbind())
                } else {
                    Source::Given(part.kernel.unbind())
                });
            made.sizes.push(part.length);
            let ends = &part.every_end;
            made.low.push(ends.iter().map(|own| own.0).collect());
            made.high.push(ends.iter().map(|own| own.1).collect());
            made.axes
                .push(part.every_end.into_iter().map(|own| own.2).collect());
        }
        Ok(made)
    }

    /// The tightest bounds of the common parameters, then those of each recording.
    fn bounds<'py>(&self, py: Python<'py>) -> PyResult<(Vector<'py>, Vector<'py>)> {
        let (low, high) = self.with(py, |joint, _| Ok(joint.bounds()))?;
        Ok((low.into_pyarray(py), high.into_pyarray(py)))
    }

    /// Weighted residuals.
    fn misfit<'py>(&self, py: Python<'py>, point: Floats<'_>) -> PyResult<Vector<'py>> {
        let point = in_order(&point)?;
        let found = self.with(py, |joint, task| joint.misfit(&point, task))?;
        Ok(found.into_pyarray(py))
    }

    /// Their derivatives.
    fn jacobian<'py>(&self, py: Python<'py>, point: Floats<'_>) -> PyResult<Matrix<'py>> {
        let point = in_order(&point)?;
        let found = self.with(py, |joint, task| joint.slopes(&point, task))?;
        let rows = found.first().map_or(0, Vec::len);
        table(py, found, rows)
    }

    /// The lowest minimum from the best starting points.
    fn solve(&self, py: Python<'_>) -> PyResult<LeastSquaresMinimum> {
        let found = self.with(py, |joint, task| core::solve(joint, task))?;
        LeastSquaresMinimum::of(py, found)
    }

    /// Weights by what is left of each recording, iterated from `solve`, and the minimum with them.
    fn by_scatter(
        &self,
        py: Python<'_>,
        first: &LeastSquaresMinimum,
    ) -> PyResult<(Vec<f64>, LeastSquaresMinimum)> {
        let first = self.minimum(py, first)?;
        let (weights, found) = self.with(py, |joint, task| {
            let found = core::by_scatter(joint, &first, task)?;
            Ok((joint.weights.clone(), found))
        })?;
        Ok((weights, LeastSquaresMinimum::of(py, found)?))
    }

    /// The minimum with the delay and the lag at zero where that fits as well.
    fn without_vanishing(
        &self,
        py: Python<'_>,
        found: &LeastSquaresMinimum,
        size: f64,
    ) -> PyResult<LeastSquaresMinimum> {
        let found = self.minimum(py, found)?;
        let which = Vanishing {
            lag: self.lag,
            delay: self.delay,
            size,
        };
        let found = self.with(py, |joint, task| {
            core::without_vanishing(joint, found, which, task)
        })?;
        LeastSquaresMinimum::of(py, found)
    }

    /// Least sum of squares with the sum of the parameters at these places held.
    fn least_held(
        &self,
        py: Python<'_>,
        best: &LeastSquaresMinimum,
        places: Vec<usize>,
        value: f64,
    ) -> PyResult<f64> {
        let best = self.minimum(py, best)?;
        self.with(py, |joint, task| {
            core::least_held(joint, &best, &places, value, task)
        })
    }

    /// The likeliest parameters and noise of rounded rows, from a start, and their covariance.
    fn likeliest_rounded(
        &self,
        py: Python<'_>,
        readings: &RoundedReadings,
        start: Floats<'_>,
    ) -> PyResult<RoundedPeak> {
        let start = owned(&start)?;
        let (peak, cov) = self.with(py, |model, task| {
            let rounded = Rounded {
                model,
                readings: &readings.core,
            };
            let peak = rounded.likeliest(&start, task)?;
            let cov = rounded.covariance(&peak, task)?;
            Ok((peak, cov))
        })?;
        Ok(RoundedPeak { peak, cov })
    }

    /// The least −2 ln L of rounded rows with the sum of the parameters at these places held.
    fn rounded_held(
        &self,
        py: Python<'_>,
        readings: &RoundedReadings,
        peak: &RoundedPeak,
        places: Vec<usize>,
        value: f64,
    ) -> PyResult<f64> {
        self.with(py, |model, task| {
            let rounded = Rounded {
                model,
                readings: &readings.core,
            };
            rounded.held(&peak.peak, &places, value, task)
        })
    }

    /// Least costs at delays, which come first in a point, the places of local minima among them, and the
    /// lowest minimum; with the shortest lag where that fits as well, to `rounding`.
    fn scan<'py>(
        &self,
        py: Python<'py>,
        delays: Floats<'_>,
        guess: Floats<'_>,
        rounding: f64,
    ) -> PyResult<(Vector<'py>, Vec<usize>, LeastSquaresMinimum)> {
        let (delays, guess) = (owned(&delays)?, owned(&guess)?);
        let (costs, found) = self.with(py, |joint, task| {
            let scan = core::scan(joint, &delays, &guess, task)?;
            let found = core::refined(joint, &scan, self.lag, rounding, task)?;
            Ok((scan.costs, found))
        })?;
        let minima = core::local_minima(&costs);
        Ok((
            costs.into_pyarray(py),
            minima,
            LeastSquaresMinimum::of(py, found)?,
        ))
    }
}

impl LeastSquares {
    fn minimum(&self, py: Python<'_>, found: &LeastSquaresMinimum) -> PyResult<Minimum> {
        let vector = |array: &Py<PyArray1<f64>>| array.bind(py).to_vec();
        let jacobian: Floats<'_> = found.jacobian.bind(py).extract()?;
        Ok(Minimum {
            point: vector(&found.point)?,
            misfit: vector(&found.misfit)?,
            slopes: columns(&jacobian)?,
        })
    }
}

#[pymethods]
impl LeastSquaresMinimum {
    #[new]
    fn new(
        point: Py<PyArray1<f64>>,
        misfit: Py<PyArray1<f64>>,
        jacobian: Py<PyArray2<f64>>,
    ) -> Self {
        Self {
            point,
            misfit,
            jacobian,
        }
    }

    fn __getnewargs__(&self, py: Python<'_>) -> MinimumParts {
        (
            self.point.clone_ref(py),
            self.misfit.clone_ref(py),
            self.jacobian.clone_ref(py),
        )
    }

    /// Covariances of the parameters, for white residuals and for those with memory, of recordings of these
    /// sizes; zero for parameters that are not `loose`.
    fn spreads<'py>(
        &self,
        py: Python<'py>,
        loose: Vec<usize>,
        sizes: Vec<usize>,
    ) -> PyResult<[Matrix<'py>; 2]> {
        let jacobian: Floats<'_> = self.jacobian.bind(py).extract()?;
        let (every, misfit) = (columns(&jacobian)?, self.misfit.bind(py).to_vec()?);
        let count = every.len();
        let own: Vec<Vec<f64>> = loose.iter().map(|place| every[*place].clone()).collect();
        let white = core::white_covariance(&own, &misfit);
        let robust = core::robust_covariance(&own, &misfit, &sizes);
        let whole = |cov: &[f64]| {
            let found = core::embedded(cov, &loose, count).into_pyarray(py);
            found.reshape([count, count])
        };
        Ok([whole(&white)?, whole(&robust)?])
    }

    /// Sum of squares.
    #[getter]
    fn cost(&self, py: Python<'_>) -> PyResult<f64> {
        let misfit = self.misfit.bind(py).to_vec()?;
        Ok(misfit.iter().map(|x| x * x).sum())
    }
}
