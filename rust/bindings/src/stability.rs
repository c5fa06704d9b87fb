//! Bindings of `deadtime::stability`: families and maps.

use deadtime::stability::{
    self, Affine, Axis, Boundaries, Chart, Damping, Family, Proof, Question, Specification, Term,
    Vertex,
};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArrayDyn};
use pyo3::conversion::FromPyObjectOwned;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{column, in_order};
use crate::errors::to_python;
use crate::quasipoly::{QuasiPolynomial, wrapped};
use crate::runtime::run;

type Floats<'py> = PyReadonlyArrayDyn<'py, f64>;

/// One summand of a family; parameters that it does not depend on are left out.
#[derive(FromPyObject)]
struct FamilyTerm {
    coefficient: f64,
    /// The power of each parameter.
    exponents: Vec<(String, u32)>,
    /// The power of s.
    power: u32,
    /// The delay where all parameters are zero.
    constant: f64,
    /// The slope of the delay by each parameter.
    slopes: Vec<(String, f64)>,
}

/// What is asked of each cell of a map.
#[derive(FromPyObject)]
pub(crate) struct MapQuestion {
    decay: f64,
    damping: Option<(f64, f64)>,
    abscissa: bool,
    proof: String,
}

impl From<MapQuestion> for Question {
    fn from(question: MapQuestion) -> Self {
        Self {
            specification: specification(question.decay, question.damping),
            abscissa: question.abscissa,
            proof: match question.proof.as_str() {
                "cells" => Proof::Cells,
                _ => Proof::Curves,
            },
        }
    }
}

/// The cells of a map.
#[pyclass(frozen, get_all, module = "deadtime._deadtime")]
pub(crate) struct MapCells {
    unstable: Py<PyArray2<i32>>,
    abscissa: Option<Py<PyArray2<f64>>>,
    status: Py<PyArray2<u8>>,
}

/// One curve on which roots lie on the edge of stability.
#[pyclass(frozen, get_all, module = "deadtime._deadtime")]
pub(crate) struct MapBoundary {
    /// Values of the parameter that varies along the rows.
    gain: Py<PyArray1<f64>>,
    /// Indices of the rows.
    row: Py<PyArray1<i64>>,
    omega: Py<PyArray1<f64>>,
    crossing: Py<PyArray1<i32>>,
    /// Name of the parameter that varies along the rows.
    along: String,
}

/// A quasi-polynomial with named parameters.
#[pyclass(frozen, module = "deadtime._deadtime", name = "Family")]
pub(crate) struct PyFamily {
    pub(crate) inner: Family,
}

#[pymethods]
impl PyFamily {
    #[new]
    fn new(py: Python<'_>, names: Vec<String>, terms: Vec<FamilyTerm>) -> PyResult<Self> {
        let term = |term: FamilyTerm| Term {
            coefficient: term.coefficient,
            exponents: one_each(&names, &term.exponents),
            power: term.power,
            delay: Affine {
                constant: term.constant,
                slopes: one_each(&names, &term.slopes),
            },
        };
        let terms = terms.into_iter().map(term).collect();
        Family::new(names, terms)
            .map(|inner| Self { inner })
            .map_err(|error| to_python(py, error))
    }

    /// The member at `values`, which are in the order of the parameters.
    fn at(&self, py: Python<'_>, values: Vec<f64>) -> PyResult<QuasiPolynomial> {
        wrapped(py, self.inner.at(&values))
    }

    /// Counts, abscissas (if asked for) and statuses over the two parameters of `axes`.
    #[pyo3(signature = (axes, question, *, threads=None, progress=None))]
    fn map<'py>(
        &self,
        py: Python<'py>,
        axes: ByName<Floats<'py>>,
        question: MapQuestion,
        threads: Option<usize>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<MapCells> {
        let question = Question::from(question);
        with_axes(&self.inner, &axes, |axes| {
            let values = vec![0.0; self.inner.names().len()];
            let cells = run(py, threads, progress.as_ref(), |task| {
                stability::map(&self.inner, &values, axes, question, task)
            })?;
            let shape = axes.map(|axis| axis.points.len());
            cells_of(py, cells, question.abscissa, shape)
        })
    }

