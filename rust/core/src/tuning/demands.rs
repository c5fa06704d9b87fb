//! What is demanded of gains, and by how much they miss it.

use num_complex::Complex64;

use super::responses::settling_time;
use crate::dde::LinearLoop;
use crate::elementary::exp;
use crate::frequency::{
    Margins, Peak, Sought, held_gain, held_margins, held_margins_of_stable, held_sensitivity,
    margins, margins_of_stable, peak, peak_to, ratio,
};
use crate::loops::{ControlLoop, Input};
use crate::quasipoly::{QuasiPolynomial, modulus};
use crate::roots::is_stable;
use crate::stability::HeldLoop;
use crate::{Error, Task};

/// Points of the integral over the noise for each decade, and its lower end as a part of the
/// bandwidth: more are more exact and take time in proportion.
const PER_DECADE: usize = 100;
const DECADES: usize = 4;

/// Bounds on the figures of a loop; those that nothing asks for are infinite or zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Demands {
    /// Largest Ms.
    pub max_sensitivity: f64,
    /// Least factor.
    pub gain_margin: f64,
    /// Least turn, degrees.
    pub phase_margin: f64,
    /// Least further delay, s.
    pub delay_margin: f64,
    /// Largest ratio of the deviations of command and measurement noise, white up to `bandwidth`.
    pub noise_gain: f64,
    /// rad/s.
    pub bandwidth: f64,
    /// Longest settling time of a step of the reference, s.
    pub settling_time: f64,
}

impl Demands {
    /// Is there one besides that of Ms?
    pub(super) fn has_others(&self) -> bool {
        self.gain_margin > 1.0
            || self.phase_margin > 0.0
            || self.delay_margin > 0.0
            || self.noise_gain.is_finite()
            || self.settling_time.is_finite()
    }

    /// Gain, phase and delay margin of a stable loop as far as they are demanded.
    fn margins_of_stable(&self, of: &ControlLoop, task: &Task) -> Result<[f64; 3], Error> {
        if is_sampled(of) && self.delay_margin > 0.0 {
            let found = margins_of(of, true, task)?;
            return Ok([found.gain_margin, found.phase_margin, found.delay_margin]);
        }
        let turns = self.phase_margin > 0.0 || self.delay_margin > 0.0;
        // Twice the demand is enough to interpolate.
        stable_margins(of, (2.0 * self.gain_margin, turns), task)
    }

    /// By how much the figures of a stable loop miss the demands, relatively, that of Ms left out; not above
    /// zero where it meets them.
    ///
    /// # Errors
    /// Those that end all work.
    pub(super) fn missed(&self, of: &ControlLoop, task: &Task) -> Result<f64, Error> {
        let mut worst = f64::NEG_INFINITY;
        let mut short = |had: f64, least: f64| worst = worst.max(1.0 - had / least);
        if self.gain_margin > 1.0 || self.phase_margin > 0.0 || self.delay_margin > 0.0 {
            let had = self.margins_of_stable(of, task)?;
            let least = [self.gain_margin, self.phase_margin, self.delay_margin];
            for (had, least) in had.into_iter().zip(least).filter(|pair| pair.1 > 0.0) {
                short(had, least);
            }
        }
        if self.noise_gain.is_finite() {
            let gain = noise_gain(of, self.bandwidth, task)?;
            worst = worst.max(gain / self.noise_gain - 1.0);
        }
        if self.settling_time.is_finite() && worst <= 0.0 {
            let settled = settling_time(of, task)?;
            let missed = settled / self.settling_time - 1.0;
            worst = worst.max(if missed.is_nan() {
                f64::INFINITY
            } else {
                missed
            });
        }
        Ok(worst)
    }
}

/// Does the loop have a hold?
pub(super) fn is_sampled(of: &ControlLoop) -> bool {
    of.values().sample_time.is_some()
}

/// Gain margin up to `most`, phase margin in degrees and delay margin in s of a loop that is stable,
/// infinite without `turns`: of a sampled one by its turns. See [`margins_of_stable`] and
/// [`held_margins_of_stable`].
pub(super) fn stable_margins(
    of: &ControlLoop,
    (most, turns): (f64, bool),
    task: &Task,
) -> Result<[f64; 3], Error> {
    if is_sampled(of) {
        let linear = of.linear(Input::Reference)?;
        return held_margins_of_stable(HeldLoop::new(&linear)?, most, turns, task);
    }
    let (n, d) = of.loop_gain()?;
    margins_of_stable(&n, &d, most, turns, task)
}

