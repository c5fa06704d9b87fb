//! The delays with which a loop with a hold is stable, proved.
//!
//! With m whole samples in the delay and a fraction φ of a sample, h = z^(m+1) a − b, where a and b depend on
//! φ alone. Over an interval of φ it is proved that no pole is on the circle (`HeldInterval`), and where
//! that fails the interval is halved, up to where stability is lost. The intervals that were needed for
//! one sample are then tried for many m at once, and for all of them: L that is nowhere one in modulus
//! stays stable with any delay. Poles pass a whole number of samples continuously, but where the command
//! acts at once, L jumps there: the poles are counted on both sides.
//!
//! Newton's iteration for the turn that brings L to −1 gives the loss its last digits.

use std::collections::HashMap;
use std::f64::consts::{PI, TAU};

use super::gain_crossovers::{Crossover, crossovers};
use super::held_range::{JUMP, RESOLVED, loses, loss_beside};
use crate::dde::control_loop::sampled::Timing;
use crate::stability::{HeldInterval, HeldLoop};
use crate::{Error, Task};

/// Turn in radians within which Newton's iteration stays, and its upper limit.
const CLOSE: f64 = 0.2;
const NEWTON: u32 = 30;

/// Last relative step of Newton's iteration, about the rounding of the turn.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// Relative distance within which rounding may hide the loss from counts, but not from the turn.
const BESIDE: f64 = 1e-3;

/// Samples in the delay from which rounding in a part of a sample may end the proof before the loss, and
/// how much before: what remains is the way of the turn of the crossover, which whole samples turn exactly.
const MANY: f64 = 1e5;
const LATE: f64 = 1.0;

/// Shortest part of a sample over which the gain is shown to be nowhere one.
const SHORTEST: f64 = 1e-4;

/// Most samples in the delay.
const MOST: f64 = 1e15;

/// The further delay in s with which a stable loop first loses stability, and the frequency there;
/// infinite where no delay is too much.
///
/// # Errors
/// [`Error::Argument`] where numbers, or the loss, are beyond double precision;
/// [`Error::Interrupted`].
pub fn further_delay(held: HeldLoop<'_>, task: &Task) -> Result<(f64, f64), Error> {
    let start = held.delay();
    let Some(end) = Search::new(held, task)?.later()? else {
        return Ok((f64::INFINITY, f64::NAN));
    };
    let (found, omega) = turned(held, end, BESIDE, task)?;
    let (delay, omega) = found.unwrap_or((end, omega));
    Ok((delay - start, omega))
}

/// A delay and a frequency.
type Loss = (f64, f64);

/// The loss of stability next to a delay by the turn of the crossover closest to −1, if there is one, and the
/// frequency of this crossover.
fn turned(
    held: HeldLoop<'_>,
    near: f64,
    share: f64,
    task: &Task,
) -> Result<(Option<Loss>, f64), Error> {
    let found = crossovers(&held.at(near)?, task)?;
    let closest = found
        .into_iter()
        .min_by(|p, q| p.distance().total_cmp(&q.distance()));
    let omega = closest.map_or(f64::NAN, |at| at.omega);
    let found = newton(held, near, omega, task)?;
    let is_beside = |found: &Loss| (found.0 - near).abs() <= share * near;
    Ok((found.filter(is_beside), omega))
}

/// The stable range of the delay.
///
/// # Errors
/// As for [`further_delay`].
pub fn held_delay_range(held: HeldLoop<'_>, task: &Task) -> Result<(f64, f64), Error> {
    let (further, _) = further_delay(held, task)?;
    let earlier = Search::new(held, task)?.earlier()?;
    Ok((earlier.unwrap_or(0.0), held.delay() + further))
}

/// A part of a sample, from one fraction to another.
type Part = (f64, f64);

struct Search<'a> {
    held: HeldLoop<'a>,
    /// Whole samples and fraction at the start.
    start: (f64, f64),
    /// What is known of parts of a sample, by the bits of their ends.
    known: HashMap<(u64, u64), HeldInterval>,
    task: &'a Task,
}

impl<'a> Search<'a> {
    fn new(held: HeldLoop<'a>, task: &'a Task) -> Result<Self, Error> {
        let timing = Timing::new(held.delay(), held.sample_time());
        refuse_if!(
            loses(held, task)? != Some(false),
            "the loop is not stable at a delay of {} s, within rounding errors",
            held.delay()
        );
        Ok(Self {
            held,
            start: (timing.samples as f64, timing.early / held.sample_time()),
            known: HashMap::new(),
            task,
        })
    }

    /// The first loss of stability on the way to longer delays.
    fn later(&mut self) -> Result<Option<f64>, Error> {
        let (mut samples, fraction) = self.start;
        let mut parts = Vec::new();
        if let Some(lost) = self.lost_in(samples, (fraction, 1.0), &mut parts)? {
            return Ok(Some(lost));
        }
        samples += 1.0;
        parts = vec![(0.0, 1.0)];
        let (mut count, mut is_new, mut is_joined) = (1.0, true, false);
        while samples < MOST {
            let delay = samples * self.held.sample_time();
            if is_new {
                if self.never(delay, &mut parts)? {
                    return Ok(None);
                }
                is_joined = !self.held.is_direct() || self.lead(&parts);
                is_new = false;
            }
            if !is_joined && self.loses(delay)? {
                return Ok(Some(delay));
            }
            // Where L jumps, the way from one m to the next is looked at too.
            let least = if is_joined && self.held.is_direct() {
                samples - 1.0
            } else {
                samples
            };
            if self.avoid(&parts, (least, samples + count - 1.0))? {
                samples += count;
                count = if is_joined { 2.0 * count } else { 1.0 };
            } else if count > 1.0 {
                count = (0.25 * count).floor().max(1.0);
            } else {
                if self.held.is_direct() && self.loses(delay)? {
                    return Ok(Some(delay));
                }
                parts.clear();
                if let Some(lost) = self.lost_in(samples, (0.0, 1.0), &mut parts)? {
                    return Ok(Some(lost));
                }
                (samples, is_new) = (samples + 1.0, true);
            }
        }
        refuse!(
            "the loop is stable with delays up to {MOST:e} samples. Longer delays were not \
             examined"
        )
    }

