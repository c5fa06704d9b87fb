//! Bindings of `deadtime::quasipoly` and `deadtime::roots`.

use deadtime::quasipoly::QuasiPolynomial as Core;
use deadtime::roots::{self, Edge, Region};
use deadtime::{Error, Task, frequency};
use num_complex::Complex64;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArray2, PyReadonlyArrayDyn};
use pyo3::prelude::*;

use crate::arrays::{in_order, owned, rows};
use crate::certificate::Certificate;
use crate::errors::to_python;
use crate::runtime::{run, run_here};

/// Fewer values than this are computed on the calling thread.
const FEW_VALUES: usize = 2048;

pub(crate) type Range = (f64, f64);
type Points<'py> = PyReadonlyArrayDyn<'py, Complex64>;
type Values<'py> = Bound<'py, PyArray1<Complex64>>;

/// Taylor coefficients at a place, with bounds on their errors.
#[pyclass(frozen, get_all, module = "deadtime._deadtime")]
pub(crate) struct Expansion {
    coefficients: Py<PyArray1<Complex64>>,
    errors: Py<PyArray1<f64>>,
    delay: f64,
}

/// Roots with discs that are proved to hold them.
#[pyclass(frozen, get_all, module = "deadtime._deadtime")]
pub(crate) struct RootSet {
    roots: Py<PyArray1<Complex64>>,
    multiplicities: Py<PyArray1<u32>>,
    radii: Py<PyArray1<f64>>,
    resolved: Py<PyArray1<bool>>,
    counted: u64,
    region: (Range, Range),
    hidden: Py<PyArray1<Complex64>>,
}

impl RootSet {
    pub(crate) fn new(py: Python<'_>, set: roots::RootSet) -> Self {
        Self::without(py, set, Vec::new())
    }

    /// Without the roots that are hidden, which are named.
    fn without(py: Python<'_>, set: roots::RootSet, hidden: Vec<Complex64>) -> Self {
        Self {
            roots: set.roots.into_pyarray(py).unbind(),
            multiplicities: set.multiplicities.into_pyarray(py).unbind(),
            radii: set.radii.into_pyarray(py).unbind(),
            resolved: set.resolved.into_pyarray(py).unbind(),
            counted: set.counted,
            region: (set.region.re, set.region.im),
            hidden: hidden.into_pyarray(py).unbind(),
        }
    }
}

/// A root and its derivative by each of the coefficients that were asked for.
#[pyclass(frozen, get_all, module = "deadtime._deadtime")]
pub(crate) struct Sensitivity {
    root: Complex64,
    coefficients: Py<PyArray1<Complex64>>,
}

impl Sensitivity {
    pub(crate) fn new(py: Python<'_>, root: Complex64, coefficients: Vec<Complex64>) -> Self {
        Self {
            root,
            coefficients: coefficients.into_pyarray(py).unbind(),
        }
    }
}

/// A quasi-polynomial of the core.
#[pyclass(frozen, module = "deadtime._deadtime")]
pub(crate) struct QuasiPolynomial {
    pub(crate) core: Core,
}

pub(crate) fn wrapped(py: Python<'_>, result: Result<Core, Error>) -> PyResult<QuasiPolynomial> {
    result
        .map(|core| QuasiPolynomial { core })
        .map_err(|error| to_python(py, error))
}

#[pymethods]
impl QuasiPolynomial {
    #[new]
    fn new(
        py: Python<'_>,
        coefficients: PyReadonlyArray2<'_, f64>,
        delays: PyReadonlyArrayDyn<'_, f64>,
    ) -> PyResult<Self> {
        wrapped(py, Core::new(rows(&coefficients), owned(&delays)?))
    }

