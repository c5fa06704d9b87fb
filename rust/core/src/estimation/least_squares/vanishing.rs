//! Lags and delays that are zero as far as the recording says.
//!
//! To first order a small lag acts like a delay. Next to zero the two cannot be distinguished, and a
//! search stops anywhere along that line. The same holds for a delay next to zero.

use super::joint::{Joint, Space};
use super::search::{Minimum, minimise};
use super::tolerances::{SEARCH, ZERO};
use crate::{Error, Task};

/// Which parameters may vanish.
#[derive(Debug, Clone, Copy)]
pub struct Vanishing {
    /// The place of a lag.
    pub lag: Option<usize>,
    /// The place of the delay.
    pub delay: Option<usize>,
    /// Size of the excitation.
    pub size: f64,
}

/// The minimum with lags and delays at zero where this does not change the cost beyond rounding.
///
/// # Errors
/// As those of the misfit.
pub fn without_vanishing(
    joint: &Joint<'_>,
    mut found: Minimum,
    which: Vanishing,
    task: &Task,
) -> Result<Minimum, Error> {
    let mut held = Vec::new();
    let rounding = found.misfit.len() as f64 * (ZERO.rounding * which.size).powi(2);
    for (place, later) in [(which.lag, which.delay), (which.delay, None)] {
        let Some(place) = place else { continue };
        let mut start = found.point.clone();
        start[place] = 0.0;
        if let Some(later) = later {
            start[later] += found.point[place];
        }
        let at_end = found.point[place] <= joint.low[place] * (1.0 + ZERO.at_bound);
        if !at_end && joint.cost(&start, task)? > ZERO.tried * found.cost() + rounding {
            continue;
        }
        let fixed: Vec<usize> = held.iter().copied().chain([place]).collect();
        let mut base = vec![0.0; start.len()];
        for place in &fixed {
            base[*place] = 0.0;
        }
        let space = Space::without(joint, base, &fixed);
        let moved = minimise(joint, &start, &space, SEARCH.to_rounding, task)?;
        if at_end || moved.cost() <= found.cost() * (1.0 + ZERO.rise) + rounding {
            found = moved;
            held.push(place);
        }
    }
    Ok(found)
}
