//! The weight of the reference with which a step settles first, and the gains beside the best that do.
//!
//! The weight moves neither margins nor the response to a load, so that it is chosen after the gains.
//! Gains that lose no more than the slack of the response to a load are judged with it.

use super::posed::{Best, Posed};
use super::responses::settling_time;
use super::robust::best;
use crate::{Error, Task};

/// Weights that are tried: more of them settle a little earlier and take time in proportion.
const WEIGHTS: u32 = 21;

/// Relative loss that counts as none.
const NOTHING: f64 = 1e-3;

/// The gains, and where the controller integrates the weight of the reference, with which a step settles
/// first at its worst in the loops with which the search began, their limits left out.
///
/// # Errors
/// As [`best`].
pub fn settled_first(posed: &Posed, task: &Task) -> Result<(Best, Option<f64>), Error> {
    let found = best(posed, task)?;
    let nominal = posed.loops.first();
    if !nominal.is_some_and(|of| of.controller().kind.integrates()) {
        return Ok((found, None));
    }
    let settled = |gains: &[f64], weight: f64| -> Result<f64, Error> {
        let mut worst = 0.0_f64;
        for place in 0..posed.first.max(1) {
            let of = posed.at(place, gains).with_weight(weight);
            let time = settling_time(&of, task)?;
            worst = worst.max(if time.is_nan() { f64::INFINITY } else { time });
        }
        Ok(worst)
    };
    // The best gains first, without a shape, then their neighbours.
    let mut near = vec![(None, &found.gains, found.value)];
    for other in &found.neighbours {
        near.push((Some(&other.shape), &other.gains, other.value));
    }
    let mut tried = Vec::new();
    for (shape, gains, value) in near {
        for step in 0..WEIGHTS {
            let weight = f64::from(step) / f64::from(WEIGHTS - 1);
            tried.push((settled(gains, weight)?, value, weight, shape));
        }
    }
    let least = tried
        .iter()
        .fold(f64::INFINITY, |least, one| least.min(one.0));
    // Of those that are as good the best response to a load, and the largest weight.
    let good = tried.iter().filter(|one| one.0 <= least * (1.0 + NOTHING));
    let chosen = good.min_by(|x, y| x.1.total_cmp(&y.1).then(y.2.total_cmp(&x.2)));
    match chosen {
        Some((time, _, weight, shape)) if time.is_finite() => {
            let weight = Some(*weight);
            let Some(shape) = *shape else {
                return Ok((found, weight));
            };
            let posed = Posed {
                shape: Some(shape.clone()),
                slack: 0.0,
                ..posed.clone()
            };
            Ok((best(&posed, task)?, weight))
        }
        _ => Ok((found, None)),
    }
}
