//! The size of factors that are random, c ~ N(0, s²), from what their columns explain.
//!
//! ```text
//! −2 ln of the marginal likelihood falls by  s² gᵀ(I + s²P)⁻¹g − ln |I + s²P|,
//! ```
//! with P the information of the columns and g their scores (Goodwin, Gevers & Ninness 1992).

use crate::elementary::log;
use crate::linear_algebra::eigenvalues::eigenvalues;
use crate::linear_algebra::lu::Lu;
use crate::linear_algebra::vectors::dot;

/// Sizes that are tried between the least and the largest.
const SIZES: usize = 25;

/// A size of random factors.
pub(super) struct Size {
    pub(super) deviation: f64,
    /// ln |I + s²P|.
    pub(super) log_volume: f64,
    /// By how much the squares fall, in units of the variance, and what the prior takes of that.
    pub(super) explained: f64,
    pub(super) penalty: f64,
    /// The fall of −2 ln of the marginal likelihood.
    pub(super) fall: f64,
}

/// All sizes between these, in order.
pub(super) fn sizes(information: &[f64], scores: &[f64], (least, most): (f64, f64)) -> Vec<Size> {
    let n = scores.len();
    let values: Vec<f64> = eigenvalues(information, n)
        .unwrap_or_default()
        .iter()
        .map(|value| value.re.max(0.0))
        .collect();
    let one = |step: usize| {
        let share = step as f64 / (SIZES - 1) as f64;
        let deviation = least * (most / least).powf(share);
        let square = deviation * deviation;
        let mut matrix: Vec<f64> = information.iter().map(|entry| square * entry).collect();
        (0..n).for_each(|at| matrix[at * (n + 1)] += 1.0);
        let mut solved = scores.to_vec();
        Lu::regular(matrix, n)?.solve(&mut solved);
        let log_volume: f64 = values.iter().map(|value| log(1.0 + square * value)).sum();
        // With c = s² (I + s²P)⁻¹ g: 2 gᵀc − cᵀPc = gᵀc + |c|²/s².
        let product = square * dot(scores, &solved);
        let penalty = square * dot(&solved, &solved);
        Some(Size {
            deviation,
            log_volume,
            explained: product + penalty,
            penalty,
            fall: product - log_volume,
        })
    };
    if values.len() < n {
        return Vec::new();
    }
    (0..SIZES).filter_map(one).collect()
}

/// The likeliest of them, if factors are likelier than none.
pub(super) fn likeliest(information: &[f64], scores: &[f64], ends: (f64, f64)) -> Option<Size> {
    let all = sizes(information, scores, ends).into_iter();
    let best = all.max_by(|a, b| a.fall.total_cmp(&b.fall));
    best.filter(|best| best.fall > 0.0)
}
