//! Bindings of `deadtime::stability`.

use deadtime::stability::{self, Affine, Axis, Family, Term};
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArrayDyn, ToPyArray};
use pyo3::prelude::*;

use crate::arrays::in_order;
use crate::errors::to_python;
use crate::runtime::run;

type Floats<'py> = PyReadonlyArrayDyn<'py, f64>;
type Table<'py, T> = Bound<'py, PyArray2<T>>;

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

    /// Counts, abscissas and statuses over two parameters; `values` holds the others.
    #[pyo3(signature = (values, parameters, first, second, abscissa, threads=None, progress=None))]
    #[expect(clippy::too_many_arguments, reason = "two axes and how to run")]
    fn map<'py>(
        &self,
        py: Python<'py>,
        values: Vec<f64>,
        parameters: (usize, usize),
        first: Floats<'py>,
        second: Floats<'py>,
        abscissa: bool,
        threads: Option<usize>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<(Table<'py, i32>, Table<'py, f64>, Table<'py, u8>)> {
        let (first, second) = (in_order(&first), in_order(&second));
        let axis = |parameter, points| Axis { parameter, points };
        let axes = [axis(parameters.0, &first), axis(parameters.1, &second)];
        let family = &self.inner;
        let chart = run(py, threads, progress.as_ref(), |task| {
            stability::map(family, &values, axes, abscissa, task)
        })?;
        let shape = [first.len(), second.len()];
        let status: Vec<u8> = chart.status.iter().map(|status| *status as u8).collect();
        Ok((
            chart.unstable.to_pyarray(py).reshape(shape)?,
            chart.abscissa.to_pyarray(py).reshape(shape)?,
            status.to_pyarray(py).reshape(shape)?,
        ))
    }
}