    /// Ascending coefficients, one row for each delay.
    fn coefficients<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let width = self.core.degree() + 1;
        let rows: Vec<Vec<f64>> = self
            .core
            .coefficients()
            .iter()
            .map(|row| {
                let mut row = row.clone();
                row.resize(width, 0.0);
                row
            })
            .collect();
        PyArray2::from_vec2(py, &rows)
            .map_err(|error| pyo3::exceptions::PyValueError::new_err(error.to_string()))
    }

    /// Delays in seconds.
    fn delays<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.core.delays())
    }

    fn kind(&self) -> &'static str {
        self.core.kind().name()
    }

    fn degree(&self) -> usize {
        self.core.degree()
    }

    fn add(&self, py: Python<'_>, other: &Self) -> PyResult<Self> {
        wrapped(py, self.core.add(&other.core))
    }

    fn sub(&self, py: Python<'_>, other: &Self) -> PyResult<Self> {
        wrapped(py, self.core.sub(&other.core))
    }

    fn mul(&self, py: Python<'_>, other: &Self) -> PyResult<Self> {
        wrapped(py, self.core.mul(&other.core))
    }

    fn scale(&self, py: Python<'_>, factor: f64) -> PyResult<Self> {
        wrapped(py, self.core.scale(factor))
    }

    fn pow(&self, py: Python<'_>, exponent: u32) -> PyResult<Self> {
        wrapped(py, self.core.pow(exponent))
    }

    fn derivative(&self, py: Python<'_>, order: u32) -> PyResult<Self> {
        wrapped(py, self.core.derivative(order))
    }

    /// The highest power of s that divides every row exactly.
    fn powers_of_s(&self) -> usize {
        self.core.powers_of_s()
    }

    /// Divided by s^k, which must divide it.
    fn without_powers(&self, k: usize) -> Self {
        let core = self.core.without_powers(k);
        Self { core }
    }

    /// First term a s^p of the Taylor series at zero that is not zero to rounding: a and p.
    fn first_term(&self) -> (f64, u32) {
        frequency::first_term(&self.core)
    }

    /// Argument of h(j omega) at frequencies above zero, continuous from zero on, in C order.
    fn argument<'py>(
        &self,
        py: Python<'py>,
        omega: PyReadonlyArrayDyn<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let omega = in_order(&omega)?;
        let found = run_here(py, |task| frequency::argument(&self.core, &omega, task))?;
        Ok(found.into_pyarray(py))
    }

    /// Values at all points, in C order.
    fn values<'py>(&self, py: Python<'py>, points: Points<'py>) -> PyResult<Values<'py>> {
        at_all(py, &points, |points, task| self.core.values(points, task))
    }

    /// h'/h at all points, in C order.
    fn logarithmic_derivatives<'py>(
        &self,
        py: Python<'py>,
        points: Points<'py>,
    ) -> PyResult<Values<'py>> {
        at_all(py, &points, |points, task| {
            self.core.logarithmic_derivatives(points, task)
        })
    }

    fn count(&self, py: Python<'_>, re: Range, im: Range, edge: &str) -> PyResult<u64> {
        let edge = side(edge)?;
        run_here(py, |task| {
            roots::count_with_edge(&self.core, &Region { re, im }, edge, task)
        })
    }

    fn certify(&self, py: Python<'_>, re: Range, im: Range) -> PyResult<Certificate> {
        let proof = run(py, None, None, |task| {
            roots::certify(&self.core, &Region { re, im }, task)
        })?;
        Certificate::new(py, &proof)
    }

    fn is_stable(&self, py: Python<'_>, strong: bool) -> PyResult<bool> {
        run_here(py, |task| roots::is_stable(&self.core, strong, task))
    }

    fn roots(&self, py: Python<'_>, re: Range, im: Range, edge: &str) -> PyResult<RootSet> {
        let edge = side(edge)?;
        let set = run_here(py, |task| {
            roots::roots_with_edge(&self.core, &Region { re, im }, edge, task)
        })?;
        Ok(RootSet::new(py, set))
    }

    fn rightmost(&self, py: Python<'_>, n: usize) -> PyResult<RootSet> {
        let set = run_here(py, |task| roots::rightmost(&self.core, n, task))?;
        Ok(RootSet::new(py, set))
    }

    fn spectral_abscissa(&self, py: Python<'_>, strong: bool) -> PyResult<f64> {
        run_here(py, |task| {
            roots::spectral_abscissa(&self.core, strong, task)
        })
    }

    /// A root, and its derivatives by the coefficients of s^power e^(-s delay).
    fn sensitivity(
        &self,
        py: Python<'_>,
        root: Complex64,
        delays: Vec<f64>,
        powers: Vec<u32>,
    ) -> PyResult<Sensitivity> {
        let terms: Vec<(f64, u32)> = delays.into_iter().zip(powers).collect();
        let (root, slopes) = run(py, None, None, |task| {
            roots::sensitivity(&self.core, root, &terms, task)
        })?;
        Ok(Sensitivity::new(py, root, slopes))
    }

    fn chain_abscissa(&self) -> f64 {
        roots::chain_abscissa(&self.core)
    }

    /// That of exact delays, if they have a common base.
    fn exact_chain_abscissa(&self, py: Python<'_>) -> PyResult<Option<f64>> {
        run_here(py, |task| roots::exact_chain_abscissa(&self.core, task))
    }

    fn base_delay(&self) -> Option<f64> {
        roots::base_delay(&self.core)
    }

    /// Taylor coefficients of h e^(s delay) at `s`.
    fn expansion(&self, py: Python<'_>, s: Complex64, order: usize) -> Expansion {
        let found = self.core.expansion(s, order);
        Expansion {
            coefficients: found.coefficients.into_pyarray(py).unbind(),
            errors: found.errors.into_pyarray(py).unbind(),
            delay: found.delay,
        }
    }
}

