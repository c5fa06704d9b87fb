//! All rows of a map. Along a row a gain varies in which the family is affine; the other parameter
//! varies from row to row.

use super::axes::{Axis, Map, put, put_value};
use super::chart::Chart;
use crate::Error;
use crate::memory::in_parallel;
use crate::stability::crossings::{Crossing, Members, Row};
use crate::stability::family::Family;

/// A map whose family is affine in the parameter along its rows.
pub(crate) struct Rows<'a> {
    map: &'a Map<'a>,
    /// Index of the axis along the rows.
    pub(crate) along: usize,
    constant: Family,
    slope: Family,
}

impl<'a> Rows<'a> {
    /// `None` where the family is affine in neither parameter, or points are not in order.
    ///
    /// Preferred is the axis along which the leading terms do not vary, which bounds the roots of a
    /// row; then one for which B has a term without s, so that a root at 0 crosses within rows and
    /// not between them; then the longer rows, which cost less for each cell.
    pub(crate) fn of(map: &'a Map<'a>) -> Option<Self> {
        let candidates = map.axes.iter().enumerate().filter_map(|(along, axis)| {
            let (constant, slope) = map.family.split(axis.parameter)?;
            if !axis.points.is_sorted() {
                return None;
            }
            let rank = (
                slope.degree() < constant.degree(),
                slope.has_constant(),
                axis.points.len(),
                along,
            );
            Some((
                rank,
                Self {
                    map,
                    along,
                    constant,
                    slope,
                },
            ))
        });
        candidates
            .max_by_key(|(rank, _)| *rank)
            .map(|(_, rows)| rows)
    }

    fn axis(&self) -> Axis<'a> {
        let [first, second] = self.map.axes;
        if self.along == 0 { first } else { second }
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

    pub(crate) fn crossings(&self) -> Result<Vec<Vec<Crossing>>, Error> {
        self.each(|_, members| Ok(members.found(self.map.task)?.unwrap_or_default()))
    }

    /// The counts along the middle column, where the family is affine in the other parameter as
    /// well. All rows start their counts from it.
    fn middle_column(&self) -> Result<Option<(usize, Row)>, Error> {
        let (axis, across) = (self.axis(), self.across());
        let column = axis.points.len() / 2;
        let Some((constant, slope)) = self.map.family.split(across.parameter) else {
            return Ok(None);
        };
        let mut values = self.map.values.to_vec();
        put(&mut values, axis, column);
        let member = |index: usize| {
            let mut values = values.clone();
            put(&mut values, across, index);
            self.map.family.at(&values).ok()
        };
        let mut bare = values.clone();
        put_value(&mut bare, across.parameter, 0.0);
        let parts = constant.at(&bare).ok().zip(slope.at(&bare).ok());
        let members = Members {
            parts: parts.as_ref().filter(|(_, b)| !b.is_zero()),
            points: across.points,
            member: &member,
            specification: self.map.question.specification,
            anchor: None,
            hold: None,
        };
        let sorted = across.points.is_sorted();
        let row = if sorted {
            members.crossed(self.map.task)?
        } else {
            Row::default()
        };
        Ok(Some((column, row)))
    }

    /// Apply `work` to all rows, in parallel.
    fn each<T: Default + Send>(
        &self,
        work: impl Fn(usize, Members<'_>) -> Result<T, Error> + Sync,
    ) -> Result<Vec<T>, Error> {
        let (axis, across) = (self.axis(), self.across());
        let rows = across.points.len();
        in_parallel(
            "the list of rows of the map",
            rows,
            || (),
            |(), index| {
                self.map.task.check()?;
                let mut values = self.map.values.to_vec();
                put(&mut values, across, index);
                let member = |cell: usize| {
                    let mut values = values.clone();
                    put(&mut values, axis, cell);
                    self.map.family.at(&values).ok()
                };
                let mut bare = values.clone();
                put_value(&mut bare, axis.parameter, 0.0);
                let parts = self.constant.at(&bare).ok().zip(self.slope.at(&bare).ok());
                let members = Members {
                    parts: parts.as_ref(),
                    points: axis.points,
                    member: &member,
                    specification: self.map.question.specification,
                    anchor: None,
                    hold: None,
                };
                work(index, members)
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
