//! Simplified Newton steps for the collocation equations.
//!
//! For the residual R of Y = y_0 + (h/2) B F(Y) the step δ solves (I − (h/2) B ⊗ J) δ = R, where J
//! = ∂f/∂y at one node, together with ∂f/∂z for delays shorter than the element. With J = 0 this is
//! Picard's iteration. Where J is nearly diagonal, or its factors would be too large, one real
//! system for each component remains. A small system is solved as a whole; a large one is divided
//! by the eigenvalues of B into complex systems of the size of J. Factors are used for all sweeps,
//! and for all elements of the same length and order.

use super::delayed::Delayed;
use super::dense::{Factors, add_multiple, dot};
use super::jacobian::{Differences, Jacobian, Point};
use super::nodes::Nodes;
use super::problem::{Columns, Equation};
use super::shifted::Shifted;
use super::sparsity::Sparsity;
use crate::{Error, Task};

/// Off-diagonal part of J, relative to its diagonal, that is left to the sweeps.
const OFF_DIAGONAL: f64 = 1e-3;

/// Largest number of unknowns of a system that is solved as a whole.
const WHOLE: usize = 100;
/// Number of components with the same system from which on its inverse pays.
const SHARED: usize = 14;
/// Number of columns up to which a Jacobian costs no more than a sweep or two.
const CHEAP: usize = 32;
/// Number of columns up to which the first Jacobian is evaluated to find its structure.
const WORTH_A_LOOK: usize = 260;

/// Relative difference of entries below which they are equal: the error of differences.
const SAME_ENTRY: f64 = 1e-6;

/// The current linearisation of a run.
#[derive(Debug, Default)]
pub(super) struct Newton {
    jacobian: Option<Jacobian>,
    differences: Differences,
    /// The diagonal, where only it is used.
    diagonal: Option<Vec<f64>>,
    /// (h/2, order) of the factors.
    key: Option<(f64, usize)>,
    whole: Option<Factors>,
    shifted: Option<Shifted>,
    /// One system for each distinct entry of the diagonal.
    single: Vec<Single>,
    known: Vec<f64>,
    /// Elements since J was evaluated.
    pub(super) age: u32,
    /// J is full and large: it is not used until sweeps without it fail.
    waits: bool,
}

/// The system of all components with one entry of the diagonal.
#[derive(Debug)]
struct Single {
    slope: f64,
    factors: Factors,
    /// The inverse, where many components share it.
    inverse: Option<Vec<f64>>,
}

impl Newton {
    /// Without a Jacobian, but perhaps with its pattern.
    pub(super) fn new(pattern: Option<&Sparsity>) -> Self {
        Self {
            differences: Differences::given(pattern),
            ..Self::default()
        }
    }

    /// Is there a Jacobian?
    pub(super) fn is_on(&self) -> bool {
        self.jacobian.is_some()
    }

    /// Discard the Jacobian.
    pub(super) fn turn_off(&mut self) {
        self.jacobian = None;
        self.key = None;
    }

    /// Does a Jacobian of this many components cost little?
    pub(super) fn is_cheap(&self, dim: usize) -> bool {
        self.differences.cost(dim) <= CHEAP
    }

    /// Should the first sweep use a Jacobian, because calls cost more than nodes?
    pub(super) fn comes_first(&self, dim: usize) -> bool {
        !self.waits && self.differences.cost(dim) <= WORTH_A_LOOK
    }

    /// Do not use a Jacobian with costly factors until sweeps without it fail.
    pub(super) fn wait_if_full(&mut self) {
        let dense = |jacobian: &Jacobian| Shifted::is_full(jacobian);
        let costly = self.diagonal.is_none() && self.jacobian.as_ref().is_some_and(dense);
        if costly && !self.is_cheap(self.jacobian.as_ref().map_or(0, Jacobian::dim)) {
            self.turn_off();
            self.waits = true;
        }
    }

    /// Calls for Jacobians so far, and columns in them.
    pub(super) fn spent(&self) -> (u64, u64) {
        (self.differences.calls, self.differences.columns)
    }

