//! What a loop feels of a plant: gain and phase, the largest stable gain, and where half of it crosses
//! over; with errors by the delta method.

use std::f64::consts::PI;

use super::class::{Class, Numbers};
use super::series::{Series, TERMS};
use crate::elementary::{angle, exp, log};
use crate::frequency::margins;
use crate::quasipoly::QuasiPolynomial;
use crate::{Error, Task};

/// Relative step of numerical derivatives: more loses curvature, less digits.
const STEP: f64 = 1e-5;

/// Steps of the secant method beside a known crossing.
const SECANTS: usize = 8;

/// The gain of a loop whose margin is the largest gain: small enough to be stable with damping above 0.05.
const SMALL: f64 = 1e-3;

/// Frequencies, and decades below the turn, on which the highest crossing is looked for.
const FREQUENCIES: usize = 200;
const DECADES: f64 = 4.0;

/// A plant with all of its numbers.
#[derive(Debug, Clone, Copy)]
pub(super) struct Seen {
    pub(super) class: Class,
    pub(super) gain: f64,
    pub(super) numbers: Numbers,
    /// What the command explains beside it.
    pub(super) series: Option<Series>,
}

impl Seen {
    /// How many numbers of the plant vary: ln gain, delay, ln of those of the lags, zero.
    pub(super) fn own(&self) -> usize {
        1 + self.class.searched()
    }

    /// How many numbers vary, with those of the series.
    pub(super) fn count(&self) -> usize {
        self.own() + self.series.map_or(0, |_| TERMS)
    }

    /// The scale of each of them.
    pub(super) fn scale(&self, at: usize, row: f64) -> f64 {
        let is_zero = self.class.has_zero && at + 1 == self.own();
        match at {
            1 => self.numbers.delay + self.numbers.sum + row,
            _ if is_zero => self.numbers.zero.abs().max(self.numbers.sum),
            _ => 1.0,
        }
    }

    /// With one of them moved.
    pub(super) fn moved(mut self, at: usize, step: f64) -> Self {
        let is_zero = self.class.has_zero && at + 1 == self.own();
        if let Some(place) = at.checked_sub(self.own()) {
            if let Some(series) = &mut self.series {
                series.factors[place] += step;
            }
            return self;
        }
        match at {
            0 => self.gain *= exp(step),
            1 => self.numbers.delay += step,
            _ if is_zero => self.numbers.zero += step,
            2 => self.numbers.sum *= exp(step),
            _ => self.numbers.product *= exp(step),
        }
        self
    }

    /// ln |G|.
    pub(super) fn log_gain(&self, omega: f64) -> f64 {
        let Numbers {
            sum, product, zero, ..
        } = self.numbers;
        let square = |x: f64| x * x;
        let poles = square(1.0 - product * omega * omega) + square(sum * omega);
        let integrator = if self.class.integrating {
            log(omega)
        } else {
            0.0
        };
        let error = self.series.map_or(0.0, |series| series.log_gain(omega));
        error + log(self.gain.abs()) + 0.5 * (log(1.0 + square(zero * omega)) - log(poles))
            - integrator
    }

    /// The static gain, or that of the integrator.
    pub(super) fn static_gain(&self) -> f64 {
        self.gain * self.series.map_or(1.0, |series| series.at_rest())
    }

    /// The gain is that at ω = 0, and may be negative where that at crossover is not.
    pub(super) fn sign(&self) -> f64 {
        1.0_f64.copysign(self.gain)
    }

    /// arg G of a positive gain, without jumps.
    pub(super) fn phase(&self, omega: f64) -> f64 {
        let Numbers {
            delay,
            sum,
            product,
            zero,
        } = self.numbers;
        let poles = angle(sum * omega, 1.0 - product * omega * omega);
        let error = self.series.map_or(0.0, |series| series.phase(omega));
        error + angle(zero * omega, 1.0) - poles - delay * omega - self.turns()
    }

