//! Stability over two parameters of a family, cell by cell.
//!
//! Every cell is computed alone, from its two parameters: it equals [`judge`] of the family's
//! member there, and results have the same bits for any number of threads. What cannot be formed
//! (an overflow of a coefficient) is an undecided cell; delays that become negative are refused
//! before any work is done.

use rayon::prelude::*;

use super::cell::{Cell, judge};
use super::family::Family;
use crate::status::CellStatus;
use crate::{Error, Task};

/// More cells than anyone can look at.
const MAX_CELLS: usize = 50_000_000;

/// One axis of a map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Axis<'a> {
    /// Index of the parameter.
    pub parameter: usize,
    /// Its values.
    pub points: &'a [f64],
}

/// A stability map: row-major arrays, the first axis running slowest.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Chart {
    /// See [`Cell::unstable`].
    pub unstable: Vec<i32>,
    /// See [`Cell::abscissa`].
    pub abscissa: Vec<f64>,
    /// See [`Cell::status`].
    pub status: Vec<CellStatus>,
}

/// Judge the members of `family` over two of its parameters; `values` holds the others.
///
/// # Errors
/// [`Error::Argument`] where the axes do not name two parameters, a value is not finite or a delay
/// becomes negative; [`Error::TooMuch`] beyond 50 million cells; [`Error::Interrupted`].
pub fn map(
    family: &Family,
    values: &[f64],
    axes: [Axis<'_>; 2],
    abscissa: bool,
    task: &Task,
) -> Result<Chart, Error> {
    let [first, second] = axes;
    let cells = check(family, values, axes)?;
    let mut chart = Chart {
        unstable: vec![0; cells],
        abscissa: vec![f64::NAN; cells],
        status: vec![CellStatus::Undecided; cells],
    };
    let width = second.points.len();
    chart
        .unstable
        .par_iter_mut()
        .zip(chart.abscissa.par_iter_mut())
        .zip(chart.status.par_iter_mut())
        .enumerate()
        .try_for_each_init(
            || values.to_vec(),
            |values, (index, ((unstable, alpha), status))| {
                task.check()?;
                put(values, first, index / width);
                put(values, second, index % width);
                let cell = match family.at(values) {
                    Ok(h) => judge(&h, abscissa, task)?,
                    Err(_) => Cell::UNDECIDED,
                };
                (*unstable, *alpha, *status) = (cell.unstable, cell.abscissa, cell.status);
                task.advance(1);
                Ok(())
            },
        )?;
    Ok(chart)
}

fn put(values: &mut [f64], axis: Axis<'_>, index: usize) {
    if let (Some(place), Some(value)) = (values.get_mut(axis.parameter), axis.points.get(index)) {
        *place = *value;
    }
}

/// The number of cells, if the arguments make sense.
fn check(family: &Family, values: &[f64], axes: [Axis<'_>; 2]) -> Result<usize, Error> {
    let count = family.names().len();
    let [first, second] = axes;
    if first.parameter == second.parameter || first.parameter.max(second.parameter) >= count {
        return Err(Error::argument(format!(
            "axes along parameters {} and {} of {count}: a map needs two different ones",
            first.parameter, second.parameter
        )));
    }
    let cells = first.points.len().saturating_mul(second.points.len());
    if cells > MAX_CELLS {
        return Err(Error::TooMuch {
            what: "the map",
            limit: MAX_CELLS as u64,
            unit: "cells",
            advice: format!(
                "{} by {} is more than a picture holds: take fewer points, or several maps of \
                 smaller ranges",
                first.points.len(),
                second.points.len()
            ),
        });
    }
    let mut ranges: Vec<(f64, f64)> = values.iter().map(|value| (*value, *value)).collect();
    for Axis { parameter, points } in axes {
        if let Some(point) = points.iter().find(|point| !point.is_finite()) {
            return Err(Error::argument(format!(
                "{point} on an axis: its points must be finite"
            )));
        }
        let low = points.iter().copied().fold(f64::INFINITY, f64::min);
        let high = points.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if let (false, Some(range)) = (points.is_empty(), ranges.get_mut(parameter)) {
            *range = (low, high);
        }
    }
    if cells > 0 {
        family.check_delays(&ranges)?;
    }
    Ok(cells)
}
