//! A command v that follows what it is told, u, within limits of its rate and of the rate of that.
//!
//! With the rate a = v′, its limit A, the limit J of a′ and T = A/J,
//!
//! ```text
//! a′ = ± J until a = clip((u − v)/T, −A, A), and a stays there.
//! ```
//!
//! So v goes to u on a parabola, a line at the rate A, and an exponential with the time constant T,
//! on which a′ stays below J. Without a limit of a′, v goes on a line at the rate A and stops at u.
//! u is constant between its jumps; every phase ends at a root of a polynomial of second degree at
//! most, so v and its integral are exact.

use crate::Error;
use crate::memory;

/// A limit of the rate in units of the command per s, and one of its derivative, infinite for none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RateLimits {
    rate: f64,
    rate_of_rate: f64,
}

/// The limited command and its rate.
#[derive(Debug, Clone, Copy)]
struct State {
    value: f64,
    rate: f64,
}

impl RateLimits {
    /// Pieces of each limited command: more follow it closer, and take as much longer.
    pub const PIECES: usize = 8;

    /// # Errors
    /// [`Error::Argument`] if a limit is not above zero, or that of the rate is infinite.
    pub fn new(rate: f64, rate_of_rate: f64) -> Result<Self, Error> {
        refuse_if!(
            !(rate > 0.0 && rate.is_finite()),
            "rate={rate}: give a finite number above zero"
        );
        refuse_if!(
            rate_of_rate.is_nan() || rate_of_rate <= 0.0,
            "rate_of_rate={rate_of_rate}: give a number above zero"
        );
        Ok(Self { rate, rate_of_rate })
    }

    /// The limited command as one that is held: each command from its time to the next becomes
    /// `parts` pieces with the mean of the limited one, the last one a piece of its end.
    ///
    /// It starts at rest at the first command.
    ///
    /// # Errors
    /// [`Error::Argument`] for commands that are not finite, times that do not increase, other
    /// numbers of the two, or no parts; [`Error::Memory`].
    pub fn held(
        &self,
        time: &[f64],
        command: &[f64],
        parts: usize,
    ) -> Result<(Vec<f64>, Vec<f64>), Error> {
        refuse_if!(
            time.len() != command.len() || time.is_empty() || parts == 0,
            "{} times, {} commands and {parts} parts are given: give one of each for every command",
            time.len(),
            command.len()
        );
        refuse_if!(
            time.windows(2).any(|pair| pair[0] >= pair[1]),
            "the times of commands must increase"
        );
        super::limits::finite("time", time)?;
        super::limits::finite("command", command)?;
        let pieces = (time.len() - 1).saturating_mul(parts).saturating_add(1);
        let mut times = memory::reserved("the times of limited commands", pieces)?;
        let mut means = memory::reserved("limited commands", pieces)?;
        let mut state = State {
            value: command[0],
            rate: 0.0,
        };
        for (ends, &told) in time.windows(2).zip(command) {
            let step = (ends[1] - ends[0]) / parts as f64;
            for part in 0..parts {
                times.push(ends[0] + part as f64 * step);
                means.push(self.advance(&mut state, told, step) / step);
            }
        }
        times.extend(time.last());
        means.push(state.value);
        Ok((times, means))
    }

    /// Move on by `duration` while `told` holds; return the integral of the value.
    fn advance(&self, state: &mut State, told: f64, duration: f64) -> f64 {
        if self.rate_of_rate.is_infinite() {
            return self.ramp(state, told, duration);
        }
        let (most, jerk) = (self.rate, self.rate_of_rate);
        let settling = most / jerk;
        let (mut left, mut integral) = (duration, 0.0);
        // At most a parabola, a line and an exponential; each ends where the next begins.
        while left > 0.0 {
            let error = told - state.value;
            let wanted = (error / settling).clamp(-most, most);
            // On the curve a = clip((u − v)/T) but for rounding.
            if (wanted - state.rate).abs() <= 1e-12 * most {
                state.rate = wanted;
                if error.abs() > most * settling * (1.0 + 1e-12) {
                    let until = (error.abs() / most - settling).min(left);
                    integral += until * (state.value + 0.5 * wanted * until);
                    state.value += wanted * until;
                    left -= until;
                } else {
                    let kept = (-left / settling).exp();
                    integral += told * left - error * settling * (1.0 - kept);
                    state.value = told - error * kept;
                    state.rate = error * kept / settling;
                    left = 0.0;
                }
                continue;
            }
            let sign = (wanted - state.rate).signum();
            let until = self.until_curve(sign * state.rate, sign * error).min(left);
            let (value, rate) = (state.value, state.rate);
            integral += until * (value + until * (0.5 * rate + sign * jerk * until / 6.0));
            state.value = value + until * (rate + 0.5 * sign * jerk * until);
            state.rate = rate + sign * jerk * until;
            left -= until;
        }
        integral
    }

    /// Time until a rising rate `a` meets clip(e/T), e the error, where it is below that now.
    fn until_curve(&self, a: f64, error: f64) -> f64 {
        let (most, jerk) = (self.rate, self.rate_of_rate);
        let settling = most / jerk;
        let to_most = (most - a) / jerk;
        let moved = to_most * (a + 0.5 * jerk * to_most);
        if error - moved >= most * settling {
            return to_most;
        }
        // J t²/2 + (a + J T) t − (e − a T) = 0, without cancellation.
        let (b, c) = (a + most, error - a * settling);
        2.0 * c / (b + (b * b + 2.0 * jerk * c).sqrt())
    }

