//! Bindings of `deadtime::stability`.

use deadtime::stability::{self, Affine, Axis, Damping, Demand, Family, Proof, Question, Term};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArrayDyn, ToPyArray};
use pyo3::prelude::*;

use crate::arrays::{column, in_order};
use crate::errors::to_python;
use crate::runtime::run;

type Floats<'py> = PyReadonlyArrayDyn<'py, f64>;
type Table<'py, T> = Bound<'py, PyArray2<T>>;

/// Gains, rows, frequencies and jumps of a boundary.
type Curve<'py> = (
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<i32>>,
);

/// Counts, abscissas and statuses of a map.
type Charted<'py> = (Table<'py, i32>, Option<Table<'py, f64>>, Table<'py, u8>);

/// coefficient, exponents, power of s, constant part of the delay, its slopes.
type Row = (f64, Vec<u32>, u32, f64, Vec<f64>);

/// A quasi-polynomial with named parameters.
#[pyclass(frozen, module = "deadtime._deadtime", name = "Family")]
pub(crate) struct PyFamily {
    pub(crate) inner: Family,
}

#[pymethods]
impl PyFamily {
    #[new]
    fn new(py: Python<'_>, names: Vec<String>, terms: Vec<Row>) -> PyResult<Self> {
        let term = |(coefficient, exponents, power, constant, slopes)| Term {
            coefficient,
            exponents,
            power,
            delay: Affine { constant, slopes },
        };
        Family::new(names, terms.into_iter().map(term).collect())
            .map(|inner| Self { inner })
            .map_err(|error| to_python(py, error))
    }

    /// Coefficients (rows padded with zeros) and delays of the member at `values`.
    fn at<'py>(
        &self,
        py: Python<'py>,
        values: Vec<f64>,
    ) -> PyResult<(Table<'py, f64>, Bound<'py, PyArray1<f64>>)> {
        let h = self
            .inner
            .at(&values)
            .map_err(|error| to_python(py, error))?;
        let width = h.degree() + 1;
        let mut padded = Vec::with_capacity(width * h.delays().len());
        for row in h.coefficients() {
            padded.extend_from_slice(row);
            padded.resize(padded.len() + width - row.len(), 0.0);
        }
        let coefficients = padded.to_pyarray(py).reshape([h.delays().len(), width])?;
        Ok((coefficients, h.delays().to_pyarray(py)))
    }

    /// Counts, abscissas (if asked for) and statuses over two parameters; `values` holds the others.
    #[pyo3(signature = (values, parameters, first, second, decay, damping, abscissa, cells, threads=None, progress=None))]
    #[expect(
        clippy::too_many_arguments,
        reason = "two axes, what is asked and how to run"
    )]
    fn map<'py>(
        &self,
        py: Python<'py>,
        values: Vec<f64>,
        parameters: (usize, usize),
        first: Floats<'py>,
        second: Floats<'py>,
        decay: f64,
        damping: Option<(f64, f64)>,
        abscissa: bool,
        cells: bool,
        threads: Option<usize>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Charted<'py>> {
        let (first, second) = (in_order(&first)?, in_order(&second)?);
        let axes = axes(parameters, &first, &second);
        let question = Question {
            demand: demand(decay, damping),
            abscissa,
            proof: if cells { Proof::Cells } else { Proof::Curves },
        };
        let family = &self.inner;
        let chart = run(py, threads, progress.as_ref(), |task| {
            stability::map(family, &values, axes, question, task)
        })?;
        let shape = [first.len(), second.len()];
        let status = column(&chart.status, |status| *status as u8)?;
        let asked = abscissa.then_some(chart.abscissa);
        Ok((
            chart.unstable.into_pyarray(py).reshape(shape)?,
            asked
                .map(|values| values.into_pyarray(py).reshape(shape))
                .transpose()?,
            status.into_pyarray(py).reshape(shape)?,
        ))
    }

    /// The abscissas of the chains over two parameters; `values` holds the others.
    fn chains<'py>(
        &self,
        py: Python<'py>,
        values: Vec<f64>,
        parameters: (usize, usize),
        first: Floats<'py>,
        second: Floats<'py>,
    ) -> PyResult<Table<'py, f64>> {
        let (first, second) = (in_order(&first)?, in_order(&second)?);
        let axes = axes(parameters, &first, &second);
        let family = &self.inner;
        let found = run(py, None, None, |task| {
            stability::chains(family, &values, axes, task)
        })?;
        found.into_pyarray(py).reshape([first.len(), second.len()])
    }

    /// The axis along the rows, and the curves: positions on it, rows, frequencies and jumps.
    #[pyo3(signature = (values, parameters, first, second, decay, damping, threads=None))]
    #[expect(
        clippy::too_many_arguments,
        reason = "two axes, what is asked and how to run"
    )]
    fn boundaries<'py>(
        &self,
        py: Python<'py>,
        values: Vec<f64>,
        parameters: (usize, usize),
        first: Floats<'py>,
        second: Floats<'py>,
        decay: f64,
        damping: Option<(f64, f64)>,
        threads: Option<usize>,
    ) -> PyResult<Option<(usize, Vec<Curve<'py>>)>> {
        let (first, second) = (in_order(&first)?, in_order(&second)?);
        let axes = axes(parameters, &first, &second);
        let family = &self.inner;
        let found = run(py, threads, None, |task| {
            stability::boundaries(family, &values, axes, demand(decay, damping), task)
        })?;
        Ok(found.map(|found| {
            let curves = found.curves.into_iter().map(|curve| {
                let gains: Vec<f64> = curve.iter().map(|vertex| vertex.gain).collect();
                let rows: Vec<i64> = curve.iter().map(|vertex| vertex.row as i64).collect();
                let omegas: Vec<f64> = curve.iter().map(|vertex| vertex.omega).collect();
                let jumps: Vec<i32> = curve.iter().map(|vertex| vertex.jump).collect();
                (
                    gains.into_pyarray(py),
                    rows.into_pyarray(py),
                    omegas.into_pyarray(py),
                    jumps.into_pyarray(py),
                )
            });
            (found.along, curves.collect())
        }))
    }
}

fn axes<'a>(parameters: (usize, usize), first: &'a [f64], second: &'a [f64]) -> [Axis<'a>; 2] {
    let axis = |parameter, points| Axis { parameter, points };
    [axis(parameters.0, first), axis(parameters.1, second)]
}

/// Decay, and (damping ratio, horizon).
fn demand(decay: f64, damping: Option<(f64, f64)>) -> Demand {
    Demand {
        decay,
        damping: damping.map(|(ratio, horizon)| Damping { ratio, horizon }),
    }
}
