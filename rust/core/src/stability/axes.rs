//! The axes of a map, and what is asked of it.

use super::demand::Demand;
use super::family::Family;
use crate::Task;

/// One axis of a map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Axis<'a> {
    /// Index of the parameter.
    pub parameter: usize,
    /// Its values, increasing.
    pub points: &'a [f64],
}

/// How the count of a cell is proved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Proof {
    /// By all crossings of its row, or the proof that a block of cells has none, and one count for all in between.
    #[default]
    Curves,
    /// By a count of its own.
    Cells,
}

/// What is asked of a map.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Question {
    /// Roots that offend against this are counted.
    pub demand: Demand,
    /// Is the spectral abscissa asked for too?
    pub abscissa: bool,
    /// How counts are proved.
    pub proof: Proof,
}

pub(super) struct Map<'a> {
    pub(super) family: &'a Family,
    pub(super) values: &'a [f64],
    pub(super) axes: [Axis<'a>; 2],
    pub(super) question: Question,
    pub(super) task: &'a Task,
}

pub(super) fn put(values: &mut [f64], axis: Axis<'_>, index: usize) {
    if let Some(value) = axis.points.get(index) {
        put_value(values, axis.parameter, *value);
    }
}

pub(super) fn put_value(values: &mut [f64], parameter: usize, value: f64) {
    if let Some(place) = values.get_mut(parameter) {
        *place = value;
    }
}