    /// The same without a limit of the rate's derivative.
    fn ramp(&self, state: &mut State, told: f64, duration: f64) -> f64 {
        let error = told - state.value;
        let until = (error.abs() / self.rate).min(duration);
        let rate = self.rate.copysign(error);
        let mut integral = until * (state.value + 0.5 * rate * until);
        state.value = if until < duration {
            told
        } else {
            state.value + rate * until
        };
        integral += (duration - until) * state.value;
        integral
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values at the ends of pieces, from means of short pieces.
    fn limited(limits: RateLimits, time: &[f64], command: &[f64]) -> (Vec<f64>, Vec<f64>) {
        limits.held(time, command, 1000).expect("commands")
    }

    #[test]
    fn a_step_becomes_a_ramp() {
        let limits = RateLimits::new(2.0, f64::INFINITY).expect("limits");
        let (times, means) = limited(limits, &[0.0, 1.0, 3.0], &[0.0, 1.0, 1.0]);
        for (pair, mean) in times.windows(2).zip(&means) {
            let middle = 0.5 * (pair[0] + pair[1]);
            let expected = (2.0 * (middle - 1.0)).clamp(0.0, 1.0);
            assert!((mean - expected).abs() < 1e-12, "{middle}: {mean}");
        }
    }

    #[test]
    fn a_step_becomes_a_parabola_a_line_and_an_exponential() {
        // A = 1, J = 5: T = 0.2 s. The rate is 1 at 0.2 s, where v = 0.1, and until the error is
        // A T = 0.2, at v = 0.8 and t = 0.9 s.
        let limits = RateLimits::new(1.0, 5.0).expect("limits");
        let (times, means) = limited(limits, &[-1.0, 0.0, 2.0], &[0.0, 1.0, 1.0]);
        let exact = |t: f64| -> f64 {
            if t <= 0.0 {
                0.0
            } else if t <= 0.2 {
                2.5 * t * t
            } else if t <= 0.9 {
                0.1 + (t - 0.2)
            } else {
                1.0 - 0.2 * (-(t - 0.9) / 0.2).exp()
            }
        };
        for (pair, mean) in times.windows(2).zip(&means) {
            // Simpson's rule is exact for the parabola, to 1e-14 for the exponential.
            let middle = 0.5 * (pair[0] + pair[1]);
            let simpson = (exact(pair[0]) + 4.0 * exact(middle) + exact(pair[1])) / 6.0;
            assert!((mean - simpson).abs() < 1e-9, "{middle}: {mean} {simpson}");
        }
    }

    #[test]
    fn it_is_the_limit_of_the_recursion_in_short_steps() {
        let (most, jerk, step) = (2.5, 5.0, 1e-5);
        let time: Vec<f64> = (0..40).map(|k| 0.065 * f64::from(k)).collect();
        let command: Vec<f64> = (0..40).map(|k| (f64::from(k * k) * 0.7).sin()).collect();
        let limits = RateLimits::new(most, jerk).expect("limits");
        let (times, means) = limits.held(&time, &command, 1).expect("commands");
        assert_eq!(times, time);
        let (mut v, mut a) = (command[0], 0.0);
        for (&told, mean) in command.iter().zip(&means).take(39) {
            let mut sum = 0.0;
            for _ in 0..6500 {
                let wanted = ((told - v) * jerk / most).clamp(-most, most);
                a += (wanted - a).clamp(-jerk * step, jerk * step);
                v += a * step;
                sum += v;
            }
            assert!(
                (mean - sum / 6500.0).abs() < 2e-4,
                "{mean} {}",
                sum / 6500.0
            );
        }
    }

    #[test]
    fn the_pieces_have_the_same_integral_however_many_there_are() {
        let time = [0.0, 0.3, 0.4, 1.9, 2.0];
        let command = [1.0, -2.0, 3.0, 0.5, 0.5];
        for rate_of_rate in [2.0, 40.0, f64::INFINITY] {
            let limits = RateLimits::new(4.0, rate_of_rate).expect("limits");
            let (_, whole) = limits.held(&time, &command, 1).expect("commands");
            let (_, fine) = limits.held(&time, &command, 7).expect("commands");
            for (mean, pieces) in whole.iter().zip(fine.chunks(7)).take(4) {
                let average = pieces.iter().sum::<f64>() / 7.0;
                assert!((mean - average).abs() < 1e-12, "{mean} {average}");
            }
            assert!((whole[4] - fine[28]).abs() < 1e-12);
        }
    }

    #[test]
    fn arguments_that_mean_nothing_are_refused() {
        assert!(RateLimits::new(0.0, 1.0).is_err());
        assert!(RateLimits::new(f64::INFINITY, 1.0).is_err());
        assert!(RateLimits::new(1.0, -1.0).is_err());
        let limits = RateLimits::new(1.0, 1.0).expect("limits");
        for (time, command, parts) in [
            (vec![], vec![], 1),
            (vec![0.0], vec![0.0, 1.0], 1),
            (vec![0.0, 0.0], vec![0.0, 1.0], 1),
            (vec![0.0, f64::NAN], vec![0.0, 1.0], 1),
            (vec![0.0, 1.0], vec![0.0, f64::INFINITY], 1),
            (vec![0.0, 1.0], vec![0.0, 1.0], 0),
        ] {
            assert!(limits.held(&time, &command, parts).is_err());
        }
    }
}
