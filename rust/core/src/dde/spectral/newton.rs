//! Simplified Newton steps for the collocation equations.
//!
//! For the residual R of Y = y_0 + (h/2) B F(Y) the step δ solves (I − (h/2) B ⊗ J) δ = R, where J
//! = ∂f/∂y at one node, together with ∂f/∂z for delays shorter than the element. With J = 0 this is
//! Picard's iteration. Where J is nearly diagonal, or its factors would be too large, one real
//! system for each component remains, tridiagonal in the Legendre basis. A small system is solved
//! as a whole; a large one is divided by the eigenvalues of B into complex systems of the size of
//! J. Factors are used for all sweeps, and for all elements of the same order and, up to rounding,
//! the same length.

use super::delayed::Delayed;
use super::jacobian::{ALONE, Differences, Jacobian, Point};
use super::nodes::Nodes;
use super::problem::{Columns, Equation};
use super::products::{Rows, multiply};
use super::scalar::Scalar;
use super::shifted::Shifted;
use super::sizes::{largest, largest_of};
use super::sparsity::Sparsity;
use crate::linear_algebra::lu::Lu;
use crate::linear_algebra::vectors::add_multiple;
use crate::order::sort_up;
use crate::{Error, Task};

/// Largest number of unknowns of a system that is solved as a whole.
const WHOLE: usize = 100;
/// Number of components with the same system from which on its inverse pays.
const SHARED: usize = 14;
/// Number of steps with the same factors from which on their matrix pays.
const OFTEN: u32 = 8;
/// Number of columns up to which a Jacobian costs no more than a sweep or two.
const CHEAP: usize = 32;
/// Number of columns up to which the first Jacobian is evaluated to find its structure.
const WORTH_A_LOOK: usize = 260;

/// Relative difference of entries below which they are equal: the error of differences.
const SAME_ENTRY: f64 = 1e-6;

/// Change of the slopes that a line leaves, relative to it, up to which the right-hand side is linear
/// in its one component.
const LINE: f64 = 1e-6;

/// Smallest step, relative to the values, from which the slope of that line is taken.
const VISIBLE: f64 = 1e-3;

/// Relative difference of lengths for which the same factors serve: sweeps correct the rest.
const SAME_LENGTH: f64 = 1e-10;

/// The current linearisation of a run.
#[derive(Debug, Default)]
pub(super) struct Newton {
    jacobian: Option<Jacobian>,
    differences: Differences,
    /// The diagonal, where only it is used.
    diagonal: Option<Diagonal>,
    /// (h/2, order) of the factors.
    key: Option<(f64, usize)>,
    whole: Option<Lu>,
    shifted: Option<Shifted>,
    /// One system for each distinct entry of the diagonal, in their order.
    single: Vec<Single>,
    /// Key and systems of another length: elements often have two lengths in turn.
    other: (Option<(f64, usize)>, Vec<Single>),
    known: Vec<f64>,
    /// Elements since J was evaluated.
    pub(super) age: u32,
    /// J is full and large: it is not used until sweeps without it fail.
    waits: bool,
    /// Has J been evaluated, or at least compared with a diagonal?
    looked: bool,
    /// Is J, of one component, that of a step instead of differences?
    is_exact: bool,
}

/// The diagonal of a Jacobian.
#[derive(Debug)]
struct Diagonal {
    /// The distinct entries, and the number of components that have them.
    entries: Vec<(f64, usize)>,
    /// Index of the entry of each component.
    of: Vec<usize>,
}

impl Diagonal {
    /// Entries that differ by no more than the error of differences become one.
    fn new(values: &[f64]) -> Self {
        let mut order: Vec<usize> = (0..values.len()).collect();
        sort_up(&mut order, |component| values[*component]);
        let mut entries: Vec<(f64, usize)> = Vec::new();
        let mut of = vec![0; values.len()];
        for component in order {
            let value = values[component];
            match entries.last_mut() {
                Some((entry, count)) if close(*entry, value) => *count += 1,
                _ => entries.push((value, 1)),
            }
            of[component] = entries.len() - 1;
        }
        Self { entries, of }
    }
}

