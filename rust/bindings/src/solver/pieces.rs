//! The polynomials of a solution, to be evaluated, pickled and copied.

use deadtime::dde::history::{History, Piece};
use deadtime::memory::{collected, copied, filled, reserved};
use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArray1, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyType;

use crate::arrays::converted;

type Vector<'py> = PyReadonlyArray1<'py, f64>;

/// What memory is asked for.
const PIECES: &str = "the list of pieces of the solution";

/// The polynomials of a solution and of its history.
#[pyclass(frozen, module = "deadtime._deadtime")]
pub(crate) struct DelayPieces {
    pub(super) history: History,
    pub(super) dim: usize,
    pub(super) end: f64,
}

/// Dimension, end of the solution; starts, ends and numbers of coefficients of the pieces; all
/// coefficients one after the other.
type Parts<'py> = (
    usize,
    f64,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<u64>>,
    Bound<'py, PyArray1<f64>>,
);

#[pymethods]
impl DelayPieces {
    /// The pieces from what [`Self::__reduce__`] takes them apart into.
    #[new]
    fn new(
        dim: usize,
        end: f64,
        starts: Vector<'_>,
        ends: Vector<'_>,
        terms: PyReadonlyArray1<'_, u64>,
        coefficients: Vector<'_>,
    ) -> PyResult<Self> {
        let refused = || PyValueError::new_err("these are no pieces of a solution");
        let spans = starts.as_array().into_iter().zip(ends.as_array());
        let (lengths, coefficients) = (terms.as_array(), coefficients.as_slice()?);
        let whole = starts.len() == ends.len() && starts.len() == terms.len();
        let mut rest = coefficients;
        let mut pieces = converted(reserved(PIECES, lengths.len()))?;
        for ((start, end), terms) in spans.zip(lengths) {
            let terms = usize::try_from(*terms).map_err(|_| refused())?;
            let count = terms.checked_mul(dim).filter(|count| *count > 0);
            let (own, others) = count
                .and_then(|count| rest.split_at_checked(count))
                .ok_or_else(refused)?;
            rest = others;
            let own = converted(copied(PIECES, own))?;
            pieces.push(Piece::new(*start, *end, terms, own));
        }
        if !whole || !rest.is_empty() {
            return Err(refused());
        }
        Ok(Self {
            history: History::new(pieces),
            dim,
            end,
        })
    }

    /// For pickle and copy.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyType>, Parts<'py>)> {
        let pieces = || self.history.pieces();
        let total = pieces().map(|piece| piece.coefficients.len()).sum();
        let mut coefficients = converted(reserved(PIECES, total))?;
        for piece in pieces() {
            coefficients.extend_from_slice(&piece.coefficients);
        }
        let starts = converted(collected(PIECES, pieces().map(|piece| piece.start)))?;
        let ends = converted(collected(PIECES, pieces().map(|piece| piece.end)))?;
        let terms = converted(collected(PIECES, pieces().map(|piece| piece.terms as u64)))?;
        let parts = (
            self.dim,
            self.end,
            starts.into_pyarray(py),
            ends.into_pyarray(py),
            terms.into_pyarray(py),
            coefficients.into_pyarray(py),
        );
        Ok((py.get_type::<Self>(), parts))
    }

    /// First and last time at which there are values.
    #[getter]
    fn span(&self) -> (f64, f64) {
        let first = self
            .history
            .pieces()
            .next()
            .map_or(self.end, |piece| piece.start);
        (first, self.end)
    }

    /// Number of polynomials.
    #[getter]
    fn count(&self) -> usize {
        self.history.len()
    }

    /// Values (`nu` 0) or derivatives (1) at the times: component, time. A joint belongs to the
    /// later piece.
    fn evaluate<'py>(
        &self,
        py: Python<'py>,
        times: Vector<'py>,
        nu: u8,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (first, last) = self.span();
        let shape = (self.dim, times.as_array().len());
        let mut values = array(0.0, shape)?;
        let mut value = vec![0.0; self.dim];
        for (mut column, &time) in values.columns_mut().into_iter().zip(times.as_array()) {
            if !(time >= first && time <= last) {
                return Err(PyValueError::new_err(format!(
                    "t={time}: the solution is known from {first} to {last} only"
                )));
            }
            let index = self.history.locate(time);
            if let Some(piece) = index.and_then(|index| self.history.piece(index)) {
                if nu == 0 {
                    piece.value(time, &mut value);
                } else {
                    piece.slope(time, &mut value);
                }
            }
            for (out, value) in column.iter_mut().zip(&value) {
                *out = *value;
            }
        }
        Ok(values.into_pyarray(py))
    }
}

/// An array of one value.
pub(super) fn array(value: f64, shape: (usize, usize)) -> PyResult<Array2<f64>> {
    let values = filled(
        "the array of values of the solution",
        value,
        shape.0.saturating_mul(shape.1),
    );
    Array2::from_shape_vec(shape, converted(values)?)
        .map_err(|error| PyValueError::new_err(error.to_string()))
}
