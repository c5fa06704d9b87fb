//! Right Radau points and the matrices of collocation at them.
//!
//! The points p_1 < … < p_N = 1 are the zeros of P_N − P_{N−1} (Legendre); with p_0 = −1 in front
//! they carry the polynomial of degree N through the start of an element and its N nodes.
//! Collocation Y′(p_i) = F_i at them is the Radau IIA method of N stages (Hairer and Wanner,
//! Solving ODEs II, section IV.5): stiffly accurate, L-stable, order 2N − 1 at the end of an
//! element and N + 1 within. In integral form Y = y_0 + (h/2) B F with B_ij = ∫ from −1 to p_i of
//! the j-th Lagrange polynomial. The defect Y′ − f(Y) is c π(x) with π = P_N − P_{N−1} to leading
//! order and largest at −1, where it can be measured; what it adds to Y there, |∫ π| / |π(−1)|, is
//! bounded by `spread`. Matrices are computed by LU factors of the basis at the points, with errors
//! of some hundred units in the last place.

use std::sync::OnceLock;

use super::chebyshev;
use super::products::{Rows, multiply, transposed};
use crate::linear_algebra::lu::Lu;

/// The numbers of nodes to choose from.
pub(super) const ORDERS: [usize; 12] = [4, 6, 8, 10, 12, 14, 16, 20, 24, 32, 40, 48];
pub(super) const LARGEST: usize = 48;
/// The largest number for systems of coupled components.
pub(super) const COUPLED: usize = 24;

/// Points and matrices for one number of nodes.
#[derive(Debug)]
pub(super) struct Nodes {
    /// N, without the start of the element.
    pub(super) order: usize,
    /// −1 and the N Radau points.
    pub(super) points: Vec<f64>,
    /// T_k at the points, row k.
    pub(super) basis: Vec<f64>,
    /// From values at the N + 1 points to coefficients, a row for each point.
    to_coefficients: Vec<f64>,
    /// B, N × N row-major.
    pub(super) integrate: Vec<f64>,
    /// The transpose of B: what a value at each node adds to the integrals.
    pub(super) integrals: Vec<f64>,
    /// P_k at the N nodes for k below N, a row for each k.
    pub(super) legendre: Vec<f64>,
    /// From values at the N nodes to Legendre coefficients, a row for each node.
    pub(super) to_legendre: Vec<f64>,
    /// Largest |∫ π| over |π(−1)|.
    pub(super) spread: f64,
    /// Largest sum of the moduli in a row of B.
    pub(super) norm: f64,
}

/// The table for one of [`ORDERS`], built on first use.
pub(super) fn nodes(order: usize) -> &'static Nodes {
    static TABLES: [OnceLock<Nodes>; LARGEST + 1] = [const { OnceLock::new() }; LARGEST + 1];
    TABLES[order.min(LARGEST)].get_or_init(|| Nodes::new(order.min(LARGEST)))
}

impl Nodes {
    fn new(order: usize) -> Self {
        let mut points = vec![-1.0];
        points.extend(radau(order));
        let n = order + 1;
        let mut basis = Vec::new();
        chebyshev::basis(&points, n, &mut basis);
        let to_coefficients = inverse_of_basis(&points, n);
        let slopes = inverse_of_basis(&points[1..], order);
        let mut wide = Vec::new();
        chebyshev::basis(&points[1..], order + 1, &mut wide);
        let mut integrate = vec![0.0; order * order];
        for i in 0..order {
            for k in 0..order {
                let weight = chebyshev::integral(k, |k| wide[k * order + i]);
                for j in 0..order {
                    integrate[i * order + j] += weight * slopes[k * order + j];
                }
            }
        }
        let mut legendre_values = vec![0.0; order * order];
        let mut to_legendre = vec![0.0; order * order];
        // The quadrature has the weights of the last row of B.
        let weights = &integrate[(order - 1) * order..];
        for (i, (x, weight)) in points[1..].iter().zip(weights).enumerate() {
            for k in 0..order {
                let value = if k == 0 { 1.0 } else { legendre(k, *x).1 };
                legendre_values[k * order + i] = value;
                to_legendre[i * order + k] = (k as f64 + 0.5) * weight * value;
            }
        }
        Self {
            order,
            points,
            basis,
            to_coefficients: transposed(&to_coefficients, n),
            norm: integrate
                .chunks_exact(order)
                .map(|row| row.iter().map(|weight| weight.abs()).sum())
                .fold(0.0, f64::max),
            integrals: transposed(&integrate, order),
            integrate,
            legendre: legendre_values,
            to_legendre,
            spread: spread(order),
        }
    }

