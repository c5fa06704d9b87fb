//! The axes of a map, and the question it answers.

use crate::stability::family::Family;
use crate::stability::specification::Specification;
use crate::{Error, Task};

/// One axis of a map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Axis<'a> {
    /// Index of the parameter.
    pub parameter: usize,
    /// Its values, increasing.
    pub points: &'a [f64],
}

impl Axis<'_> {
    /// The least and the largest point; `None` where there is no point.
    ///
    /// # Errors
    /// [`Error::Argument`] where a point is not finite.
    pub(crate) fn range(&self) -> Result<Option<(f64, f64)>, Error> {
        if let Some(point) = self.points.iter().find(|point| !point.is_finite()) {
            refuse!("an axis contains {point}, but its points must be finite");
        }
        let low = self.points.iter().copied().fold(f64::INFINITY, f64::min);
        let high = self
            .points
            .iter()
            .copied()
            .fold(f64::NEG_INFINITY, f64::max);
        Ok((!self.points.is_empty()).then_some((low, high)))
    }
}

/// Check that the axes name two parameters of the family.
///
/// # Errors
/// [`Error::Argument`] where they do not.
pub(crate) fn check_parameters(family: &Family, axes: [Axis<'_>; 2]) -> Result<(), Error> {
    let count = family.names().len();
    let [first, second] = axes;
    refuse_if!(
        first.parameter == second.parameter || first.parameter.max(second.parameter) >= count,
        "the axes are along parameters {} and {} of {count}, but a map needs two different \
         parameters",
        first.parameter,
        second.parameter
    );
    Ok(())
}

/// How the count of a cell is proved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Proof {
    /// By all crossings of its row, or by the proof that a block of cells has none, and one count
    /// for all cells in between.
    #[default]
    Curves,
    /// By a separate count.
    Cells,
}

/// The question that a map answers.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Question {
    /// The specification whose violating roots are counted.
    pub specification: Specification,
    /// Is the spectral abscissa requested as well?
    pub abscissa: bool,
    /// How counts are proved.
    pub proof: Proof,
}

pub(crate) struct Map<'a> {
    pub(crate) family: &'a Family,
    pub(crate) values: &'a [f64],
    pub(crate) axes: [Axis<'a>; 2],
    pub(crate) question: Question,
    pub(crate) task: &'a Task,
}

pub(crate) fn put(values: &mut [f64], axis: Axis<'_>, index: usize) {
    if let Some(value) = axis.points.get(index) {
        put_value(values, axis.parameter, *value);
    }
}

pub(crate) fn put_value(values: &mut [f64], parameter: usize, value: f64) {
    if let Some(place) = values.get_mut(parameter) {
        *place = value;
    }
}
