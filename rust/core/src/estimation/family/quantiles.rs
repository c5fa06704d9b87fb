//! Quantiles of Student's t, and the probability of a sum of squares.

use crate::elementary::exp;

/// Steps of Newton's method for the normal quantile, more than it needs from zero up to 1 − 10⁻⁹.
const STEPS: usize = 60;

/// P(|x| < reach) = level of a normal variable.
fn normal(level: f64) -> f64 {
    let mut x: f64 = 0.0;
    for _ in 0..STEPS {
        let density = exp(-0.5 * x * x) * (2.0 / std::f64::consts::PI).sqrt();
        x += (level - libm::erf(x / std::f64::consts::SQRT_2)) / density;
    }
    x
}

/// P(|t| < reach) = level, by the expansion of Cornish and Fisher (Abramowitz & Stegun 26.7.5).
pub(super) fn student(level: f64, freedom: f64) -> f64 {
    let x = normal(level);
    let square = x * x;
    let first = x * (square + 1.0) / 4.0;
    let second = x * ((5.0 * square + 16.0) * square + 3.0) / 96.0;
    let third = x * (((3.0 * square + 19.0) * square + 17.0) * square - 15.0) / 384.0;
    x + (first + (second + third / freedom) / freedom) / freedom
}

/// P(χ² > value), by the cube root of Wilson and Hilferty (1931).
pub(super) fn beyond(value: f64, freedom: f64) -> f64 {
    let spread = 2.0 / (9.0 * freedom);
    let x = (libm::cbrt(value / freedom) - 1.0 + spread) / spread.sqrt();
    0.5 * libm::erfc(x / std::f64::consts::SQRT_2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_tables() {
        for (level, freedom, expected) in [
            (0.95, 8.4, 2.287),
            (0.95, 12.6, 2.167),
            (0.95, 1e9, 1.95996),
        ] {
            assert!((student(level, freedom) / expected - 1.0).abs() < 2e-3);
        }
        for (value, freedom, expected) in [(18.307, 10.0, 0.05), (37.566, 20.0, 0.01)] {
            assert!((beyond(value, freedom) / expected - 1.0).abs() < 0.02);
        }
    }
}