    /// Coefficients of a vector function from its values at the N + 1 points.
    pub(super) fn coefficients(&self, values: &[f64], out: &mut [f64]) {
        let n = self.order + 1;
        let rows = Rows::of(n);
        multiply((values, rows), &self.to_coefficients, n, (out, rows));
    }
}

/// Inverse of the matrix T_k(x_i), row k belonging to the coefficient of T_k.
fn inverse_of_basis(points: &[f64], n: usize) -> Vec<f64> {
    let mut table = Vec::new();
    chebyshev::basis(points, n, &mut table);
    let rows = (0..n * n).map(|at| table[(at % n) * n + at / n]).collect();
    // Distinct points make a regular matrix.
    Lu::regular(rows, n).map_or_else(|| vec![0.0; n * n], |factors| factors.inverse())
}

/// P_{n−1} and P_n at x.
fn legendre(n: usize, x: f64) -> (f64, f64) {
    let (mut below, mut here) = (1.0, x);
    for k in 2..=n {
        let k = k as f64;
        (below, here) = (here, ((2.0 * k - 1.0) * x * here - (k - 1.0) * below) / k);
    }
    (below, here)
}

/// The zeros of P_n − P_{n−1}, ascending, by Newton's method from the Chebyshev-Radau points.
fn radau(n: usize) -> Vec<f64> {
    let mut points: Vec<f64> = (1..n)
        .map(|k| {
            let angle = 2.0 * std::f64::consts::PI * (n - k) as f64 / (2 * n - 1) as f64;
            let mut x = angle.cos();
            for _ in 0..50 {
                let (below, here) = legendre(n, x);
                let (deeper, _) = legendre(n - 1, x);
                let width = x * x - 1.0;
                let slope = n as f64 * (x * here - below) / width
                    - (n - 1) as f64 * (x * below - deeper) / width;
                let step = (here - below) / slope;
                x -= step;
                if step.abs() < 1e-15 {
                    break;
                }
            }
            x
        })
        .collect();
    points.push(1.0);
    points
}

/// Largest |∫ from −1 to x of P_n − P_{n−1}| over 2, from the integral of P_k,
/// (P_{k+1} − P_{k−1}) / (2k + 1).
fn spread(n: usize) -> f64 {
    const SAMPLES: u32 = 400;
    (0..=SAMPLES)
        .map(|i| {
            let x = 2.0 * f64::from(i) / f64::from(SAMPLES) - 1.0;
            let (low, below) = legendre(n - 1, x);
            let (here, above) = legendre(n + 1, x);
            let integral = (above - below) / (2 * n + 1) as f64 - (here - low) / (2 * n - 1) as f64;
            0.5 * integral.abs()
        })
        .fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_matrices_integrate_and_interpolate_polynomials() {
        for order in ORDERS {
            let nodes = nodes(order);
            let power = i32::try_from(order).unwrap();
            assert!(nodes.points.is_sorted());
            // ∫ of (N) x^(N−1) is x^N, up to its value at −1.
            let start = (-1.0_f64).powi(power);
            let slopes: Vec<f64> = nodes.points[1..]
                .iter()
                .map(|x| f64::from(power) * x.powi(power - 1))
                .collect();
            for (row, x) in nodes.integrate.chunks_exact(order).zip(&nodes.points[1..]) {
                let sum = crate::linear_algebra::vectors::dot(row, &slopes);
                assert!((sum - (x.powi(power) - start)).abs() < 2e-13, "{order} {x}");
            }
            let values: Vec<f64> = nodes.points.iter().map(|x| x.powi(power)).collect();
            let mut coefficients = vec![0.0; order + 1];
            nodes.coefficients(&values, &mut coefficients);
            let x = 0.3_f64;
            assert!((chebyshev::value(&coefficients, x) - x.powi(power)).abs() < 1e-13);
            assert!(nodes.spread > 0.0 && nodes.spread < 0.5);
        }
    }

    #[test]
    fn the_last_row_has_the_degree_of_radau_quadrature() {
        let nodes = nodes(8);
        // Exact to degree 2N − 2: ∫ x^14 = 2/15.
        let values: Vec<f64> = nodes.points[1..].iter().map(|x| x.powi(14)).collect();
        let weights = &nodes.integrate[7 * 8..];
        assert!((crate::linear_algebra::vectors::dot(weights, &values) - 2.0 / 15.0).abs() < 1e-14);
    }
}
