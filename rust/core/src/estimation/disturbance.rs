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
            "the noise has a standard deviation of {}: give a finite one, zero or more",
            self.deviation
        );
        refuse_if!(
            self.deviation > 0.0 && (self.time_constant.is_nan() || self.time_constant <= 0.0),
            "the noise has a time constant of {} s: give a time constant above zero",
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
    /// Covariance at the first row: stationary where it is known, see [`settle`].
    pub(super) start: Vec<f64>,
}

/// The stationary covariance of these states, air and then lags: the air has moved them before the
/// first row. What follows them is at rest, an integrator for example, whose output the offset shifts.
///
/// Each state depends on those before it alone, so that A P + P Aᵀ + G Gᵀ = 0 has one entry of P at a
/// time.
fn settle(a: &[f64], noise: &[f64], start: &mut [f64], order: &[usize]) {
    let n = start.len().isqrt();
    // A lag that is negative has no stationary state.
    if order.iter().any(|i| a[i * n + i] >= 0.0) {
        return;
    }
    for (count, &i) in order.iter().enumerate() {
        for (others, &j) in order[..=count].iter().enumerate() {
            let of_i: f64 = order[..count]
                .iter()
                .map(|k| a[i * n + k] * start[k * n + j])
                .sum();
            let of_j: f64 = order[..others]
                .iter()
                .map(|k| a[j * n + k] * start[k * n + i])
                .sum();
            let value = -(of_i + of_j + noise[i * n + j]) / (a[i * n + i] + a[j * n + j]);
            (start[i * n + j], start[j * n + i]) = (value, value);
        }
    }
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
        let airs = disturbances.iter().zip(states..n);
        let airs = airs.filter(|(one, _)| one.entry == Entry::Input);
        let order: Vec<usize> = airs.map(|(_, i)| i).chain(0..plant.lags).collect();
        settle(&a, &noise, &mut start, &order);
        Ok(Self { a, noise, c, start })
    }
}

#[cfg(test)]
mod tests {
    use super::super::plant::Plant;
    use super::*;

    fn air_of(deviation: f64) -> Disturbance {
        Disturbance {
            entry: Entry::Input,
            time_constant: 0.3,
            deviation,
        }
    }

    #[test]
    fn air_has_moved_the_lags_before_the_first_row() {
        let plant = Plant::new(&[1.0], &[1.0, 0.0]).unwrap();
        for (lags, zero) in [(&[0.2][..], 0.0), (&[0.2, 0.1], 0.0), (&[0.2, 0.1], 0.05)] {
            let joint = Joint::new(&plant.space(lags, zero), &[air_of(0.7)]).unwrap();
            let n = joint.c.len();
            let integrator = lags.len();
            for i in (0..n).filter(|i| *i != integrator) {
                for j in (0..n).filter(|j| *j != integrator) {
                    let half = |i: usize, j: usize| -> f64 {
                        let terms = (0..n).map(|k| joint.a[i * n + k] * joint.start[k * n + j]);
                        terms.sum()
                    };
                    let change = half(i, j) + half(j, i) + joint.noise[i * n + j];
                    assert!(change.abs() < 1e-14, "{lags:?} {i} {j} {change}");
                }
                assert_eq!(joint.start[integrator * n + i], 0.0);
            }
        }
        // Of one lag T behind air of time constant τ, the variance is τ/(τ + T) of that of the air.
        let joint = Joint::new(&plant.space(&[0.2], 0.0), &[air_of(0.7)]).unwrap();
        assert!((joint.start[0] - 0.49 * 0.3 / 0.5).abs() < 1e-15);
    }

    #[test]
    fn lags_that_the_air_does_not_pass_are_at_rest() {
        let plant = Plant::new(&[1.0], &[1.0, 0.0]).unwrap();
        let behind = plant.with_air_behind_lags(true).space(&[0.2, 0.1], 0.0);
        let joint = Joint::new(&behind, &[air_of(0.7)]).unwrap();
        let moved = joint.start.iter().filter(|entry| **entry != 0.0);
        assert_eq!(moved.count(), 1);
    }
}
