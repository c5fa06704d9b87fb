//! Where roots of a matrix cannot be: a radius for a half plane, from norms.
//!
//! Let F be the computed inverse of E, Y = I − F E. From M(s) x = 0 follows, multiplied by F,
//!     s (I − Y + Σ F N_j e^(−s τ_j)) x = Σ F A_j e^(−s τ_j) x.
//! On Re s ≥ σ, with w_j = e^(−σ τ_j), in the maximum norm weighted by any y > 0:
//!     |s| (1 − |Y| − Σ |F N_j| w_j) ≤ Σ |F A_j| w_j.
//! y is taken from the power iteration of the matrix of moduli, for which the bound is best. Where
//! the bracket is not positive although Re s = σ lies right of the chains, the inverse of the
//! difference part is bounded over all phases (`difference`). Products with F have errors of at
//! most (n + 2) u |F| |N|, which are added; the errors of sums of non-negative numbers are covered
//! by MARGIN.

use super::difference::Difference;
use super::factor::{ROUNDING, factor};
use super::quotient::Value;
use super::system::Irreducible;
use crate::elementary::exp_above;
use crate::linear_algebra::rows::Rows;
use crate::{Error, Task};
use num_complex::Complex64;

const MARGIN: f64 = 1.0 + 1e-9;

/// Power iterations for the weights of the norm.
const ITERATIONS: usize = 40;

/// Larger than every effect of underflow on an entry of a product with F.
const FLOOR: f64 = 1e-250;

/// Largest norm of Y with which F counts as an inverse. Larger: matrices closer to singular ones
/// are accepted; smaller: the bounds stay tighter.
const LARGEST_RESIDUAL: f64 = 0.5;

/// Lower limit on an image in the power iteration, because a row of M may have slopes alone.
const LEAST_IMAGE: f64 = 1e-300;

/// Part of the weights that each power iteration keeps, because they could otherwise alternate.
/// Larger: they settle more slowly; smaller: alternation dies out more slowly.
const KEPT: f64 = 0.1;

/// Least weight, relative to the largest one. Larger: worse bounds where rows differ much in size;
/// smaller: quotients may underflow or overflow.
const LEAST_WEIGHT: f64 = 1e-30;

/// Least radius, because all roots may be at 0.
const LEAST_RADIUS: f64 = 1e-100;

/// F times the matrices of a system, by delay, with bounds on the moduli of their entries.
#[derive(Debug, Clone)]
pub(super) struct Leading {
    delays: Vec<f64>,
    /// F A_j, and bounds on the norms of their errors.
    products: Vec<(Rows, f64)>,
    /// |F A_j|.
    values: Vec<Vec<Vec<f64>>>,
    /// |F N_j|; for delay 0 |Y|.
    slopes: Vec<Vec<Vec<f64>>>,
    pub(super) difference: Difference,
}

impl Leading {
    /// # Errors
    /// [`Error::Argument`] where E is singular, or so close to it that no inverse can be verified.
    pub(super) fn new(system: &Irreducible) -> Result<Self, Error> {
        let n = system.size();
        let (e, _) = system.dense(0);
        let singular = || {
            Error::argument(
                "E is singular, or too close to singular, but a half plane needs an E that can be \
                 inverted. Eliminate algebraic equations, or give a region with four closed sides",
            )
        };
        let inverse = factor(real(&e)).ok_or_else(singular)?.inverse;
        let product = |matrix: &[Vec<f64>]| {
            let mut found = vec![vec![0.0; n]; n];
            let mut moduli = found.clone();
            for (i, (sums, bounds)) in found.iter_mut().zip(&mut moduli).enumerate() {
                for (x, row) in inverse.row(i).0.iter().zip(matrix) {
                    for ((sum, bound), y) in sums.iter_mut().zip(bounds.iter_mut()).zip(row) {
                        *sum += x * y;
                        *bound += (x * y).abs();
                    }
                }
            }
            let loss = (n as f64 + 2.0) * ROUNDING;
            for row in &mut moduli {
                for bound in row {
                    *bound = *bound * loss + FLOOR;
                }
            }
            (found, moduli)
        };
        let above = |(found, loss): &(Vec<Vec<f64>>, Vec<Vec<f64>>)| -> Vec<Vec<f64>> {
            found
                .iter()
                .zip(loss)
                .map(|(row, loss)| {
                    row.iter()
                        .zip(loss)
                        .map(|(x, e)| (x.abs() + e) * MARGIN)
                        .collect()
                })
                .collect()
        };
        let mut own = product(&e);
        for (i, row) in own.0.iter_mut().enumerate() {
            if let Some(x) = row.get_mut(i) {
                *x -= 1.0;
            }
        }
        let unit = above(&own);
        let (mut values, mut slopes) = (Vec::new(), vec![unit.clone()]);
        let mut products = Vec::new();
        let mut late = Vec::new();
        for (index, delay) in system.delays().iter().enumerate() {
            let (slope, value) = system.dense(index);
            let value = product(&value);
            values.push(above(&value));
            products.push((real(&value.0), frobenius(&value.1)));
            if index > 0 {
                let product = product(&slope);
                slopes.push(above(&product));
                if product.0.iter().flatten().any(|x| *x != 0.0) {
                    late.push((*delay, product.0, frobenius(&product.1)));
                }
            }
        }
        if frobenius(&unit) > LARGEST_RESIDUAL {
            return Err(singular());
        }
        Ok(Self {
            delays: system.delays().to_vec(),
            products,
            values,
            slopes,
            difference: Difference::new(n, late, frobenius(&unit)),
        })
    }

