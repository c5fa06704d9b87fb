//! Noise of the family: white, ARMA(1,1) or ARMA(2,2), with missing rows.
//!
//! Columns are whitened by the innovations of a Kalman filter on Harvey's state (Forecasting, Structural
//! Time Series Models and the Kalman Filter, 1989, section 3.3), started from the stationary
//! covariance. With the factor e^(ln det/2n) on them, −2 ln L is n ln of their sum of squares.
//! Searched are the partial correlations as x/√(1 + x²), below limits that keep roots from 1.

use super::smoothing::Smoothing;
use super::tolerances::RANGES;
use crate::elementary::{exp, log};

/// Relative change of the variance of an innovation below which the filter has settled.
const SETTLED: f64 = 1e-12;

/// Doublings of the time over which the stationary covariance is summed: 2³⁰ rows.
const DOUBLINGS: usize = 30;

/// Most rows that are missing one after the other before the state is taken as forgotten.
const LONGEST_GAP: usize = 1000;

/// A model of the noise.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Noise {
    /// Independent values.
    White,
    /// ARMA(1,1).
    Arma11,
    /// ARMA(2,2).
    Arma22,
}

impl Noise {
    /// All of them, the simplest first.
    pub const ALL: [Self; 3] = [Self::White, Self::Arma11, Self::Arma22];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::White => "white",
            Self::Arma11 => "arma11",
            Self::Arma22 => "arma22",
        }
    }

    /// The model of this name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|noise| noise.name() == name)
    }

    /// Coefficients of each side.
    pub fn order(self) -> usize {
        self as usize
    }

    /// How many numbers are searched.
    pub(super) fn searched(self) -> usize {
        2 * self.order()
    }

    /// Coefficients of the autoregression and the moving average.
    pub(super) fn coefficients(self, x: &[f64]) -> Coefficients {
        let bounded = |x: f64, limit: f64| limit * x / (1.0 + x * x).sqrt();
        let memory = RANGES.memory;
        // A root near −1 is that of a filter; one near 1 fits away the offset.
        let averaged = |x: f64| bounded(x, if x > 0.0 { memory } else { RANGES.averaging });
        match (self, x) {
            (Self::Arma11, [ar, ma]) => Coefficients {
                ar: [bounded(*ar, memory), 0.0],
                ma: [averaged(*ma), 0.0],
            },
            (Self::Arma22, [a, b, c, d]) => {
                let [a, b] = [bounded(*a, memory), bounded(*b, memory)];
                let [c, d] = [averaged(*c), averaged(*d)];
                Coefficients {
                    ar: [a * (1.0 - b), b],
                    ma: [c * (1.0 + d), d],
                }
            }
            _ => Coefficients::default(),
        }
    }
}

/// y[k] = Σ ar y[k − i] + e[k] + Σ ma e[k − j].
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Coefficients {
    /// Of the output.
    pub ar: [f64; 2],
    /// Of the innovations.
    pub ma: [f64; 2],
}

type Matrix = [[f64; 3]; 3];

fn times(a: &Matrix, b: &Matrix) -> Matrix {
    let mut out = [[0.0; 3]; 3];
    for (row, left) in out.iter_mut().zip(a) {
        for (j, place) in row.iter_mut().enumerate() {
            *place = left[0] * b[0][j] + left[1] * b[1][j] + left[2] * b[2][j];
        }
    }
    out
}

fn transposed(a: &Matrix) -> Matrix {
    let mut out = *a;
    for (i, row) in out.iter_mut().enumerate() {
        for (j, place) in row.iter_mut().enumerate() {
            *place = a[j][i];
        }
    }
    out
}

fn sum(a: &Matrix, b: &Matrix) -> Matrix {
    let mut out = *a;
    for (row, other) in out.iter_mut().zip(b) {
        for (place, other) in row.iter_mut().zip(other) {
            *place += other;
        }
    }
    out
}

/// The gains of the filter for one row.
#[derive(Debug, Clone, Copy)]
struct Gain {
    second: f64,
    third: f64,
    scale: f64,
}

/// Whitens columns of rows at these distances.
#[derive(Debug)]
pub(super) struct Whitener<'a> {
    gaps: &'a [usize],
    coefficients: Coefficients,
    /// The mean that the record is.
    smoothing: Option<&'a Smoothing>,
    /// None for white noise.
    gains: Vec<Gain>,
    /// What innovations are multiplied by where the filter has settled.
    pub(super) factor: f64,
}

impl<'a> Whitener<'a> {
    /// `weight` is one over the size of the noise, up to a factor.
    pub(super) fn new(gaps: &'a [usize], noise: Noise, x: &[f64], weight: f64) -> Self {
        let coefficients = noise.coefficients(x);
        let mut out = Self {
            gaps,
            smoothing: None,
            coefficients,
            gains: Vec::new(),
            factor: 1.0,
        };
        if noise != Noise::White {
            out.prepare();
        }
        out.factor *= weight;
        out
    }

