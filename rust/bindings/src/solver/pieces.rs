//! The polynomials of a solution and of its history: made of what the caller gave, evaluated, pickled
//! and copied.

use deadtime::Error;
use deadtime::dde::breaks::BreakingPoint;
use deadtime::dde::history::{History, Piece};
use deadtime::dde::spectral::{Problem, approximate};
use deadtime::memory::{collected, copied, filled, reserved};
use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArray1, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyType;

use crate::arrays::{converted, finite, numbers};
use crate::errors::to_python;

type Vector<'py> = PyReadonlyArray1<'py, f64>;

/// What memory is asked for.
const PIECES: &str = "the list of pieces of the solution";

/// Error of the history as a part of the tolerance.
const SHARE: f64 = 0.01;
/// Features of a history shorter than this part of the largest delay may be missed.
const RESOLUTION: f64 = 1e-3;

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
        let refused = || PyValueError::new_err("the pieces of the solution are not valid");
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
                    "t={time}: the solution is known only from {first} to {last}"
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

/// Fill in history and breaking points of a problem.
pub(super) fn read_history(
    problem: &mut Problem,
    history: &Bound<'_, PyAny>,
    slope: Option<&Bound<'_, PyAny>>,
    breaks: &[f64],
) -> PyResult<()> {
    let (start, dim) = (problem.start, problem.dim());
    let first = start - problem.memory();
    let mut points = Vec::new();
    let pieces = if !history.is_callable() {
        let mut value = vec![0.0; dim];
        let who = || "history".to_owned();
        numbers(history, &mut value, who, |shape| {
            format!("history has shape {shape}: give one number for each of {dim} components")
        })?;
        let before = if problem.delays.is_empty() {
            start - 1.0
        } else {
            first
        };
        vec![Piece::new(before, start, 1, value).with_slopes()]
    } else if problem.delays.is_empty() {
        vec![Piece::new(start - 1.0, start, 1, problem.y0.clone()).with_slopes()]
    } else {
        let found = fitted(problem, (first, start), history, slope, breaks)?;
        points = found.1;
        found.0
    };
    // The solution joins its history with a kink at least.
    let mut last = vec![0.0; dim];
    if let Some(piece) = pieces.last() {
        piece.value(start, &mut last);
    }
    let jumps = problem
        .y0
        .iter()
        .zip(&last)
        .enumerate()
        .any(|(d, (y, last))| {
            let atol = problem.atol.get(d).or(problem.atol.first());
            (y - last).abs() > SHARE * (atol.copied().unwrap_or(0.0) + problem.rtol * y.abs())
        });
    points.push(BreakingPoint {
        time: start,
        order: u32::from(!jumps),
    });
    problem.history = History::new(pieces);
    problem.breaks = points;
    Ok(())
}

/// Polynomials through a function, and through its derivative where it is given.
fn fitted(
    problem: &Problem,
    (first, start): (f64, f64),
    history: &Bound<'_, PyAny>,
    slope: Option<&Bound<'_, PyAny>>,
    breaks: &[f64],
) -> PyResult<(Vec<Piece>, Vec<BreakingPoint>)> {
    let dim = problem.dim();
    let rows = if slope.is_some() { 2 * dim } else { dim };
    let tolerance = |row: usize, size: f64| {
        let atol = problem.atol.get(row % dim).or(problem.atol.first());
        SHARE * (atol.copied().unwrap_or(0.0) + problem.rtol * size)
    };
    let mut failure = None;
    let gap = problem.max_step.min(RESOLUTION * (start - first));
    let found = approximate(
        (first, start),
        gap,
        breaks,
        rows,
        tolerance,
        |times, out| {
            let read = times
                .iter()
                .zip(out.chunks_exact_mut(rows))
                .try_for_each(|(time, out)| {
                    let (values, slopes) = out.split_at_mut(dim);
                    sample("history", history, *time, values)?;
                    match slope {
                        Some(slope) => {
                            sample("the derivative of the history", slope, *time, slopes)
                        }
                        None => Ok(()),
                    }
                });
            read.map_err(|error| {
                failure = Some(error);
                Error::Caller
            })
        },
    );
    if let Some(error) = failure {
        return Err(error);
    }
    let found = found.map_err(|error| to_python(history.py(), error))?;
    let pieces = found.pieces.into_iter().map(|mut piece| {
        if slope.is_some() {
            piece.slopes = piece.coefficients.split_off(dim * piece.terms);
            piece
        } else {
            piece.with_slopes()
        }
    });
    Ok((pieces.collect(), found.breaks))
}

/// One value of a function of time.
fn sample(name: &str, function: &Bound<'_, PyAny>, time: f64, out: &mut [f64]) -> PyResult<()> {
    let dim = out.len();
    let found = function.call1((time,))?;
    let who = || format!("{name} at t={time}");
    numbers(&found, out, who, |shape| {
        format!(
            "{name} returned an array of shape {shape} at t={time}: return one number for each of \
             {dim} components"
        )
    })?;
    finite(out, |value| {
        format!(
            "{name} is {value} at t={time}: give finite values from t0 minus the largest delay to t0"
        )
    })
}
