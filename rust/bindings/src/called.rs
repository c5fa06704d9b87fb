//! Bindings of searches over statistics that Python computes.

use deadtime::estimation::{
    EndSearch, MixturePart, interval_end as end, mixture_interval as mixture,
    secant_ends as secants, shared_number as shared,
};
use numpy::{IntoPyArray, PyArray1, PyReadonlyArrayDyn};
use pyo3::prelude::*;

use crate::arrays::{converted, owned};
use crate::calls::Calls;
use crate::runtime::run_attached;

/// Where the excess, below zero at the start, becomes zero, or the floor; the first step is below zero for a
/// lower end. The farthest place that was tried, where it is below zero all the way.
#[pyfunction]
pub(crate) fn interval_end(
    excess: &Bound<'_, PyAny>,
    start: f64,
    step: f64,
    floor: f64,
    farthest: f64,
    tolerance: f64,
) -> PyResult<f64> {
    let calls = Calls::new(excess.py());
    let search = EndSearch {
        step,
        floor,
        farthest,
        tolerance,
    };
    let found = run_attached(calls.py, |task| {
        let excess = |place: f64| calls.kept(excess.call1((place,)).and_then(|x| x.extract()));
        end(excess, start, search, task)
    });
    Ok(calls.ended(found)?.unwrap_or_else(|farthest| farthest))
}

/// Where a sum is least between two ends, the sum there, and the ends where it has risen by `rise`; first
/// on a grid of so many steps, all to a tolerance.
#[pyfunction]
pub(crate) fn shared_number(
    total: &Bound<'_, PyAny>,
    ends: (f64, f64),
    steps: usize,
    rise: f64,
    floor: f64,
    tolerance: f64,
) -> PyResult<(f64, f64, (f64, f64))> {
    let calls = Calls::new(total.py());
    let found = run_attached(calls.py, |task| {
        let sum = |place: f64| calls.kept(total.call1((place,)).and_then(|x| x.extract()));
        shared(sum, ends, steps, (rise, floor, tolerance), task)
    });
    let found = calls.ended(found)?;
    Ok((found.value, found.least, found.ends))
}

/// The interval of a mixture of estimates, each with its weight, its value, and one deviation below and above
/// it, at a level; between two ends, to a tolerance.
#[pyfunction]
pub(crate) fn mixture_interval(
    parts: Vec<(f64, f64, f64, f64)>,
    level: f64,
    ends: (f64, f64),
    tolerance: f64,
) -> PyResult<(f64, f64)> {
    let parts = parts
        .into_iter()
        .map(|(weight, value, low, high)| MixturePart {
            weight,
            value,
            ends: (low, high),
        });
    let parts: Vec<MixturePart> = parts.collect();
    converted(mixture(&parts, level, ends, tolerance))
}

/// How far the lower and upper ends of quantities are from their values, from a covariance of numbers and a
/// quantile; `moved` has the change of each quantity by steps of the numbers.
#[pyfunction]
pub(crate) fn secant_ends<'py>(
    moved: &Bound<'py, PyAny>,
    cov: PyReadonlyArrayDyn<'py, f64>,
    reach: f64,
) -> PyResult<[Bound<'py, PyArray1<f64>>; 2]> {
    let (calls, cov) = (Calls::new(moved.py()), owned(&cov)?);
    let found = run_attached(calls.py, |_| {
        let moved = |step: &[f64]| {
            let found = moved.call1((step.to_vec(),)).and_then(|x| x.extract());
            calls.kept(found)
        };
        secants(moved, &cov, reach)
    });
    let (below, above) = calls.ended(found)?;
    Ok([below, above].map(|one| one.into_pyarray(calls.py)))
}