    /// The abscissas of the chains of roots over the two parameters of `axes`.
    fn chains<'py>(
        &self,
        py: Python<'py>,
        axes: ByName<Floats<'py>>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        with_axes(&self.inner, &axes, |axes| {
            let values = vec![0.0; self.inner.names().len()];
            let found = run(py, None, None, |task| {
                stability::chains(&self.inner, &values, axes, task)
            })?;
            let shape = axes.map(|axis| axis.points.len());
            found.into_pyarray(py).reshape(shape)
        })
    }

    /// The curves on which roots lie on the edge of stability; None where they cannot be followed.
    #[pyo3(signature = (axes, *, decay, damping))]
    fn boundaries<'py>(
        &self,
        py: Python<'py>,
        axes: ByName<Floats<'py>>,
        decay: f64,
        damping: Option<(f64, f64)>,
    ) -> PyResult<Option<Vec<MapBoundary>>> {
        with_axes(&self.inner, &axes, |axes| {
            let values = vec![0.0; self.inner.names().len()];
            let found = run(py, None, None, |task| {
                stability::boundaries(
                    &self.inner,
                    &values,
                    axes,
                    specification(decay, damping),
                    task,
                )
            })?;
            found
                .map(|found| {
                    let curves = found.each_ref();
                    let curves = curves.map(|found| map_boundaries(py, &self.inner, axes, found));
                    let [first, second] = curves;
                    Ok([first?, second?].into_iter().flatten().collect())
                })
                .transpose()
        })
    }
}

/// A number for each name, zero for those that are not in the list.
fn one_each<T: Copy + Default>(names: &[String], listed: &[(String, T)]) -> Vec<T> {
    let number = |name: &String| {
        let found = listed.iter().find(|(known, _)| known == name);
        found.map_or_else(T::default, |(_, value)| *value)
    };
    names.iter().map(number).collect()
}

