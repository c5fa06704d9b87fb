//! All rows of a map. Along a row a gain varies in which the family is affine, or a delay; the other
//! parameter varies from row to row.

use super::axes::{Axis, Map, put, put_value};
use super::block::Grid;
use super::blocks;
use super::chart::Chart;
use crate::Error;
use crate::parallel;
use crate::stability::crossings::{ByParts, Crossing, Delay, Members, Row};
use crate::stability::family::Family;
use crate::stability::specification::Specification;

/// One axis of a map with the two parts of the family along it: A + k B, or A + e^(−s σ T) B.
struct Line<'a> {
    axis: Axis<'a>,
    constant: Family,
    slope: Family,
    delay_slope: Option<f64>,
}

impl<'a> Line<'a> {
    /// `None` where the parameter of the axis does not enter as a gain.
    fn of_gain(map: &Map<'a>, axis: Axis<'a>) -> Option<Self> {
        let (constant, slope) = map.family.split(axis.parameter)?;
        Some(Self {
            axis,
            constant,
            slope,
            delay_slope: None,
        })
    }

    /// `None` where the parameter is not the delay of some terms.
    fn of_delay(map: &Map<'a>, axis: Axis<'a>) -> Option<Self> {
        let (constant, slope, delay_slope) = map.family.split_delay(axis.parameter)?;
        Some(Self {
            axis,
            constant,
            slope,
            delay_slope: Some(delay_slope),
        })
    }

    /// Apply `work` to the members along the axis, `values` holding all other parameters.
    fn members<T>(
        &self,
        map: &Map<'_>,
        values: &[f64],
        work: impl FnOnce(Members<'_>) -> Result<T, Error>,
    ) -> Result<T, Error> {
        let member = |index: usize| {
            let mut values = values.to_vec();
            put(&mut values, self.axis, index);
            map.family.at(&values).ok()
        };
        let mut bare = values.to_vec();
        match self.delay_slope {
            None => put_value(&mut bare, self.axis.parameter, 0.0),
            Some(_) => put(&mut bare, self.axis, 0),
        }
        let parts = self.constant.at(&bare).ok().zip(self.slope.at(&bare).ok());
        let by_parts = OneRow {
            map,
            values,
            axis: self.axis,
        };
        let delay = self.delay_slope.map(|slope| Delay {
            slope,
            by_parts: &by_parts,
        });
        work(Members {
            parts: parts.as_ref(),
            delay,
            points: self.axis.points,
            member: &member,
            specification: map.question.specification,
            anchor: None,
            hold: None,
        })
    }
}

/// The members along one axis, `values` holding the other parameters.
struct OneRow<'a> {
    map: &'a Map<'a>,
    values: &'a [f64],
    axis: Axis<'a>,
}

impl OneRow<'_> {
    fn with(&self, specification: Specification) -> Grid<'_, 1> {
        Grid::row(self.map.family, self.values, self.axis, specification)
    }
}

impl ByParts for OneRow<'_> {
    fn counts(&self) -> Result<Row, Error> {
        self.with(self.map.question.specification)
            .counts(self.map.task)
    }

    fn crossings(&self) -> Result<Vec<Crossing>, Error> {
        self.with(self.map.question.specification)
            .crossings(self.map.task)
    }

    fn is_clear(&self, line: f64, cells: [usize; 2]) -> Result<bool, Error> {
        self.with(Specification::left_of(line))
            .is_clear(cells, self.map.task)
    }
}

/// What rows are made for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Wanted {
    Counts,
    Abscissas,
    Boundaries,
}

/// A map whose family is affine in the parameter along its rows, or has it as one delay.
pub(crate) struct Rows<'a> {
    map: &'a Map<'a>,
    /// Index of the axis along the rows.
    pub(crate) along: usize,
    line: Line<'a>,
}

impl<'a> Rows<'a> {
    /// `None` where no axis has such a parameter, or points are not in order.
    ///
    /// Counts prefer a delay, whose crossings have few frequencies, each with many delays; boundaries
    /// and abscissas prefer a gain. Otherwise that axis is preferred along which the leading
    /// terms do not vary, which bounds the roots of a row; then one for which B has a term without
    /// s, so that a root at 0 crosses within rows and not between them; then the longer rows, which
    /// cost less for each cell.
    pub(crate) fn of(map: &'a Map<'a>, wanted: Wanted) -> Option<Self> {
        Self::along(map, wanted, &[0, 1])
    }

