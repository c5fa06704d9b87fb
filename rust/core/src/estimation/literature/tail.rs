//! Delay of an integrator loop from the exponential tail of a response that does not overshoot.
//!
//! With K Td < 1/e the rightmost root of s (lag s + 1) + K e^(−s Td) = 0 is real, s = −r. Then Td =
//! ln(r (1 − lag r)/K)/r, in a sampled loop K = −1/H(e^(−r h); Td).

use num_complex::Complex64;

use super::super::least_squares::robust_covariance;
use super::held::held_transfer;
use super::zero::zero;

/// The fit of an exponential.
struct Fit {
    /// Most steps.
    steps: usize,
    /// Change of the numbers, as a share, at which it ends.
    converged: f64,
    /// Shortenings of a step that does not lower the misfit.
    halvings: usize,
    /// Step of difference quotients, as a share of the rate: more loses curvature, less digits.
    step: f64,
}

const FIT: Fit = Fit {
    steps: 100,
    converged: 1e-14,
    halvings: 30,
    step: 1e-6,
};

/// A tail height e^(−rate t).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tail {
    /// At its beginning.
    pub height: f64,
    /// 1/s.
    pub rate: f64,
    /// Standard error of the rate.
    pub error: f64,
}

/// How the tail of a response is read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TailReading {
    /// The tail begins where this share of the step is left.
    pub share: f64,
    /// What may be left with a command that is not limited, as a share of the step.
    pub most: f64,
    /// A movement that stands out of the noise.
    pub clear: f64,
    /// Fewest samples of a tail.
    pub fewest: usize,
}

/// What is not rounding, as a share of the step: of a movement, and of the end of a tail.
const LEAST: (f64, f64) = (1e-6, 1e-9);

/// Added to what is left, whose logarithm is taken.
const NONE: f64 = 1e-12;

/// Share of the first sample of a tail down to which it gives a first guess of the rate, and the least guess.
const GUESS: (f64, f64) = (0.2, 1e-3);

/// The number of samples of the tail of a step response, at times since its step, and the exponential through
/// them; none of too few.
pub fn step_tail(since: &[f64], travelled: &[f64], reading: TailReading) -> (usize, Option<Tail>) {
    let left: Vec<f64> = travelled.iter().map(|x| 1.0 - x).collect();
    let last_above = |share: f64| left.iter().rposition(|left| *left > share);
    let first = last_above(reading.share).map_or(0, |last| last + 1);
    let mut begin = since.get(first).copied().unwrap_or(f64::INFINITY);
    if let Some(limited) = last_above(reading.most) {
        // The first movement of the output is an upper bound of the delay.
        let movement = reading.clear.max(LEAST.0);
        let moved = travelled.iter().position(|x| *x > movement).unwrap_or(0);
        begin = begin.max(since[limited] + since[moved]);
    }
    // Errors below rounding hold no information.
    let end = last_above(LEAST.1).map_or(0, |last| last + 1);
    let rows = since.partition_point(|t| *t < begin)..end;
    if rows.len() < reading.fewest {
        return (rows.len(), None);
    }
    let time: Vec<f64> = since[rows.clone()]
        .iter()
        .map(|t| t - since[rows.start])
        .collect();
    let left = &left[rows.clone()];
    let clear = reading.clear.max(GUESS.0 * left[0]);
    let count = left.iter().position(|x| *x <= clear).unwrap_or(left.len());
    let guess = -log_slope(&time[..count.max(2)], &left[..count.max(2)]);
    (rows.len(), Some(tail_rate(&time, left, guess.max(GUESS.1))))
}

/// Slope of the line through the logarithm of what is left.
fn log_slope(time: &[f64], left: &[f64]) -> f64 {
    let logs: Vec<f64> = left.iter().map(|x| libm::log(x.abs() + NONE)).collect();
    let count = time.len() as f64;
    let centre = time.iter().sum::<f64>() / count;
    let mean = logs.iter().sum::<f64>() / count;
    let rows = time.iter().zip(&logs);
    let shared: f64 = rows.map(|(t, x)| (t - centre) * (x - mean)).sum();
    shared / time.iter().map(|t| (t - centre).powi(2)).sum::<f64>()
}

/// The exponential through what is left at times since its beginning, from a guess of its rate.
pub fn tail_rate(time: &[f64], left: &[f64], guess: f64) -> Tail {
    let residuals = |height: f64, rate: f64| -> Vec<f64> {
        let pairs = time.iter().zip(left);
        pairs
            .map(|(t, x)| x - height * libm::exp(-rate * t))
            .collect()
    };
    let cost = |of: &[f64]| of.iter().map(|x| x * x).sum::<f64>();
    let columns = |height: f64, rate: f64| -> [Vec<f64>; 2] {
        let decays: Vec<f64> = time.iter().map(|t| libm::exp(-rate * t)).collect();
        let by_rate = time
            .iter()
            .zip(&decays)
            .map(|(t, d)| -height * t * d)
            .collect();
        [decays, by_rate]
    };
    let (mut height, mut rate) = (left.first().copied().unwrap_or(0.0), guess);
    let mut misfit = residuals(height, rate);
    for _ in 0..FIT.steps {
        let [a, b] = columns(height, rate);
        let product = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| x * y).sum::<f64>();
        let (aa, ab, bb) = (product(&a, &a), product(&a, &b), product(&b, &b));
        let (ra, rb) = (product(&a, &misfit), product(&b, &misfit));
        let det = aa * bb - ab * ab;
        let (mut dh, mut dr) = ((bb * ra - ab * rb) / det, (aa * rb - ab * ra) / det);
        let mut halvings = 0;
        let next = loop {
            let next = residuals(height + dh, rate + dr);
            if cost(&next) <= cost(&misfit) || halvings == FIT.halvings {
                break next;
            }
            (dh, dr) = (0.5 * dh, 0.5 * dr);
            halvings += 1;
        };
        if cost(&next).is_nan() || cost(&next) > cost(&misfit) {
            break;
        }
        (height, rate, misfit) = (height + dh, rate + dr, next);
        if dh.abs() <= FIT.converged * height.abs() && dr.abs() <= FIT.converged * rate.abs() {
            break;
        }
    }
    let cov = robust_covariance(&columns(height, rate), &misfit, &[time.len()]);
    Tail {
        height,
        rate,
        error: cov.get(3).map_or(f64::NAN, |x| x.sqrt()),
    }
}

/// Delay of the loop with the root −rate, negative where there is none, and its slope by the rate.
pub fn delay_of_rate(rate: f64, stiffness: f64, lag: f64, sample_time: Option<f64>) -> (f64, f64) {
    let at = |rate: f64| delay(rate, stiffness, lag, sample_time);
    let step = FIT.step * rate;
    (at(rate), (at(rate + step) - at(rate - step)) / (2.0 * step))
}

fn delay(rate: f64, stiffness: f64, lag: f64, sample_time: Option<f64>) -> f64 {
    let delay = libm::log(rate * (1.0 - lag * rate) / stiffness) / rate;
    let Some(h) = sample_time else { return delay };
    let z = Complex64::from(libm::exp(-rate * h));
    let excess = |late: f64| libm::log(-held_transfer(z, late, lag, h).inv().re / stiffness);
    // The hold delays by about half a sample; a rate that is too small gives a negative delay.
    let at_zero = excess(0.0);
    if at_zero <= 0.0 {
        return (at_zero / rate).min(-1e-300);
    }
    zero(excess, 0.0, delay.max(0.0) + h)
}
