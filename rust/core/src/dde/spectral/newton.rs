//! Simplified Newton steps for the collocation equations.
//!
//! The residual R of Y = y_0 + (h/2) B F(Y) is answered by δ with (I − (h/2) B ⊗ J) δ = R, where
//! J = ∂f/∂y by forward differences at one node, together with ∂f/∂z for delays shorter than the
//! element. With J = 0 this is a sweep of Picard's. Only the diagonal of J enters where it carries
//! nearly all of J or where the full system would be too large; a system a component is then left.
//! Factors serve all sweeps, and all elements of the same length and order.

use super::delayed::Delayed;
use super::dense::{Factors, dot};
use super::nodes::Nodes;
use super::{Columns, Equation};
use crate::{Error, Task};

/// Unknowns of a full system.
const FULL: usize = 320;
/// Off-diagonal part of J, relative to its diagonal, that is left to the sweeps.
const OFF_DIAGONAL: f64 = 1e-3;

/// Components with one system from which on its inverse pays.
const SHARED: usize = 14;

/// The linearisation of a run as it stands.
#[derive(Debug, Default)]
pub(super) struct Newton {
    jacobian: Vec<f64>,
    diagonal: bool,
    /// (h/2, order) of the factors.
    key: Option<(f64, usize)>,
    full: Option<Factors>,
    /// One system for each different entry of the diagonal.
    single: Vec<Single>,
    known: Vec<f64>,
    /// Elements since J was evaluated.
    pub(super) age: u32,
    scratch: Columned,
}

/// The system of all components with one entry of the diagonal.
#[derive(Debug)]
struct Single {
    slope: f64,
    factors: Factors,
    /// Where many share it.
    inverse: Option<Vec<f64>>,
}

/// Arguments for the differences: one column a component.
#[derive(Debug, Default)]
struct Columned {
    t: Vec<f64>,
    y: Vec<f64>,
    z: Vec<f64>,
    dz: Vec<f64>,
    f: Vec<f64>,
    steps: Vec<f64>,
}

impl Newton {
    /// Whether there is a Jacobian.
    pub(super) fn is_on(&self) -> bool {
        !self.jacobian.is_empty()
    }

    /// Forget the Jacobian.
    pub(super) fn turn_off(&mut self) {
        self.jacobian.clear();
        self.key = None;
    }

    /// Differences at `node` of the element whose arguments are `at` and whose slopes are `f`.
    pub(super) fn evaluate<E: Equation + ?Sized>(
        &mut self,
        equation: &mut E,
        at: Columns<'_>,
        f: &[f64],
        node: usize,
        delayed: &Delayed,
        task: &Task,
    ) -> Result<bool, Error> {
        let n = at.t.len();
        let dim = at.y.len() / n;
        let work = &mut self.scratch;
        work.t.clear();
        work.t.resize(dim, at.t[node]);
        let spread = |values: &[f64], out: &mut Vec<f64>| {
            out.clear();
            for row in values.chunks_exact(n) {
                out.extend(std::iter::repeat_n(row[node], dim));
            }
        };
        spread(at.y, &mut work.y);
        spread(at.z, &mut work.z);
        spread(at.dz, &mut work.dz);
        work.steps.clear();
        for d in 0..dim {
            let row = &at.y[d * n..(d + 1) * n];
            let size = row.iter().fold(1e-3_f64, |size, y| size.max(y.abs()));
            let step = f64::EPSILON.sqrt() * size;
            let moved = row[node] + step;
            work.steps.push(moved - row[node]);
            work.y[d * dim + d] = moved;
            for j in 0..at.z.len() / (dim * n) {
                if delayed.reaches_itself(j) {
                    work.z[(j * dim + d) * dim + d] += step;
                }
            }
        }
        work.f.clear();
        work.f.resize(dim * dim, 0.0);
        let columns = Columns {
            t: &work.t,
            y: &work.y,
            z: &work.z,
            dz: &work.dz,
        };
        equation.slope(columns, &mut work.f, task)?;
        self.jacobian.clear();
        for i in 0..dim {
            for d in 0..dim {
                let difference = work.f[i * dim + d] - f[i * n + node];
                self.jacobian.push(difference / work.steps[d]);
            }
        }
        self.key = None;
        self.age = 0;
        if self.jacobian.iter().any(|entry| !entry.is_finite()) {
            self.turn_off();
            return Ok(false);
        }
        let (mut on, mut off) = (0.0_f64, 0.0_f64);
        for (at, entry) in self.jacobian.iter().enumerate() {
            if at % (dim + 1) == 0 {
                on = on.max(entry.abs());
            } else {
                off = off.max(entry.abs());
            }
        }
        self.diagonal = off <= OFF_DIAGONAL * on || dim * n > FULL;
        Ok(true)
    }

    /// Turn the residual (component, node) into the step δ; `false` where the system is singular.
    pub(super) fn solve(&mut self, nodes: &Nodes, half: f64, residual: &mut [f64]) -> bool {
        let order = nodes.order;
        if self.key != Some((half, order)) && !self.factorise(nodes, half, residual.len() / order) {
            return false;
        }
        if let Some(full) = &self.full {
            full.solve(residual);
            return true;
        }
        let dim = residual.len() / order;
        for (d, residual) in residual.chunks_exact_mut(order).enumerate() {
            let entry = self.jacobian[d * dim + d];
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

    fn factorise(&mut self, nodes: &Nodes, half: f64, dim: usize) -> bool {
        let order = nodes.order;
        self.key = None;
        self.full = None;
        self.single.clear();
        let entry = |i: usize, j: usize, slope: f64| {
            let identity = if i == j { 1.0 } else { 0.0 };
            identity - half * nodes.integrate[i * order + j] * slope
        };
        if self.diagonal {
            for d in 0..dim {
                let slope = self.jacobian[d * dim + d];
                if self.single.iter().any(|one| close(one.slope, slope)) {
                    continue;
                }
                let diagonal = self.jacobian.iter().step_by(dim + 1);
                let sharing = diagonal.filter(|other| close(**other, slope)).count();
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
        } else {
            let size = dim * order;
            let mut matrix = Vec::with_capacity(size * size);
            for row in 0..size {
                for column in 0..size {
                    let slope = self.jacobian[row / order * dim + column / order];
                    let identity = if row == column { 1.0 } else { 0.0 };
                    let weight = nodes.integrate[row % order * order + column % order];
                    matrix.push(identity - half * weight * slope);
                }
            }
            let Some(factors) = Factors::new(size, matrix) else {
                return false;
            };
            self.full = Some(factors);
        }
        self.key = Some((half, order));
        true
    }
}

/// Entries that differ by no more than differences are wrong by.
fn close(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-6 * a.abs().max(b.abs())
}
