//! The further delay with which a loop with a hold loses stability.
//!
//! A further delay T changes the fraction of a sample in it, and b with that. Its effect on a
//! crossover at ω is close to a turn by ω T: from a stable loop, steps of less than the smallest
//! φ/ω over the crossovers, φ the turn that brings L to −1, approach the first loss of stability,
//! and Newton's iteration for φ = 0 ends at it. The poles are counted after every step, and on both
//! sides of the result, which proves that stability is lost there; that it is not lost and regained
//! within a step is not proved.
//!
//! Where the plant has modes faster than a sample, or the command acts at once (L jumps where the
//! delay is a whole number of samples), the crossovers of all parts of a sample are looked at. Whole
//! samples turn each of them by ω T exactly and are passed at once; a sample in which stability may
//! be lost is followed in the steps of `held_range`.
//!
//! Neither crossovers nor counts (`circle`) cost more for a longer delay.

use std::f64::consts::{PI, TAU};

use super::circle::is_stable;
use super::gain_crossovers::{Crossover, crossovers};
use super::held_range::loss_of_delay;
use crate::stability::HeldLoop;
use crate::{Error, Task};

/// Share of the estimated distance to the loss of stability that a step takes.
const CAUTIOUS: f64 = 0.7;

/// Turn in radians from which Newton's iteration is used.
const CLOSE: f64 = 0.02;

/// Upper limits on the steps of the approach and of Newton's iteration.
const STEPS: u32 = 2000;
const NEWTON: u32 = 30;

/// Last relative step of Newton's iteration, about the rounding of the turn.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// Fractions of a sample for which it is found whether the gain reaches one.
const FRACTIONS: usize = 33;

/// Fractions just below a whole sample.
const LATE: [f64; 3] = [1e-1, 1e-4, 1e-9];

/// Product of the fastest mode of the plant and the sample time beyond which the loop gain changes
/// much with the fraction of a sample in the delay. The fastest oscillation then turns by PART in the
/// parts of a sample that are looked at, between the least and the most of them.
const ABRUPT: f64 = 0.5;
const PART: f64 = 0.25;
const PARTS: (f64, f64) = (8.0, 128.0);

/// Relative distance at which a jump of the loop gain is looked at from below.
const JUMP: f64 = 1e-11;

/// Upper limit on halvings of a step in which stability is lost.
const HALVINGS: u32 = 60;

/// Relative distances from the result at which stability is counted, the larger ones where rounding
/// hides it closer by.
const BESIDE: [f64; 3] = [1e-7, 1e-5, 1e-3];

/// The further delay in s with which a stable loop first loses stability, and the frequency there;
/// infinite where no delay is too much.
///
/// # Errors
/// [`Error::Argument`] where numbers, or the loss, are beyond double precision;
/// [`Error::Interrupted`].
pub fn further_delay(held: HeldLoop<'_>, task: &Task) -> Result<(f64, f64), Error> {
    let (start, period) = (held.delay(), held.sample_time());
    let is_abrupt = held.fastest() * period > ABRUPT || held.is_direct();
    let mut delay = start;
    for _ in 0..STEPS {
        task.check()?;
        let Some(Crossover { omega, turn, .. }) = nearest(held, delay, is_abrupt, task)? else {
            match next_crossover(held, delay, task)? {
                Some(next) => delay = next,
                None => return Ok((f64::INFINITY, f64::NAN)),
            }
            continue;
        };
        if !is_abrupt
            && turn < CLOSE
            && let Some(found) = newton(held, delay, omega, task)?
        {
            return confirmed(held, found, task);
        }
        let step = CAUTIOUS * turn / omega;
        let next = if is_abrupt {
            // At the same fraction of a sample b stays, and a crossover turns by ω T exactly.
            let samples = (step / period).floor();
            if samples == 0.0 {
                let next = delay + period;
                if let Some(lost) = loss_of_delay(held, (delay, next), task)? {
                    return confirmed(held, (lost, omega), task);
                }
                delay = next;
                continue;
            }
            delay + samples * period
        } else {
            delay + step
        };
        if !keeps(held, next, task)?.unwrap_or(false) {
            let found = bracketed(held, delay, next, task)?;
            return confirmed(held, found, task);
        }
        delay = next;
    }
    refuse!(
        "no loss of stability was met from a delay of {start} s to {delay} s, and none beyond is \
         ruled out: look at single delays with is_stable()"
    )
}

/// The stable range of the delay.
///
/// # Errors
/// As for [`further_delay`].
pub fn held_delay_range(held: HeldLoop<'_>, task: &Task) -> Result<(f64, f64), Error> {
    let (further, _) = further_delay(held, task)?;
    let start = held.delay();
    let earlier = loss_of_delay(held, (start, 0.0), task)?;
    Ok((earlier.unwrap_or(0.0), start + further))
}

/// Is the loop stable at a delay? `None` where rounding decides.
fn keeps(held: HeldLoop<'_>, delay: f64, task: &Task) -> Result<Option<bool>, Error> {
    let numbers = held.at(delay)?;
    is_stable(&numbers, &crossovers(&numbers, task)?, task)
}

