//! Numbers drawn from Gaussian and gamma distributions, the same in every run and on every machine.

use std::f64::consts::TAU;

use crate::elementary::{log, sin_cos};

/// A sequence of drawn numbers.
#[derive(Debug, Clone)]
pub(super) struct Draws {
    state: u64,
    /// A normal number that was drawn with the last.
    other: Option<f64>,
}

impl Draws {
    pub(super) const fn new(seed: u64) -> Self {
        Self {
            state: seed,
            other: None,
        }
    }

    /// Evenly between zero, not reached, and one (SplitMix64; Steele, Lea & Flood 2014).
    fn uniform(&mut self) -> f64 {
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.state ^ (self.state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (((mixed ^ (mixed >> 31)) >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
    }

    /// Of variance one (Box & Muller 1958).
    pub(super) fn normal(&mut self) -> f64 {
        if let Some(other) = self.other.take() {
            return other;
        }
        let size = (-2.0 * log(self.uniform())).sqrt();
        let (sine, cosine) = sin_cos(TAU * self.uniform());
        self.other = Some(size * sine);
        size * cosine
    }

    /// A sum of squares of so many normal numbers, at least two (Marsaglia & Tsang 2000).
    pub(super) fn chi_squared(&mut self, freedom: f64) -> f64 {
        let shape = 0.5 * freedom.max(2.0) - 1.0 / 3.0;
        loop {
            let x = self.normal();
            let side = 1.0 + x / (9.0 * shape).sqrt();
            let cube = side * side * side;
            if side > 0.0 && log(self.uniform()) < 0.5 * x * x + shape * (1.0 - cube + log(cube)) {
                return 2.0 * shape * cube;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_are_those_of_the_distributions() {
        let mut draws = Draws::new(0);
        let count = 40_000;
        let moments = |values: &[f64]| {
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            let squares: f64 = values.iter().map(|x| (x - mean) * (x - mean)).sum();
            (mean, squares / values.len() as f64)
        };
        let normal: Vec<f64> = (0..count).map(|_| draws.normal()).collect();
        let (mean, variance) = moments(&normal);
        assert!(mean.abs() < 0.02 && (variance - 1.0).abs() < 0.03);
        for freedom in [2.0, 7.0, 188.0] {
            let found: Vec<f64> = (0..count).map(|_| draws.chi_squared(freedom)).collect();
            let (mean, variance) = moments(&found);
            assert!((mean / freedom - 1.0).abs() < 0.03, "{freedom} {mean}");
            assert!(
                (variance / (2.0 * freedom) - 1.0).abs() < 0.1,
                "{freedom} {variance}"
            );
        }
    }
}
