//! The systems of Newton's method for collocation, decoupled.
//!
//! (I − (h/2) B ⊗ J) δ = R couples all nodes and components of an element. With B = V Λ V⁻¹, and R
//! and δ in the basis V, it is equivalent to one system (I − (h/2) λ_k J) x_k = r_k of the size of
//! J for each eigenvalue, and for a real J those of conjugate pairs are conjugate (Butcher, 1976;
//! Bickart, 1977; Hairer and Wanner, Solving ODEs II, section IV.8). The condition of V grows from
//! 30 for 4 nodes to 5e12 for 24, where δ has a relative error of some 1e-2; iterative refinement
//! reduces it.

use std::sync::OnceLock;

use num_complex::Complex64;

use super::jacobian::Jacobian;
use super::nodes::{COUPLED, Nodes};
use super::products::transposed;
use crate::linear_algebra::banded::Banded;
use crate::linear_algebra::eigenvalues::eigenvalues;
use crate::linear_algebra::elimination::Eliminated;
use crate::linear_algebra::rows::Rows;
use crate::linear_algebra::vectors::add_multiple;

/// Upper limit on the numbers in the factors of all systems together (bounds memory).
const MOST: usize = 1 << 24;
/// Steps of Rayleigh quotient iteration.
const ITERATIONS: usize = 4;
/// Number of refinement steps. Each reduces the error by a factor that depends on the condition of
/// V. The remaining error is rough from node to node, and affects the defect at the start of an
/// element, a derivative, long before the values.
fn improvements(order: usize) -> u32 {
    match order {
        0..=10 => 0,
        11..=20 => 1,
        _ => 3,
    }
}

/// One eigenvalue of B of each pair, with the transformations to its basis and back.
#[derive(Debug)]
struct Mode {
    value: Complex64,
    /// Row of V⁻¹: real and imaginary parts.
    into: (Vec<f64>, Vec<f64>),
    /// Column of V, twice for a pair.
    back: (Vec<f64>, Vec<f64>),
}

/// The eigenvalues and eigenvectors of B for an order, computed on first use.
fn modes(nodes: &Nodes) -> &'static [Mode] {
    static TABLES: [OnceLock<Vec<Mode>>; COUPLED + 1] = [const { OnceLock::new() }; COUPLED + 1];
    TABLES[nodes.order.min(COUPLED)].get_or_init(|| {
        let n = nodes.order;
        let found = eigenvalues(&nodes.integrate, n).unwrap_or_default();
        let pairs = found
            .iter()
            .map(|value| eigenpair(&nodes.integrate, n, *value));
        let (found, columns): (Vec<_>, Vec<_>) = pairs.flatten().unzip();
        if columns.len() != n {
            return Vec::new();
        }
        let vectors = filled(n, |i, k| columns[k][i]);
        let Some(inverse) = Eliminated::new(vectors).map(|factors| factors.inverse()) else {
            return Vec::new();
        };
        let modes = (0..n).filter(|k| found[*k].im >= 0.0).map(|k| {
            let weight = if found[k].im > 0.0 { 2.0 } else { 1.0 };
            Mode {
                value: found[k],
                into: (0..n)
                    .map(|i| (inverse.get(k, i).re, inverse.get(k, i).im))
                    .unzip(),
                back: columns[k]
                    .iter()
                    .map(|x| (weight * x.re, weight * x.im))
                    .unzip(),
            }
        });
        modes.collect()
    })
}

