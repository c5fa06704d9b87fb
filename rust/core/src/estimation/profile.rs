//! The profile of the likelihood over one quantity, and the ends of an interval.

use super::fit::{Fit, Model, Point, SHORTEST_LAG, Timing};
use crate::{Error, Task};

/// A quantity that a profile holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// The delay.
    Delay,
    /// Delay and lags together.
    Total,
    /// The gain.
    Gain,
    /// A lag.
    Lag(usize),
}

/// Farthest end of an interval, in Gaussian half widths.
const FARTHEST: f64 = 64.0;

/// Accuracy of an end, as a share of the half width.
const TOLERANCE: f64 = 2e-3;

/// Accuracy of −2 ln L where a quantity is held.
const RISE_TOLERANCE: f64 = 1e-3;

/// Most refinements of an end.
const REFINEMENTS: usize = 12;

impl Quantity {
    /// Its value at a point; a gain that is eliminated is no part of a point.
    pub fn value(self, point: &Point) -> f64 {
        match self {
            Self::Delay => point.delay(),
            Self::Total => point.total(),
            Self::Gain => point.gain,
            Self::Lag(i) => point.lags.get(i).copied().unwrap_or(0.0),
        }
    }

    /// A point with the quantity at this value and the others near where they were.
    fn held(self, point: &Point, value: f64, model: &Model) -> Point {
        let mut held = point.clone();
        match self {
            Self::Delay => {
                // What the delay loses or gains, the first free lag takes.
                let change = value - point.delay();
                let least = SHORTEST_LAG * model.row_time();
                let free = model.free.lags.iter().position(|free| *free);
                if let Some(lag) = free.and_then(|free| held.lags.get_mut(free)) {
                    *lag = (*lag - change).max(least);
                }
                held.timing = Timing::Delay(value);
            }
            Self::Total => {
                let lags: f64 = held.lags.iter().sum();
                if value < lags {
                    let share = value / lags;
                    held.lags.iter_mut().for_each(|lag| *lag *= share);
                }
                held.timing = Timing::Total(value);
            }
            Self::Gain => held.gain = value,
            Self::Lag(i) => {
                held.timing = match held.timing {
                    Timing::Delay(delay) => Timing::Delay(delay),
                    Timing::Total(_) => Timing::Total(point.total().max(value)),
                };
                if let Some(lag) = held.lags.get_mut(i) {
                    *lag = value;
                }
            }
        }
        held
    }
}

impl Model {
    /// The maximum with one quantity at `value`, from a fit near it.
    ///
    /// # Errors
    ///
    /// As for `Model::at`.
    pub fn held(
        &self,
        near: &Fit,
        quantity: Quantity,
        value: f64,
        task: &Task,
    ) -> Result<Fit, Error> {
        self.fit(
            &quantity.held(&near.point, value, self),
            Some(quantity),
            RISE_TOLERANCE,
            task,
        )
    }

    /// The end of the interval of a quantity: where −2 ln L has risen by `rise`.
    ///
    /// `reach` is about its distance from the best value, with its sign. Returns the end and the
    /// lowest fit seen on the way, which may be below the best.
    ///
    /// # Errors
    ///
    /// As for `Model::at`.
    pub fn end(
        &self,
        best: &Fit,
        quantity: Quantity,
        reach: f64,
        rise: f64,
        floor: f64,
        task: &Task,
    ) -> Result<(f64, Fit), Error> {
        let centre = quantity.value(&best.point);
        let mut lowest = best.clone();
        let mut near = best.clone();
        let (mut inner, mut inner_rise) = (centre, 0.0);
        let mut outer = centre + reach;
        let mut bracket = None;
        let mut width = reach;
        while width.abs() <= FARTHEST * reach.abs() {
            outer = (centre + width).max(floor);
            near = self.held(&near, quantity, outer, task)?;
            if near.objective < lowest.objective {
                lowest = near.clone();
            }
            let found = near.objective - best.objective;
            if found >= rise {
                bracket = Some(found);
                break;
            }
            if outer <= floor {
                return Ok((floor, lowest));
            }
            (inner, inner_rise) = (outer, found.max(0.0));
            // Where the rise is quadratic the end is at once here.
            let guess = (rise / found.max(1e-3 * rise)).sqrt() * 1.02;
            width *= guess.clamp(1.1, 2.0);
        }
        let Some(mut outer_rise) = bracket else {
            return Ok((outer, lowest));
        };
        // False position in the square root of the rise, which is nearly linear (Illinois).
        let goal = rise.sqrt();
        let (mut low, mut high) = (inner_rise.sqrt() - goal, outer_rise.sqrt() - goal);
        for _ in 0..REFINEMENTS {
            if (outer - inner).abs() <= TOLERANCE * reach.abs() || high.abs() < 1e-3 * goal {
                break;
            }
            let middle = inner + (outer - inner) * (low / (low - high));
            near = self.held(&near, quantity, middle, task)?;
            if near.objective < lowest.objective {
                lowest = near.clone();
            }
            outer_rise = (near.objective - best.objective).max(0.0);
            let found = outer_rise.sqrt() - goal;
            if found.abs() < 2e-3 * goal {
                return Ok((middle, lowest));
            }
            if found > 0.0 {
                (outer, high) = (middle, found);
                low *= 0.5;
            } else {
                (inner, low) = (middle, found);
                high *= 0.5;
            }
        }
        Ok((outer, lowest))
    }
}
