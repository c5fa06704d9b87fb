//! Loops that differ in the gains of their controller, each in some scenarios of all other numbers.
//!
//! The loop gain n/d is linear in the gains. Of continuous loops n and d are families of
//! quasi-polynomials. Of sampled ones the feedback is u = Σ g_i (K_i x + L_i w), and the other
//! equations depend on the scenario alone.

use crate::dde::LinearLoop;
use crate::dde::control_loop::sampled;
use crate::frequency::{Margins, held_margins, held_margins_of_stable, margins, margins_of_stable};
use crate::quasipoly::{QuasiPolynomial, modulus};
use crate::roots::{chain_abscissa, rightmost, spectral_abscissa};
use crate::stability::{Family, HeldLoop};
use crate::{Error, Task};

/// Poles that decay at most this many times as fast as the slowest one are dominant. A delay always
/// leaves fast poles with little damping, which do not show in a response.
const DOMINANT: f64 = 3.0;

/// Poles of a continuous loop among which the dominant ones are sought.
const POLES: usize = 8;

/// What the gains act on.
#[derive(Debug, Clone)]
pub enum Loops {
    /// d + n, n and d, with all gains as the first parameters.
    Continuous([Family; 3]),
    /// Of each kind of scenario the loops with one gain of one and the others of zero.
    Sampled(Vec<Vec<LinearLoop>>),
}

/// The numbers of a loop besides its free gains.
#[derive(Debug, Clone)]
pub struct Scenario {
    /// The gains that are given, then the other numbers.
    pub numbers: Vec<f64>,
    /// Which of the kinds of a sampled loop.
    pub kind: usize,
    /// Lag and sample time, s: a unit of time together with the delay.
    pub time: f64,
}

/// See the head of this file.
#[derive(Debug, Clone)]
pub struct Candidates {
    loops: Loops,
    /// Place of the delay among the free gains and the numbers of a scenario.
    delay: usize,
    pub(super) scenarios: Vec<Scenario>,
}

/// The dominant poles of a loop.
#[derive(Debug, Clone, Copy)]
pub struct Dominant {
    /// The smallest damping ratio; NaN of an unstable loop.
    pub damping: f64,
    /// The spectral abscissa, 1/s.
    pub abscissa: f64,
}

impl Loops {
    /// A continuous loop with this characteristic function, whose first parameters are its `gains`.
    ///
    /// # Errors
    /// As [`Family::parted`].
    pub fn continuous(function: &Family, gains: usize) -> Result<Self, Error> {
        let (n, d) = function.parted(gains)?;
        Ok(Self::Continuous([function.clone(), n, d]))
    }
}

impl Candidates {
    /// Loops in these scenarios, which must not be empty.
    pub fn new(loops: Loops, delay: usize, scenarios: Vec<Scenario>) -> Self {
        Self {
            loops,
            delay,
            scenarios,
        }
    }

    /// All numbers of a loop, and the unit of time; `late` takes the place of the delay.
    pub(super) fn values(
        &self,
        gains: &[f64],
        scenario: &Scenario,
        late: Option<f64>,
    ) -> (Vec<f64>, f64) {
        let mut values = [gains, &scenario.numbers].concat();
        let Some(delay) = values.get_mut(self.delay) else {
            return (values, scenario.time);
        };
        *delay = late.unwrap_or(*delay);
        let time = *delay + scenario.time;
        (values, time)
    }

    /// The spectral abscissa in 1/s; infinite where it is not found.
    pub(super) fn abscissa(
        &self,
        values: &[f64],
        scenario: &Scenario,
        task: &Task,
    ) -> Result<f64, Error> {
        let found = match &self.loops {
            Loops::Continuous([h, ..]) => {
                h.at(values).and_then(|h| spectral_abscissa(&h, true, task))
            }
            Loops::Sampled(kinds) => sampled_loop(kinds, values, self.delay, scenario.kind)
                .and_then(|plant| HeldLoop::new(&plant)?.abscissa(task)),
        };
        let found = found_or(found, f64::INFINITY)?;
        Ok(if found.is_nan() { f64::INFINITY } else { found })
    }