/// Eigenvalue and eigenvector of a real matrix, row-major, close to a computed eigenvalue, by
/// Rayleigh quotient iteration: their residual is that of rounding.
fn eigenpair(matrix: &[f64], n: usize, value: Complex64) -> Option<(Complex64, Vec<Complex64>)> {
    let start = (value, vec![Complex64::ONE; n]);
    (0..ITERATIONS).try_fold(start, |(value, mut vector), _| {
        // Beside the eigenvalue, by its own rounding error, so that there are factors.
        let near = value * (1.0 + 4.0 * f64::EPSILON);
        let shifted = filled(n, |i, k| {
            matrix[i * n + k] - if i == k { near } else { Complex64::ZERO }
        });
        Eliminated::new(shifted)?.solve(&mut vector);
        let length = vector.iter().map(|x| x.norm_sqr()).sum::<f64>().sqrt();
        vector.iter_mut().for_each(|x| *x /= length);
        let image =
            |row: &[f64]| -> Complex64 { row.iter().zip(&vector).map(|(a, x)| x * a).sum() };
        let images = matrix.chunks_exact(n).map(image);
        let quotient: Complex64 = vector.iter().zip(images).map(|(x, y)| x.conj() * y).sum();
        (length.is_finite() && quotient.is_finite()).then_some((quotient, vector))
    })
}

/// The matrix with these entries.
fn filled(n: usize, entry: impl Fn(usize, usize) -> Complex64) -> Rows {
    let mut rows = Rows::zeros(n);
    for i in 0..n {
        (0..n).for_each(|k| rows.add(i, k, entry(i, k)));
    }
    rows
}

/// The factors of one system.
#[derive(Debug)]
enum Factors {
    Banded(Banded),
    Full(Eliminated),
}

/// The factors of all systems for one length and order.
#[derive(Debug)]
pub(super) struct Shifted {
    modes: &'static [Mode],
    factors: Vec<Factors>,
    /// Index of each component in them.
    place: Vec<usize>,
}

impl Shifted {
    /// Would factors within the band be as large as full ones?
    pub(super) fn is_full(jacobian: &Jacobian) -> bool {
        let n = jacobian.dim();
        Banded::size(n, jacobian.band()) >= n * n
    }

    /// Do the factors for this Jacobian fit into the limit?
    pub(super) fn fits(jacobian: &Jacobian, order: usize) -> bool {
        let (n, band) = (jacobian.dim(), jacobian.band());
        order.div_ceil(2) * Banded::size(n, band).min(n * n) <= MOST
    }

    /// Factors for elements of the length 2 `half`; `None` where one is singular, or there are more
    /// nodes than V allows.
    pub(super) fn new(jacobian: &Jacobian, nodes: &Nodes, half: f64) -> Option<Self> {
        if nodes.order > COUPLED {
            return None;
        }
        let modes = modes(nodes);
        let (n, band) = (jacobian.dim(), jacobian.band());
        let full = Self::is_full(jacobian);
        let factors = modes.iter().map(|mode| {
            let factor = -half * mode.value;
            if full {
                let mut matrix = Rows::zeros(n);
                (0..n).for_each(|d| matrix.add(d, d, Complex64::ONE));
                for (row, column, value) in jacobian.entries() {
                    matrix.add(jacobian.place[row], jacobian.place[column], factor * value);
                }
                Eliminated::new(matrix).map(Factors::Full)
            } else {
                let mut matrix = Banded::new(n, band);
                for (row, column, value) in jacobian.entries() {
                    let (row, column) = (jacobian.place[row], jacobian.place[column]);
                    *matrix.entry(row, column) = factor * value;
                }
                (0..n).for_each(|d| *matrix.entry(d, d) += 1.0);
                matrix.factorise().then_some(Factors::Banded(matrix))
            }
        });
        let factors: Option<Vec<Factors>> = factors.collect();
        Some(Self {
            modes,
            factors: factors.filter(|factors| !factors.is_empty())?,
            place: jacobian.place.clone(),
        })
    }

    /// Replace the residual (component, node) by the step; `false` where it is not finite.
    pub(super) fn solve(
        &self,
        jacobian: &Jacobian,
        nodes: &Nodes,
        half: f64,
        residual: &mut [f64],
    ) -> bool {
        // Node by node, so that loops run over the many components.
        let right = transposed(residual, nodes.order);
        let mut step = vec![0.0; right.len()];
        self.add(&right, &mut step);
        for _ in 0..improvements(nodes.order) {
            let mut left = right.clone();
            jacobian.defect(nodes, half, &step, &mut left);
            self.add(&left, &mut step);
        }
        residual.copy_from_slice(&transposed(&step, self.place.len()));
        step.iter().all(|step| step.is_finite())
    }

