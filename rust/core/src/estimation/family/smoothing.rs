//! Readings that are a moving mean, taken after the fact, of what the sensor read.
//!
//! ```text
//! y = M x,   M: the mean over L rows around each, with a share of those at its ends
//! ```
//! The readings x are found back, up to waves that the mean takes away. They are fitted like others, and
//! whitened by the factor of M Mᵀ + ρ behind M, to which such waves are nothing. The mean moves no edge
//! by more than half of it, and its delay is zero. ρ is what was added to the mean, by rounding for one.

/// What is added to find readings back, and how often: the mean of what is found is then the record.
const BACK: (f64, usize) = (1e-10, 3);

/// A moving mean of so many rows.
#[derive(Debug, Clone)]
pub(super) struct Smoothing {
    /// Its length, rows.
    pub(super) length: f64,
    weights: Vec<f64>,
    rows: usize,
    /// The lower factor of M Mᵀ + ρ: of each row what counts, the diagonal last.
    factor: Vec<Vec<f64>>,
    /// ln of its determinant.
    pub(super) log_det: f64,
    /// The record, less its mean.
    readings: Vec<f64>,
}

impl Smoothing {
    /// Of this length, with so much noise added to the mean, in units of the variance of a reading.
    pub(super) fn new(readings: &[f64], length: f64, added: f64) -> Option<Self> {
        let half = (0.5 * (length - 1.0)).ceil().max(0.0) as usize;
        let weight = |at: usize| {
            let off = at.abs_diff(half) as f64;
            (0.5 * length - (off - 0.5)).clamp(0.0, 1.0) / length
        };
        let mut out = Self {
            length,
            weights: (0..=2 * half).map(weight).collect(),
            rows: readings.len(),
            factor: Vec::new(),
            log_det: 0.0,
            readings: readings.to_vec(),
        };
        (readings.len() > 4 * half && out.factorise(added)).then_some(out)
    }

    fn half(&self) -> usize {
        self.weights.len() / 2
    }

    /// Cholesky's factor of the banded matrix.
    fn factorise(&mut self, added: f64) -> bool {
        let width = self.weights.len();
        let product = |off: usize| -> f64 {
            let pairs = self.weights[off..].iter().zip(&self.weights);
            pairs.map(|(one, other)| one * other).sum()
        };
        let mut band: Vec<f64> = (0..width).map(product).collect();
        band[0] += added;
        let count = self.rows + 1 - width;
        let mut factor: Vec<Vec<f64>> = Vec::with_capacity(count);
        let mut log_det = 0.0;
        for at in 0..count {
            let first = (at + 1).saturating_sub(width);
            let mut row = Vec::with_capacity(at - first + 1);
            for column in first..=at {
                let mut entry = band[at - column];
                let start = first.max((column + 1).saturating_sub(width));
                let other: &[f64] = factor.get(column).map_or(&[], Vec::as_slice);
                let begun = (column + 1).saturating_sub(width);
                for place in start..column {
                    let left: f64 = row[place - first];
                    let right = if column == at {
                        left
                    } else {
                        other[place - begun]
                    };
                    entry -= left * right;
                }
                if column < at {
                    row.push(entry / other[column - begun]);
                } else if entry > 0.0 {
                    log_det += entry.ln();
                    row.push(entry.sqrt());
                } else {
                    return false;
                }
            }
            factor.push(row);
        }
        (self.factor, self.log_det) = (factor, log_det);
        true
    }

    /// The mean of a column, of rows with a whole one around them.
    fn mean(&self, column: &[f64]) -> Vec<f64> {
        let each = column.windows(self.weights.len());
        each.map(|some| some.iter().zip(&self.weights).map(|(y, w)| y * w).sum())
            .collect()
    }

    fn solve_lower(&self, column: &mut [f64]) {
        for (at, row) in self.factor.iter().enumerate() {
            let first = at + 1 - row.len();
            let known: f64 = row.iter().zip(&column[first..at]).map(|(l, x)| l * x).sum();
            column[at] = (column[at] - known) / row[row.len() - 1];
        }
    }

