//! Bindings of the family of plants of `deadtime::estimation`.

use deadtime::estimation::{
    Between, Candidate, Class, Family, FamilyNoise, Grade, Named, Question, Record,
    fit_family as fit, refine_family,
};
use numpy::{PyArray1, PyReadonlyArrayDyn};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{frozen, owned};
use crate::runtime::{run, run_here};

type Floats<'py> = PyReadonlyArrayDyn<'py, f64>;

type Array = Py<PyArray1<f64>>;

/// Kind, size, its error, time, record, lead, and rivals.
type NamedCause = (&'static str, f64, f64, f64, usize, f64, Vec<&'static str>);

/// One class of plants, fitted.
#[pyclass(frozen, get_all, module = "deadtime._deadtime")]
pub(crate) struct FamilyCandidate {
    plant: &'static str,
    integrating: bool,
    order: usize,
    has_zero: bool,
    names: Vec<&'static str>,
    values: Array,
    errors: Array,
    /// Row-major.
    covariance: Array,
    quantile: f64,
    dispersion: f64,
    complex_poles: bool,
    lags: Vec<f64>,
    pole_frequency: f64,
    pole_damping: f64,
    noise: &'static str,
    ar: Vec<f64>,
    ma: Vec<f64>,
    noise_std: f64,
    /// Of each record.
    noise_stds: Vec<f64>,
    innovation_std: f64,
    deviance: f64,
    bic: f64,
    parameters: usize,
    told: usize,
    whiteness: f64,
    /// Of each record.
    residuals: Vec<Array>,
    fitted: Vec<Array>,
    limit: &'static str,
}

impl FamilyCandidate {
    fn new(py: Python<'_>, one: &Candidate) -> Self {
        let array = |values: &[f64]| frozen(py, values.to_vec()).unbind();
        let poles = one.poles();
        let order = one.noise.order();
        Self {
            plant: one.class.name(),
            integrating: one.class.integrating,
            order: one.class.order,
            has_zero: one.class.has_zero,
            names: one.class.numbers(),
            values: array(&one.values),
            errors: array(&one.errors()),
            covariance: array(&one.covariance),
            quantile: one.quantile,
            dispersion: one.dispersion,
            complex_poles: one.numbers.are_complex(),
            lags: one.numbers.lags(),
            pole_frequency: poles.0,
            pole_damping: poles.1,
            noise: one.noise.name(),
            ar: one.coefficients.ar[..order].to_vec(),
            ma: one.coefficients.ma[..order].to_vec(),
            noise_std: one.deviation,
            noise_stds: one.deviations.clone(),
            innovation_std: one.innovation,
            deviance: one.deviance,
            bic: one.bic,
            parameters: one.parameters,
            told: one.told,
            whiteness: one.white,
            residuals: one.residuals.iter().map(|own| array(own)).collect(),
            fitted: one.fitted.iter().map(|own| array(own)).collect(),
            limit: one.limit.unwrap_or(""),
        }
    }
}

/// Delay, gain, real time constants, zero, frequency and damping of a pair of poles.
type PlantParts = (f64, f64, Vec<f64>, f64, Option<(f64, f64)>);

#[pymethods]
impl FamilyCandidate {
    /// The numbers of the plant with these values of `names`.
    fn plant_of(&self, values: Vec<f64>) -> PlantParts {
        let class = Class {
            integrating: self.integrating,
            order: self.order,
            has_zero: self.has_zero,
        };
        let (gain, own) = class.of_values(&values);
        (own.delay, gain, own.lags(), own.zero, own.pair())
    }
}

/// The family of plants fitted to a record.
#[pyclass(frozen, module = "deadtime._deadtime")]
pub(crate) struct FamilyFit {
    core: Family,
    omega: Vec<f64>,
    level: f64,
    #[pyo3(get)]
    candidates: Vec<Py<FamilyCandidate>>,
}