    /// Differences at `node` of an element of this order whose arguments are `at`.
    pub(super) fn evaluate<E: Equation + ?Sized>(
        &mut self,
        equation: &mut E,
        at: Columns<'_>,
        node: usize,
        delayed: &Delayed,
        task: &Task,
    ) -> Result<bool, Error> {
        let n = at.t.len();
        let dim = at.y.len() / n;
        let pick =
            |values: &[f64]| -> Vec<f64> { values.chunks_exact(n).map(|row| row[node]).collect() };
        let (y, z, dz) = (pick(at.y), pick(at.z), pick(at.dz));
        let steps = at.y.chunks_exact(n).zip(&y).map(|(row, y)| {
            let size = row.iter().fold(1e-3_f64, |size, y| size.max(y.abs()));
            (y + f64::EPSILON.sqrt() * size) - y
        });
        let inner = (0..at.z.len() / at.y.len()).map(|delay| delayed.reaches_itself(delay));
        let point = Point {
            t: at.t[node],
            y: &y,
            z: &z,
            dz: &dz,
            steps: &steps.collect::<Vec<f64>>(),
            inner: &inner.collect::<Vec<bool>>(),
        };
        self.jacobian = self.differences.jacobian(equation, &point, task)?;
        self.key = None;
        self.age = 0;
        let Some(jacobian) = &self.jacobian else {
            return Ok(false);
        };
        let mut diagonal = vec![0.0; dim];
        let (mut on, mut off) = (0.0_f64, 0.0_f64);
        for (row, column, value) in jacobian.entries() {
            if row == column {
                diagonal[row] = value;
                on = on.max(value.abs());
            } else {
                off = off.max(value.abs());
            }
        }
        let alone = off <= OFF_DIAGONAL * on || !Shifted::fits(jacobian, n - 1);
        self.diagonal = alone.then_some(diagonal);
        Ok(true)
    }

    /// Replace the residual (component, node) by the step δ; `false` where the system is singular.
    pub(super) fn solve(&mut self, nodes: &Nodes, half: f64, residual: &mut [f64]) -> bool {
        let order = nodes.order;
        if self.key != Some((half, order)) && !self.factorise(nodes, half) {
            return false;
        }
        if let Some(whole) = &self.whole {
            whole.solve(residual);
            return true;
        }
        let diagonal = match (&self.diagonal, &self.shifted, &self.jacobian) {
            (Some(diagonal), _, _) => diagonal,
            (None, Some(shifted), Some(jacobian)) => {
                return shifted.solve(jacobian, nodes, half, residual);
            }
            _ => return false,
        };
        for (&entry, residual) in diagonal.iter().zip(residual.chunks_exact_mut(order)) {
            let single = self.single.iter().find(|one| close(one.slope, entry));
            match single.map(|one| (&one.factors, &one.inverse)) {
                Some((_, Some(inverse))) => {
                    self.known.clear();
                    self.known.extend_from_slice(residual);
                    for (step, row) in residual.iter_mut().zip(inverse.chunks_exact(order)) {
                        *step = dot(row, &self.known);
                    }
                }
                Some((factors, None)) => factors.solve(residual),
                None => {}
            }
        }
        true
    }

    fn factorise(&mut self, nodes: &Nodes, half: f64) -> bool {
        let order = nodes.order;
        self.key = None;
        self.whole = None;
        self.shifted = None;
        self.single.clear();
        let entry = |i: usize, j: usize, slope: f64| {
            let identity = if i == j { 1.0 } else { 0.0 };
            identity - half * nodes.integrate[i * order + j] * slope
        };
        if let Some(diagonal) = &self.diagonal {
            for &slope in diagonal {
                if self.single.iter().any(|one| close(one.slope, slope)) {
                    continue;
                }
                let sharing = diagonal
                    .iter()
                    .filter(|other| close(**other, slope))
                    .count();
                let size = order * order;
                let matrix = (0..size).map(|at| entry(at / order, at % order, slope));
                let Some(factors) = Factors::new(order, matrix.collect()) else {
                    return false;
                };
                let inverse = (sharing > SHARED).then(|| factors.inverse());
                self.single.push(Single {
                    slope,
                    factors,
                    inverse,
                });
            }
        } else if let Some(jacobian) = &self.jacobian
            && jacobian.dim() * order <= WHOLE
        {
            let size = jacobian.dim() * order;
            let mut matrix = vec![0.0; size * size];
            matrix
                .iter_mut()
                .step_by(size + 1)
                .for_each(|one| *one = 1.0);
            for (row, column, value) in jacobian.entries() {
                for (i, weights) in nodes.integrate.chunks_exact(order).enumerate() {
                    let at = (row * order + i) * size + column * order;
                    add_multiple(&mut matrix[at..at + order], -half * value, weights);
                }
            }
            self.whole = Factors::new(size, matrix);
            if self.whole.is_none() {
                return false;
            }
        } else if let Some(jacobian) = &self.jacobian {
            self.shifted = Shifted::new(jacobian, nodes, half);
            if self.shifted.is_none() {
                return false;
            }
        }
        self.key = Some((half, order));
        true
    }
}

/// Do two entries differ by no more than the error of differences?
fn close(a: f64, b: f64) -> bool {
    (a - b).abs() <= SAME_ENTRY * a.abs().max(b.abs())
}
