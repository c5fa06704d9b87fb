//! The delay in terms of samples.

use crate::dde::scalar::Scalar;

/// The delay in terms of samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Timing<S = f64> {
    /// m, the whole samples in the delay.
    pub samples: usize,
    /// δ, what remains of the delay, in [0, Ts).
    pub early: S,
    /// Ts − δ.
    pub late: S,
}

impl<S: Scalar> Timing<S> {
    /// The parts of `delay` seconds at `sample_time` seconds.
    pub fn new(delay: S, sample_time: S) -> Self {
        let ratio = delay.value() / sample_time.value();
        let nearest = ratio.round();
        if (ratio - nearest).abs() <= 8.0 * f64::EPSILON * nearest.max(1.0) {
            let early = S::from(-nearest).mul_add(sample_time, delay).pinned(0.0);
            return Self {
                samples: nearest as usize,
                early,
                late: (sample_time - early).pinned(sample_time.value()),
            };
        }
        let whole = ratio.floor();
        // With one rounding: the product of the whole number and Ts is not rounded separately.
        let early = S::from(-whole).mul_add(sample_time, delay);
        let early = early.pinned(early.value().clamp(0.0, sample_time.value()));
        Self {
            samples: whole as usize,
            early,
            late: sample_time - early,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn whole_samples_leave_no_fraction_whatever_the_rounding() {
        // 3 × 0.065 is 0.195, but 0.195/0.065 is not 3 in floating point.
        for m in 0..400 {
            let timing = Timing::new(0.065 * f64::from(m), 0.065);
            assert_eq!((timing.samples, timing.early), (m as usize, 0.0));
        }
        assert_eq!(Timing::new(0.195, 0.065).samples, 3);
    }

    proptest! {
        #[test]
        fn parts_of_the_delay_add_up(delay in 0.0..10.0_f64, sample_time in 1e-3..1.0_f64) {
            let timing = Timing::new(delay, sample_time);
            prop_assert!((0.0..sample_time).contains(&timing.early));
            let sum = timing.samples as f64 * sample_time + timing.early;
            prop_assert!((sum - delay).abs() <= 8.0 * f64::EPSILON * delay);
            prop_assert!(
                (timing.early + timing.late - sample_time).abs() <= f64::EPSILON * sample_time
            );
        }
    }
}
