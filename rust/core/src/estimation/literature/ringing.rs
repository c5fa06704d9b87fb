//! Delay and gain of an integrator loop from the decay and the period of its oscillation.
//!
//! The rightmost pair of roots s = −σ ± iω of s (lag s + 1) + K e^(−s Td) = 0 leaves extremes π/ω apart,
//! each e^(−σπ/ω) times the one before. In a sampled loop 1 + K H(e^(s h); Td) = 0 takes its place.

use std::f64::consts::PI;

use num_complex::Complex64;

use super::extremes::{Extreme, weighted_slope};
use super::held::held_transfer;
use super::zero::zero;

/// Contribution of the other modes to the first extreme as a share, and the factor by which it falls to
/// the next one: with K Td between 0.5 and 1.5 the second pair of roots decays 30 to 100 times as much
/// per half period as the first. More trusts later peaks more, which have more noise.
const OTHER_MODES: f64 = 0.03;

/// Step of difference quotients, as a share of ω: more loses curvature, less digits.
const STEP: f64 = 1e-6;

/// σ and ω of an oscillation, and their covariance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ringing {
    /// 1/s.
    pub sigma: f64,
    /// rad/s.
    pub omega: f64,
    /// Of both, row-major.
    pub covariance: [f64; 4],
}

/// The oscillation that leaves these extremes.
pub fn ringing(extremes: &[Extreme]) -> Ringing {
    let index: Vec<f64> = (0..extremes.len()).map(|i| i as f64).collect();
    let other = |i: &f64| OTHER_MODES.powf(i + 1.0);
    let times: Vec<f64> = extremes.iter().map(|e| e.time).collect();
    let logs: Vec<f64> = extremes.iter().map(|e| libm::log(e.height)).collect();
    let mean = match times[..] {
        [first, .., last] => (last - first) / (times.len() - 1) as f64,
        _ => f64::NAN,
    };
    let pairs = || extremes.iter().zip(&index);
    let of_times: Vec<f64> = pairs()
        .map(|(e, i)| e.time_error.hypot(other(i) * mean))
        .collect();
    let of_logs: Vec<f64> = pairs()
        .map(|(e, i)| (e.height_error / e.height).hypot(other(i)))
        .collect();
    let (half, half_error) = weighted_slope(&index, &times, &of_times);
    let (fall, fall_error) = weighted_slope(&index, &logs, &of_logs);
    let (sigma, omega) = (-fall / half, PI / half);
    // By the fall and by the half period.
    let (f, h) = ((fall_error / half).powi(2), (half_error / half).powi(2));
    let mixed = sigma * omega * h;
    Ringing {
        sigma,
        omega,
        covariance: [f + sigma * sigma * h, mixed, mixed, omega * omega * h],
    }
}

/// Delay and K of the loop that has this root, of the smallest delay there is; none where no delay gives a
/// sampled loop this root.
///
/// The phase of the plant at the root falls as the delay grows, so there is one delay for every turn; the
/// rightmost root belongs to the first.
fn loop_with_root(root: Complex64, lag: f64, sample_time: Option<f64>) -> Option<(f64, f64)> {
    let plant = root * (lag * root + 1.0);
    // e^(−s Td) = −s (lag s + 1)/K
    let delay = -(-plant).arg() / root.im;
    let Some(h) = sample_time else {
        return Some((delay, plant.norm() * libm::exp(root.re * delay)));
    };
    let z = (root * h).exp();
    let gain_at = |late: f64| -held_transfer(z, late, lag, h).inv();
    // Relative to the required phase, so that no jump of 2π is within half a period of it.
    let phase = |late: f64| gain_at(late).arg();
    // The hold delays by about half a sample.
    let reach = h.min(0.4 * PI / root.im);
    let (low, high) = (delay - 0.5 * h - reach, delay - 0.5 * h + reach);
    if !(phase(low) < 0.0 && phase(high) > 0.0) {
        return None;
    }
    let delay = zero(phase, low, high);
    Some((delay, gain_at(delay).re))
}

/// Delay and K of the loop that oscillates so, and their covariance; none as [`loop_with_root`].
pub fn loop_with_ringing(
    found: &Ringing,
    lag: f64,
    sample_time: Option<f64>,
) -> Option<([f64; 2], [f64; 4])> {
    let at = |sigma: f64, omega: f64| {
        let (delay, gain) = loop_with_root(Complex64::new(-sigma, omega), lag, sample_time)?;
        Some([delay, gain])
    };
    let Ringing { sigma, omega, .. } = *found;
    let step = STEP * omega;
    let by = |ends: [Option<[f64; 2]>; 2]| {
        let [Some(upper), Some(lower)] = ends else {
            return None;
        };
        Some(std::array::from_fn::<f64, 2, _>(|i| {
            (upper[i] - lower[i]) / (2.0 * step)
        }))
    };
    let here = at(sigma, omega)?;
    let slopes = [
        by([at(sigma + step, omega), at(sigma - step, omega)])?,
        by([at(sigma, omega + step), at(sigma, omega - step)])?,
    ];
    let entry = |i: usize, j: usize| -> f64 {
        let sum = |m: usize, n: usize| slopes[m][i] * found.covariance[2 * m + n] * slopes[n][j];
        sum(0, 0) + sum(0, 1) + sum(1, 0) + sum(1, 1)
    };
    Some((here, [entry(0, 0), entry(0, 1), entry(1, 0), entry(1, 1)]))
}