/// Is a loop stable, hold and delay taken exactly, neutral ones strongly? Where rounding hides it, not.
///
/// # Errors
/// Those that end all work.
pub(super) fn is_stable_loop(of: &ControlLoop, task: &Task) -> Result<bool, Error> {
    let found = match of.values().sample_time {
        None => of.characteristic().and_then(|h| is_stable(&h, true, task)),
        Some(_) => of
            .linear(Input::Reference)
            .and_then(|linear| HeldLoop::new(&linear)?.is_stable(task))
            .map(|found| found == Some(true)),
    };
    match found {
        Err(error) if error.ends_all() => Err(error),
        found => Ok(found.unwrap_or(false)),
    }
}

/// The largest modulus of the sensitivity; `None` where the loop is not stable.
///
/// # Errors
/// As [`margins_of`].
pub(super) fn sensitivity_of(of: &ControlLoop, task: &Task) -> Result<Option<Peak>, Error> {
    sensitivity_to(of, None, task)
}

/// The same, of a continuous loop as well as it is sought.
pub(super) fn sensitivity_to(
    of: &ControlLoop,
    sought: Option<Sought>,
    task: &Task,
) -> Result<Option<Peak>, Error> {
    if is_sampled(of) {
        let linear = of.linear(Input::Reference)?;
        return held_sensitivity(HeldLoop::new(&linear)?, task);
    }
    let (n, d) = of.loop_gain()?;
    let closed = d.add(&n)?;
    if !is_stable(&closed, true, task)? {
        return Ok(None);
    }
    match sought {
        Some(sought) => peak_to(&d, &closed, &[], sought, task).map(Some),
        None => peak(&d, &closed, &[], task).map(Some),
    }
}

/// All margins and sensitivities of a loop; without `delay_margin` that of a sampled one is NaN.
///
/// # Errors
/// As [`margins`] and [`held_margins`].
pub fn margins_of(of: &ControlLoop, delay_margin: bool, task: &Task) -> Result<Margins, Error> {
    if of.values().sample_time.is_none() {
        let (n, d) = of.loop_gain()?;
        return margins(&n, &d, task);
    }
    let linear = of.linear(Input::Reference)?;
    held_margins(HeldLoop::new(&linear)?, delay_margin, task)
}

/// The standard deviation of the command over that of measurement noise that is white up to
/// `bandwidth` rad/s: gain² = 1/B ∫ |F/(1 + L)|² dω over the logarithm of ω, F being the feedback; of a
/// sampled loop with its own L, and the filter of its derivative as if it were continuous.
///
/// # Errors
/// [`Error::Argument`] where the loop gain is not known.
pub fn noise_gain(of: &ControlLoop, bandwidth: f64, task: &Task) -> Result<f64, Error> {
    let (f, g) = of.controller().feedback(&of.values().controller);
    let ascending = |row: &[f64]| row.iter().rev().copied().collect::<Vec<f64>>();
    let [f, g] = [f, g].map(|row| QuasiPolynomial::new(vec![ascending(&row)], vec![0.0]));
    let count = PER_DECADE * DECADES;
    let step = std::f64::consts::LN_10 / PER_DECADE as f64;
    let omega: Vec<f64> = (0..=count)
        .map(|k| bandwidth * exp(-step * (count - k) as f64))
        .collect();
    let points: Vec<Complex64> = omega.iter().map(|w| Complex64::new(0.0, *w)).collect();
    let feedback = ratio(&f?, &g?, &points, task)?;
    let gain = match of.values().sample_time {
        None => {
            let (n, d) = of.loop_gain()?;
            ratio(&n, &d, &points, task)?
        }
        Some(_) => {
            let linear: LinearLoop = of.linear(Input::Reference)?;
            held_gain(HeldLoop::new(&linear)?, &omega)?
        }
    };
    let squares = feedback.iter().zip(gain).zip(&omega);
    let squares: Vec<f64> = squares
        .map(|((f, l), w)| {
            let size = modulus(f / (1.0 + l));
            // At a pole of L at zero the command follows the output back.
            if size.is_nan() { 0.0 } else { size * size * w }
        })
        .collect();
    let inner: f64 = squares
        .windows(2)
        .map(|pair| 0.5 * (pair[0] + pair[1]))
        .sum();
    Ok((inner * step / bandwidth).sqrt())
}