    pub(super) fn turns(&self) -> f64 {
        if self.class.integrating {
            0.5 * PI
        } else {
            0.0
        }
    }

    /// The frequency at which the largest stable proportional gain oscillates; none where no gain is
    /// largest, infinite for a delay alone.
    pub(super) fn turn(&self, task: &Task) -> Result<Option<f64>, Error> {
        let Numbers {
            delay,
            sum,
            product,
            zero,
        } = self.numbers;
        if self.class.order == 0 && !self.class.integrating {
            return Ok(Some(f64::INFINITY));
        }
        let time = if self.class.integrating {
            delay + sum + zero.abs() + product.sqrt()
        } else {
            1.0
        };
        let small = SMALL / time;
        let n = QuasiPolynomial::new(vec![vec![small, small * zero]], vec![delay])?;
        let mut poles = vec![1.0, sum, product];
        if self.class.integrating {
            poles.insert(0, 0.0);
        }
        let d = QuasiPolynomial::new(vec![poles], vec![0.0])?;
        let found = margins(&n, &d, task)?;
        let omega = found.gain_margin_omega;
        Ok((found.stable && omega.is_finite() && omega > 0.0).then_some(omega))
    }

    /// The same beside a known one, for numbers that have moved.
    pub(super) fn turn_near(&self, omega: f64) -> f64 {
        if omega == f64::INFINITY {
            return omega;
        }
        // The multiple of 180 degrees that is meant.
        let target = (self.phase(omega) / PI).round() * PI;
        self.passing(omega, target)
    }

    /// The frequency near this one where the phase passes a value.
    pub(super) fn passing(&self, omega: f64, phase: f64) -> f64 {
        solved(omega, |omega| self.phase(omega) - phase)
    }

    /// ln of the largest stable gain.
    pub(super) fn log_largest(&self, turn: f64) -> f64 {
        if turn == f64::INFINITY {
            return -log(self.gain.abs());
        }
        -self.log_gain(self.turn_near(turn))
    }

    /// The highest frequency below the turn where half of the largest stable gain crosses over; half of the
    /// turn where it does not.
    pub(super) fn crossover(&self, turn: f64) -> f64 {
        let level = self.log_gain(turn) + log(2.0);
        let place = |step: usize| {
            turn * exp(-DECADES * std::f64::consts::LN_10 * step as f64 / FREQUENCIES as f64)
        };
        let above = (1..=FREQUENCIES).find(|step| self.log_gain(place(*step)) >= level);
        above.map_or(0.5 * turn, |step| self.crossover_near(place(step), turn))
    }

    pub(super) fn crossover_near(&self, omega: f64, turn: f64) -> f64 {
        let level = self.log_gain(self.turn_near(turn)) + log(2.0);
        let found = solved(omega, |omega| self.log_gain(omega) - level);
        if found.is_finite() && found > 0.0 {
            found
        } else {
            omega
        }
    }

    /// A quantity, and its gradient over the numbers.
    pub(super) fn gradient(&self, row: f64, of: impl Fn(&Self) -> f64) -> Vec<f64> {
        let one = |at: usize| {
            let step = STEP * self.scale(at, row);
            let (up, down) = (self.moved(at, step), self.moved(at, -step));
            (of(&up) - of(&down)) / (2.0 * step)
        };
        (0..self.count()).map(one).collect()
    }
}

/// The zero of a function near a frequency.
fn solved(omega: f64, of: impl Fn(f64) -> f64) -> f64 {
    let (mut x, mut next) = (omega, omega * (1.0 + STEP));
    let mut value = of(x);
    for _ in 0..SECANTS {
        let after = of(next);
        if after == value {
            break;
        }
        let step = after * (next - x) / (after - value);
        if !step.is_finite() {
            break;
        }
        (x, value) = (next, after);
        next = (next - step).clamp(0.5 * next, 2.0 * next);
    }
    next
}
