//! One number for gains: their objective in the worst scenario, and what they miss of the margins.
//!
//! Margins are requirements: a shortfall costs many times as much as any gain in the objective, and
//! is zero where the requirements are met.

use super::candidates::{Candidates, Scenario};
use crate::{Error, Task};

/// Cost of a relative shortfall of 1 of a margin, in units of the objective: large enough that no
/// gain in the objective pays for a shortfall.
const PENALTY: f64 = 50.0;

/// Shortfall of an unstable loop, whose crossings are no margins: that of all three together.
pub(super) const UNSTABLE: f64 = 3.0;

/// Cost of an unstable loop where the damping ratio counts: above every other cost.
const NEVER: f64 = 1e6;

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
}

/// An objective and the least margins: gain margin, phase margin in degrees, delay margin in s; zero
/// for none.
#[derive(Debug, Clone, Copy)]
pub struct Goal {
    /// What is made best.
    pub objective: Objective,
    /// See above.
    pub required: [f64; 3],
    /// The size of the objective.
    pub scale: f64,
}

impl Objective {
    /// The cost of a loop in one scenario, with another delay if one is given.
    ///
    /// # Errors
    /// As [`Candidates::dominant`].
    pub(super) fn cost(
        self,
        of: &Candidates,
        gains: &[f64],
        scenario: &Scenario,
        late: Option<f64>,
        task: &Task,
    ) -> Result<f64, Error> {
        let (values, time) = of.values(gains, scenario, late);
        if self == Self::Abscissa {
            return of.abscissa(&values, scenario, task);
        }
        let found = of.dominant(&values, scenario, task)?;
        if found.damping.is_nan() {
            return Ok(NEVER + found.abscissa);
        }
        let unit = if time == 0.0 { 1.0 } else { time };
        Ok(-found.damping + TIE * found.abscissa * unit)
    }

    /// The cost in the worst scenario; where it is more than `most`, perhaps that of another one.
    ///
    /// # Errors
    /// As [`Candidates::dominant`].
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
            let cost = self.cost(of, gains, &of.scenarios[place], None, task)?;
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
        cost < match self {
            Self::Abscissa => 0.0,
            Self::Damping => NEVER,
        }
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
    /// As [`Candidates::dominant`].
    pub fn total(
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
    pub fn shortfall(
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
            let scenario = &of.scenarios[place];
            let (values, _) = of.values(gains, scenario, None);
            let found = of.stable_margins(&values, scenario, wanted, task)?;
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
pub struct Decisive {
    cost: usize,
    margins: usize,
}

/// All places, `first` the first of them.
fn beginning_with(first: usize, count: usize) -> impl Iterator<Item = usize> {
    std::iter::once(first).chain((0..count).filter(move |place| *place != first))
}
