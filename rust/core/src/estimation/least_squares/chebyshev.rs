//! Misfit of a loop whose delay is a polynomial through Chebyshev points (Torkamani & Butcher 2013).
//!
//! The output over the last delay, y(t + θ) for −Td ≤ θ ≤ 0, is the polynomial through its values
//! Y₀ … Y_N at θ_j = Td/2 (cos(jπ/N) − 1). All but the first follow from the differentiation matrix,
//! Y_j′ = 2/Td (D Y)_j (Trefethen 2000, chapter 6), the first by the loop, Y₀′ = v, lag v′ + v =
//! K (r − Y_N), v itself the right side without a lag. The step response of these ordinary equations is
//! a sum of exponentials, and the reference a sum of steps.

use num_complex::Complex64;

use super::joint::Part;
use super::quotients::quotients;
use super::tolerances::LARGEST_EXPONENT;
use crate::elementary::exp;
use crate::linear_algebra::eigenvalues::eigenvalues;
use crate::linear_algebra::elimination::Eliminated;
use crate::linear_algebra::rows::Rows;
use crate::{Error, Task};

/// Misfit where the modes of the loop are not found: more than that of any loop that is recorded.
const NO_MODES: f64 = 1e20;

/// Shift of an eigenvalue at which its vectors are found, as a share of it: less may divide by zero.
const SHIFT: f64 = 1e-13;

/// One recording.
#[derive(Debug, Clone)]
pub struct Chebyshev {
    /// Time stamps.
    pub time: Vec<f64>,
    /// What was recorded.
    pub output: Vec<f64>,
    /// Times of the steps of the reference, the first row counted as one, and its value from there on.
    pub steps: Vec<(f64, f64)>,
    /// Delay, gain, lag and Kp where they are not fitted.
    pub known: [f64; 4],
    /// Place of delay, gain and lag in a point, where they are fitted.
    pub places: [Option<usize>; 3],
    /// The output at the start; the last number of a point where there is none.
    pub start: Option<f64>,
    /// Degree of the polynomial.
    pub intervals: usize,
    /// Whether the output is later than the plant by the delay.
    pub is_late: bool,
    /// Scale of each number of a point.
    pub units: Vec<f64>,
}

impl Chebyshev {
    fn output_at(&self, point: &[f64]) -> Option<Vec<f64>> {
        let [delay, gain, lag] =
            std::array::from_fn(|i| self.places[i].map_or(self.known[i], |place| point[place]));
        let start = self.start.or(point.last().copied())?;
        let found = StepModes::new(self.intervals, delay, gain * self.known[3], lag)?;
        let late = if self.is_late { delay } else { 0.0 };
        let mut output = vec![start; self.time.len()];
        let mut before = start;
        for (time, level) in &self.steps {
            let jump = level - std::mem::replace(&mut before, *level);
            for (output, stamp) in output.iter_mut().zip(&self.time) {
                *output += jump * (1.0 + found.at((stamp - time - late).max(0.0)));
            }
        }
        Some(output)
    }
}

impl Part for Chebyshev {
    fn misfit(&self, point: &[f64], _: &Task) -> Result<Vec<f64>, Error> {
        // Numbers at which the modes are not found are as far from the minimum as any.
        let Some(found) = self.output_at(point) else {
            return Ok(vec![NO_MODES; self.output.len()]);
        };
        Ok(found.iter().zip(&self.output).map(|(x, y)| x - y).collect())
    }

    fn slopes(&self, point: &[f64], task: &Task) -> Result<Vec<Vec<f64>>, Error> {
        let misfit = |point: &[f64]| self.misfit(point, task);
        quotients(misfit, point, &self.units, |index| {
            self.places[2] == Some(index)
        })
    }
}

/// The unit step response 1 + Σ w e^(λ t) of the approximated loop.
#[derive(Debug, Clone)]
struct StepModes {
    modes: Vec<(Complex64, Complex64)>,
}