/// The crossover whose estimated distance to the loss of stability is least; with a loop gain that
/// changes much within a sample, at all parts of the next one.
fn nearest(
    held: HeldLoop<'_>,
    delay: f64,
    is_abrupt: bool,
    task: &Task,
) -> Result<Option<Crossover>, Error> {
    let mut found = crossovers(&held.at(delay)?, task)?;
    if is_abrupt {
        for beside in within_sample(held, delay) {
            found.extend(crossovers(&held.at(beside)?, task)?);
        }
    }
    let distance = |at: &Crossover| at.turn / at.omega;
    Ok(found
        .into_iter()
        .min_by(|p, q| distance(p).total_cmp(&distance(q))))
}

/// Delays in the next sample, on both sides of the whole number of samples as well.
fn within_sample(held: HeldLoop<'_>, delay: f64) -> Vec<f64> {
    let period = held.sample_time();
    let whole = period * ((delay / period * (1.0 + 1e-12)).floor() + 1.0);
    let turn = held.fastest_oscillation(f64::INFINITY) * period;
    let parts = (turn / PART).clamp(PARTS.0, PARTS.1).ceil();
    let inner = (1..parts as u32).map(|part| delay + period * f64::from(part) / parts);
    inner.chain([whole * (1.0 - JUMP), whole]).collect()
}

/// The loss of stability between a delay at which the loop is stable and one at which it is not.
fn bracketed(
    held: HeldLoop<'_>,
    mut low: f64,
    mut high: f64,
    task: &Task,
) -> Result<(f64, f64), Error> {
    let turned = |delay: f64| -> Result<f64, Error> {
        let found = crossovers(&held.at(delay)?, task)?;
        let closest = found
            .into_iter()
            .min_by(|p, q| p.distance().total_cmp(&q.distance()));
        Ok(closest.map_or(f64::NAN, |at| at.omega))
    };
    for halving in 0..HALVINGS {
        if high - low <= 2.0 * JUMP * high {
            break;
        }
        if halving % 6 == 5 {
            let found = newton(held, high, turned(high)?, task)?;
            if let Some(found) = found.filter(|found| found.0 >= low && found.0 <= high) {
                return Ok(found);
            }
        }
        let middle = 0.5 * (low + high);
        if keeps(held, middle, task)?.unwrap_or(false) {
            low = middle;
        } else {
            high = middle;
        }
    }
    Ok((high, turned(high)?))
}

/// The next delay with a fraction of a sample for which the gain reaches one.
fn next_crossover(held: HeldLoop<'_>, delay: f64, task: &Task) -> Result<Option<f64>, Error> {
    let period = held.sample_time();
    let here = delay / period;
    let even = (0..FRACTIONS).map(|k| k as f64 / FRACTIONS as f64);
    let late = LATE.iter().map(|gap| 1.0 - gap);
    let mut fractions: Vec<f64> = even
        .chain(late)
        .map(|fraction| {
            let ahead = (fraction - here).rem_euclid(1.0);
            if ahead > 0.0 { ahead } else { 1.0 }
        })
        .collect();
    fractions.sort_by(f64::total_cmp);
    for ahead in fractions {
        let next = delay + ahead * period;
        if !crossovers(&held.at(next)?, task)?.is_empty() {
            return Ok(Some(next));
        }
    }
    Ok(None)
}

/// The delay at which the turn of the crossover next to `omega` is zero.
fn newton(
    held: HeldLoop<'_>,
    mut delay: f64,
    mut omega: f64,
    task: &Task,
) -> Result<Option<(f64, f64)>, Error> {
    let start = delay;
    for _ in 0..NEWTON {
        let found = crossovers(&held.at(delay)?, task)?;
        let off = |at: &Crossover| (at.omega - omega).abs();
        let Some(at) = found.into_iter().min_by(|p, q| off(p).total_cmp(&off(q))) else {
            return Ok(None);
        };
        let turn = if at.turn > PI { at.turn - TAU } else { at.turn };
        omega = at.omega;
        let step = turn / omega;
        delay += step;
        if step.abs() <= ROUNDING * (delay + 1.0 / omega) {
            return Ok(Some((delay, omega)));
        }
        if (delay - start).abs() > 10.0 * CLOSE / omega {
            return Ok(None);
        }
    }
    Ok(None)
}

/// The further delay, if stability is lost there.
fn confirmed(
    held: HeldLoop<'_>,
    (delay, omega): (f64, f64),
    task: &Task,
) -> Result<(f64, f64), Error> {
    let start = held.delay();
    for beside in BESIDE {
        let (before, after) = (delay * (1.0 - beside), delay * (1.0 + beside));
        let lost = keeps(held, after, task)? == Some(false);
        if lost && (before <= start || keeps(held, before, task)? == Some(true)) {
            return Ok((delay - start, omega));
        }
    }
    refuse!(
        "stability seems to be lost at a delay of {delay} s, but a count of the poles on both \
         sides does not confirm it: look at single delays with is_stable()"
    )
}