    /// Add the solution for a residual (node, component) to a step.
    fn add(&self, residual: &[f64], step: &mut [f64]) {
        let dim = self.place.len();
        let mut x = vec![Complex64::ZERO; dim];
        let (mut re, mut im) = (vec![0.0; dim], vec![0.0; dim]);
        for (mode, factors) in self.modes.iter().zip(&self.factors) {
            re.fill(0.0);
            im.fill(0.0);
            let weights = mode.into.0.iter().zip(&mode.into.1);
            for (row, (a, b)) in residual.chunks_exact(dim).zip(weights) {
                add_multiple(&mut re, *a, row);
                add_multiple(&mut im, *b, row);
            }
            for ((place, re), im) in self.place.iter().zip(&re).zip(&im) {
                x[*place] = Complex64::new(*re, *im);
            }
            match factors {
                Factors::Banded(factors) => factors.solve(&mut x),
                Factors::Full(factors) => factors.solve(&mut x),
            }
            for ((place, re), im) in self.place.iter().zip(&mut re).zip(&mut im) {
                (*re, *im) = (x[*place].re, x[*place].im);
            }
            let weights = mode.back.0.iter().zip(&mode.back.1);
            for (row, (a, b)) in step.chunks_exact_mut(dim).zip(weights) {
                add_multiple(row, *a, &re);
                add_multiple(row, -b, &im);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dde::spectral::nodes::{ORDERS, nodes};
    use crate::dde::spectral::sparsity::Sparsity;

    /// A chain of neighbours, or everything coupled with everything.
    fn matrix(dim: usize, full: bool) -> Jacobian {
        let mut entries = Vec::new();
        for i in 0..dim {
            for j in 0..dim {
                if full || i.abs_diff(j) <= 1 {
                    let value = if i == j {
                        -3e4
                    } else {
                        1e4 / (1 + i + 2 * j) as f64
                    };
                    entries.push((i, j, value));
                }
            }
        }
        let rows: Vec<usize> = entries.iter().map(|entry| entry.0).collect();
        let columns: Vec<usize> = entries.iter().map(|entry| entry.1).collect();
        let pattern = Sparsity::new(dim, &rows, &columns).unwrap();
        let value = |i: usize, j: usize| {
            entries
                .iter()
                .find(|entry| (entry.0, entry.1) == (i, j))
                .unwrap()
                .2
        };
        let places: Vec<(usize, usize)> = (0..dim)
            .flat_map(|j| pattern.column(j).map(move |at| (at, j)))
            .collect();
        let values = places
            .iter()
            .map(|(at, j)| value(pattern.rows[*at], *j))
            .collect();
        Jacobian::new(pattern, values)
    }

    #[test]
    fn the_parts_solve_the_whole() {
        for order in ORDERS.into_iter().filter(|order| *order <= COUPLED) {
            let nodes = nodes(order);
            for (dim, full) in [(1, true), (2, true), (9, true), (40, false)] {
                for half in [1e-7, 1e-3, 1.0] {
                    let jacobian = matrix(dim, full);
                    let shifted = Shifted::new(&jacobian, nodes, half).unwrap();
                    let known: Vec<f64> =
                        (0..dim * order).map(|i| ((i * i) as f64).sin()).collect();
                    let mut right = vec![0.0; known.len()];
                    jacobian.defect(nodes, half, &transposed(&known, order), &mut right);
                    let mut right = transposed(&right, dim);
                    right.iter_mut().for_each(|r| *r = -*r);
                    assert!(shifted.solve(&jacobian, nodes, half, &mut right));
                    let pairs = right.iter().zip(&known);
                    let error = pairs.fold(0.0_f64, |worst, (a, b)| worst.max((a - b).abs()));
                    assert!(error < 1e-7, "{order} {dim} {half}: {error}");
                }
            }
        }
    }
}
