//! The Jacobian of the right-hand side by forward differences, sparse where it is sparse.
//!
//! J = ∂f/∂y, with ∂f/∂z for the delays shorter than the element, at one node. The first calls take
//! the base and three columns in which all components move at once, with fixed pseudo-random signs.
//! They show how much each row can change, so that changes by rounding errors are distinguished
//! from entries. Where each row changes as by one entry on the diagonal in all three, the Jacobian
//! is taken as its diagonal: a row with other entries looks so by chance, which may cost sweeps but
//! no accuracy. A pattern that was given or found before is used by groups, and its result is
//! compared with the three columns; where they differ, the pattern is determined again, one
//! component at a time. Columns come in blocks, so that memory grows with the entries and not with
//! the square of the components.

use super::nodes::Nodes;
use super::problem::{Columns, Equation};
use super::sparsity::Sparsity;
use crate::linear_algebra::vectors::add_multiple;
use crate::{Error, Task};

/// Number of columns in which all components move.
const CHECKS: usize = 3;
/// Number of components up to which every entry is kept and none is checked.
const FEW: usize = 8;
/// Differences below this share of what a row can change count as rounding errors.
const ROUNDING: f64 = 1e-6;
/// Share of what a row can change by which a pattern may be wrong.
const AGREED: f64 = 1e-2;
/// Share of the largest entry on the diagonal that others may have to be left out.
pub(super) const ALONE: f64 = 1e-3;
/// Upper limit on the numbers in the arguments of one call (bounds memory).
const BLOCK: usize = 1 << 21;
/// Upper limit on the entries of a Jacobian (bounds memory).
const MOST: usize = 1 << 22;

/// A sparse matrix, with an order of the components that makes its band narrow.
#[derive(Debug, Default)]
pub(super) struct Jacobian {
    pattern: Sparsity,
    values: Vec<f64>,
    /// Index of each component in the banded order.
    pub(super) place: Vec<usize>,
    band: usize,
}

impl Jacobian {
    /// A matrix from its pattern and its entries.
    pub(super) fn new(pattern: Sparsity, values: Vec<f64>) -> Self {
        let (place, band) = pattern.banded();
        Self {
            pattern,
            values,
            place,
            band,
        }
    }

    /// Number of components.
    pub(super) fn dim(&self) -> usize {
        self.pattern.dim()
    }

    /// Largest distance of an entry from the diagonal in the banded order.
    pub(super) fn band(&self) -> usize {
        self.band
    }

    /// Row, column and value of the entries.
    pub(super) fn entries(&self) -> impl Iterator<Item = (usize, usize, f64)> {
        (0..self.dim()).flat_map(move |column| {
            let range = self.pattern.column(column);
            range.map(move |at| (self.pattern.rows[at], column, self.values[at]))
        })
    }

    /// Subtract (I − (h/2) B ⊗ J) of a step (node, component) from a right-hand side.
    pub(super) fn defect(&self, nodes: &Nodes, half: f64, step: &[f64], right: &mut [f64]) {
        let dim = self.dim();
        let mut slopes = vec![0.0; step.len()];
        for (slopes, step) in slopes.chunks_exact_mut(dim).zip(step.chunks_exact(dim)) {
            for (column, step) in step.iter().enumerate() {
                for at in self.pattern.column(column) {
                    slopes[self.pattern.rows[at]] += self.values[at] * step;
                }
            }
        }
        let weights = nodes.integrate.chunks_exact(nodes.order);
        let rows = right.chunks_exact_mut(dim).zip(step.chunks_exact(dim));
        for ((right, step), weights) in rows.zip(weights) {
            add_multiple(right, -1.0, step);
            for (slopes, weight) in slopes.chunks_exact(dim).zip(weights) {
                add_multiple(right, half * weight, slopes);
            }
        }
    }
}

