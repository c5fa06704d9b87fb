//! Stability of loops with a hold over two parameters.
//!
//! Along a row a gain varies in which the feedback is affine; everything else may vary from row to
//! row. Where it does not, as in a map over two gains, the model is shared by all rows, and the
//! counts of all rows start from those of one column. Rows are counted as those of any map
//! (`crossings`). A row of one cell is judged alone.

use super::model::{LoopPolynomials, Polynomial, share_of_errors};
use crate::parallel;
use crate::quasipoly::QuasiPolynomial;
use crate::stability::crossings::Members;
use crate::stability::hold::Hold;
use crate::stability::map::{Chart, Lines, Proof, Question, Vertex, join_both};
use crate::stability::specification::Specification;
use crate::{Error, Task};

/// Upper limit on the number of cells (bounds memory and time).
const MAX_CELLS: usize = 50_000_000;

/// Loops x′ = A x + B w, u = (K + k K₁) x + (L + k L₁) w, w the command a delay later. Every array
/// holds one entry for all rows, or one a row.
#[derive(Debug, Clone, Copy)]
pub struct LoopRows<'a> {
    /// Number of rows.
    pub rows: usize,
    /// Number of states in the arrays.
    pub states: usize,
    /// Number of states that are used, from the first on.
    pub used: &'a [f64],
    /// A, n × n an entry.
    pub a: &'a [f64],
    /// B, n an entry.
    pub b: &'a [f64],
    /// K, n an entry.
    pub k: &'a [f64],
    /// L.
    pub l: &'a [f64],
    /// K₁, n an entry.
    pub k_slope: &'a [f64],
    /// L₁.
    pub l_slope: &'a [f64],
    /// Delay, s.
    pub delay: &'a [f64],
    /// Sample time, s.
    pub sample_time: &'a [f64],
    /// The values of k in every row.
    pub points: &'a [f64],
}

/// A row with numbers: everything that its members follow from.
struct Numbers {
    hold: Hold,
    delay: f64,
    a: Vec<f64>,
    constant: Vec<f64>,
    slope: Vec<f64>,
    /// A and B of A + k B.
    parts: Option<(QuasiPolynomial, QuasiPolynomial)>,
}

/// Counts (and abscissas) of every row; row-major, or with the rows as columns. `column` is the
/// column of the map at the middle of its points: one row, with a value of k for each row of the map.
///
/// # Errors
/// [`Error::Argument`] for arrays of other lengths or models without sense; [`Error::TooMuch`]
/// beyond 50 million cells; [`Error::Interrupted`].
pub fn held_map(
    rows: &LoopRows<'_>,
    column: Option<&LoopRows<'_>>,
    question: Question,
    as_columns: bool,
    task: &Task,
) -> Result<Chart, Error> {
    question.specification.check()?;
    let cells = rows.rows.saturating_mul(rows.points.len());
    if cells > MAX_CELLS {
        return Err(Error::TooMuch {
            what: "the map",
            limit: MAX_CELLS as u64,
            unit: "cells",
            advice: format!(
                "{} by {} points are too many for a map: give fewer points, or make several maps \
                 of smaller ranges",
                rows.rows,
                rows.points.len()
            ),
        });
    }
    if cells == 0 {
        return Ok(Chart::default());
    }
    let shared = rows.shared_model()?;
    let anchors = match column.filter(|column| column.points.is_sorted()) {
        None => None,
        Some(column) => {
            let numbers = column.numbers(0, None)?;
            let counted = numbers.members(column.points, question.specification, |members| {
                members.crossed(task)
            })?;
            Some((rows.points.len() / 2, counted))
        }
    };
    let counted = rows.each(task, |index| {
        let numbers = rows.numbers(index, shared.as_ref())?;
        let row = numbers.members(rows.points, question.specification, |members| {
            let members = Members {
                anchor: anchors
                    .as_ref()
                    .and_then(|(place, row)| Some((*place, row.cell(index)?))),
                ..*members
            };
            let counts = if question.proof == Proof::Cells || !rows.points.is_sorted() {
                members.alone(task)?
            } else {
                members.count(task)?
            };
            if question.abscissa {
                members.abscissas(&counts, task)
            } else {
                Ok(counts)
            }
        })?;
        task.advance(rows.points.len() as u64);
        Ok(row)
    })?;
    let mut chart = Chart::stable(cells)?;
    let width = if as_columns {
        rows.rows
    } else {
        rows.points.len()
    };
    chart.fill(&counted, width, as_columns)?;
    Ok(chart)
}

/// The curves on which roots lie on the edge of the specification: those along the rows, and those
/// that run along them and are found by the columns. `columns` are the loops of the same map along
/// the parameter that varies from row to row, if that is a gain as well.
///
/// # Errors
/// As for [`held_map`].
pub fn held_boundaries(
    rows: &LoopRows<'_>,
    columns: Option<&LoopRows<'_>>,
    specification: Specification,
    task: &Task,
) -> Result<[Vec<Vec<Vertex>>; 2], Error> {
    specification.check()?;
    let is_ordered = |lines: &&LoopRows<'_>| lines.points.is_sorted() && rows.points.is_sorted();
    let columns = columns.filter(is_ordered);
    let columns = columns.map(|columns| columns.lines(specification, task));
    let found = rows.lines(specification, task)?;
    Ok(join_both(&found, columns.transpose()?.as_ref()))
}