#[pymethods]
impl FamilyFit {
    #[getter]
    fn verdict(&self) -> &'static str {
        match self.core.verdict.grade {
            Grade::Reliable => "reliable",
            Grade::Indication => "indication",
            Grade::None => "none",
        }
    }

    #[getter]
    fn reason(&self) -> &'static str {
        self.core.verdict.reason
    }

    #[getter]
    fn reason_size(&self) -> f64 {
        self.core.verdict.size
    }

    #[getter]
    fn shift(&self) -> i64 {
        self.core.shift
    }

    #[getter]
    fn kind(&self) -> &'static str {
        if self.core.straight {
            "straight"
        } else {
            "held"
        }
    }

    #[getter]
    fn kind_decided(&self) -> bool {
        self.core.decided
    }

    /// What the plant lacks and is worth a name: name, size, its standard error, when it began (NaN: all the
    /// time), in which record, the BIC by which the records are explained better with it, and the names of others
    /// that explain them about as well.
    #[getter]
    fn causes(&self) -> Vec<NamedCause> {
        let causes = self.core.causes.iter().filter(|one| one.named);
        causes
            .map(|one| {
                let rivals = one.rivals.iter().map(|kind| kind.name());
                (
                    one.kind.name(),
                    one.size,
                    one.error,
                    one.time,
                    one.record,
                    one.lead,
                    rivals.collect(),
                )
            })
            .collect()
    }

    /// Rows that are no readings of the sensor: why, in which record, how many, from and to which time, and
    /// the mean age of repeated readings, s, or the length of a moving mean, rows.
    #[getter]
    fn sensor_faults(&self) -> Vec<(&'static str, usize, usize, f64, f64, f64)> {
        let faults = self.core.sensor.iter();
        faults
            .map(|one| {
                let (kind, rows) = (one.kind.name(), one.rows);
                (kind, one.record, rows, one.from, one.to, one.size)
            })
            .collect()
    }

    #[getter]
    fn rows(&self) -> usize {
        self.core.rows
    }

    #[getter]
    fn first_rows(&self) -> Vec<usize> {
        self.core.first_rows.clone()
    }

    #[getter]
    fn at_rest(&self) -> bool {
        self.core.at_rest
    }

    #[getter]
    fn told(&self) -> usize {
        self.core.candidates.first().map_or(0, |best| best.told)
    }

    #[getter]
    fn asked(&self) -> usize {
        self.core
            .candidates
            .first()
            .map_or(0, |best| best.values.len())
    }

    #[getter]
    fn excited<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        frozen(py, self.core.excited.clone())
    }

    #[getter]
    fn omega<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        frozen(py, self.omega.clone())
    }

    #[getter]
    fn hull<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        named(py, &self.core.hull)
    }

    /// The intervals at another level.
    fn hull_at<'py>(&self, py: Python<'py>, level: f64) -> PyResult<Bound<'py, PyDict>> {
        named(py, &run_here(py, |task| self.core.hull_at(level, task))?)
    }

    /// The pieces of each interval at a level, where it is not one.
    fn pieces_at<'py>(&self, py: Python<'py>, level: f64) -> PyResult<Bound<'py, PyDict>> {
        let out = PyDict::new(py);
        for one in run_here(py, |task| self.core.hull_at(level, task))? {
            out.set_item(one.name, one.pieces)?;
        }
        Ok(out)
    }

    /// The numbers of the answer, by the names of an estimate.
    #[getter]
    fn shown<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let at = |name: &str| self.value(name);
        let found = PyDict::new(py);
        found.set_item("crossover", at("crossover"))?;
        found.set_item("largest_gain", at("largest_gain"))?;
        found.set_item("intervals", self.hull(py)?)?;
        found.set_item("determined", self.told())?;
        found.set_item("asked", self.asked())?;
        found.set_item("at_rest", self.at_rest())?;
        found.set_item("excited", self.excited(py))?;
        let names = [
            "gain_at_crossover",
            "phase_at_crossover",
            "delay_at_crossover",
        ];
        let [gain, phase, delay] = names.map(at);
        found.set_item("_at_crossover", (gain, phase, delay))?;
        Ok(found)
    }

    #[getter]
    fn crossover(&self) -> f64 {
        self.value("crossover")
    }

    #[getter]
    fn largest_gain(&self) -> f64 {
        self.value("largest_gain")
    }

    #[getter]
    fn gain_at_crossover(&self) -> f64 {
        self.value("gain_at_crossover")
    }

    #[getter]
    fn phase_at_crossover(&self) -> f64 {
        self.value("phase_at_crossover")
    }

    #[getter]
    fn delay_at_crossover(&self) -> f64 {
        self.value("delay_at_crossover")
    }

    /// The mean equivalent delay over frequencies with weights that add up to one: value, ends.
    #[pyo3(signature = (omega, weight, level=None))]
    fn mean_delay(
        &self,
        py: Python<'_>,
        omega: Vec<f64>,
        weight: Vec<f64>,
        level: Option<f64>,
    ) -> PyResult<(f64, f64, f64)> {
        check_frequencies(&omega)?;
        let level = level.unwrap_or(self.level);
        run_here(py, |task| {
            self.core.mean_delay(&omega, &weight, level, task)
        })
    }

    /// Gain, phase and equivalent delay at frequencies; each a list of values, lower and upper ends.
    #[pyo3(signature = (omega, level=None))]
    fn at<'py>(
        &self,
        py: Python<'py>,
        omega: Vec<f64>,
        level: Option<f64>,
    ) -> PyResult<Bound<'py, PyDict>> {
        check_frequencies(&omega)?;
        let found = run_here(py, |task| {
            self.core.at(&omega, level.unwrap_or(self.level), task)
        })?;
        let out = PyDict::new(py);
        for (name, of) in [("gain", 0), ("phase", 1), ("delay", 2)] {
            let parts = |part: fn(&(f64, f64, f64)) -> f64| {
                let values = found.iter().map(|one| part(&one[of])).collect();
                frozen(py, values)
            };
            out.set_item(name, (parts(|x| x.0), parts(|x| x.1), parts(|x| x.2)))?;
        }
        Ok(out)
    }
}