/// The point at which a Jacobian is evaluated.
#[derive(Debug)]
pub(super) struct Point<'a> {
    pub(super) t: f64,
    pub(super) y: &'a [f64],
    pub(super) z: &'a [f64],
    pub(super) dz: &'a [f64],
    /// Shift of each component.
    pub(super) steps: &'a [f64],
    /// Is the delay shorter than the element?
    pub(super) inner: &'a [bool],
}

/// The known pattern, and the cost of the differences so far.
#[derive(Debug, Default)]
pub(super) struct Differences {
    /// The pattern, the group of each column, and their number.
    known: Option<(Sparsity, Vec<usize>, usize)>,
    /// Calls of the right-hand side, and columns in them.
    pub(super) calls: u64,
    pub(super) columns: u64,
}

/// The components that a column moves: none, one, a group, or all of them with signs.
#[derive(Debug, Clone, Copy)]
enum Move {
    None,
    One(usize),
    Group(usize),
    All(usize),
}

impl Differences {
    /// Start from a pattern.
    pub(super) fn given(pattern: Option<&Sparsity>) -> Self {
        Self {
            known: pattern.map(|pattern| with_groups(pattern.clone())),
            ..Self::default()
        }
    }

    /// Number of columns that a Jacobian needs.
    pub(super) fn cost(&self, dim: usize) -> usize {
        match &self.known {
            _ if dim <= FEW => dim + 1,
            Some((_, _, count)) => count + CHECKS + 1,
            None => dim + CHECKS + 1,
        }
    }

    /// The Jacobian at a point. Only its diagonal where it has too many entries; `None` where it is
    /// not finite, or has more components than `most` and an unknown pattern.
    pub(super) fn jacobian<E: Equation + ?Sized>(
        &mut self,
        equation: &mut E,
        point: &Point<'_>,
        most: usize,
        task: &Task,
    ) -> Result<Option<Jacobian>, Error> {
        let dim = point.y.len();
        if dim <= FEW {
            let moves: Vec<Move> = std::iter::once(Move::None)
                .chain((0..dim).map(Move::One))
                .collect();
            let f = self.slopes(equation, point, &moves, task)?;
            let (base, rest) = f.split_at(dim);
            let pairs = rest.chunks_exact(dim).zip(point.steps);
            let values = pairs.flat_map(|(column, step)| {
                column
                    .iter()
                    .zip(base)
                    .map(move |(f, base)| (f - base) / step)
            });
            let pattern = Sparsity {
                starts: (0..=dim).map(|d| d * dim).collect(),
                rows: (0..dim * dim).map(|at| at % dim).collect(),
            };
            return Ok(finite(pattern, values.collect()));
        }
        let moves = [Move::None, Move::All(0), Move::All(1), Move::All(2)];
        let mut checks = self.slopes(equation, point, &moves, task)?;
        let base: Vec<f64> = checks.drain(..dim).collect();
        if base.iter().chain(&checks).any(|f| !f.is_finite()) {
            return Ok(None);
        }
        for check in checks.chunks_exact_mut(dim) {
            check.iter_mut().zip(&base).for_each(|(f, base)| *f -= base);
        }
        if let Some((pattern, group, count)) = self.known.take() {
            let values = self.by_groups(equation, point, (&pattern, &group, count), &base, task)?;
            let agreed = agrees(&pattern, &values, point.steps, &base, &checks);
            if agreed {
                let found = finite(pattern.clone(), values);
                self.known = Some((pattern, group, count));
                return Ok(found);
            }
        }
        if let Some(diagonal) = diagonal(point.steps, &base, &checks) {
            return Ok(finite(only_diagonal(dim), diagonal));
        }
        if dim > most {
            return Ok(None);
        }
        self.detect(equation, point, &base, &checks, task)
    }

