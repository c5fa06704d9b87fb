//! The history of a solution from what the caller gave: numbers or a function.

use deadtime::Error;
use deadtime::dde::breaks::BreakingPoint;
use deadtime::dde::history::{History, Piece};
use deadtime::dde::spectral::{Problem, approximate};
use pyo3::prelude::*;

use super::numbers::{finite, numbers};
use crate::errors::to_python;

/// Error of the history as a part of the tolerance.
const SHARE: f64 = 0.01;
/// What lasts longer than this part of the largest delay is seen in a history.
const RESOLUTION: f64 = 1e-3;

/// Fill in history and breaking points of a problem.
pub(super) fn read(
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
        vec![Piece::new(start - 1.0, start, 1, problem.initial.clone()).with_slopes()]
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
        .initial
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
    let gap = problem.longest.min(RESOLUTION * (start - first));
    let found = approximate((first, start), gap, breaks, rows, tolerance, |time, out| {
        let (values, slopes) = out.split_at_mut(dim);
        let read = sample("history", history, time, values).and_then(|()| match slope {
            Some(slope) => sample("the derivative of the history", slope, time, slopes),
            None => Ok(()),
        });
        read.map_err(|error| {
            failure = Some(error);
            Error::Caller
        })
    });
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
            "{name} returned shape {shape} at t={time}: give one number for each of {dim} \
             components"
        )
    })?;
    finite(out, |value| {
        format!(
            "{name} is {value} at t={time}: give finite values from t0 minus the largest delay to t0"
        )
    })
}