    /// [`Self::of`] along one of these axes.
    pub(crate) fn along(map: &'a Map<'a>, wanted: Wanted, axes: &[usize]) -> Option<Self> {
        let all = map.axes.into_iter().enumerate();
        let chosen = all.filter(|(along, _)| axes.contains(along));
        let lines = chosen.flat_map(|(along, axis)| {
            // Only the imaginary axis is crossed at frequencies that do not depend on the delay.
            let Specification { decay, damping } = map.question.specification;
            let suits = damping.is_none() && (decay == 0.0 || wanted == Wanted::Abscissas);
            let delay = Line::of_delay(map, axis).filter(|_| suits);
            let lines = [delay, Line::of_gain(map, axis)];
            lines.into_iter().flatten().map(move |line| (along, line))
        });
        let sorted = lines.filter(|(_, line)| line.axis.points.is_sorted());
        let best = sorted.max_by_key(|(along, line)| {
            (
                line.delay_slope.is_some() == (wanted == Wanted::Counts),
                line.slope.degree() < line.constant.degree(),
                line.slope.has_constant(),
                line.axis.points.len(),
                *along,
            )
        });
        best.map(|(along, line)| Self { map, along, line })
    }

    fn across(&self) -> Axis<'a> {
        let [first, second] = self.map.axes;
        if self.along == 0 { second } else { first }
    }

    fn rows(&self) -> Result<Vec<Row>, Error> {
        let middle = self.middle_column()?;
        self.each(|index, members| {
            let members = Members {
                anchor: middle
                    .as_ref()
                    .and_then(|(column, row)| Some((*column, row.cell(index)?))),
                ..members
            };
            let counts = members.count(self.map.task)?;
            let row = if self.map.question.abscissa {
                members.abscissas(&counts, self.map.task)?
            } else {
                counts
            };
            self.map.task.advance(members.points.len() as u64);
            Ok(row)
        })
    }

    /// Are the boundaries curves? Not along a delay where a root of all members stays at 0: there every
    /// cell is on the boundary.
    pub(crate) fn has_boundaries(&self) -> bool {
        self.line.delay_slope.is_none() || blocks::grid(self.map).is_some()
    }

    pub(crate) fn crossings(&self) -> Result<Vec<Vec<Crossing>>, Error> {
        let is_divisible = blocks::grid(self.map).is_some();
        self.each(|index, members| match members.found(self.map.task)? {
            Some(found) => Ok(found),
            None if is_divisible => {
                let mut values = self.map.values.to_vec();
                put(&mut values, self.across(), index);
                let row = OneRow {
                    map: self.map,
                    values: &values,
                    axis: self.line.axis,
                };
                row.crossings()
            }
            None => Ok(Vec::new()),
        })
    }

    /// The counts along the middle column, where the other parameter is a gain or a delay as well.
    /// All rows start their counts from it.
    fn middle_column(&self) -> Result<Option<(usize, Row)>, Error> {
        let across = self.across();
        let column = self.line.axis.points.len() / 2;
        let gain = || Line::of_gain(self.map, across);
        let Some(line) = Line::of_delay(self.map, across).or_else(gain) else {
            return Ok(None);
        };
        let mut values = self.map.values.to_vec();
        put(&mut values, self.line.axis, column);
        let row = line.members(self.map, &values, |members| {
            let varies = members.parts.is_none_or(|(_, b)| !b.is_zero());
            if across.points.is_sorted() && varies {
                members.crossed(self.map.task)
            } else {
                Ok(Row::default())
            }
        })?;
        Ok(Some((column, row)))
    }

    /// Apply `work` to all rows, in parallel.
    fn each<T: Default + Send>(
        &self,
        work: impl Fn(usize, Members<'_>) -> Result<T, Error> + Sync,
    ) -> Result<Vec<T>, Error> {
        let across = self.across();
        parallel::results(
            "the list of rows of the map",
            across.points.len(),
            || (),
            |(), index| {
                self.map.task.check()?;
                let mut values = self.map.values.to_vec();
                put(&mut values, across, index);
                self.line
                    .members(self.map, &values, |members| work(index, members))
            },
        )
    }

    pub(crate) fn chart(&self) -> Result<Chart, Error> {
        let rows = self.rows()?;
        let [first, second] = self.map.axes;
        let mut chart = Chart::stable(first.points.len() * second.points.len())?;
        chart.fill(&rows, second.points.len(), self.along == 0)?;
        Ok(chart)
    }
}