impl<'a> LoopRows<'a> {
    /// The crossings of all rows.
    fn lines(&self, specification: Specification, task: &Task) -> Result<Lines<'a>, Error> {
        let shared = self.shared_model()?;
        let crossings = self.each(task, |index| {
            let numbers = self.numbers(index, shared.as_ref())?;
            numbers.members(self.points, specification, |members| {
                Ok(members.found(task)?.unwrap_or_default())
            })
        })?;
        Ok(Lines {
            crossings,
            points: self.points,
        })
    }

    /// An entry of an array for a row.
    fn entry(
        &self,
        name: &str,
        data: &'a [f64],
        width: usize,
        row: usize,
    ) -> Result<&'a [f64], Error> {
        let start = if data.len() == width { 0 } else { row * width };
        let fits = data.len() == width || data.len() == width * self.rows;
        match data.get(start..start + width).filter(|_| fits) {
            Some(entry) => Ok(entry),
            None => refuse!(
                "{name} has {} elements: give {width} for all rows or {} for {} rows",
                data.len(),
                width * self.rows,
                self.rows
            ),
        }
    }

    fn number(&self, name: &str, data: &'a [f64], row: usize) -> Result<f64, Error> {
        let entry = self.entry(name, data, 1, row)?;
        Ok(entry.first().copied().unwrap_or(f64::NAN))
    }

    fn used(&self, row: usize) -> Result<usize, Error> {
        let used = self.number("the number of states", self.used, row)?;
        refuse_if!(
            !(used >= 0.0 && used <= self.states as f64),
            "{used} states are used, but there are {}",
            self.states
        );
        Ok(used as usize)
    }

    fn model(&self, row: usize) -> Result<LoopPolynomials, Error> {
        let (n, used) = (self.states, self.used(row)?);
        let a = self.entry("A", self.a, n * n, row)?;
        let a: Vec<f64> = (0..used * used)
            .map(|place| a[place / used * n + place % used])
            .collect();
        LoopPolynomials::new(
            &a,
            &self.entry("B", self.b, n, row)?[..used],
            self.number("delay", self.delay, row)?,
            self.number("sample_time", self.sample_time, row)?,
        )
    }

    /// The model of all rows, where they have the same.
    fn shared_model(&self) -> Result<Option<LoopPolynomials>, Error> {
        let n = self.states;
        let is_shared = self.a.len() == n * n
            && self.b.len() == n
            && self.delay.len() == 1
            && self.sample_time.len() == 1
            && self.used.len() == 1;
        is_shared.then(|| self.model(0)).transpose()
    }

    fn numbers(&self, row: usize, shared: Option<&LoopPolynomials>) -> Result<Numbers, Error> {
        let own;
        let model = match shared {
            Some(model) => model,
            None => {
                own = self.model(row)?;
                &own
            }
        };
        let (n, used) = (self.states, self.used(row)?);
        let constant = model.feedback(
            &self.entry("K", self.k, n, row)?[..used],
            self.number("L", self.l, row)?,
        );
        let slope = model.feedback(
            &self.entry("the slope of K", self.k_slope, n, row)?[..used],
            self.number("the slope of L", self.l_slope, row)?,
        );
        let sample_time = self.number("sample_time", self.sample_time, row)?;
        Ok(Numbers::new(model, constant, slope, sample_time))
    }

    /// Apply `work` to all rows, in parallel.
    fn each<T: Default + Send>(
        &self,
        task: &Task,
        work: impl Fn(usize) -> Result<T, Error> + Sync,
    ) -> Result<Vec<T>, Error> {
        parallel::results(
            "the list of rows of the map",
            self.rows,
            || (),
            |(), index| {
                task.check()?;
                work(index)
            },
        )
    }
}

impl Numbers {
    fn new(
        model: &LoopPolynomials,
        constant: Polynomial,
        slope: Polynomial,
        sample_time: f64,
    ) -> Self {
        let coefficients =
            share_of_errors(&[&model.a, &constant, &slope], model.delay, sample_time);
        let negative = |row: &[f64]| row.iter().map(|c| -c).collect::<Vec<f64>>();
        let a = model.a.coefficients.clone();
        let rows = vec![a.clone(), negative(&constant.coefficients)];
        let with = QuasiPolynomial::new(rows, vec![0.0, model.delay]);
        let by = QuasiPolynomial::new(vec![negative(&slope.coefficients)], vec![model.delay]);
        Self {
            hold: Hold {
                sample_time,
                coefficients,
            },
            delay: model.delay,
            a,
            constant: constant.coefficients,
            slope: slope.coefficients,
            parts: with.ok().zip(by.ok()).filter(|_| coefficients.is_finite()),
        }
    }

    /// h at one k; `None` where a coefficient overflows or is not known.
    fn member(&self, k: f64) -> Option<QuasiPolynomial> {
        let row = self.constant.iter().zip(&self.slope);
        let row = row
            .map(|(constant, slope)| -(constant + k * slope))
            .collect();
        let rows = vec![self.a.clone(), row];
        self.parts.as_ref()?;
        QuasiPolynomial::new(rows, vec![0.0, self.delay]).ok()
    }

    fn members<T>(
        &self,
        points: &[f64],
        specification: Specification,
        work: impl FnOnce(&Members<'_>) -> Result<T, Error>,
    ) -> Result<T, Error> {
        let member = |index: usize| self.member(points.get(index).copied()?);
        work(&Members {
            parts: self.parts.as_ref(),
            delay: None,
            points,
            member: &member,
            specification,
            anchor: None,
            hold: Some(self.hold),
        })
    }
}
