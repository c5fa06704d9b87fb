//! What moves the output besides the command: air through the plant, coloured noise of the sensor.
//!
//! Each is an Ornstein–Uhlenbeck process, w′ = −w/τ + q ξ. Its limits are a random walk (τ → ∞) and
//! white noise (τ → 0 at constant q τ).

use super::plant::PlantSpace;
use crate::Error;

/// Where a disturbance enters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Entry {
    /// At the input of the plant or behind its lags, as moving air does.
    Input,
    /// At the measurement.
    Output,
}

/// An Ornstein–Uhlenbeck process with its stationary distribution at the first row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Disturbance {
    /// Where it enters.
    pub entry: Entry,
    /// Time constant τ, s.
    pub time_constant: f64,
    /// Standard deviation of the stationary process, in standard deviations of the white noise.
    pub deviation: f64,
}

impl Disturbance {
    /// An error unless the numbers are those of a process.
    pub(super) fn check(&self) -> Result<(), Error> {
        refuse_if!(
            !(self.deviation >= 0.0 && self.deviation.is_finite()),
            "noise of deviation {}: give a finite deviation of at least zero",
            self.deviation
        );
        refuse_if!(
            self.deviation > 0.0 && (self.time_constant.is_nan() || self.time_constant <= 0.0),
            "noise of time constant {} s: give a time constant above zero",
            self.time_constant
        );
        Ok(())
    }
}

/// The joint equations of plant and disturbances: x′ = A x + G ξ, y = C x.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Joint {
    pub(super) a: Vec<f64>,
    /// G Gᵀ.
    pub(super) noise: Vec<f64>,
    pub(super) c: Vec<f64>,
    /// Covariance at the first row: the plant's own states are at rest.
    pub(super) start: Vec<f64>,
}

impl Joint {
    pub(super) fn new(plant: &PlantSpace, disturbances: &[Disturbance]) -> Result<Self, Error> {
        let states = plant.b.len();
        let n = states + disturbances.len();
        let mut a = vec![0.0; n * n];
        let mut c = plant.c.clone();
        let (mut noise, mut start) = (vec![0.0; n * n], vec![0.0; n * n]);
        for (row, own) in a
            .chunks_exact_mut(n.max(1))
            .zip(plant.a.chunks_exact(states.max(1)))
        {
            for (place, value) in row.iter_mut().zip(own) {
                *place = *value;
            }
        }
        for (index, one) in (states..n).zip(disturbances) {
            one.check()?;
            let rate = 1.0 / one.time_constant;
            let variance = one.deviation * one.deviation;
            let (drive, direct) = match one.entry {
                Entry::Input => (Some(&plant.air), plant.air_direct),
                Entry::Output => (None, 1.0),
            };
            for (row, b) in a
                .chunks_exact_mut(n.max(1))
                .zip(drive.into_iter().flatten())
            {
                row[index] = *b;
            }
            a[index * n + index] = -rate;
            noise[index * n + index] = 2.0 * rate * variance;
            start[index * n + index] = variance;
            c.push(direct);
        }
        Ok(Self { a, noise, c, start })
    }
}
