//! A known digital filter of an output, and its inverse.
//!
//! A filter y = B/A x, in powers of 1/z, colours the noise of the sensor, and it is the filtered rows
//! that are logged. With its zeros inside the unit circle, x = A/B y is what the sensor read, and its
//! noise is white again. A low-pass has zeros at the Nyquist frequency, on the circle, and its inverse
//! has no end there. They are moved to a circle of radius `LARGEST`: C instead of B. What is computed
//! is then B/C x, which differs from x near the Nyquist frequency alone, and by a known delay. The mean
//! of two rows has no part there. What is added behind the filter, as by the digits of a log, is
//! amplified near that frequency by up to A/C, and a larger circle than needed lets it colour what is
//! computed. Rows are averaged over the time by which the filter is late, in which
//! filtered rows are alike, and at least in pairs.

use num_complex::Complex64;

use super::polynomial::roots;

/// Radius of the circle to which zeros are moved.
const LARGEST: f64 = 0.5;

/// Zeros at lower frequencies than a quarter of the rate of the rows stay where they are, up to this radius.
const LARGEST_LOW: f64 = 0.98;

/// How far beyond the unit circle a zero may be by rounding.
const ROUNDING: f64 = 1e-6;

/// Share of the start that may be left when rows are used.
const FORGOTTEN: f64 = 1e-6;

/// Why a filter has no inverse.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NoInverse {
    /// It is not stable.
    Unstable,
    /// It removes a frequency, or has a zero outside the unit circle.
    Removes,
}

/// A filter y = B/A x in ascending powers of 1/z, with a part C for B that can be inverted.
#[derive(Debug, Clone, PartialEq)]
pub struct KnownFilter {
    b: Vec<f64>,
    a: Vec<f64>,
    inverted: Vec<f64>,
    /// Largest radius of a root of C.
    radius: f64,
}

impl KnownFilter {
    /// The filter with these finite coefficients, of which some are not zero.
    ///
    /// # Errors
    ///
    /// Where it has no inverse.
    pub fn new(b: Vec<f64>, a: Vec<f64>) -> Result<Self, NoInverse> {
        let poles = roots(&a).filter(|_| a.first() != Some(&0.0));
        if poles.is_none_or(|poles| poles.iter().any(|pole| pole.norm() >= 1.0)) {
            return Err(NoInverse::Unstable);
        }
        let zeros = roots(&b).ok_or(NoInverse::Removes)?;
        let removes = |zero: &Complex64| {
            let is_fast = zero.re < 0.0;
            zero.norm() > 1.0 + ROUNDING || (!is_fast && zero.norm() > LARGEST_LOW)
        };
        if zeros.iter().any(removes) {
            return Err(NoInverse::Removes);
        }
        let moved: Vec<Complex64> = zeros
            .into_iter()
            .map(|zero| match zero.norm() {
                size if zero.re < 0.0 && size > LARGEST => zero * LARGEST / size,
                _ => zero,
            })
            .collect();
        let mut inverted = product(&moved);
        let scale = b.iter().sum::<f64>() / inverted.iter().sum::<f64>();
        inverted.iter_mut().for_each(|c| *c *= scale);
        let radius = moved.iter().map(|zero| zero.norm()).fold(0.0, f64::max);
        Ok(Self {
            b,
            a,
            inverted,
            radius,
        })
    }

    /// How late the filter follows a slow signal, in rows.
    pub fn late(&self) -> f64 {
        mean_power(&self.b) - mean_power(&self.a)
    }

    /// How late B/C follows, in rows.
    pub fn remaining(&self) -> f64 {
        mean_power(&self.b) - mean_power(&self.inverted)
    }

    /// Rows until what is computed does not depend on rows before the log.
    pub fn start(&self) -> usize {
        let fading = if self.radius > 0.0 {
            libm::log(FORGOTTEN) / libm::log(self.radius)
        } else {
            0.0
        };
        self.a.len() + fading.ceil() as usize
    }