    /// The same on the way to no delay.
    fn earlier(&mut self) -> Result<Option<f64>, Error> {
        let (mut samples, fraction) = self.start;
        let mut parts = Vec::new();
        if let Some(lost) = self.lost_in(samples, (fraction, 0.0), &mut parts)? {
            return Ok(Some(lost));
        }
        parts = vec![(1.0, 0.0)];
        let mut count = 1.0;
        while samples > 0.0 {
            let delay = samples * self.held.sample_time();
            if self.held.is_direct() && self.loses(delay * (1.0 - JUMP))? {
                return Ok(Some(delay));
            }
            let count_here = f64::min(count, samples);
            if self.avoid(&parts, (samples - count_here, samples - 1.0))? {
                samples -= count_here;
                count = if self.held.is_direct() {
                    1.0
                } else {
                    2.0 * count
                };
            } else if count > 1.0 {
                count = (0.25 * count).floor().max(1.0);
            } else {
                samples -= 1.0;
                parts.clear();
                if let Some(lost) = self.lost_in(samples, (1.0, 0.0), &mut parts)? {
                    return Ok(Some(lost));
                }
            }
        }
        Ok(None)
    }

    /// The first loss of stability from one fraction of a sample to another; else the parts into which
    /// the way was cut.
    fn lost_in(
        &mut self,
        samples: f64,
        way: Part,
        parts: &mut Vec<Part>,
    ) -> Result<Option<f64>, Error> {
        let period = self.held.sample_time();
        let mut open = vec![way];
        while let Some(part) = open.pop() {
            self.task.check()?;
            if self.avoid(&[part], (samples, samples))? {
                parts.push(part);
                continue;
            }
            let (from, to) = part;
            let size = samples + from.max(to).max(0.05);
            if (to - from).abs() > RESOLVED * size {
                let middle = 0.5 * (from + to);
                open.extend([(middle, to), (from, middle)]);
                continue;
            }
            let stable = (samples + from) * period;
            let beyond = (size * period).copysign(to - from);
            let found = loss_beside(
                &mut |delay| {
                    loses(
                        HeldLoop::new(&self.held.with_delay(delay.max(0.0)))?,
                        self.task,
                    )
                },
                stable,
                (beyond, BESIDE),
            )?;
            let found = match found {
                None => {
                    let share = if samples > MANY { LATE } else { BESIDE };
                    turned(self.held, stable, share, self.task)?
                        .0
                        .map(|(delay, _)| delay)
                }
                found => found,
            };
            refuse_if!(
                found.is_none(),
                "the loop is stable with delays from {} to {stable} s. Above, its stability is \
                 not known, because a pole is closer to the unit circle than rounding errors",
                self.held.delay()
            );
            return Ok(found);
        }
        Ok(None)
    }

    /// Is no pole on the circle, in any of these parts of a sample, with any m between these?
    fn avoid(&mut self, parts: &[Part], (least, most): (f64, f64)) -> Result<bool, Error> {
        for part in parts {
            let interval = self.interval(*part);
            if !interval.avoids_circle((least + 1.0, most + 1.0)) {
                return Ok(false);
            }
            self.task.check()?;
        }
        Ok(true)
    }

    /// Is the gain of the loop nowhere one, for any fraction of a sample? The parts are made as short as that
    /// takes.
    fn never(&mut self, delay: f64, parts: &mut Vec<Part>) -> Result<bool, Error> {
        if !crossovers(&self.held.at(delay)?, self.task)?.is_empty() {
            return Ok(false);
        }
        let mut found = Vec::new();
        let mut open: Vec<Part> = parts.iter().rev().copied().collect();
        while let Some((from, to)) = open.pop() {
            if self.avoid(&[(from, to)], (0.0, f64::INFINITY))? {
                found.push((from, to));
            } else if to - from > SHORTEST {
                let middle = 0.5 * (from + to);
                open.extend([(middle, to), (from, middle)]);
            } else {
                return Ok(false);
            }
        }
        *parts = found;
        Ok(true)
    }

    /// Do these parts of a sample need no count where the samples become one more?
    fn lead(&mut self, parts: &[Part]) -> bool {
        parts
            .iter()
            .all(|part| self.interval(*part).leads_at_minus_one())
    }

    /// The loop over a part of a sample.
    fn interval(&mut self, (from, to): Part) -> &HeldInterval {
        let ends = (from.min(to), from.max(to));
        let known = self.known.entry((ends.0.to_bits(), ends.1.to_bits()));
        known.or_insert_with(|| self.held.within_sample(ends))
    }

    /// Is the loop not stable at a delay?
    fn loses(&self, delay: f64) -> Result<bool, Error> {
        let made = self.held.with_delay(delay);
        Ok(loses(HeldLoop::new(&made)?, self.task)? != Some(false))
    }
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
