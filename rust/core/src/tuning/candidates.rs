//! Loops that differ in the gains of their controller, each in some scenarios of all other numbers.

use super::demands::{is_sampled, margins_of, stable_margins};
use crate::frequency::Margins;
use crate::loops::{ControlLoop, Input, Place};
use crate::quasipoly::modulus;
use crate::roots::{chain_abscissa, rightmost};
use crate::stability::HeldLoop;
use crate::{Error, Task};

/// Poles that decay at most this many times as fast as the slowest one are dominant. A delay always
/// leaves fast poles with little damping, which do not show in a response.
const DOMINANT: f64 = 3.0;

/// Poles of a continuous loop among which the dominant ones are sought.
const POLES: usize = 8;

/// See the head of this file.
#[derive(Debug, Clone)]
pub struct Candidates {
    /// A loop for each scenario, whose free gains do not matter.
    pub(super) scenarios: Vec<ControlLoop>,
    /// Places of the free gains.
    pub(super) free: Vec<usize>,
}

/// The dominant poles of a loop.
#[derive(Debug, Clone, Copy)]
pub struct Dominant {
    /// The smallest damping ratio; NaN of an unstable loop.
    pub damping: f64,
    /// The spectral abscissa, 1/s.
    pub abscissa: f64,
}

impl Candidates {
    /// Loops in these scenarios, which must not be empty, with the places of their free gains.
    pub fn new(scenarios: Vec<ControlLoop>, free: Vec<usize>) -> Self {
        Self { scenarios, free }
    }

    /// The loop with these gains in a scenario.
    pub(super) fn at(&self, gains: &[f64], scenario: &ControlLoop) -> ControlLoop {
        with_gains(scenario, &self.free, gains)
    }

    /// The dominant poles of gains in each scenario.
    ///
    /// # Errors
    /// As [`rightmost`] and [`HeldLoop::poles`].
    pub fn all_dominant(&self, gains: &[f64], task: &Task) -> Result<Vec<Dominant>, Error> {
        let each = |scenario: &ControlLoop| dominant(&self.at(gains, scenario), task);
        self.scenarios.iter().map(each).collect()
    }

    /// The margins of gains in each scenario, zero of a loop that is not stable; without
    /// `delay_margin` that of a sampled loop, which takes long, is NaN.
    ///
    /// # Errors
    /// As [`margins_of`].
    pub fn margins(
        &self,
        gains: &[f64],
        delay_margin: bool,
        task: &Task,
    ) -> Result<Vec<Margins>, Error> {
        let each =
            |scenario: &ControlLoop| margins_of(&self.at(gains, scenario), delay_margin, task);
        self.scenarios.iter().map(each).collect()
    }
}

/// A loop with these free gains.
pub(super) fn with_gains(of: &ControlLoop, free: &[usize], gains: &[f64]) -> ControlLoop {
    let mut values = of.values().clone();
    for (place, gain) in free.iter().zip(gains) {
        values.set(Place::Controller(*place), *gain);
    }
    of.with(values)
}

/// Lag and sample time, s: a unit of time together with the delay.
pub(super) fn unit_of_time(of: &ControlLoop) -> f64 {
    let values = of.values();
    let lag = of.place("lag").ok().and_then(|place| values.get(place));
    values.delay + lag.unwrap_or(0.0) + values.sample_time.unwrap_or(0.0)
}

/// The spectral abscissa in 1/s; infinite where it is not found.
pub(super) fn abscissa(of: &ControlLoop, task: &Task) -> Result<f64, Error> {
    let found = found_or(of.abscissa(task), f64::INFINITY)?;
    Ok(if found.is_nan() { f64::INFINITY } else { found })
}

/// The dominant poles. The chains of a neutral loop oscillate without end: where they are dominant, the
/// damping ratio is zero.
///
/// # Errors
/// As [`rightmost`] and [`HeldLoop::poles`].
pub(super) fn dominant(of: &ControlLoop, task: &Task) -> Result<Dominant, Error> {
    let (poles, chain) = if is_sampled(of) {
        let linear = of.linear(Input::Reference)?;
        (HeldLoop::new(&linear)?.poles()?, f64::NEG_INFINITY)
    } else {
        let h = of.characteristic()?;
        (rightmost(&h, POLES, task)?.roots, chain_abscissa(&h))
    };
    let abscissa = poles.iter().fold(chain, |most, pole| most.max(pole.re));
    let horizon = DOMINANT * abscissa;
    let near = poles.iter().filter(|pole| pole.re >= horizon);
    let ratios = near.map(|pole| -pole.re / modulus(*pole));
    let damping = if abscissa >= 0.0 || abscissa.is_nan() {
        f64::NAN
    } else if chain >= horizon {
        0.0
    } else {
        ratios.fold(f64::INFINITY, f64::min)
    };
    Ok(Dominant { damping, abscissa })
}

/// Gain margin, phase margin in degrees and delay margin in s of a loop that is stable; zero where they
/// are not found. See [`stable_margins`].
pub(super) fn margins_or_none(
    of: &ControlLoop,
    wanted: (f64, bool),
    task: &Task,
) -> Result<[f64; 3], Error> {
    found_or(stable_margins(of, wanted, task), [0.0; 3])
}

/// What was found, or `otherwise`; an error only where all work ends.
fn found_or<T>(found: Result<T, Error>, otherwise: T) -> Result<T, Error> {
    match found {
        Err(error) if !error.ends_all() => Ok(otherwise),
        found => found,
    }
}