    /// The dominant poles. The chains of a neutral loop oscillate without end: where they are
    /// dominant, the damping ratio is zero.
    ///
    /// # Errors
    /// As [`rightmost`] and [`sampled::poles`].
    pub(super) fn dominant(
        &self,
        values: &[f64],
        scenario: &Scenario,
        task: &Task,
    ) -> Result<Dominant, Error> {
        let (poles, chain) = match &self.loops {
            Loops::Continuous([h, ..]) => {
                let h = h.at(values)?;
                (rightmost(&h, POLES, task)?.roots, chain_abscissa(&h))
            }
            Loops::Sampled(kinds) => {
                let plant = sampled_loop(kinds, values, self.delay, scenario.kind)?;
                (sampled::poles(&plant)?, f64::NEG_INFINITY)
            }
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

    /// The dominant poles of gains in each scenario.
    ///
    /// # Errors
    /// As [`rightmost`] and [`sampled::poles`].
    pub fn all_dominant(&self, gains: &[f64], task: &Task) -> Result<Vec<Dominant>, Error> {
        let each = |scenario: &Scenario| {
            let (values, _) = self.values(gains, scenario, None);
            self.dominant(&values, scenario, task)
        };
        self.scenarios.iter().map(each).collect()
    }

    /// Gain margin, phase margin in degrees and delay margin in s of a loop that is stable; zero
    /// where they are not found. See [`margins_of_stable`] and [`held_margins_of_stable`].
    pub(super) fn stable_margins(
        &self,
        values: &[f64],
        scenario: &Scenario,
        (most, turns): (f64, bool),
        task: &Task,
    ) -> Result<[f64; 3], Error> {
        let found = match &self.loops {
            Loops::Continuous([_, n, d]) => {
                parts(n, d, values).and_then(|(n, d)| margins_of_stable(&n, &d, most, turns, task))
            }
            Loops::Sampled(kinds) => sampled_loop(kinds, values, self.delay, scenario.kind)
                .and_then(|plant| {
                    held_margins_of_stable(HeldLoop::new(&plant)?, most, turns, task)
                }),
        };
        found_or(found, [0.0; 3])
    }

    /// Gain, phase and delay margin, Ms and Mt of gains in each scenario, NaN of a loop that is not
    /// stable; without `delay_margin` that of a sampled loop, which takes long, is NaN.
    ///
    /// # Errors
    /// As [`margins`] and [`held_margins`].
    pub fn margins(
        &self,
        gains: &[f64],
        delay_margin: bool,
        task: &Task,
    ) -> Result<Vec<[f64; 5]>, Error> {
        let each = |scenario: &Scenario| {
            let (values, _) = self.values(gains, scenario, None);
            let found = match &self.loops {
                Loops::Continuous([_, n, d]) => {
                    let (n, d) = parts(n, d, &values)?;
                    margins(&n, &d, task)?
                }
                Loops::Sampled(kinds) => {
                    let plant = sampled_loop(kinds, &values, self.delay, scenario.kind)?;
                    held_margins(HeldLoop::new(&plant)?, delay_margin, task)?
                }
            };
            Ok(figures(&found))
        };
        self.scenarios.iter().map(each).collect()
    }
}

/// What was found, or `otherwise`; an error only where all work ends.
fn found_or<T>(found: Result<T, Error>, otherwise: T) -> Result<T, Error> {
    match found {
        Err(error) if !error.ends_all() => Ok(otherwise),
        found => found,
    }
}

fn figures(found: &Margins) -> [f64; 5] {
    [
        found.gain_margin,
        found.phase_margin,
        found.delay_margin,
        found.peaks.sensitivity.value,
        found.peaks.complementary.value,
    ]
}

/// n and d.
fn parts(
    n: &Family,
    d: &Family,
    values: &[f64],
) -> Result<(QuasiPolynomial, QuasiPolynomial), Error> {
    Ok((n.at(values)?, d.at(values)?))
}

/// The loop whose gains are the first of `values`, and its delay the one at `delay`.
fn sampled_loop(
    kinds: &[Vec<LinearLoop>],
    values: &[f64],
    delay: usize,
    kind: usize,
) -> Result<LinearLoop, Error> {
    let shares = kinds.get(kind).map(Vec::as_slice).unwrap_or_default();
    let (Some(first), Some(delay)) = (shares.first(), values.get(delay)) else {
        refuse!("{kind}: there is no such kind of loop");
    };
    let mut equations = first.equations().clone();
    equations.k.fill(0.0);
    equations.l = 0.0;
    for (share, value) in shares.iter().zip(values) {
        let own = share.equations();
        for (sum, k) in equations.k.iter_mut().zip(&own.k) {
            *sum += value * k;
        }
        equations.l += value * own.l;
    }
    LinearLoop::new(equations, *delay, first.sample_time(), None)
}