/// The system of all components with one entry of the diagonal.
#[derive(Debug)]
struct Single {
    factors: Scalar,
    /// The inverse, where many components share it.
    inverse: Option<Vec<f64>>,
    /// The matrix of steps from a constant, where there were many, and their number.
    steps: Option<Vec<f64>>,
    used: u32,
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
        self.forget_factors();
    }

    fn forget_factors(&mut self) {
        self.key = None;
        self.other.0 = None;
    }

    /// Discard the Jacobian because it was taken at arguments of another kind.
    pub(super) fn forget(&mut self) {
        self.turn_off();
        self.looked = self.waits;
    }

    /// Does a Jacobian of this many components cost little?
    pub(super) fn is_cheap(&self, dim: usize) -> bool {
        self.differences.cost(dim) <= CHEAP
    }

    /// The number of components up to which the first sweep should use any Jacobian, because calls
    /// cost more than nodes; beyond, and where calls are cheap, it should use a diagonal one. `None`
    /// where it should not.
    pub(super) fn comes_first(&self, dim: usize, costly: bool) -> Option<usize> {
        if self.is_on() {
            return None;
        }
        let any = costly && !self.waits && self.differences.cost(dim) <= WORTH_A_LOOK;
        (any || !self.looked).then_some(if any { dim } else { 0 })
    }

    /// The number of components up to which a new Jacobian may be another than a diagonal one.
    pub(super) fn worth_renewing(&self) -> usize {
        if self.is_uncoupled() {
            WORTH_A_LOOK
        } else {
            usize::MAX
        }
    }

    /// Are the components taken as uncoupled?
    pub(super) fn is_uncoupled(&self) -> bool {
        self.is_on() && self.diagonal.is_some()
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
        most: usize,
        task: &Task,
    ) -> Result<bool, Error> {
        self.looked = true;
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
        self.jacobian = self.differences.jacobian(equation, &point, most, task)?;
        self.is_exact = false;
        self.forget_factors();
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
        let alone = off <= ALONE * on || !Shifted::fits(jacobian, n - 1);
        self.diagonal = alone.then(|| Diagonal::new(&diagonal));
        Ok(true)
    }

    /// Largest slope at the nodes after a step δ of one component that J does not explain; `None` for
    /// several components, or where that says little of the error.
    ///
    /// Where the slopes follow a line instead, its slope, exact to rounding, becomes J.
    pub(super) fn unexplained(&mut self, y: &[f64], step: &[f64], change: &[f64]) -> Option<f64> {
        let [entry] = &mut self.diagonal.as_mut()?.entries[..] else {
            return None;
        };
        if entry.1 != 1 || entry.0 > 0.0 {
            return None;
        }
        let beside = |slope: f64| largest_of(step, change, |step, change| change - slope * step);
        let left = beside(entry.0);
        if !self.is_exact && largest(step) > VISIBLE * largest(y) {
            let products = step.iter().zip(change).map(|(step, change)| step * change);
            let slope = products.sum::<f64>() / step.iter().map(|step| step * step).sum::<f64>();
            if slope <= 0.0 && beside(slope) <= LINE * slope.abs() * largest(step) {
                entry.0 = slope;
                self.is_exact = true;
                self.forget_factors();
            }
        }
        Some(left)
    }

    /// Is the right-hand side linear in its one component, as far as it was seen?
    pub(super) fn is_exact(&self) -> bool {
        self.is_on() && self.is_exact
    }

    /// The step δ of one component from a constant at which the slopes at the nodes are known; `false`
    /// where the system is singular.
    pub(super) fn step_from_rest(
        &mut self,
        nodes: &Nodes,
        half: f64,
        slopes: &[f64],
        step: &mut [f64],
    ) -> bool {
        if !self.prepare(nodes, half) {
            return false;
        }
        let Some(single) = self.single.first_mut() else {
            return false;
        };
        single.used += 1;
        if single.used == OFTEN {
            single.steps = Some(single.factors.steps(nodes, half));
        }
        match &single.steps {
            Some(steps) => {
                let row = Rows::of(nodes.order);
                multiply((slopes, row), steps, nodes.order, (step, row));
            }
            None => {
                let work = &mut self.known;
                single
                    .factors
                    .step_from_rest(nodes, half, slopes, (step, work));
            }
        }
        true
    }

    /// Have factors for this length and order; `false` where the system is singular.
    fn prepare(&mut self, nodes: &Nodes, half: f64) -> bool {
        let order = nodes.order;
        let fits = |key: Option<(f64, usize)>| {
            key.is_some_and(|(length, number)| {
                number == order && (length - half).abs() <= SAME_LENGTH * half
            })
        };
        if !fits(self.key) && self.diagonal.is_some() {
            std::mem::swap(&mut self.key, &mut self.other.0);
            std::mem::swap(&mut self.single, &mut self.other.1);
        }
        fits(self.key) || self.factorise(nodes, half)
    }

    /// Replace the residual (component, node) by the step δ; `false` where the system is singular.
    pub(super) fn solve(&mut self, nodes: &Nodes, half: f64, residual: &mut [f64]) -> bool {
        if !self.prepare(nodes, half) {
            return false;
        }
        let order = nodes.order;
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
        let row = Rows::of(order);
        if let ([single], true) = (&self.single[..], diagonal.entries.len() == 1)
            && let Some(inverse) = &single.inverse
        {
            self.known.clear();
            self.known.extend_from_slice(residual);
            multiply((&self.known, row), inverse, order, (residual, row));
            return true;
        }
        for (&index, residual) in diagonal.of.iter().zip(residual.chunks_exact_mut(order)) {
            let single = self.single.get(index);
            match single.map(|one| (&one.factors, &one.inverse)) {
                Some((_, Some(inverse))) => {
                    self.known.clear();
                    self.known.extend_from_slice(residual);
                    multiply((&self.known, row), inverse, order, (residual, row));
                }
                Some((factors, None)) => factors.solve(nodes, residual, &mut self.known),
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
        if let Some(diagonal) = &self.diagonal {
            for &(slope, sharing) in &diagonal.entries {
                let Some(factors) = Scalar::new(order, half * slope) else {
                    return false;
                };
                let inverse = (sharing > SHARED).then(|| factors.inverse(nodes));
                self.single.push(Single {
                    factors,
                    inverse,
                    steps: None,
                    used: 0,
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
            self.whole = Lu::regular(matrix, size);
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
