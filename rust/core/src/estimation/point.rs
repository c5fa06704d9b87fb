//! One set of numbers of plant and noise, and what a profile holds of it.

use super::likelihood::Noise;

/// What the lags are measured from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Timing {
    /// The delay, s.
    Delay(f64),
    /// Delay and lags less the zero, s.
    Total(f64),
}

/// One set of numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    /// Delay, or delay and lags less the zero.
    pub timing: Timing,
    /// s.
    pub lags: Vec<f64>,
    /// s.
    pub zero: f64,
    /// The gain; without effect where it is eliminated.
    pub gain: f64,
    /// The noise of each recording.
    pub noise: Vec<Noise>,
}

impl Point {
    /// Delay and lags less the zero, s: by so much the answer to a ramp is late in the end.
    pub fn total(&self) -> f64 {
        match self.timing {
            Timing::Delay(delay) => delay + self.lag(),
            Timing::Total(total) => total,
        }
    }

    /// Lags less the zero, s.
    pub(super) fn lag(&self) -> f64 {
        self.lags.iter().sum::<f64>() - self.zero
    }

    /// s.
    pub fn delay(&self) -> f64 {
        match self.timing {
            Timing::Delay(delay) => delay,
            Timing::Total(total) => total - self.lag(),
        }
    }
}

/// A quantity that a profile holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// The delay.
    Delay,
    /// Delay and lags less the zero.
    Total,
    /// The gain.
    Gain,
    /// A lag.
    Lag(usize),
    /// The zero.
    Zero,
}

impl Quantity {
    /// Its value at a point; a gain that is eliminated is no part of a point.
    pub fn value(self, point: &Point) -> f64 {
        match self {
            Self::Delay => point.delay(),
            Self::Total => point.total(),
            Self::Gain => point.gain,
            Self::Zero => point.zero,
            Self::Lag(i) => point.lags.get(i).copied().unwrap_or(0.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn delay_and_total_are_the_lags_less_the_zero_apart() {
        let mut point = Point {
            timing: Timing::Delay(0.3),
            lags: vec![0.2, 0.1],
            zero: 0.05,
            gain: 1.0,
            noise: Vec::new(),
        };
        assert!((point.total() - 0.55).abs() < 1e-15);
        point.timing = Timing::Total(0.55);
        assert!((point.delay() - 0.3).abs() < 1e-15);
        assert_eq!(Quantity::Zero.value(&point), 0.05);
    }
}
