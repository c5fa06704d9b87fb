//! Bindings of `deadtime::frequency`.

use deadtime::frequency::{self, Crossings, Margins};
use num_complex::Complex64;
use numpy::{IntoPyArray, PyArray1, PyReadonlyArrayDyn};
use pyo3::prelude::*;

use crate::arrays::{column, in_order};
use crate::quasipoly::QuasiPolynomial;
use crate::runtime::run_here;
use crate::stability::PyFamily;

type Floats = Py<PyArray1<f64>>;
type Range = (f64, f64);

/// What `deadtime.Margins` shows.
#[pyclass(frozen, get_all, module = "deadtime._deadtime", name = "Margins")]
pub(crate) struct PyMargins {
    stable: bool,
    gain_margin: f64,
    gain_reduction: f64,
    phase_margin: f64,
    delay_margin: f64,
    gain_margin_omega: f64,
    gain_reduction_omega: f64,
    phase_margin_omega: f64,
    delay_margin_omega: f64,
    gain_crossovers: Floats,
    phase_margins: Floats,
    delay_margins: Floats,
    phase_crossovers: Floats,
    gain_margins: Floats,
    searched: (f64, f64),
    hidden: Py<PyArray1<Complex64>>,
    max_sensitivity: f64,
    max_sensitivity_omega: f64,
    max_complementary_sensitivity: f64,
    max_complementary_sensitivity_omega: f64,
    disk_margin: f64,
    disk_margin_omega: f64,
}

impl PyMargins {
    pub(crate) fn new(py: Python<'_>, found: Margins) -> Self {
        let array = |values: Vec<f64>| values.into_pyarray(py).unbind();
        Self {
            stable: found.stable,
            gain_margin: found.gain_margin,
            gain_reduction: found.gain_reduction,
            phase_margin: found.phase_margin,
            delay_margin: found.delay_margin,
            gain_margin_omega: found.gain_margin_omega,
            gain_reduction_omega: found.gain_reduction_omega,
            phase_margin_omega: found.phase_margin_omega,
            delay_margin_omega: found.delay_margin_omega,
            gain_crossovers: array(found.gain_crossovers),
            phase_margins: array(found.phase_margins),
            delay_margins: array(found.delay_margins),
            phase_crossovers: array(found.phase_crossovers),
            gain_margins: array(found.gain_margins),
            searched: found.searched,
            hidden: found.hidden.into_pyarray(py).unbind(),
            max_sensitivity: found.peaks.sensitivity.value,
            max_sensitivity_omega: found.peaks.sensitivity.omega,
            max_complementary_sensitivity: found.peaks.complementary.value,
            max_complementary_sensitivity_omega: found.peaks.complementary.omega,
            disk_margin: 1.0 / found.peaks.disk.value,
            disk_margin_omega: found.peaks.disk.omega,
        }
    }
}

/// Margins of the loop gain n/d; with `all_modes` those that n and d have in common count for
/// stability.
#[pyfunction]
pub(crate) fn loop_margins(
    py: Python<'_>,
    n: &QuasiPolynomial,
    d: &QuasiPolynomial,
    all_modes: bool,
) -> PyResult<PyMargins> {
    let margins = if all_modes {
        frequency::margins
    } else {
        frequency::margins_of_ratio
    };
    let found = run_here(py, |task| margins(&n.core, &d.core, task))?;
    Ok(PyMargins::new(py, found))
}

/// The largest |n/d| over frequency and where it is, infinite of what is not stable.
#[pyfunction]
pub(crate) fn hinf_norm(
    py: Python<'_>,
    n: &QuasiPolynomial,
    d: &QuasiPolynomial,
) -> PyResult<(f64, f64)> {
    let found = run_here(py, |task| frequency::hinf_norm(&n.core, &d.core, task))?;
    Ok((found.value, found.omega))
}

/// A frequency beyond which |n/d| < `level` is certain, rad/s; infinite where there is none.
#[pyfunction]
pub(crate) fn end_of_gain(n: &QuasiPolynomial, d: &QuasiPolynomial, level: f64) -> f64 {
    frequency::end_of_gain(&n.core, &d.core, level, 0)
}

/// n/d at all points, in C order.
#[pyfunction]
pub(crate) fn ratio<'py>(
    py: Python<'py>,
    n: &QuasiPolynomial,
    d: &QuasiPolynomial,
    points: PyReadonlyArrayDyn<'py, Complex64>,
) -> PyResult<Bound<'py, PyArray1<Complex64>>> {
    let points = in_order(&points)?;
    let values = run_here(py, |task| frequency::ratio(&n.core, &d.core, &points, task))?;
    Ok(values.into_pyarray(py))
}

/// Crossings of the imaginary axis as the one parameter of a family varies.
#[pyclass(frozen, get_all, module = "deadtime._deadtime", name = "Crossings")]
pub(crate) struct PyCrossings {
    values: Floats,
    omega: Floats,
    direction: Py<PyArray1<i32>>,
    unlisted: Vec<Range>,
}

impl PyCrossings {
    fn new(py: Python<'_>, found: Crossings) -> PyResult<Self> {
        let list = &found.crossings;
        Ok(Self {
            values: column(list, |place| place.value)?.into_pyarray(py).unbind(),
            omega: column(list, |place| place.omega)?.into_pyarray(py).unbind(),
            direction: column(list, |place| place.direction)?
                .into_pyarray(py)
                .unbind(),
            unlisted: found.unlisted,
        })
    }
}

/// All crossings of the imaginary axis while the one parameter of a family is in a range.
#[pyfunction]
pub(crate) fn crossings(py: Python<'_>, family: &PyFamily, ends: Range) -> PyResult<PyCrossings> {
    let found = run_here(py, |task| frequency::crossings(&family.inner, ends, task))?;
    PyCrossings::new(py, found)
}

/// How much a delay, the one parameter of a family, can grow from `start` on.
#[pyfunction]
pub(crate) fn delay_margin(py: Python<'_>, family: &PyFamily, start: f64) -> PyResult<f64> {
    run_here(py, |task| {
        frequency::delay_margin(&family.inner, start, task)
    })
}

/// Stable values around `value` of a delay, the one parameter of a family.
#[pyfunction]
pub(crate) fn delay_range(py: Python<'_>, family: &PyFamily, value: f64) -> PyResult<Range> {
    run_here(py, |task| {
        frequency::delay_range(&family.inner, value, task)
    })
}

/// Stable values around `value`, within `bounds`, of a factor.
#[pyfunction]
pub(crate) fn gain_range(
    py: Python<'_>,
    family: &PyFamily,
    value: f64,
    bounds: Range,
) -> PyResult<Range> {
    run_here(py, |task| {
        frequency::gain_range(&family.inner, value, bounds, task)
    })
}

/// Stable values around `value` of the damping of a filter; beyond `highest` the loop gain is
/// below one for all larger ones.
#[pyfunction]
pub(crate) fn damping_range(
    py: Python<'_>,
    family: &PyFamily,
    value: f64,
    highest: f64,
) -> PyResult<Range> {
    run_here(py, |task| {
        frequency::damping_range(&family.inner, value, highest, task)
    })
}

/// Stable values around `value` of the corner of a filter; beyond `highest` the loop gain is below
/// one for any.
#[pyfunction]
pub(crate) fn corner_range(
    py: Python<'_>,
    family: &PyFamily,
    value: f64,
    highest: f64,
) -> PyResult<Range> {
    run_here(py, |task| {
        frequency::corner_range(&family.inner, value, highest, task)
    })
}
