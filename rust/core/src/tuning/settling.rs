//! The weight of the reference with which a step settles first, and the gains beside the best that do.
//!
//! The weight moves neither margins nor the response to a load, so that it is chosen after the gains.
//! Gains that lose no more than the slack of the response to a load are judged with it. A limit of the
//! command is left out: it acts on large steps alone, and the gains are for steps of all sizes.

use super::posed::{Best, Posed};
use super::responses::settling_time;
use super::robust::best;
use crate::{Error, Task, parallel};

/// Weights that are tried: more of them settle a little earlier and take time in proportion.
const WEIGHTS: u32 = 21;

/// Relative loss that counts as none.
const NOTHING: f64 = 1e-3;

/// Part of the best response to a load that is given for a step that settles earlier, where no demand is
/// made: the response is flat along the ratios of the gains, where the settling time is not.
pub const SLACK: f64 = 0.1;

/// Gains with the weight of the reference that goes with them.
#[derive(Debug, Clone)]
pub struct Settled {
    /// The gains.
    pub best: Best,
    /// The weight, where one was chosen.
    pub weight: Option<f64>,
    /// The value of the best gains, of which the slack may have cost a part.
    pub least: f64,
    /// When a step has settled in the worst of the loops with which the search began, s; infinite where
    /// that is not known.
    pub time: f64,
}

/// The gains, and where the controller integrates the weight of the reference, with which a step settles
/// first; a weight that is given stays. The search judges a demand on the settling time without a weight.
/// So gains that are sought without it come first: with their weight they may meet it.
///
/// # Errors
/// As [`best`].
pub fn settled_first(posed: &Posed, given: Option<f64>, task: &Task) -> Result<Settled, Error> {
    let longest = posed.demands.settling_time;
    if longest.is_finite() {
        let mut free = posed.clone();
        free.demands.settling_time = f64::INFINITY;
        for slack in [0.0, SLACK] {
            free.slack = slack;
            let found = weighed(&free, given, task)?;
            if found.time <= longest {
                return Ok(found);
            }
        }
    }
    weighed(posed, given, task)
}

fn weighed(posed: &Posed, given: Option<f64>, task: &Task) -> Result<Settled, Error> {
    let found = best(posed, task)?;
    let least = found.value;
    let without = |best| Settled {
        best,
        least,
        weight: None,
        time: f64::INFINITY,
    };
    let nominal = posed.loops.first();
    if !nominal.is_some_and(|of| of.controller().kind.integrates()) {
        return Ok(without(found));
    }
    let weights = match given {
        Some(weight) => vec![weight],
        None => {
            let step = |step| f64::from(step) / f64::from(WEIGHTS - 1);
            (0..WEIGHTS).map(step).collect()
        }
    };
    // The best gains first, without a shape, then their neighbours.
    let mut near = vec![(None, &found.gains, found.value)];
    for other in &found.neighbours {
        near.push((Some(&other.shape), &other.gains, other.value));
    }
    let worst = |index: usize| -> Result<f64, Error> {
        let (_, gains, _) = near[index / weights.len()];
        let weight = weights[index % weights.len()];
        let mut worst = 0.0_f64;
        for place in 0..posed.first.max(1) {
            let of = posed.at(place, gains).with_weight(weight);
            let time = settling_time(&of, task)?;
            worst = worst.max(if time.is_nan() { f64::INFINITY } else { time });
        }
        Ok(worst)
    };
    let times = parallel::results(
        "the steps of a design",
        near.len() * weights.len(),
        || (),
        |(), index| worst(index),
    )?;
    let earliest = times.iter().copied().fold(f64::INFINITY, f64::min);
    // Of those that are as good the best response to a load, and the largest weight.
    let good = (0..times.len()).filter(|&index| times[index] <= earliest * (1.0 + NOTHING));
    let row = |index: usize| near[index / weights.len()];
    let weight = |index: usize| weights[index % weights.len()];
    let chosen = good.min_by(|&x, &y| {
        let by_weight = weight(y).total_cmp(&weight(x));
        row(x).2.total_cmp(&row(y).2).then(by_weight)
    });
    let Some(chosen) = chosen.filter(|_| earliest.is_finite()) else {
        return Ok(without(found));
    };
    let (weight, time) = (given.is_none().then(|| weight(chosen)), times[chosen]);
    let best = match row(chosen).0.cloned() {
        None => found,
        Some(shape) => best(
            &Posed {
                shape: Some(shape),
                slack: 0.0,
                ..posed.clone()
            },
            task,
        )?,
    };
    Ok(Settled {
        best,
        least,
        weight,
        time,
    })
}