    /// Entries of a known pattern.
    fn by_groups<E: Equation + ?Sized>(
        &mut self,
        equation: &mut E,
        point: &Point<'_>,
        (pattern, group, count): (&Sparsity, &[usize], usize),
        base: &[f64],
        task: &Task,
    ) -> Result<Vec<f64>, Error> {
        let dim = base.len();
        let mut members = vec![Vec::new(); count];
        for (column, group) in group.iter().enumerate() {
            members[*group].push(column);
        }
        let mut values = vec![0.0; pattern.rows.len()];
        let width = width(point);
        for first in (0..count).step_by(width) {
            let last = (first + width).min(count);
            let moves: Vec<Move> = (first..last).map(Move::Group).collect();
            let f = self.moved(equation, point, &moves, Some(group), task)?;
            for (f, columns) in f.chunks_exact(dim).zip(&members[first..last]) {
                for &column in columns {
                    for at in pattern.column(column) {
                        let row = pattern.rows[at];
                        values[at] = (f[row] - base[row]) / point.steps[column];
                    }
                }
            }
        }
        Ok(values)
    }

    /// Determine the pattern, one component at a time.
    fn detect<E: Equation + ?Sized>(
        &mut self,
        equation: &mut E,
        point: &Point<'_>,
        base: &[f64],
        checks: &[f64],
        task: &Task,
    ) -> Result<Option<Jacobian>, Error> {
        let dim = base.len();
        let least: Vec<f64> = (0..dim)
            .map(|row| {
                let moved = checks[row..].iter().step_by(dim);
                let most = moved.fold(0.0_f64, |most, f| most.max(f.abs()));
                (ROUNDING * most).max(4.0 * f64::EPSILON * base[row].abs())
            })
            .collect();
        let mut pattern = Sparsity::default();
        let mut values = Vec::new();
        let mut diagonal = vec![0.0; dim];
        let mut fits = true;
        let width = width(point);
        for first in (0..dim).step_by(width) {
            let last = (first + width).min(dim);
            let moves: Vec<Move> = (first..last).map(Move::One).collect();
            let f = self.slopes(equation, point, &moves, task)?;
            for (column, f) in (first..last).zip(f.chunks_exact(dim)) {
                pattern.starts.push(pattern.rows.len());
                let step = point.steps[column];
                diagonal[column] = (f[column] - base[column]) / step;
                for (row, ((f, base), least)) in f.iter().zip(base).zip(&least).enumerate() {
                    let change = f - base;
                    if row == column || change.is_nan() || change.abs() > *least {
                        pattern.rows.push(row);
                        values.push(change / step);
                    }
                }
            }
            fits = fits && pattern.rows.len() <= MOST;
            if !fits {
                pattern = Sparsity::default();
                values.clear();
            }
        }
        if !fits {
            return Ok(finite(only_diagonal(dim), diagonal));
        }
        pattern.starts.push(pattern.rows.len());
        self.known = Some(with_groups(pattern.clone()));
        Ok(finite(pattern, values))
    }

    fn slopes<E: Equation + ?Sized>(
        &mut self,
        equation: &mut E,
        point: &Point<'_>,
        moves: &[Move],
        task: &Task,
    ) -> Result<Vec<f64>, Error> {
        self.moved(equation, point, moves, None, task)
    }

