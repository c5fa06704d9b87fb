//! One number for gains: their objective in the worst scenario, and what they miss of the margins.
//!
//! Margins are requirements: a shortfall costs many times as much as any gain in the objective, and
//! is zero where the requirements are met.

use super::candidates::{Candidates, abscissa, dominant, margins_or_none, unit_of_time};
use crate::loops::ControlLoop;
use crate::{Error, Task};

/// Cost of a relative shortfall of 1 of a margin, in units of the objective: large enough that no
/// gain in the objective pays for a shortfall.
const PENALTY: f64 = 50.0;

/// Shortfall of an unstable loop, whose crossings are no margins: that of all three together.
pub(super) const UNSTABLE: f64 = 3.0;

/// Cost of an unstable loop where the damping ratio counts, and of a step that does not settle: above
/// every other cost.
pub(super) const NEVER: f64 = 1e6;

/// Weight of the abscissa, in units of 1/(delay + lag), where the damping is equal. It is one over
/// whole ranges of gains.
const TIE: f64 = 1e-3;

/// What is made best.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Objective {
    /// The spectral abscissa smallest.
    Abscissa,
    /// The damping ratio of the dominant poles largest.
    Damping,
    /// The settling time of a step smallest.
    SettlingTime,
    /// The overshoot of a step smallest.
    Overshoot,
}

/// An objective and the least margins: gain margin, phase margin in degrees, delay margin in s; zero
/// for none.
#[derive(Debug, Clone, Copy)]
pub(super) struct Goal {
    /// What is made best.
    pub(super) objective: Objective,
    /// See above.
    pub(super) required: [f64; 3],
    /// The size of the objective.
    pub(super) scale: f64,
}

impl Objective {
    /// The objective of that name.
    pub fn named(name: &str) -> Option<Self> {
        Some(match name {
            "abscissa" => Self::Abscissa,
            "damping" => Self::Damping,
            "settling_time" => Self::SettlingTime,
            "overshoot" => Self::Overshoot,
            _ => return None,
        })
    }

    /// Is it that of a simulated step? Others are of the poles.
    pub(super) fn is_simulated(self) -> bool {
        matches!(self, Self::SettlingTime | Self::Overshoot)
    }

    /// The cost of a loop by its poles.
    ///
    /// # Errors
    /// As [`dominant`].
    pub(super) fn cost(self, of: &ControlLoop, task: &Task) -> Result<f64, Error> {
        if self != Self::Damping {
            return abscissa(of, task);
        }
        let found = dominant(of, task)?;
        if found.damping.is_nan() {
            return Ok(NEVER + found.abscissa);
        }
        let time = unit_of_time(of);
        let unit = if time == 0.0 { 1.0 } else { time };
        Ok(-found.damping + TIE * found.abscissa * unit)
    }

    /// The cost in the worst scenario; where it is more than `most`, perhaps that of another one.
    ///
    /// # Errors
    /// As [`dominant`].
    pub(super) fn worst(
        self,
        of: &Candidates,
        gains: &[f64],
        most: f64,
        last: &mut Decisive,
        task: &Task,
    ) -> Result<f64, Error> {
        let mut worst = f64::NEG_INFINITY;
        for place in beginning_with(last.cost, of.scenarios.len()) {
            let cost = self.cost(&of.at(gains, &of.scenarios[place]), task)?;
            if cost > worst {
                (worst, last.cost) = (cost, place);
            }
            if worst > most {
                break;
            }
        }
        Ok(worst)
    }

    /// Is a loop of this cost stable?
    fn is_stable(self, cost: f64) -> bool {
        cost < if self == Self::Damping { NEVER } else { 0.0 }
    }
}

impl Goal {
    /// Whether there are requirements.
    fn is_free(&self) -> bool {
        self.required.iter().all(|least| *least <= 0.0)
    }

    /// The cost of gains, with what they miss of the margins; where it is more than `most`, perhaps
    /// too small.
    ///
    /// # Errors
    /// As [`dominant`].
    pub(super) fn total(
        &self,
        of: &Candidates,
        gains: &[f64],
        most: f64,
        last: &mut Decisive,
        task: &Task,
    ) -> Result<f64, Error> {
        let cost = self.objective.worst(of, gains, most, last, task)?;
        if self.is_free() || cost > most {
            return Ok(cost);
        }
        let unit = self.penalty();
        if !self.objective.is_stable(cost) {
            return Ok(cost + unit * UNSTABLE);
        }
        let short = self.shortfall(of, gains, (most - cost) / unit, last, task)?;
        Ok(cost + unit * short)
    }

    /// The cost of a relative shortfall of 1.
    pub(super) fn penalty(&self) -> f64 {
        PENALTY * self.scale
    }

    /// The sum of the relative shortfalls of the margins of stable loops, each at its least over the
    /// scenarios; where it is more than `most`, perhaps too small.
    ///
    /// # Errors
    /// Those that end all work.
    pub(super) fn shortfall(
        &self,
        of: &Candidates,
        gains: &[f64],
        most: f64,
        last: &mut Decisive,
        task: &Task,
    ) -> Result<f64, Error> {
        if self.is_free() {
            return Ok(0.0);
        }
        let [gain, phase, late] = self.required;
        let wanted = (gain, phase.max(late) > 0.0);
        let mut least = [f64::INFINITY; 3];
        let mut missing = 0.0;
        for place in beginning_with(last.margins, of.scenarios.len()) {
            let found = margins_or_none(&of.at(gains, &of.scenarios[place]), wanted, task)?;
            for (least, margin) in least.iter_mut().zip(found) {
                *least = least.min(margin);
            }
            let each = least.iter().zip(self.required);
            let each = each.filter(|(_, required)| *required > 0.0);
            let sum = each
                .map(|(had, required)| (1.0 - had / required).max(0.0))
                .sum();
            if sum > missing {
                (missing, last.margins) = (sum, place);
            }
            if missing > most {
                break;
            }
        }
        Ok(missing)
    }
}

/// The scenarios that decided last: they are looked at first.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Decisive {
    cost: usize,
    margins: usize,
}

/// All places, `first` the first of them.
fn beginning_with(first: usize, count: usize) -> impl Iterator<Item = usize> {
    std::iter::once(first).chain((0..count).filter(move |place| *place != first))
}
