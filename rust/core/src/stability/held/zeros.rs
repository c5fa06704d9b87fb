//! All zeros z of z^m a(σ) − b(σ), σ = (z − 1)/Ts, for many samples m of delay.
//!
//! Simultaneous Newton steps that keep the zeros apart (Aberth 1973, Iteration methods for finding all
//! zeros of a polynomial simultaneously): a step costs a few operations a pair, where the eigenvalues of
//! the transition matrix take its dimension to the third power.

use num_complex::Complex64;

/// Relative size of a step from which on a zero counts as found, and most rounds of steps.
const FOUND: f64 = 1e-12;
const ROUNDS: usize = 200;

/// A modulus below which a zero decays within a sample, wherever it is.
const NOTHING: f64 = 1e-12;

/// First angle of the zeros on their circle, rad: none is on the real line, where conjugate ones would
/// stay together.
const FIRST_ANGLE: f64 = 0.4;

/// The polynomials of a loop with a hold, and the samples of its delay.
pub(super) struct Held<'a> {
    pub(super) a: &'a [f64],
    pub(super) b: &'a [f64],
    pub(super) samples: usize,
    pub(super) sample_time: f64,
}

impl Held<'_> {
    /// The zeros; none where they are not found.
    pub(super) fn zeros(&self) -> Option<Vec<Complex64>> {
        let mut zeros = self.first()?;
        let mut open: Vec<usize> = (0..zeros.len()).collect();
        for _ in 0..ROUNDS {
            let mut left = Vec::new();
            for &place in &open {
                let z = zeros[place];
                let newton = self.newton(z);
                let others = zeros
                    .iter()
                    .enumerate()
                    .filter(|(other, _)| *other != place);
                let pulls: Complex64 = others.map(|(_, other)| (z - other).inv()).sum();
                let step = newton / (1.0 - newton * pulls);
                if !step.is_finite() {
                    return None;
                }
                zeros[place] = z - step;
                if step.norm().max(newton.norm()) > FOUND * z.norm() && z.norm() > NOTHING {
                    left.push(place);
                }
            }
            if left.is_empty() {
                return Some(zeros);
            }
            open = left;
        }
        None
    }

    /// Points on the circle that has the product of all zeros.
    fn first(&self) -> Option<Vec<Complex64>> {
        let degree = self.a.iter().rposition(|c| *c != 0.0)?;
        let count = degree + self.samples;
        let at_zero = value(self.b, Complex64::from(-1.0 / self.sample_time))
            .0
            .norm();
        let leading = self.a[degree].abs() * self.sample_time.powi(-(degree as i32));
        let radius = (at_zero / leading).powf(1.0 / count as f64);
        if !(radius > 0.0 && radius.is_finite()) {
            return None;
        }
        let angle = |k: usize| FIRST_ANGLE + std::f64::consts::TAU * k as f64 / count as f64;
        Some(
            (0..count)
                .map(|k| Complex64::from_polar(radius, angle(k)))
                .collect(),
        )
    }

    /// p/p′ at z.
    fn newton(&self, z: Complex64) -> Complex64 {
        let sigma = (z - 1.0) / self.sample_time;
        let ((a, a_slope), (b, b_slope)) = (value(self.a, sigma), value(self.b, sigma));
        let m = self.samples as f64;
        let slope = |of: Complex64| of / self.sample_time;
        if z.norm_sqr() > 1.0 {
            let back = z.powi(-(self.samples as i32));
            let p = a - back * b;
            return p / (m * a / z + slope(a_slope) - back * slope(b_slope));
        }
        let before = z.powi(self.samples as i32 - 1);
        let p = before * z * a - b;
        p / (m * before * a + before * z * slope(a_slope) - slope(b_slope))
    }
}

/// A polynomial in ascending powers and its derivative.
fn value(coefficients: &[f64], x: Complex64) -> (Complex64, Complex64) {
    let start = (Complex64::ZERO, Complex64::ZERO);
    coefficients
        .iter()
        .rev()
        .fold(start, |(p, slope), c| (p * x + c, slope * x + p))
}
