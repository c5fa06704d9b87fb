//! How much more the numbers scatter than the likelihood says, from the scores of blocks of rows.
//!
//! With Q R = W the whitened sensitivities and g = Qᵀe of a block, A = QᵀQ its leverage, the sum of
//! gᵀ(I − A)⁻¹g over the blocks is p σ² where the model is right (Bell & McCaffrey 2002, CR2).

use super::projection::Projection;
use super::tolerances::BLOCKS;
use crate::linear_algebra::lu::Lu;
use crate::linear_algebra::vectors::dot;

/// The factor of the variance, at least 1, and the degrees of freedom that go with it.
pub(super) fn dispersion(sensitivities: &[Vec<f64>], residual: &[f64], variance: f64) -> (f64, f64) {
    let basis = Projection::new(sensitivities.to_vec()).into_columns();
    let p = basis.len();
    let freedom = BLOCKS.freedom * (p * (BLOCKS.count - 1)) as f64;
    let mut sum = 0.0;
    for block in blocks(&basis, residual.len()) {
        let parts = |column: &Vec<f64>| column[block.clone()].to_vec();
        let own: Vec<Vec<f64>> = basis.iter().map(parts).collect();
        let mut score: Vec<f64> = own.iter().map(|q| dot(q, &residual[block.clone()])).collect();
        let mut matrix = vec![0.0; p * p];
        for i in 0..p {
            for j in 0..p {
                matrix[i * p + j] = -BLOCKS.leverage * dot(&own[i], &own[j]);
            }
            matrix[i * p + i] += 1.0;
        }
        let plain = score.clone();
        if let Some(factors) = Lu::regular(matrix, p) {
            factors.solve(&mut score);
        }
        sum += dot(&plain, &score);
    }
    let factor = sum / (p.max(1) as f64 * variance);
    (if factor > 1.0 { factor } else { 1.0 }, freedom)
}

/// Blocks of rows of about equal leverage.
fn blocks(basis: &[Vec<f64>], rows: usize) -> Vec<std::ops::Range<usize>> {
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
