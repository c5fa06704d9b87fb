//! The system (I − a B) δ = R of one component, without a full factorisation.
//!
//! B integrates the polynomial of degree N − 1 through the nodes. In the Legendre basis
//! ∫ P_k = (P_{k+1} − P_{k−1}) / (2k + 1), ∫ P_0 = P_1 + P_0, and at the nodes, the zeros of
//! P_N − P_{N−1}, P_N is P_{N−1}. The system is therefore tridiagonal there. Eliminated from the
//! highest degree down, its pivots d_k = 1 + a² / ((2k + 1)(2k + 3) d_{k+1}) are at least 1 for
//! k ≥ 1 and a ≤ 0, and d_0 as well. For a > 0 the pivot d_0 decreases like e^(−a): elements on
//! which a solution grows that fast are refused. The transformation to coefficients is the
//! quadrature at the nodes, exact to degree 2N − 2.

use super::nodes::Nodes;
use super::products::{Rows, multiply, transposed};

/// Smallest pivot relative to the entries of the system.
const LEAST: f64 = 1e-10;

/// The factors for one a.
#[derive(Debug)]
pub(super) struct Scalar {
    /// Factor on row k + 1 that is subtracted from row k.
    above: Vec<f64>,
    /// Factor on row k − 1 that is added to row k, once divided by its pivot.
    below: Vec<f64>,
    /// 1 over the pivots.
    inverse: Vec<f64>,
}

impl Scalar {
    /// Factors; `None` where the system is singular or not finite.
    pub(super) fn new(order: usize, a: f64) -> Option<Self> {
        let odd = |k: usize| (2 * k + 1) as f64;
        let mut pivots = vec![1.0; order];
        let mut above = vec![0.0; order];
        pivots[0] = 1.0 - a;
        pivots[order - 1] = 1.0 - a / odd(order - 1);
        for k in (0..order - 1).rev() {
            above[k] = a / odd(k + 1) / pivots[k + 1];
            pivots[k] += above[k] * a / odd(k);
        }
        let least = LEAST * (1.0 + a.abs());
        if !pivots.iter().all(|d| d.is_finite() && *d > least) {
            return None;
        }
        // The entry below the diagonal in column k − 1 is −a / (2k − 1).
        let below = pivots.iter().enumerate();
        let below = below.map(|(k, pivot)| a / (2.0 * k as f64 - 1.0) / pivot);
        Some(Self {
            above,
            below: below.collect(),
            inverse: pivots.iter().map(|pivot| 1.0 / pivot).collect(),
        })
    }

    /// Solve in place; `work` is overwritten.
    pub(super) fn solve(&self, nodes: &Nodes, values: &mut [f64], work: &mut Vec<f64>) {
        let row = Rows::of(nodes.order);
        work.resize(nodes.order, 0.0);
        multiply((values, row), &nodes.to_legendre, nodes.order, (work, row));
        self.solve_legendre(nodes, work, values);
    }

    /// The solution for the residual (h/2) B F of slopes F at the nodes, which is that of a constant:
    /// it is formed in the Legendre basis as well. `work` is overwritten.
    pub(super) fn step_from_rest(
        &self,
        nodes: &Nodes,
        half: f64,
        slopes: &[f64],
        (step, work): (&mut [f64], &mut Vec<f64>),
    ) {
        let order = nodes.order;
        let row = Rows::of(order);
        work.resize(order, 0.0);
        multiply((slopes, row), &nodes.to_legendre, order, (work, row));
        // What is integrated from the degree below; for P_0, and where P_N is P_{N−1}, from its own.
        let mut below = work[0];
        for k in 0..order {
            let odd = (2 * k + 1) as f64;
            let own = work[k] / odd;
            let above = match work.get(k + 1) {
                Some(above) => -above / (odd + 2.0),
                None => own,
            };
            work[k] = half * (below + above);
            below = own;
        }
        self.solve_legendre(nodes, work, step);
    }