fn check_frequencies(omega: &[f64]) -> PyResult<()> {
    let is_wrong = |omega: &&f64| !(omega.is_finite() && **omega > 0.0);
    match omega.iter().find(is_wrong) {
        Some(wrong) => Err(PyValueError::new_err(format!(
            "a frequency is {wrong} rad/s: give frequencies above zero"
        ))),
        None => Ok(()),
    }
}

impl FamilyFit {
    fn value(&self, name: &str) -> f64 {
        let found = self.core.hull.iter().find(|one| one.name == name);
        found.map_or(f64::NAN, |one| one.value)
    }
}

fn named<'py>(py: Python<'py>, all: &[Named]) -> PyResult<Bound<'py, PyDict>> {
    let out = PyDict::new(py);
    for one in all {
        out.set_item(one.name, (one.low, one.high))?;
    }
    Ok(out)
}

fn named_between(kind: &str) -> PyResult<Between> {
    match kind {
        "held" => Ok(Between::Held),
        "straight" | "samples" => Ok(Between::Straight),
        "undecided" => Ok(Between::Undecided),
        _ => Err(PyValueError::new_err(format!(
            "between {kind:?}: give 'held', 'straight', 'samples' or 'undecided'"
        ))),
    }
}

fn unknown<T>(what: &str, name: &str, found: Option<T>) -> PyResult<T> {
    found.ok_or_else(|| PyValueError::new_err(format!("{what} {name:?} is not known")))
}

/// A record: times, commands, outputs, how many first rows are used as input only, times of the commands
/// where they are not those of the rows, and for how long the controller holds each, s.
type Columns<'py> = (
    Floats<'py>,
    Floats<'py>,
    Floats<'py>,
    usize,
    Option<Floats<'py>>,
    f64,
);

/// Fit the family of plants to records of one plant; with what some of them show, only beside that.
#[pyfunction]
#[pyo3(signature = (records, *, between="held", closed_loop=false, at_rest=None, largest_delay=None,
    plant=None, integrates=None, noise=None, level=0.95, causes=false, omega=None, progress=None,
    known=None))]
#[expect(clippy::too_many_arguments, reason = "given by name")]
pub(crate) fn fit_family(
    py: Python<'_>,
    records: Vec<Columns<'_>>,
    between: &str,
    closed_loop: bool,
    at_rest: Option<bool>,
    largest_delay: Option<f64>,
    plant: Option<&str>,
    integrates: Option<bool>,
    noise: Option<&str>,
    level: f64,
    causes: bool,
    omega: Option<Vec<f64>>,
    progress: Option<Py<PyAny>>,
    known: Option<Py<FamilyFit>>,
) -> PyResult<FamilyFit> {
    let record = |(time, command, output, earlier, sent, hold): &Columns<'_>| {
        PyResult::Ok(Record {
            time: owned(time)?,
            command: owned(command)?,
            output: owned(output)?,
            earlier: *earlier,
            sent: sent.as_ref().map(owned).transpose()?,
            hold: *hold,
        })
    };
    let records: Vec<Record> = records.iter().map(record).collect::<PyResult<_>>()?;
    let class = plant.map(|name| unknown("plant", name, Class::named(name)));
    let noise = noise.map(|name| unknown("noise", name, FamilyNoise::named(name)));
    let question = Question {
        between: named_between(between)?,
        in_loop: closed_loop,
        at_rest,
        largest_delay,
        class: class.transpose()?,
        integrating: integrates,
        noise: noise.transpose()?,
        level,
        causes,
    };
    let core = run(py, Some(1), progress.as_ref(), |task| {
        let records = records.into_iter().map(Record::checked);
        let records = records.collect::<Result<Vec<_>, _>>()?;
        match &known {
            Some(known) => refine_family(&known.get().core, &records, &question, task),
            None => fit(&records, &question, task),
        }
    })?;
    let candidates = core.candidates.iter();
    let candidates = candidates.map(|one| Py::new(py, FamilyCandidate::new(py, one)));
    Ok(FamilyFit {
        candidates: candidates.collect::<PyResult<_>>()?,
        level,
        omega: omega.unwrap_or_else(|| core.excited.clone()),
        core,
    })
}
