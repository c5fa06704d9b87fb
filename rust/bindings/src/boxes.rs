//! Bindings of the proved boxes of `deadtime::stability`.

use deadtime::stability::{self, Axis, Limits, Node};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArrayDyn};
use pyo3::prelude::*;

use crate::arrays::{column, in_order};
use crate::runtime::run;
use crate::stability::PyFamily;

type Floats<'py> = PyReadonlyArrayDyn<'py, f64>;
type Vector<'py, T> = Bound<'py, PyArray1<T>>;
type Table<'py, T> = Bound<'py, PyArray2<T>>;
type Pairs = Vec<(f64, f64)>;

/// Low and high corners, counts, the tree (parameter or −1, where, first child or leaf), share
/// undecided.
type Found<'py> = (
    Table<'py, f64>,
    Table<'py, f64>,
    Vector<'py, i32>,
    (Vector<'py, i8>, Vector<'py, f64>, Vector<'py, i64>),
    f64,
);

/// Boxes with a proved count over the ranges of all parameters.
#[pyfunction]
#[pyo3(signature = (family, ranges, undecided, boxes, threads=None, progress=None))]
pub(crate) fn proved_boxes<'py>(
    py: Python<'py>,
    family: &PyFamily,
    ranges: Pairs,
    undecided: f64,
    boxes: usize,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Found<'py>> {
    let limits = Limits { undecided, boxes };
    let family = &family.inner;
    let found = run(py, threads, progress.as_ref(), |task| {
        stability::proved_boxes(family, &ranges, limits, task)
    })?;
    let shape = [found.unstable.len(), ranges.len()];
    let part = |node: &Node| match node {
        Node::Leaf(index) => (-1, 0.0, *index as i64),
        Node::Halved {
            parameter,
            at,
            first,
        } => (*parameter as i8, *at, *first as i64),
    };
    let parameters = column(&found.nodes, |node| part(node).0)?;
    let places = column(&found.nodes, |node| part(node).1)?;
    let links = column(&found.nodes, |node| part(node).2)?;
    Ok((
        found.low.into_pyarray(py).reshape(shape)?,
        found.high.into_pyarray(py).reshape(shape)?,
        found.unstable.into_pyarray(py),
        (
            parameters.into_pyarray(py),
            places.into_pyarray(py),
            links.into_pyarray(py),
        ),
        found.undecided,
    ))
}

/// A large stable box within the ranges.
#[pyfunction]
#[pyo3(signature = (family, ranges, around, tol, threads=None, progress=None))]
pub(crate) fn largest_stable_box(
    py: Python<'_>,
    family: &PyFamily,
    ranges: Pairs,
    around: Option<Vec<f64>>,
    tol: f64,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Option<Pairs>> {
    let family = &family.inner;
    run(py, threads, progress.as_ref(), |task| {
        stability::largest_stable_box(family, &ranges, around.as_deref(), tol, task)
    })
}

/// Proved radius, the one beyond which it cannot go, and a witness.
#[pyfunction]
pub(crate) fn stability_radius(
    py: Python<'_>,
    family: &PyFamily,
    point: Vec<f64>,
    scales: Vec<f64>,
    tol: f64,
    boxes: usize,
) -> PyResult<(f64, f64, Option<Vec<f64>>)> {
    let family = &family.inner;
    let found = run(py, None, None, |task| {
        stability::stability_radius(family, &point, &scales, (tol, boxes), task)
    })?;
    Ok((found.radius, found.upper, found.witness))
}

/// Counts over two parameters, the largest met over the ranges of the others.
#[pyfunction]
#[pyo3(signature = (family, ranges, parameters, first, second, boxes, threads=None, progress=None))]
#[expect(clippy::too_many_arguments, reason = "two axes and how to run")]
pub(crate) fn robust_map<'py>(
    py: Python<'py>,
    family: &PyFamily,
    ranges: Pairs,
    parameters: (usize, usize),
    first: Floats<'py>,
    second: Floats<'py>,
    boxes: usize,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Table<'py, i32>> {
    let (first, second) = (in_order(&first)?, in_order(&second)?);
    let axis = |parameter, points| Axis { parameter, points };
    let axes = [axis(parameters.0, &first), axis(parameters.1, &second)];
    let family = &family.inner;
    let counts = run(py, threads, progress.as_ref(), |task| {
        stability::robust_map(family, &ranges, axes, boxes, task)
    })?;
    counts.into_pyarray(py).reshape([first.len(), second.len()])
}