    /// The matrix of [`Scalar::step_from_rest`]: a row for the slope at each node.
    pub(super) fn steps(&self, nodes: &Nodes, half: f64) -> Vec<f64> {
        let order = nodes.order;
        // Row k holds coefficient k for a unit slope at each of the nodes; a row at a time, so that
        // no sum waits for another.
        let slopes = transposed(&nodes.to_legendre, order);
        let mut rows = vec![0.0; order * order];
        let line = |k: usize| slopes.chunks_exact(order).nth(k);
        for (k, row) in rows.chunks_exact_mut(order).enumerate() {
            let odd = (2 * k + 1) as f64;
            let (below, by) = (line(k.saturating_sub(1)), 1.0 / (odd - 2.0).max(1.0));
            add(row, half * by, below.unwrap_or_default());
            match line(k + 1) {
                Some(above) => add(row, -half / (odd + 2.0), above),
                None => add(row, half / odd, line(k).unwrap_or_default()),
            }
        }
        for k in (1..order).rev() {
            let (lower, upper) = rows.split_at_mut(k * order);
            add(
                &mut lower[(k - 1) * order..],
                -self.above[k - 1],
                &upper[..order],
            );
        }
        for k in 0..order {
            let (lower, upper) = rows.split_at_mut(k * order);
            let row = &mut upper[..order];
            row.iter_mut().for_each(|x| *x *= self.inverse[k]);
            if k > 0 {
                add(row, self.below[k], &lower[(k - 1) * order..]);
            }
        }
        let all = Rows::of(order);
        let rows = transposed(&rows, order);
        let mut steps = vec![0.0; order * order];
        multiply((&rows, all), &nodes.legendre, order, (&mut steps, all));
        steps
    }

    /// Solve for coefficients in the Legendre basis, and give the values at the nodes.
    fn solve_legendre(&self, nodes: &Nodes, work: &mut [f64], values: &mut [f64]) {
        let row = Rows::of(nodes.order);
        let mut higher = 0.0;
        for (x, above) in work.iter_mut().zip(&self.above).rev() {
            *x -= above * higher;
            higher = *x;
        }
        let mut lower = 0.0;
        for ((x, below), inverse) in work.iter_mut().zip(&self.below).zip(&self.inverse) {
            *x = *x * inverse + below * lower;
            lower = *x;
        }
        multiply((work, row), &nodes.legendre, nodes.order, (values, row));
    }

    /// The inverse, a row for each right-hand side; it pays where many components share it.
    pub(super) fn inverse(&self, nodes: &Nodes) -> Vec<f64> {
        let n = nodes.order;
        let (mut inverse, mut work) = (vec![0.0; n * n], Vec::new());
        for (j, column) in inverse.chunks_exact_mut(n).enumerate() {
            column[j] = 1.0;
            self.solve(nodes, column, &mut work);
        }
        inverse
    }
}

/// Add `factor` times another row.
fn add(row: &mut [f64], factor: f64, other: &[f64]) {
    for (sum, x) in row.iter_mut().zip(other) {
        *sum += factor * x;
    }
}

#[cfg(test)]
mod tests {
    use super::super::nodes::{ORDERS, nodes};
    use super::*;
    use crate::linear_algebra::vectors::dot;

    #[test]
    fn the_solution_satisfies_the_full_system() {
        for order in ORDERS {
            let nodes = nodes(order);
            for a in [0.0, -1e-9, -0.3, -20.0, -1e8, 0.3, 1.0, 3.0] {
                let scalar = Scalar::new(order, a).unwrap();
                let known: Vec<f64> = (0..order).map(|i| ((i * i) as f64).sin()).collect();
                let mut found: Vec<f64> = nodes
                    .integrate
                    .chunks_exact(order)
                    .zip(&known)
                    .map(|(row, x)| x - a * dot(row, &known))
                    .collect();
                let (inverse, row) = (scalar.inverse(nodes), Rows::of(order));
                let mut by_inverse = vec![0.0; order];
                multiply((&found, row), &inverse, order, (&mut by_inverse, row));
                scalar.solve(nodes, &mut found, &mut Vec::new());
                let mut residual = vec![0.0; order];
                multiply((&known, row), &nodes.integrals, order, (&mut residual, row));
                residual.iter_mut().for_each(|x| *x *= 0.7);
                scalar.solve(nodes, &mut residual, &mut Vec::new());
                let (mut step, mut work) = (vec![0.0; order], Vec::new());
                scalar.step_from_rest(nodes, 0.7, &known, (&mut step, &mut work));
                for (step, solved) in step.iter().zip(&residual) {
                    assert!(
                        (step - solved).abs() < 1e-12,
                        "{order} {a}: {step} {solved}"
                    );
                }
                for (found, known) in found.iter().chain(&by_inverse).zip(known.iter().cycle()) {
                    assert!((found - known).abs() < 1e-9, "{order} {a}: {found} {known}");
                }
            }
        }
    }

    #[test]
    fn what_grows_too_fast_or_is_not_finite_is_refused() {
        for a in [7.0, 1e3, f64::INFINITY, f64::NAN] {
            assert!(Scalar::new(4, a).is_none(), "{a}");
        }
    }
}