    /// Every root with Re s ≥ `sigma` has a smaller modulus.
    ///
    /// # Errors
    /// [`Error::Argument`] where that cannot be shown: at or left of the chains.
    pub(super) fn radius(&self, sigma: f64, task: &Task) -> Result<f64, Error> {
        let weights: Vec<f64> = self
            .delays
            .iter()
            .map(|delay| {
                if *delay == 0.0 {
                    1.0
                } else {
                    exp_above(-sigma * delay)
                }
            })
            .collect();
        let values = weighted(&self.values, &weights);
        let slopes = weighted(&self.slopes, &weights);
        let beyond = || {
            Error::argument(format!(
                "right of Re s = {sigma:e} there are more roots than double precision can bound: \
                 close the region on the left"
            ))
        };
        if values
            .iter()
            .chain(&slopes)
            .flatten()
            .any(|x| !x.is_finite())
        {
            return Err(beyond());
        }
        let n = values.len();
        let mut y = vec![1.0; n];
        for _ in 0..ITERATIONS {
            let on_slope = image(&slopes, &y);
            let next: Vec<f64> = image(&values, &y)
                .iter()
                .zip(&on_slope)
                .zip(&y)
                .map(|((a, b), y)| a + b * a.max(LEAST_IMAGE) + KEPT * y)
                .collect();
            let top = next.iter().fold(0.0f64, |a, b| a.max(*b));
            // The weights never differ by much, so that the bounds themselves do not underflow or
            // overflow.
            y = next.iter().map(|x| (x / top).max(LEAST_WEIGHT)).collect();
        }
        let norm = |matrix: &[Vec<f64>], y: &[f64]| {
            let quotient = |(a, b): (&f64, &f64)| a / b;
            image(matrix, y)
                .iter()
                .zip(y)
                .map(quotient)
                .fold(0.0f64, f64::max)
                * MARGIN
        };
        let ones = vec![1.0; n];
        let mut best = f64::INFINITY;
        for y in [&y, &ones] {
            let share = norm(&slopes, y);
            if share < 1.0 {
                best = best.min(norm(&values, y) / (1.0 - share) * MARGIN);
            }
        }
        // With one delayed derivative the chains take one matrix, and all its phases can be followed.
        let followed = self.difference.number_of_terms() == 1;
        if (followed || best.is_infinite())
            && let Some(inverse) = self.difference.inverse_bound(sigma, task)?
        {
            best = best.min(inverse * frobenius(&values) * MARGIN);
            if followed {
                let parts = self.products.iter().zip(&weights);
                let parts = parts.map(|((matrix, lost), weight)| Value {
                    matrix: matrix.clone(),
                    lost: *lost,
                    weight: *weight,
                });
                let parts: Vec<Value> = parts.collect();
                let bound = self.difference.quotient_bound(sigma, &parts, task)?;
                best = best.min(bound.unwrap_or(f64::INFINITY));
            }
        }
        if best.is_finite() {
            Ok(best.max(LEAST_RADIUS))
        } else if self.difference.is_trivial() {
            Err(beyond())
        } else {
            refuse!(
                "the half plane right of Re s = {sigma} may contain infinitely many roots: give a \
                 half plane right of the chains (chain_abscissa)"
            )
        }
    }
}

/// A real matrix as a complex one.
fn real(matrix: &[Vec<f64>]) -> Rows {
    let mut rows = Rows::zeros(matrix.len());
    for (i, row) in matrix.iter().enumerate() {
        for (j, x) in row.iter().enumerate() {
            rows.add(i, j, Complex64::new(*x, 0.0));
        }
    }
    rows
}

fn weighted(matrices: &[Vec<Vec<f64>>], weights: &[f64]) -> Vec<Vec<f64>> {
    let mut total = matrices
        .first()
        .map(|m| vec![vec![0.0; m.len()]; m.len()])
        .unwrap_or_default();
    for (matrix, weight) in matrices.iter().zip(weights) {
        for (sums, row) in total.iter_mut().zip(matrix) {
            for (sum, x) in sums.iter_mut().zip(row) {
                *sum += if *x == 0.0 { 0.0 } else { weight * x };
            }
        }
    }
    total
}

fn image(matrix: &[Vec<f64>], y: &[f64]) -> Vec<f64> {
    let dot = |row: &Vec<f64>| row.iter().zip(y).map(|(a, b)| a * b).sum();
    matrix.iter().map(dot).collect()
}

fn frobenius(matrix: &[Vec<f64>]) -> f64 {
    matrix.iter().flatten().map(|x| x * x).sum::<f64>().sqrt() * MARGIN
}