    /// The right-hand side with components moved: column, component.
    fn moved<E: Equation + ?Sized>(
        &mut self,
        equation: &mut E,
        point: &Point<'_>,
        moves: &[Move],
        group: Option<&[usize]>,
        task: &Task,
    ) -> Result<Vec<f64>, Error> {
        let (dim, n) = (point.y.len(), moves.len());
        let spread = |values: &[f64]| -> Vec<f64> {
            let rows = values
                .iter()
                .flat_map(|value| std::iter::repeat_n(*value, n));
            rows.collect()
        };
        let (mut y, mut z) = (spread(point.y), spread(point.z));
        let mut shift = |d: usize, column: usize, step: f64| {
            y[d * n + column] += step;
            for (j, _) in point.inner.iter().enumerate().filter(|(_, inner)| **inner) {
                z[(j * dim + d) * n + column] += step;
            }
        };
        for (column, moved) in moves.iter().enumerate() {
            match *moved {
                Move::None => {}
                Move::One(d) => shift(d, column, point.steps[d]),
                Move::Group(wanted) => {
                    let group = group.unwrap_or_default().iter().enumerate();
                    for (d, _) in group.filter(|(_, group)| **group == wanted) {
                        shift(d, column, point.steps[d]);
                    }
                }
                Move::All(check) => {
                    for (d, step) in point.steps.iter().enumerate() {
                        shift(d, column, sign(check, d) * step);
                    }
                }
            }
        }
        let (t, dz) = (vec![point.t; n], spread(point.dz));
        let at = Columns {
            t: &t,
            y: &y,
            z: &z,
            dz: &dz,
        };
        let mut f = vec![0.0; dim * n];
        equation.slope(at, &mut f, task)?;
        self.calls += 1;
        self.columns += n as u64;
        let by_columns = (0..dim * n).map(|at| f[at % dim * n + at / dim]);
        Ok(by_columns.collect())
    }
}

fn with_groups(pattern: Sparsity) -> (Sparsity, Vec<usize>, usize) {
    let (group, count) = pattern.groups();
    (pattern, group, count)
}

fn finite(pattern: Sparsity, values: Vec<f64>) -> Option<Jacobian> {
    let all = values.iter().all(|value| value.is_finite());
    all.then(|| Jacobian::new(pattern, values))
}

/// Number of columns in one call.
fn width(point: &Point<'_>) -> usize {
    let column = point.y.len() + point.z.len() + point.dz.len();
    (BLOCK / column.max(1)).max(FEW)
}

/// A pseudo-random sign, the same in every run.
fn sign(check: usize, component: usize) -> f64 {
    let mut bits = (component as u64 + 1) ^ ((check as u64 + 1) << 40);
    for _ in 0..3 {
        bits = (bits ^ (bits >> 31)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    }
    if bits >> 63 == 0 { 1.0 } else { -1.0 }
}

fn only_diagonal(dim: usize) -> Sparsity {
    Sparsity {
        starts: (0..=dim).collect(),
        rows: (0..dim).collect(),
    }
}

/// The diagonal, where it explains the change of every row when all components moved.
fn diagonal(steps: &[f64], base: &[f64], checks: &[f64]) -> Option<Vec<f64>> {
    let dim = base.len();
    let entry =
        |check: usize, row: usize| sign(check, row) * checks[check * dim + row] / steps[row];
    let entries: Vec<f64> = (0..dim).map(|row| entry(0, row)).collect();
    let largest = entries.iter().fold(0.0_f64, |size, x| size.max(x.abs()));
    let agree = |row: usize| {
        let noise = 64.0 * f64::EPSILON * base[row].abs() / steps[row];
        (1..CHECKS).all(|check| (entry(check, row) - entries[row]).abs() <= ALONE * largest + noise)
    };
    (0..dim).all(agree).then_some(entries)
}

/// Do the entries explain the change of the right-hand side when all components moved?
fn agrees(pattern: &Sparsity, values: &[f64], steps: &[f64], base: &[f64], checks: &[f64]) -> bool {
    let dim = base.len();
    let mut size = vec![0.0_f64; dim];
    let mut predicted = vec![0.0; checks.len()];
    for (column, step) in steps.iter().enumerate() {
        for at in pattern.column(column) {
            let row = pattern.rows[at];
            let change = values[at] * step;
            size[row] = size[row].max(change.abs());
            for (check, predicted) in predicted.chunks_exact_mut(dim).enumerate() {
                predicted[row] += sign(check, column) * change;
            }
        }
    }
    predicted
        .iter()
        .zip(checks)
        .enumerate()
        .all(|(at, (predicted, check))| {
            let row = at % dim;
            let noise = 64.0 * f64::EPSILON * base[row].abs();
            (predicted - check).abs() <= AGREED * size[row].max(check.abs()) + noise
        })
}