/// Hand the axes of a map to `work`, with their parameters as `family` numbers them.
pub(crate) fn with_axes<T>(
    family: &Family,
    axes: &ByName<Floats<'_>>,
    work: impl FnOnce([Axis<'_>; 2]) -> PyResult<T>,
) -> PyResult<T> {
    let places = axes.places(family)?;
    let points: Vec<_> = axes.values().map(in_order).collect::<PyResult<_>>()?;
    let ([first, second], [x, y]) = (&places[..], &points[..]) else {
        return Err(PyValueError::new_err(format!(
            "a map has two axes, but {} were given",
            places.len()
        )));
    };
    let axis = |parameter, points| Axis { parameter, points };
    work([axis(*first, x), axis(*second, y)])
}

fn map_boundaries(
    py: Python<'_>,
    family: &Family,
    axes: [Axis<'_>; 2],
    found: &Boundaries,
) -> PyResult<Vec<MapBoundary>> {
    let along = axes.get(found.along).map_or(0, |axis| axis.parameter);
    let along = family.names().get(along).cloned().unwrap_or_default();
    curves_of(py, &along, &found.curves)
}

/// The arrays of a map of this shape.
pub(crate) fn cells_of(
    py: Python<'_>,
    cells: Chart,
    with_abscissa: bool,
    shape: [usize; 2],
) -> PyResult<MapCells> {
    let status = column(&cells.status, |status| *status as u8)?;
    let abscissa = with_abscissa.then_some(cells.abscissa);
    Ok(MapCells {
        unstable: cells.unstable.into_pyarray(py).reshape(shape)?.unbind(),
        abscissa: abscissa
            .map(|values| values.into_pyarray(py).reshape(shape))
            .transpose()?
            .map(Bound::unbind),
        status: status.into_pyarray(py).reshape(shape)?.unbind(),
    })
}

/// The curves of a map along whose rows this parameter varies.
pub(crate) fn curves_of(
    py: Python<'_>,
    along: &str,
    curves: &[Vec<Vertex>],
) -> PyResult<Vec<MapBoundary>> {
    let boundary = |curve: &Vec<Vertex>| {
        Ok(MapBoundary {
            gain: column(curve, |vertex| vertex.gain)?
                .into_pyarray(py)
                .unbind(),
            row: column(curve, |vertex| vertex.row as i64)?
                .into_pyarray(py)
                .unbind(),
            omega: column(curve, |vertex| vertex.omega)?
                .into_pyarray(py)
                .unbind(),
            crossing: column(curve, |vertex| vertex.jump)?
                .into_pyarray(py)
                .unbind(),
            along: along.to_owned(),
        })
    };
    curves.iter().map(boundary).collect()
}

/// Decay, and (damping ratio, horizon).
pub(crate) fn specification(decay: f64, damping: Option<(f64, f64)>) -> Specification {
    Specification {
        decay,
        damping: damping.map(|(ratio, horizon)| Damping { ratio, horizon }),
    }
}

/// Names of parameters and the value of each.
pub(crate) struct ByName<T>(Vec<(String, T)>);

impl<'a, 'py, T: FromPyObjectOwned<'py>> FromPyObject<'a, 'py> for ByName<T> {
    type Error = PyErr;

    fn extract(object: Borrowed<'a, 'py, PyAny>) -> PyResult<Self> {
        let dict = object.cast::<PyDict>()?;
        let item = |(name, value): (Bound<'py, PyAny>, Bound<'py, PyAny>)| {
            let value = value.extract::<T>().map_err(Into::<PyErr>::into)?;
            Ok((name.extract::<String>()?, value))
        };
        dict.iter().map(item).collect::<PyResult<_>>().map(Self)
    }
}

impl<T> ByName<T> {
    /// Names and values, in the order of the dict.
    pub(crate) fn items(&self) -> impl Iterator<Item = &(String, T)> {
        self.0.iter()
    }

    /// The values, in the order of the dict.
    pub(crate) fn values(&self) -> impl Iterator<Item = &T> {
        self.0.iter().map(|(_, value)| value)
    }

    /// The index in `family` of each parameter, in the order of the dict.
    pub(crate) fn places(&self, family: &Family) -> PyResult<Vec<usize>> {
        let place = |(name, _): &(String, T)| {
            let found = family.names().iter().position(|known| known == name);
            found.ok_or_else(|| {
                PyValueError::new_err(format!(
                    "{name} is not a parameter of this expression. Its parameters are {}",
                    family.names().join(", ")
                ))
            })
        };
        self.0.iter().map(place).collect()
    }

    /// The values in the order of the parameters of `family`, `fill` where there is none.
    pub(crate) fn ordered(&self, family: &Family, fill: T) -> PyResult<Vec<T>>
    where
        T: Copy,
    {
        let mut values = vec![fill; family.names().len()];
        for (place, value) in self.places(family)?.into_iter().zip(self.values()) {
            if let Some(slot) = values.get_mut(place) {
                *slot = *value;
            }
        }
        Ok(values)
    }

    /// A dict with the same names: `values` are in the order of the parameters of `family`.
    pub(crate) fn named<'py, V>(
        &self,
        py: Python<'py>,
        family: &Family,
        values: &[V],
    ) -> PyResult<Bound<'py, PyDict>>
    where
        V: Copy + IntoPyObject<'py>,
    {
        let dict = PyDict::new(py);
        for (place, (name, _)) in self.places(family)?.into_iter().zip(&self.0) {
            if let Some(value) = values.get(place) {
                dict.set_item(name, *value)?;
            }
        }
        Ok(dict)
    }
}