    fn solve_upper(&self, column: &mut [f64]) {
        for (at, row) in self.factor.iter().enumerate().rev() {
            let first = at + 1 - row.len();
            column[at] /= row[row.len() - 1];
            let value = column[at];
            for (entry, l) in column[first..at].iter_mut().zip(row) {
                *entry -= l * value;
            }
        }
    }

    /// A column of readings, whitened; its last entries are zero.
    pub(super) fn whiten(&self, column: &[f64]) -> Vec<f64> {
        let mut out = self.mean(column);
        self.solve_lower(&mut out);
        out.resize(self.rows, 0.0);
        out
    }

    /// Readings whose mean the record is.
    pub(super) fn found_back(&self) -> Option<Vec<f64>> {
        let exact = Self::new(&self.readings, self.length, BACK.0)?;
        let half = self.half();
        let goal = &self.readings[half..self.rows - half];
        let mut out = vec![0.0; self.rows];
        for _ in 0..BACK.1 {
            let mut off: Vec<f64> = goal
                .iter()
                .zip(exact.mean(&out))
                .map(|(y, own)| y - own)
                .collect();
            exact.solve_lower(&mut off);
            exact.solve_upper(&mut off);
            for (at, value) in off.iter().enumerate() {
                for (entry, weight) in out[at..].iter_mut().zip(&self.weights) {
                    *entry += weight * value;
                }
            }
        }
        Some(out)
    }

    /// The record again.
    pub(super) fn readings(&self) -> &[f64] {
        &self.readings
    }

    /// The mean of residuals, NaN where none is whole.
    pub(super) fn shown(&self, residual: &[f64]) -> Vec<f64> {
        let mut out = vec![f64::NAN; self.half()];
        out.extend(self.mean(residual));
        out.resize(self.rows, f64::NAN);
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn readings_are_found_back_up_to_what_the_mean_takes_away() {
        let wave = |at: usize| (0.3 * at as f64).sin() + ((at * 7919 % 101) as f64 / 101.0 - 0.5);
        let x: Vec<f64> = (0..120).map(wave).collect();
        for length in [1.3, 2.76, 5.0] {
            let half = (0.5 * (length - 1.0_f64)).ceil() as usize;
            let bare = Smoothing::new(&x, length, 1e-8).unwrap();
            let mut readings = vec![0.0; half];
            readings.extend(bare.mean(&x));
            readings.resize(x.len(), 0.0);
            let smoothing = Smoothing::new(&readings, length, 1e-8).unwrap();
            let again = smoothing.mean(&smoothing.found_back().unwrap());
            for (own, y) in again.iter().zip(&readings[half..]) {
                assert!((own - y).abs() < 1e-9);
            }
            // Whitening is that of the same waves in both.
            let (one, other) = (
                smoothing.whiten(&x),
                smoothing.whiten(&smoothing.found_back().unwrap()),
            );
            assert!(one.iter().zip(&other).all(|(a, b)| (a - b).abs() < 1e-4));
        }
    }

    #[test]
    fn white_readings_stay_white() {
        // L⁻¹ M Mᵀ L⁻ᵀ = I.
        let length = 2.5;
        let count = 30;
        let smoothing = Smoothing::new(&vec![0.0; count], length, 0.0).unwrap();
        let unit = |at: usize| {
            let mut column = vec![0.0; count];
            column[at] = 1.0;
            smoothing.whiten(&column)
        };
        let columns: Vec<Vec<f64>> = (0..count).map(unit).collect();
        for i in 0..count - 2 {
            for j in 0..count - 2 {
                let product: f64 = columns.iter().map(|column| column[i] * column[j]).sum();
                let goal = f64::from(u8::from(i == j));
                assert!((product - goal).abs() < 1e-6, "{i} {j} {product}");
            }
        }
    }
}