impl StepModes {
    /// Rates λ and weights w; none where they are not found.
    fn new(intervals: usize, delay: f64, stiffness: f64, lag: f64) -> Option<Self> {
        let nodes = intervals + 1;
        let n = nodes + usize::from(lag > 0.0);
        let mut a = vec![0.0; n * n];
        let matrix = differentiation(intervals);
        for i in 1..nodes {
            for j in 0..nodes {
                a[i * n + j] = 2.0 / delay * matrix[i * nodes + j];
            }
        }
        if lag > 0.0 {
            a[nodes] = 1.0;
            a[nodes * n + nodes - 1] = -stiffness / lag;
            a[nodes * n + nodes] = -1.0 / lag;
        } else {
            a[nodes - 1] = -stiffness;
        }
        if !a.iter().all(|x| x.is_finite()) {
            return None;
        }
        let mut modes = Vec::new();
        for rate in eigenvalues(&a, n)? {
            if rate.im < 0.0 {
                continue;
            }
            // The deviation from the new reference is −1 over the whole delay at first, at rest.
            let right = vector(&a, n, rate, false)?;
            let left = vector(&a, n, rate, true)?;
            let begun: Complex64 = left[..nodes].iter().sum();
            let norm: Complex64 = left.iter().zip(&right).map(|(l, r)| l * r).sum();
            // One of each conjugate pair stands for both.
            let both = if rate.im > 0.0 { 2.0 } else { 1.0 };
            modes.push((rate, -both * right[0] * begun / norm));
        }
        Some(Self { modes })
    }

    /// The response at a time since the step, less 1.
    fn at(&self, since: f64) -> f64 {
        let one = |(rate, weight): &(Complex64, Complex64)| {
            let phase = since * rate.im;
            let (sine, cosine) = (libm::sin(phase), libm::cos(phase));
            exp((since * rate.re).min(LARGEST_EXPONENT)) * (weight.re * cosine - weight.im * sine)
        };
        self.modes.iter().map(one).sum()
    }
}

/// The right or left vector of an eigenvalue, by inverse iteration.
fn vector(a: &[f64], n: usize, rate: Complex64, is_left: bool) -> Option<Vec<Complex64>> {
    let mut shifted = Rows::zeros(n);
    for i in 0..n {
        for j in 0..n {
            let entry = if is_left { a[j * n + i] } else { a[i * n + j] };
            shifted.add(i, j, Complex64::from(entry));
        }
        shifted.add(i, i, -rate * (1.0 + SHIFT));
    }
    let factors = Eliminated::new(shifted)?;
    let mut x: Vec<Complex64> = (0..n)
        .map(|i| Complex64::new(1.0, 0.3 + 0.1 * i as f64))
        .collect();
    for _ in 0..3 {
        factors.solve(&mut x);
        let size = x.iter().map(|x| x.norm()).fold(0.0, f64::max);
        x.iter_mut().for_each(|x| *x /= size);
    }
    x.iter().all(|x| x.is_finite()).then_some(x)
}

/// The matrix that differentiates polynomials by their values at cos(jπ/order), j = 0 … order.
fn differentiation(order: usize) -> Vec<f64> {
    let n = order + 1;
    let x = |j: usize| libm::cos(std::f64::consts::PI * j as f64 / order as f64);
    let c = |j: usize| {
        let end = if j == 0 || j == order { 2.0 } else { 1.0 };
        if j.is_multiple_of(2) { end } else { -end }
    };
    let mut matrix = vec![0.0; n * n];
    for i in 0..n {
        for j in (0..n).filter(|j| *j != i) {
            matrix[i * n + j] = c(i) / c(j) / (x(i) - x(j));
        }
        // With this diagonal the derivative of a constant is zero to rounding.
        let sum: f64 = matrix[i * n..][..n].iter().sum();
        matrix[i * n + i] = -sum;
    }
    matrix
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_matrix_differentiates_polynomials() {
        let (order, n) = (6, 7);
        let x: Vec<f64> = (0..n)
            .map(|j| libm::cos(std::f64::consts::PI * j as f64 / order as f64))
            .collect();
        let matrix = differentiation(order);
        for power in 0..=order as i32 {
            for i in 0..n {
                let found: f64 = (0..n).map(|j| matrix[i * n + j] * x[j].powi(power)).sum();
                let slope = if power == 0 {
                    0.0
                } else {
                    f64::from(power) * x[i].powi(power - 1)
                };
                assert!((found - slope).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn the_step_response_begins_at_rest_and_follows_the_delay() {
        // Before one delay the rate of the exact loop is K, behind the lag.
        let found = StepModes::new(16, 0.4, 1.0, 0.0).unwrap();
        assert!((1.0 + found.at(0.0)).abs() < 1e-9);
        assert!((1.0 + found.at(0.3) - 0.3).abs() < 2e-3);
        let lagged = StepModes::new(16, 0.4, 1.0, 0.05).unwrap();
        assert!((1.0 + lagged.at(0.3) - 0.25).abs() < 5e-3);
    }
}
