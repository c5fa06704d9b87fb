//! Covariance of a fit for white residuals, and for those with memory.
//!
//! For white ones it is σ² (JᵀJ)⁻¹. The sandwich (JᵀJ)⁻¹ S (JᵀJ)⁻¹ with Newey and West's (1987)
//! long-run covariance S of the scores J_t e_t stays valid for others. Its bandwidth is Andrews' (1991,
//! eq. 6.2 and 6.4) plug-in for the Bartlett kernel.

use super::tolerances::MEMORY;
use crate::linear_algebra::lu::Lu;
use crate::linear_algebra::vectors::dot;

/// σ² (JᵀJ)⁻¹, row-major; the columns of J and the residuals.
pub fn white_covariance(columns: &[Vec<f64>], residuals: &[f64]) -> Vec<f64> {
    let freedom = residuals.len() as f64 - columns.len() as f64;
    let variance = dot(residuals, residuals) / freedom;
    let mut cov = inverse_information(columns);
    cov.iter_mut().for_each(|x| *x *= variance);
    cov
}

/// The sandwich; recordings, of these sizes, are independent of each other.
pub fn robust_covariance(columns: &[Vec<f64>], residuals: &[f64], sizes: &[usize]) -> Vec<f64> {
    let (n, k) = (residuals.len(), columns.len());
    let mut spread = vec![0.0; k * k];
    let mut first = 0;
    for size in sizes {
        let rows = first..first + size;
        let piece = &residuals[rows.clone()];
        let scored = |column: &Vec<f64>| -> Vec<f64> {
            let own = &column[rows.clone()];
            own.iter().zip(piece).map(|(slope, e)| slope * e).collect()
        };
        let scores: Vec<Vec<f64>> = columns.iter().map(scored).collect();
        let bandwidth = bandwidth(piece);
        for i in 0..k {
            for j in 0..k {
                let mut sum = dot(&scores[i], &scores[j]);
                for lag in 1..=bandwidth {
                    let taper = 1.0 - lag as f64 / (bandwidth as f64 + 1.0);
                    let later = dot(&scores[i][lag..], &scores[j][..size - lag]);
                    let earlier = dot(&scores[i][..size - lag], &scores[j][lag..]);
                    sum += taper * (later + earlier);
                }
                spread[i * k + j] += sum;
            }
        }
        first += size;
    }
    let bread = inverse_information(columns);
    // n/(n − k): with it the white case agrees with the usual estimate.
    let factor = n as f64 / (n as f64 - k as f64);
    let product = |x: &[f64], y: &[f64]| -> Vec<f64> {
        let entry = |at: usize| (0..k).map(|m| x[at / k * k + m] * y[m * k + at % k]).sum();
        (0..k * k).map(entry).collect()
    };
    let mut cov = product(&product(&bread, &spread), &bread);
    cov.iter_mut().for_each(|x| *x *= factor);
    cov
}

/// The covariance of all of `count` parameters from that of those that are `loose`: zero for the others.
pub fn embedded(cov: &[f64], loose: &[usize], count: usize) -> Vec<f64> {
    let mut whole = vec![0.0; count * count];
    for (i, row) in loose.iter().enumerate() {
        for (j, column) in loose.iter().enumerate() {
            whole[row * count + column] = cov[i * loose.len() + j];
        }
    }
    whole
}

/// Andrews' bandwidth for the Bartlett kernel, residuals taken as an AR(1) process.
fn bandwidth(residuals: &[f64]) -> usize {
    let n = residuals.len();
    let power = dot(residuals, residuals);
    let neighbours = dot(&residuals[1.min(n)..], &residuals[..n.saturating_sub(1)]);
    let rho = if power > 0.0 { neighbours / power } else { 0.0 };
    let rho = rho.clamp(-MEMORY.most, MEMORY.most);
    let alpha = 4.0 * rho * rho / ((1.0 - rho) * (1.0 + rho)).powi(2);
    let best = (1.1447 * libm::cbrt(alpha * n as f64)).ceil();
    (best as usize).min(n / MEMORY.longest)
}

/// (JᵀJ)⁻¹ of the scaled columns, made orthonormal one after the other, twice.
fn inverse_information(columns: &[Vec<f64>]) -> Vec<f64> {
    let k = columns.len();
    let mut r = vec![0.0; k * k];
    let mut done: Vec<Vec<f64>> = Vec::new();
    let mut scales = Vec::new();
    for (j, column) in columns.iter().enumerate() {
        let norm = dot(column, column).sqrt();
        let scale = if norm == 0.0 { 1.0 } else { norm };
        let mut left: Vec<f64> = column.iter().map(|x| x / scale).collect();
        for _ in 0..2 {
            for (i, unit) in done.iter().enumerate() {
                let share = dot(unit, &left);
                r[i * k + j] += share;
                for (left, unit) in left.iter_mut().zip(unit) {
                    *left -= share * unit;
                }
            }
        }
        let rest = dot(&left, &left).sqrt();
        r[j * k + j] = rest;
        left.iter_mut().for_each(|x| *x /= rest);
        done.push(left);
        scales.push(scale);
    }
    let inverse = Lu::new(r, k).inverse();
    let entry = |at: usize| {
        let (i, j) = (at / k, at % k);
        let sum: f64 = (0..k)
            .map(|m| inverse[i * k + m] * inverse[j * k + m])
            .sum();
        sum / (scales[i] * scales[j])
    };
    (0..k * k).map(entry).collect()
}
