//! Inverse Hessian of −2 ln L by the numbers of the plant, from their Fisher information.
//!
//! Delay, lags and zero have similar effects, so that the likelihood is a narrow valley over them, and
//! a search that begins with a diagonal stops on its side. With I the information, and T the
//! derivatives of delay, lags, zero and gain by the variables of the search, the Hessian is 2 TᵀIT.

use super::fit::{Model, Slot};
use super::likelihood::Wanted;
use super::point::{Point, Quantity, Timing};
use crate::{Error, Task};

/// Added to a Hessian of unit diagonal: bounds its condition.
const RIDGE: f64 = 1e-7;

impl Model {
    /// Put the inverse Hessian by those of the slots that are numbers of the plant into that by all
    /// slots, unless the information is singular.
    pub(super) fn scoring(
        &self,
        point: &Point,
        held: Option<Quantity>,
        slots: &[Slot],
        all: &mut [f64],
        task: &Task,
    ) -> Result<(), Error> {
        let is_plant =
            |slot: &Slot| matches!(slot, Slot::Time | Slot::Lag(_) | Slot::Zero | Slot::Gain);
        let places: Vec<usize> = (0..slots.len()).filter(|i| is_plant(&slots[*i])).collect();
        let n = places.len();
        if n < 2 {
            return Ok(());
        }
        let mut hessian = vec![0.0; n * n];
        for run in 0..point.noise.len() {
            let found = self.part(run, point, held, Wanted::All, task)?;
            let size = found.information.len().isqrt();
            let changes: Vec<Vec<f64>> = places
                .iter()
                .map(|place| self.change(slots[*place], point, size))
                .collect();
            for (i, left) in changes.iter().enumerate() {
                let rows = found.information.chunks_exact(size.max(1));
                let turned: Vec<f64> = rows.map(|row| product(row, left)).collect();
                for (j, right) in changes.iter().enumerate() {
                    hessian[i * n + j] += 2.0 * product(&turned, right);
                }
            }
        }
        for (i, row) in inverse(&hessian, n)
            .unwrap_or_default()
            .chunks_exact(n)
            .enumerate()
        {
            for (j, entry) in row.iter().enumerate() {
                all[places[i] * slots.len() + places[j]] = *entry;
            }
        }
        Ok(())
    }

    /// Change of a searched gain, delay, free lags and zero, `size` in all, by a variable.
    fn change(&self, slot: Slot, point: &Point, size: usize) -> Vec<f64> {
        let lags = self.free.lags.iter().filter(|free| **free).count();
        let known = usize::from(self.free.delay) + lags + usize::from(self.free.zero);
        let delay = size.saturating_sub(known);
        let first = delay + usize::from(self.free.delay);
        let from_total = self.free.delay && matches!(point.timing, Timing::Total(_));
        let mut out = vec![0.0; size];
        let mut put = |place: usize, value: f64| {
            if let Some(entry) = out.get_mut(place) {
                *entry = value;
            }
        };
        match slot {
            Slot::Time => put(delay, 1.0),
            Slot::Lag(i) => {
                let lag = point.lags.get(i).copied().unwrap_or(0.0);
                let before = self.free.lags.iter().take(i).filter(|free| **free).count();
                put(first + before, lag);
                if from_total {
                    put(delay, -lag);
                }
            }
            Slot::Zero => {
                put(first + lags, 1.0);
                if from_total {
                    put(delay, 1.0);
                }
            }
            Slot::Gain => put(0, 1.0),
            _ => {}
        }
        out
    }
}

fn product(x: &[f64], y: &[f64]) -> f64 {
    x.iter().zip(y).map(|(x, y)| x * y).sum()
}

/// The inverse of a positive definite matrix, by Cholesky's method on its unit diagonal; none for
/// another matrix.
fn inverse(matrix: &[f64], n: usize) -> Option<Vec<f64>> {
    let scales: Vec<f64> = (0..n).map(|i| matrix[i * n + i].sqrt().recip()).collect();
    if !scales.iter().all(|scale| scale.is_finite() && *scale > 0.0) {
        return None;
    }
    // The factor L, then the columns of its inverse.
    let mut factor = vec![0.0; n * n];
    for i in 0..n {
        for j in 0..=i {
            let ridge = if i == j { RIDGE } else { 0.0 };
            let scaled = matrix[i * n + j] * scales[i] * scales[j] + ridge;
            let left = scaled - product(&factor[i * n..i * n + j], &factor[j * n..j * n + j]);
            factor[i * n + j] = if i == j {
                if left.is_nan() || left <= 0.0 {
                    return None;
                }
                left.sqrt()
            } else {
                left / factor[j * n + j]
            };
        }
    }
    let mut lower = vec![0.0; n * n];
    for j in 0..n {
        for i in j..n {
            let unit = if i == j { 1.0 } else { 0.0 };
            let sum: f64 = (j..i).map(|k| factor[i * n + k] * lower[k * n + j]).sum();
            lower[i * n + j] = (unit - sum) / factor[i * n + i];
        }
    }
    let mut out = vec![0.0; n * n];
    for i in 0..n {
        for j in 0..n {
            let sum: f64 = (0..n).map(|k| lower[k * n + i] * lower[k * n + j]).sum();
            out[i * n + j] = sum * scales[i] * scales[j];
        }
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_inverse_times_the_matrix_is_one() {
        let matrix = [4.0, 1e-3, 2.0, 1e-3, 1e-6, 1e-4, 2.0, 1e-4, 3.0];
        let inverse = inverse(&matrix, 3).unwrap();
        for i in 0..3 {
            for j in 0..3 {
                let sum: f64 = (0..3).map(|k| matrix[i * 3 + k] * inverse[k * 3 + j]).sum();
                let size = (inverse[j * 3 + j] * matrix[i * 3 + i]).sqrt();
                let unit = if i == j { 1.0 } else { 0.0 };
                assert!((sum - unit).abs() < 1e-5 * size, "{i} {j} {sum}");
            }
        }
        assert!(super::inverse(&[1.0, 2.0, 2.0, 1.0], 2).is_none());
        assert!(super::inverse(&[0.0], 1).is_none());
    }
}
