//! How much more the numbers scatter than the likelihood says, from the scores of blocks of rows.
//!
//! With Q R = W the whitened sensitivities and g = Qᵀe of a block, A = QᵀQ its leverage, the sum of
//! gᵀ(I − A)⁻¹g over the blocks is p σ² where the model is right (Bell & McCaffrey 2002, CR2). Where no
//! block has much leverage, the jackknife takes its place: gᵀ(I − A)⁻²g (m − 1)/m.

use std::ops::Range;

use super::projection::Projection;
use super::tolerances::BLOCKS;
use crate::estimation::statistics::{chi_squared_beyond, student_reach};
use crate::linear_algebra::eigenvalues::eigenvalues;
use crate::linear_algebra::lu::Lu;
use crate::linear_algebra::vectors::dot;

/// Lags at which residuals are compared, and rows for each.
const LAGS: usize = 20;
const ROWS_A_LAG: usize = 5;

/// The factor of the variance, at least 1, and the degrees of freedom that go with it: of blocks of rows, or of
/// the records at these places where they differ by more. Records of one plant that differ widen what is known of it.
/// Where the residuals are not white, the model does not say how much they scatter, and blocks alone do.
pub(super) fn dispersion(
    sensitivities: &[Vec<f64>],
    residual: &[f64],
    variance: f64,
    is_white: bool,
    places: &[Range<usize>],
) -> (f64, f64) {
    let basis = Projection::new(sensitivities.to_vec()).into_columns();
    let own = blocks(&basis, residual.len());
    let factor = scatter(&basis, residual, &own) / variance;
    let freedom = BLOCKS.freedom * (basis.len() * (own.len() - 1)) as f64;
    let within = if is_white && chi_squared_beyond(factor * freedom, freedom) > BLOCKS.chance {
        // As the model says, whose own scatter then counts as more blocks would.
        let weight = 1.0 + BLOCKS.prior;
        let own = ((factor + BLOCKS.prior) / weight).max(1.0);
        (own, weight * freedom)
    } else {
        (if factor > 1.0 { factor } else { 1.0 }, freedom)
    };
    if places.len() < 2 {
        return within;
    }
    // Scores of records are independent.
    let freedom = (basis.len() * (places.len() - 1)) as f64;
    let between = (scatter(&basis, residual, places) / variance, freedom);
    let reach =
        |(factor, freedom): (f64, f64)| factor.sqrt() * student_reach(BLOCKS.level, freedom);
    let differ = chi_squared_beyond(between.0 * freedom, freedom) <= BLOCKS.chance;
    if differ && reach(between) > reach(within) {
        between
    } else {
        within
    }
}

/// The mean square of the scores of some blocks.
fn scatter(basis: &[Vec<f64>], residual: &[f64], blocks: &[Range<usize>]) -> f64 {
    let p = basis.len();
    let (mut corrected, mut jackknifed, mut most) = (0.0, 0.0, 0.0_f64);
    for block in blocks {
        let own: Vec<&[f64]> = basis.iter().map(|column| &column[block.clone()]).collect();
        let score: Vec<f64> = own
            .iter()
            .map(|q| dot(q, &residual[block.clone()]))
            .collect();
        let mut leverage = vec![0.0; p * p];
        for (i, left) in own.iter().enumerate() {
            for (j, right) in own.iter().enumerate() {
                leverage[i * p + j] = dot(left, right);
            }
        }
        let values = eigenvalues(&leverage, p).unwrap_or_default();
        most = values.iter().fold(most, |most, value| most.max(value.re));
        let mut without: Vec<f64> = leverage.iter().map(|a| -BLOCKS.most_leverage * a).collect();
        (0..p).for_each(|i| without[i * p + i] += 1.0);
        let mut solved = score.clone();
        if let Some(factors) = Lu::regular(without, p) {
            factors.solve(&mut solved);
        }
        corrected += dot(&score, &solved);
        jackknifed += dot(&solved, &solved);
    }
    let count = blocks.len() as f64;
    let sum = if most <= BLOCKS.jackknife {
        jackknifed * (count - 1.0) / count
    } else {
        corrected
    };
    sum / p.max(1) as f64
}

/// Blocks of rows of about equal leverage.
fn blocks(basis: &[Vec<f64>], rows: usize) -> Vec<Range<usize>> {
    let leverage = |row: usize| basis.iter().map(|q| q[row] * q[row]).sum::<f64>();
    let share = basis.len() as f64 / BLOCKS.count as f64;
    let (mut out, mut start, mut sum) = (Vec::new(), 0, 0.0);
    for row in 0..rows {
        sum += leverage(row);
        if sum >= share * (out.len() + 1) as f64 && out.len() + 1 < BLOCKS.count {
            out.push(start..row + 1);
            start = row + 1;
        }
    }
    out.push(start..rows);
    out
}

/// The probability of correlations as large in white residuals (Ljung & Box 1978).
pub(super) fn whiteness(residual: &[f64], searched: usize) -> f64 {
    let count = residual.len();
    let lags = LAGS.min(count / ROWS_A_LAG);
    if lags <= searched {
        return 1.0;
    }
    let square = dot(residual, residual);
    let mut sum = 0.0;
    for lag in 1..=lags {
        let correlation = dot(&residual[lag..], &residual[..count - lag]) / square;
        sum += correlation * correlation / (count - lag) as f64;
    }
    let rows = count as f64;
    chi_squared_beyond(rows * (rows + 2.0) * sum, (lags - searched) as f64)
}