/// A ratio of the core.
#[pyclass(frozen, module = "deadtime._deadtime")]
pub(crate) struct Ratio {
    core: roots::Ratio,
}

#[pymethods]
impl Ratio {
    #[new]
    fn new(n: &QuasiPolynomial, d: &QuasiPolynomial) -> Self {
        let core = roots::Ratio::new(n.core.clone(), d.core.clone());
        Self { core }
    }

    fn count(&self, py: Python<'_>, re: Range, im: Range, edge: &str) -> PyResult<u64> {
        let edge = side(edge)?;
        run_here(py, |task| self.core.count(&Region { re, im }, edge, task))
    }

    fn poles(&self, py: Python<'_>, re: Range, im: Range, edge: &str) -> PyResult<RootSet> {
        let edge = side(edge)?;
        let found = run_here(py, |task| self.core.poles(&Region { re, im }, edge, task))?;
        Ok(listed(py, found))
    }

    fn rightmost(&self, py: Python<'_>, n: usize) -> PyResult<RootSet> {
        let found = run_here(py, |task| self.core.rightmost(n, task))?;
        Ok(listed(py, found))
    }

    fn spectral_abscissa(&self, py: Python<'_>, strong: bool) -> PyResult<f64> {
        run_here(py, |task| self.core.spectral_abscissa(strong, task))
    }

    /// The verdict, and the hidden roots on which it rests.
    fn stability<'py>(&self, py: Python<'py>, strong: bool) -> PyResult<(bool, Values<'py>)> {
        let found = run_here(py, |task| self.core.stability(strong, task))?;
        Ok((found.stable, found.hidden.into_pyarray(py)))
    }
}

/// Poles, and each hidden root as often as it is one.
fn listed(py: Python<'_>, found: roots::Poles) -> RootSet {
    let hidden = found.hidden.roots.iter().zip(&found.hidden.multiplicities);
    let hidden = hidden.flat_map(|(root, m)| std::iter::repeat_n(*root, *m as usize));
    RootSet::without(py, found.poles, hidden.collect())
}

/// What `work` makes of all points, in C order: a few of them on the calling thread.
fn at_all<'py>(
    py: Python<'py>,
    points: &Points<'py>,
    work: impl FnOnce(&[Complex64], &Task) -> Result<Vec<Complex64>, Error> + Send,
) -> PyResult<Values<'py>> {
    let points = in_order(points)?;
    let work = |task: &Task| work(&points, task);
    let values = if points.len() < FEW_VALUES {
        run_here(py, work)?
    } else {
        run(py, None, None, work)?
    };
    Ok(values.into_pyarray(py))
}

/// To which side roots on an edge belong.
pub(crate) fn side(edge: &str) -> PyResult<Edge> {
    match edge {
        "error" => Ok(Edge::Refused),
        "inside" => Ok(Edge::Inside),
        "outside" => Ok(Edge::Outside),
        other => Err(pyo3::exceptions::PyValueError::new_err(format!(
            "edge={other:?}: choose \"error\", \"inside\" or \"outside\""
        ))),
    }
}
