//! One number for gains: their objective in the worst scenario, and what they miss of the margins.
//!
//! Margins are requirements: a shortfall costs many times as much as any gain in the objective, and
//! is zero where the requirements are met.

use super::candidates::{Candidates, Scenario};
use crate::{Error, Task};

/// Cost of a relative shortfall of 1 of a margin, in units of the objective: large enough that no
/// gain in the objective pays for a shortfall.
pub(super) const PENALTY: f64 = 50.0;

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
        if !(found.abscissa < 0.0) {
            return Ok(NEVER + found.abscissa);
        }
        let unit = if time == 0.0 { 1.0 } else { time };
        Ok(-found.damping + TIE * found.abscissa * unit)
    }

    /// The cost in the worst scenario.
    ///
    /// # Errors
    /// As [`Candidates::dominant`].
    pub(super) fn worst(self, of: &Candidates, gains: &[f64], task: &Task) -> Result<f64, Error> {
        let mut worst = f64::NEG_INFINITY;
        for scenario in &of.scenarios {
            worst = worst.max(self.cost(of, gains, scenario, None, task)?);
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

    /// The cost of gains, with what they miss of the margins.
    ///
    /// # Errors
    /// As [`Candidates::dominant`].
    pub fn total(&self, of: &Candidates, gains: &[f64], task: &Task) -> Result<f64, Error> {
        let cost = self.objective.worst(of, gains, task)?;
        if self.is_free() {
            return Ok(cost);
        }
        let short = if self.objective.is_stable(cost) {
            self.shortfall(of, gains, f64::INFINITY, task)?
        } else {
            UNSTABLE
        };
        Ok(cost + PENALTY * self.scale * short)
    }

    /// The sum of the relative shortfalls of the margins of stable loops, each at its least over the
    /// scenarios. Where it is more than `most` it ends there, and may be too small.
    ///
    /// # Errors
    /// Those that end all work.
    pub fn shortfall(
        &self,
        of: &Candidates,
        gains: &[f64],
        most: f64,
        task: &Task,
    ) -> Result<f64, Error> {
        if self.is_free() {
            return Ok(0.0);
        }
        let mut least = [f64::INFINITY; 3];
        let mut missing = 0.0;
        for scenario in &of.scenarios {
            let (values, _) = of.values(gains, scenario, None);
            let found = of.stable_margins(&values, scenario, task)?;
            for (least, margin) in least.iter_mut().zip(found) {
                *least = least.min(margin);
            }
            let each = least
                .iter()
                .zip(self.required)
                .filter(|(_, least)| *least > 0.0);
            missing = each.map(|(had, least)| (1.0 - had / least).max(0.0)).sum();
            if missing > most {
                break;
            }
        }
        Ok(missing)
    }
}