    /// That of white noise behind a mean.
    pub(super) fn behind(mut self, smoothing: Option<&'a Smoothing>) -> Self {
        if let Some(own) = smoothing {
            self.factor *= exp(0.5 * own.log_det / self.gaps.len().max(1) as f64);
        }
        self.smoothing = smoothing;
        self
    }

    fn transition(&self) -> Matrix {
        let [first, second] = self.coefficients.ar;
        [[first, 1.0, 0.0], [second, 0.0, 1.0], [0.0; 3]]
    }

    fn prepare(&mut self) {
        let step = self.transition();
        let across = transposed(&step);
        let [first, second] = self.coefficients.ma;
        let into = [1.0, first, second];
        let noise: Matrix = into.map(|left| into.map(|right| left * right));
        let stationary = {
            let (mut covariance, mut power) = (noise, step);
            for _ in 0..DOUBLINGS {
                let later = times(&times(&power, &covariance), &transposed(&power));
                covariance = sum(&covariance, &later);
                power = times(&power, &power);
            }
            covariance
        };
        let mut covariance = stationary;
        let mut gain = Gain {
            second: 0.0,
            third: 0.0,
            scale: 1.0,
        };
        let (mut log_det, mut log_variance) = (0.0, 0.0);
        self.gains.reserve(self.gaps.len());
        // Of rows at the same distance as those before, whose filter has settled, all is known.
        let (mut settled, mut known, mut before) = (false, 0, f64::INFINITY);
        for (at, gap) in self.gaps.iter().enumerate() {
            if settled && *gap == known {
                log_det += log_variance;
                self.gains.push(gain);
                continue;
            }
            if at > 0 && *gap > LONGEST_GAP {
                covariance = stationary;
            } else if at > 0 {
                for _ in 0..*gap {
                    covariance = sum(&times(&times(&step, &covariance), &across), &noise);
                }
            }
            let variance = covariance[0][0];
            settled = *gap == known && (variance - before).abs() < SETTLED * variance;
            (known, before) = (*gap, variance);
            log_variance = log(variance);
            log_det += log_variance;
            gain = Gain {
                second: covariance[0][1] / variance,
                third: covariance[0][2] / variance,
                scale: 1.0 / variance.sqrt(),
            };
            self.gains.push(gain);
            let gains = [1.0, gain.second, gain.third];
            for (row, left) in covariance.iter_mut().zip(gains) {
                for (place, right) in row.iter_mut().zip(gains) {
                    *place -= left * right * variance;
                }
            }
        }
        self.factor = exp(0.5 * log_det / self.gaps.len().max(1) as f64);
    }

    /// The innovations of a column, scaled.
    pub(super) fn whiten(&self, column: &[f64]) -> Vec<f64> {
        if let Some(smoothing) = self.smoothing {
            let mut out = smoothing.whiten(column);
            out.iter_mut().for_each(|entry| *entry *= self.factor);
            return out;
        }
        if self.gains.is_empty() {
            return column.iter().map(|entry| entry * self.factor).collect();
        }
        let [first, second] = self.coefficients.ar;
        let mut state = [0.0; 3];
        let mut out = Vec::with_capacity(column.len());
        for ((value, gain), gap) in column.iter().zip(&self.gains).zip(self.gaps) {
            if !out.is_empty() {
                if *gap > LONGEST_GAP {
                    state = [0.0; 3];
                } else {
                    for _ in 0..*gap {
                        state = [
                            first * state[0] + state[1],
                            second * state[0] + state[2],
                            0.0,
                        ];
                    }
                }
            }
            let error = value - state[0];
            out.push(error * gain.scale * self.factor);
            state = [
                *value,
                state[1] + gain.second * error,
                state[2] + gain.third * error,
            ];
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn missing_rows_leave_the_likelihood_of_the_rest() {
        // AR(1) over rows 0, 1, 4: the innovation after a gap of g rows has the variance
        // (1 − φ²ᵍ)/(1 − φ²).
        let x = [0.8, 0.0];
        let phi = Noise::Arma11.coefficients(&x).ar[0];
        let gaps = [1, 1, 3];
        let values = [0.4, -0.3, 1.1];
        let found = Whitener::new(&gaps, Noise::Arma11, &x, 1.0).whiten(&values);
        let after = |power: i32| (1.0 - phi.powi(2 * power)) / (1.0 - phi * phi);
        let variances = [1.0 / (1.0 - phi * phi), after(1), after(3)];
        let errors = [0.4, -0.3 - phi * 0.4, 1.1 + phi.powi(3) * 0.3];
        let factor = variances.iter().product::<f64>().powf(1.0 / 6.0);
        for ((found, error), variance) in found.iter().zip(errors).zip(variances) {
            assert!((found - factor * error / variance.sqrt()).abs() < 1e-9);
        }
    }
}