    /// Rows that are averaged.
    pub fn together(&self) -> usize {
        (2.0 * self.late()).round_ties_even().max(2.0) as usize
    }

    /// B/C x of the filtered rows, as if the first had been there for ever.
    pub fn undone(&self, output: &[f64]) -> Vec<f64> {
        let Some(first) = output.first() else {
            return Vec::new();
        };
        let count = self.a.len().max(self.inverted.len());
        let lead = self.inverted[0];
        let padded = |part: &[f64]| -> Vec<f64> {
            let at = |i: usize| part.get(i).map_or(0.0, |c| c / lead);
            (0..count).map(at).collect()
        };
        let (above, below) = (padded(&self.a), padded(&self.inverted));
        let rest = above.iter().sum::<f64>() / below.iter().sum::<f64>();
        // States of the transposed direct form, at rest under the first row; the last one is zero.
        let mut states: Vec<f64> = (1..=count)
            .map(|i| {
                let above: f64 = above[i..].iter().sum();
                (above - rest * below[i..].iter().sum::<f64>()) * first
            })
            .collect();
        let mut filtered = Vec::with_capacity(output.len());
        for x in output {
            let y = above[0] * x + states[0];
            for i in 1..count {
                states[i - 1] = states[i] + above[i] * x - below[i] * y;
            }
            filtered.push(y);
        }
        filtered
    }
}

/// Mean power of 1/z, weighted by the coefficients.
fn mean_power(coefficients: &[f64]) -> f64 {
    let powers = coefficients.iter().enumerate();
    let sum: f64 = powers.map(|(power, c)| power as f64 * c).sum();
    sum / coefficients.iter().sum::<f64>()
}

/// Coefficients of the polynomial with these roots, conjugates among them, from the highest power on.
fn product(roots: &[Complex64]) -> Vec<f64> {
    let mut found = vec![Complex64::ONE];
    for root in roots {
        found.push(Complex64::ZERO);
        for i in (1..found.len()).rev() {
            let before = found[i - 1];
            found[i] -= root * before;
        }
    }
    found.into_iter().map(|c| c.re).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_first_order_filter_is_undone_exactly() {
        let (k, x) = (0.4, [1.0, 3.0, -2.0, 5.0, 0.5, 0.25]);
        let filter = KnownFilter::new(vec![k], vec![1.0, k - 1.0]).unwrap();
        let mut y = vec![x[0]];
        for value in &x[1..] {
            y.push((1.0 - k) * y[y.len() - 1] + k * value);
        }
        for (undone, x) in filter.undone(&y).iter().zip(x) {
            assert!((undone - x).abs() < 1e-13);
        }
        assert!((filter.late() - (1.0 - k) / k).abs() < 1e-14);
        assert_eq!((filter.remaining(), filter.start()), (0.0, 2));
    }

    #[test]
    fn zeros_on_the_circle_move_to_the_smaller_one() {
        // (1 + 1/z)² of a Butterworth filter: C = 16/9 (1 + 1/(2 z))².
        let filter = KnownFilter::new(vec![1.0, 2.0, 1.0], vec![1.0, -0.5, 0.1]).unwrap();
        for (found, expected) in filter.inverted.iter().zip([16.0, 16.0, 4.0]) {
            assert!((found - expected / 9.0).abs() < 1e-7);
        }
    }

    #[test]
    fn what_has_no_inverse_is_said() {
        let why = |b: &[f64], a: &[f64]| KnownFilter::new(b.to_vec(), a.to_vec()).err();
        assert_eq!(why(&[1.0], &[1.0, -1.2]), Some(NoInverse::Unstable));
        assert_eq!(why(&[1.0], &[0.0, 1.0]), Some(NoInverse::Unstable));
        assert_eq!(why(&[1.0, -1.0], &[1.0]), Some(NoInverse::Removes));
        assert_eq!(why(&[1.0, 2.0], &[1.0]), Some(NoInverse::Removes));
        assert_eq!(why(&[0.0, 1.0], &[1.0]), None);
    }
}
