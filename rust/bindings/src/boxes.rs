//! Bindings of `deadtime::stability`: what is proved of whole boxes of parameters.

use deadtime::stability::{self, Limits, Node};
use numpy::ndarray::{Array2, Axis};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArrayDyn};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::column;
use crate::runtime::run;
use crate::stability::ByName;
use crate::stability::{PyFamily, with_axes};

type Range = (f64, f64);

/// Boxes with a proved count, a column a parameter in the order of the ranges, and the tree in
/// which they are found.
#[pyclass(frozen, get_all, module = "deadtime._deadtime")]
pub(crate) struct ProvedBoxes {
    low: Py<PyArray2<f64>>,
    high: Py<PyArray2<f64>>,
    unstable: Py<PyArray1<i32>>,
    undecided: f64,
    /// Which parameter a node of the tree divides, -1 for a box.
    parameter: Py<PyArray1<i8>>,
    /// Where a node divides it.
    at: Py<PyArray1<f64>>,
    /// The node of the lower half, which that of the upper one follows, or the index of the box.
    link: Py<PyArray1<i64>>,
}

/// How far parameters may move.
#[pyclass(frozen, get_all, module = "deadtime._deadtime")]
pub(crate) struct StabilityRadius {
    radius: f64,
    upper: f64,
    witness: Option<Py<PyDict>>,
}

/// Divide ranges of all parameters into boxes with a proved count.
#[pyfunction]
#[pyo3(signature = (family, ranges, *, tol, max_boxes, threads=None, progress=None))]
pub(crate) fn proved_boxes(
    py: Python<'_>,
    family: &PyFamily,
    ranges: ByName<Range>,
    tol: f64,
    max_boxes: usize,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<ProvedBoxes> {
    let family = &family.inner;
    let places = ranges.places(family)?;
    let ordered = ranges.ordered(family, (0.0, 0.0))?;
    let limits = Limits {
        undecided: tol,
        boxes: max_boxes,
    };
    let found = run(py, threads, progress.as_ref(), |task| {
        stability::proved_boxes(family, &ordered, limits, task)
    })?;
    let shape = (found.unstable.len(), ordered.len());
    let corners = |ends: Vec<f64>| {
        let ends = Array2::from_shape_vec(shape, ends)
            .map_err(|error| PyValueError::new_err(error.to_string()))?;
        Ok::<_, PyErr>(ends.select(Axis(1), &places).into_pyarray(py).unbind())
    };
    let node = |node: &Node| match *node {
        Node::Leaf(index) => (-1, 0.0, index as i64),
        Node::Halved {
            parameter,
            at,
            first,
        } => {
            let place = places.iter().position(|place| *place == parameter);
            (place.map_or(-1, |place| place as i8), at, first as i64)
        }
    };
    Ok(ProvedBoxes {
        low: corners(found.low)?,
        high: corners(found.high)?,
        unstable: found.unstable.into_pyarray(py).unbind(),
        undecided: found.undecided,
        parameter: column(&found.nodes, |each| node(each).0)?
            .into_pyarray(py)
            .unbind(),
        at: column(&found.nodes, |each| node(each).1)?
            .into_pyarray(py)
            .unbind(),
        link: column(&found.nodes, |each| node(each).2)?
            .into_pyarray(py)
            .unbind(),
    })
}

/// A large stable box within the ranges; None where there is none to be found.
#[pyfunction]
#[pyo3(signature = (family, ranges, *, around, tol, threads=None, progress=None))]
pub(crate) fn largest_stable_box<'py>(
    py: Python<'py>,
    family: &PyFamily,
    ranges: ByName<Range>,
    around: Option<ByName<f64>>,
    tol: f64,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Option<Bound<'py, PyDict>>> {
    let family = &family.inner;
    let ordered = ranges.ordered(family, (0.0, 0.0))?;
    let around = around.map(|point| point.ordered(family, 0.0)).transpose()?;
    let found = run(py, threads, progress.as_ref(), |task| {
        stability::largest_stable_box(family, &ordered, around.as_deref(), tol, task)
    })?;
    found
        .map(|found| ranges.named(py, family, &found))
        .transpose()
}

/// How far all parameters may move from a point, each in its own unit.
#[pyfunction]
#[pyo3(signature = (family, point, scales, *, tol, max_boxes))]
pub(crate) fn stability_radius(
    py: Python<'_>,
    family: &PyFamily,
    point: ByName<f64>,
    scales: ByName<f64>,
    tol: f64,
    max_boxes: usize,
) -> PyResult<StabilityRadius> {
    let family = &family.inner;
    let values = point.ordered(family, 0.0)?;
    let units = scales.ordered(family, 0.0)?;
    let found = run(py, None, None, |task| {
        stability::stability_radius(family, &values, &units, (tol, max_boxes), task)
    })?;
    let witness = found
        .witness
        .map(|witness| point.named(py, family, &witness))
        .transpose()?;
    Ok(StabilityRadius {
        radius: found.radius,
        upper: found.upper,
        witness: witness.map(Bound::unbind),
    })
}

/// Counts over the two parameters of `axes`, the largest met over the ranges of the others.
#[pyfunction]
#[pyo3(signature = (family, axes, over, *, max_boxes, threads=None, progress=None))]
pub(crate) fn robust_map<'py>(
    py: Python<'py>,
    family: &PyFamily,
    axes: ByName<PyReadonlyArrayDyn<'py, f64>>,
    over: ByName<Range>,
    max_boxes: usize,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyArray2<i32>>> {
    let family = &family.inner;
    // The kernel puts the points of the axes in the place of their ranges, cell by cell.
    let ranges = over.ordered(family, (0.0, 0.0))?;
    with_axes(family, &axes, |axes| {
        let counts = run(py, threads, progress.as_ref(), |task| {
            stability::robust_map(family, &ranges, axes, max_boxes, task)
        })?;
        let shape = axes.map(|axis| axis.points.len());
        counts.into_pyarray(py).reshape(shape)
    })
}
