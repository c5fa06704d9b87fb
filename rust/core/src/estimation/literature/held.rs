//! The plant gain/(s (lag s + 1)) under held commands: over time, with its derivatives, and as H(z).
//!
//! A command u_k holds from t_k to t_{k+1}. For a gain of one,
//!
//! ```text
//! v′ = (u − v)/lag,  F′ = v,  F(t) = I(t) − lag v(t),  I = the integral of u,
//! ```
//!
//! (v = u without a lag), from rest before the first command. Between commands I is a line and v − u_k
//! decays as e^(−(t − t_k)/lag). dF/dt = v, and with p = dv/dlag, dF/dlag = −v − lag p.
//!
//! The unit step response is S(t) = t − lag (1 − e^(−t/lag)). A command held for one sample time h is
//! a step up and a step down, so with a delay of (d + f) h, 0 ≤ f < 1, g = 1 − f and q = 1/z (modified
//! z-transform, Jury 1964),
//!
//! ```text
//! H(z) = q^(d+1) [h q/(1 − q) + g h − lag + lag e^(−g h/lag) (1 − q)/(1 − e^(−h/lag) q)],
//! ```
//!
//! exact for every delay.

use num_complex::Complex64;

use crate::elementary::exp;

/// Shorter lags, in steps between commands, have no effect and would overflow.
const SHORTEST: f64 = 1e-7;

/// H(z) for a gain of one.
pub(super) fn held_transfer(z: Complex64, delay: f64, lag: f64, sample_time: f64) -> Complex64 {
    let (q, one) = (z.inv(), Complex64::ONE);
    let whole = (delay / sample_time).floor();
    let rest = 1.0 - (delay / sample_time - whole);
    let mut ramp = sample_time * q / (one - q) + rest * sample_time;
    if lag > 0.0 {
        let late = libm::exp(-rest * sample_time / lag) * (one - q);
        ramp += lag * late / (one - libm::exp(-sample_time / lag) * q) - lag;
    }
    ramp * q.powi(whole as i32 + 1)
}

/// The commands, each held until the next.
#[derive(Debug, Clone)]
pub struct HeldPath {
    time: Vec<f64>,
    command: Vec<f64>,
    integral: Vec<f64>,
    shortest: f64,
}

/// F, dF/dt and dF/dlag at some times.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PathAt {
    /// F.
    pub value: Vec<f64>,
    /// dF/dt.
    pub rate: Vec<f64>,
    /// dF/dlag.
    pub by_lag: Vec<f64>,
}

impl HeldPath {
    /// Commands at increasing times; the last one holds for ever.
    pub fn new(time: Vec<f64>, command: Vec<f64>) -> Self {
        let mut integral = vec![0.0; command.len().min(1)];
        let mut sum = 0.0;
        let mut least = f64::INFINITY;
        for (pair, command) in time.windows(2).zip(&command) {
            sum += command * (pair[1] - pair[0]);
            least = least.min(pair[1] - pair[0]);
            integral.push(sum);
        }
        Self {
            time,
            command,
            integral,
            shortest: SHORTEST * least,
        }
    }

    /// F and its derivatives at times in any order for a lag.
    pub fn at(&self, times: &[f64], lag: f64) -> PathAt {
        let velocities = if lag > self.shortest {
            self.velocities(lag)
        } else {
            Vec::new()
        };
        let mut found = PathAt::default();
        let mut row = 0;
        for time in times {
            // Times mostly increase: the next command is near.
            let is_here = self.time.get(row).is_some_and(|from| from <= time);
            let next = |row: usize| self.time.get(row + 1).is_none_or(|from| from > time);
            if !(is_here && next(row)) {
                row = if is_here && next(row + 1) {
                    row + 1
                } else {
                    self.time
                        .partition_point(|from| from <= time)
                        .saturating_sub(1)
                };
            }
            let (mut value, mut v, mut by_lag) = (0.0, 0.0, 0.0);
            if self.time.get(row).is_some_and(|from| from <= time) {
                let (since, command) = (time - self.time[row], self.command[row]);
                let integral = self.integral[row] + command * since;
                if let Some((velocity, slope)) = velocities.get(row) {
                    let decay = exp(-since / lag);
                    let gap = velocity - command;
                    v = command + gap * decay;
                    let p = slope * decay + gap * decay * since / (lag * lag);
                    (value, by_lag) = (integral - lag * v, -v - lag * p);
                } else {
                    // To first order a lag is a delay: dF/dlag = −v at no lag.
                    v = command;
                    (value, by_lag) = (integral - lag * command, -command);
                }
            }
            found.value.push(value);
            found.rate.push(v);
            found.by_lag.push(by_lag);
        }
        found
    }

    /// The velocity v and dv/dlag at the start of each command.
    fn velocities(&self, lag: f64) -> Vec<(f64, f64)> {
        let (mut v, mut p) = (0.0, 0.0);
        let mut found = vec![(v, p)];
        let (mut length, mut decay) = (f64::NAN, 0.0);
        for (pair, command) in self.time.windows(2).zip(&self.command) {
            let step = pair[1] - pair[0];
            if step != length {
                (length, decay) = (step, exp(-step / lag));
            }
            p = decay * (p + step / (lag * lag) * (v - command));
            v = command + (v - command) * decay;
            found.push((v, p));
        }
        found
    }
}
