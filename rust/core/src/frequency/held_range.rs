//! The values of one number, around its present one, for which a loop with a hold is stable, proved.
//!
//! Nothing is a polynomial in a time constant or a sample time. From a stable value, intervals are
//! taken towards either end, and over each it is proved that no pole is on the circle
//! (`stability::held::interval`). Where that fails the interval is halved, and where it succeeds the
//! next one is longer. Where it fails at last, stability is lost next to the value before, and
//! halving ends at the loss.
//!
//! Where the delay is a whole number of samples the matrices change, and intervals end there. Poles pass
//! it continuously, but where the command acts at once, L jumps: the poles are counted on both sides.
//! `further_delay` follows the delay in the same way.
//!
//! A gain in which the feedback is affine needs no intervals: its range ends at the next of all its
//! crossings (`gain_range_held`).
//!
//! *What is not proved.* At `FARTHEST` times the value and the time constants, and at a tenth and a
//! hundredth of that, the distance to a loss of stability is compared: the least turn in rad, or
//! logarithm of a factor, over all crossovers, without an upper limit. Where it grows, or comes to
//! rest well above zero, the end is infinite. A number that cannot be zero is followed down to
//! `NEARLY_ZERO` of itself, and so far a lag is that is zero. A sample time is followed down to where the
//! hold delays the fastest mode and crossover by a small part of the distance, or to `MOST_SAMPLES` samples
//! in the delay, and a few shorter ones.

use super::circle::is_stable;
use super::gain_crossovers::{FAR, crossovers};
use crate::dde::LinearLoop;
use crate::dde::control_loop::sampled::Timing;
use crate::stability::{HeldInterval, HeldLoop};
use crate::{Error, Task};

/// First interval, relative to the value, and the largest; a longer one follows a success.
const FIRST: f64 = 0.05;
const LONGEST: f64 = 0.5;
const LONGER: f64 = 2.0;

/// Length of an interval, relative to the value, below which stability is lost next to it.
pub(super) const RESOLVED: f64 = 1e-9;

/// Upper limit on the intervals in one direction.
const STEPS: u32 = 50_000;

/// Largest and smallest value, relative to the present one, and to the time constants.
const FARTHEST: f64 = 1e6;
const NEARLY_ZERO: f64 = 1e-6;

/// Size that a value counts as having where it may be zero, relative to the present one, or to the
/// sample time where that is zero.
const FLOOR: f64 = 0.05;

/// An oscillation counts until it has decayed to e^(−DECAYED) within a sample.
const DECAYED: f64 = 3.0;

/// Relative distance at which a jump of the loop gain is looked at from the other side.
pub(super) const JUMP: f64 = 1e-11;

/// Halvings of an interval in which stability is lost, and where they end.
const HALVINGS: u32 = 200;
const RESOLUTION: f64 = 2.0 * f64::EPSILON;

/// Largest distance that is compared: further ones are alike.
const ALIKE: f64 = 25.0;

/// Factors on L that are looked at where samples are short.
const NEAR: (f64, f64) = (0.36, 2.72);

/// Share of the distance that may be lost over the last decade where it rests.
const RESTS: f64 = 1e-3;

/// Turn by the hold, as a part of the distance, below which shorter samples change nothing.
const CONTINUOUS: f64 = 0.05;

/// Samples in the delay beyond which shorter ones are not looked at one by one, the shorter ones that are,
/// and the share of the distance that is left there.
const MOST_SAMPLES: f64 = 200.0;
const SHORTER: [f64; 6] = [0.5, 0.3, 0.1, 0.03, 0.01, 0.003];
const KEPT: f64 = 0.5;

/// Distance between the last stable and the first unstable value, relative, between which rounding
/// may hide which is which.
const HIDDEN: f64 = 1e-5;

/// Relative distances beyond a value at which a loss of stability is looked for.
const BEYOND: [f64; 8] = [1e-9, 3e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3];

/// Value, relative to the present one, that is zero but for rounding.
const ZERO: f64 = 1e-13;

/// Most samples in the delay for which discs of the poles decide where counts do not.
const FEW: f64 = 200.0;

/// Changes of a number, relative to it, for which the loop is compared to find whether its poles
/// depend on it: any two that are not special values.
const CHANGES: [f64; 2] = [0.37, 0.71];

/// What varies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Number {
    /// The sample time.
    SampleTime,
    /// Another number, not the delay: it moves the equations of plant and controller.
    Other,
}

/// A loop for each value of a number, and over intervals of it.
pub trait Members {
    /// The loop for a value.
    ///
    /// # Errors
    /// For a value that the loop cannot have.
    fn at(&mut self, value: f64) -> Result<LinearLoop, Error>;

    /// The loop over an interval, with m samples in the delay.
    ///
    /// # Errors
    /// As [`at`](Self::at).
    fn within(&mut self, interval: (f64, f64), samples: f64) -> Result<HeldInterval, Error>;
}

struct Search<'a, M> {
    members: &'a mut M,
    number: Number,
    start: f64,
    /// The delay and the sample time at the start.
    times: (f64, f64),
    /// Does the number keep its sign?
    keeps_sign: bool,
    task: &'a Task,
}

/// The stable range of a number around `start`, between bounds that may be infinite. A bound of zero
/// is reached in intervals relative to the value.
///
/// # Errors
/// Those of `members`; [`Error::Argument`] where the loop is not stable at `start`, or an end is
/// neither found nor ruled out; [`Error::Interrupted`].
pub fn held_range(
    members: &mut impl Members,
    number: Number,
    start: f64,
    (low, high): (f64, f64),
    task: &Task,
) -> Result<(f64, f64), Error> {
    let here = members.at(start)?;
    let held = HeldLoop::new(&here)?;
    let times = (held.delay(), held.sample_time());
    if number == Number::Other && is_idle(members, &here, start)? {
        return Ok((low, high));
    }
    refuse_if!(
        loses(held, task)? != Some(false),
        "the loop is not stable at {start}, within rounding errors"
    );
    let keeps_sign = (low == 0.0 || high == 0.0) && start != 0.0;
    let mut search = Search {
        members,
        number,
        start,
        times,
        keeps_sign,
        task,
    };
    Ok((search.end(low)?, search.end(high)?))
}

/// Do the poles not depend on the number?
fn is_idle(members: &mut impl Members, here: &LinearLoop, start: f64) -> Result<bool, Error> {
    let size = if start == 0.0 { 1.0 } else { start.abs() };
    for part in CHANGES {
        if !members.at(start + part * size)?.has_poles_of(here) {
            return Ok(false);
        }
    }
    Ok(true)
}

/// Is a pole outside the circle? `None` where rounding decides.
pub(super) fn loses(held: HeldLoop<'_>, task: &Task) -> Result<Option<bool>, Error> {
    task.check()?;
    let numbers = held.at(held.delay())?;
    let found = match is_stable(&numbers, &crossovers(&numbers, task)?, task)? {
        None if held.delay() <= FEW * held.sample_time() => match held.are_inside() {
            Err(error) if error.ends_all() => return Err(error),
            found => found.unwrap_or(None),
        },
        found => found,
    };
    Ok(found.map(|stable| !stable))
}

/// The loss of stability within `hidden` of `size` after a stable value, found by counts; `None` where
/// there is none.
pub(super) fn loss_beside(
    loses: &mut dyn FnMut(f64) -> Result<Option<bool>, Error>,
    stable: f64,
    (size, hidden): (f64, f64),
) -> Result<Option<f64>, Error> {
    for part in BEYOND.into_iter().filter(|part| *part <= hidden) {
        let value = stable + part * size;
        if loses(value)? == Some(true) {
            return between(loses, stable, value).map(Some);
        }
    }
    Ok(None)
}

/// Where stability is lost between two values.
fn between(
    loses: &mut dyn FnMut(f64) -> Result<Option<bool>, Error>,
    mut stable: f64,
    unstable: f64,
) -> Result<f64, Error> {
    let mut end = unstable;
    for _ in 0..HALVINGS {
        let middle = 0.5 * (stable + end);
        let is_last = (end - stable).abs() <= RESOLUTION * middle.abs();
        if is_last || middle == stable || middle == end {
            break;
        }
        match loses(middle)? {
            Some(false) => stable = middle,
            _ => end = middle,
        }
    }
    Ok(end)
}

impl<M: Members> Search<'_, M> {
    /// The first loss of stability towards `bound`, or `bound`.
    fn end(&mut self, bound: f64) -> Result<f64, Error> {
        if bound == self.start {
            return Ok(bound);
        }
        let sign = (bound - self.start).signum();
        let last = self.last(bound)?;
        let mut value = self.start;
        let mut step = FIRST * self.size(value);
        for _ in 0..STEPS {
            self.task.check()?;
            if value == last {
                return self.at_last(bound, last);
            }
            if sign < 0.0 && self.is_continuous(value)? {
                return Ok(bound);
            }
            let (samples, limit) = self.piece(value, sign, last);
            if sign < 0.0 && self.number == Number::SampleTime && samples > MOST_SAMPLES {
                return self.at_short_samples(value, last);
            }
            let ahead = value + sign * step;
            let next = if (limit - ahead) * sign <= 0.0 {
                limit
            } else {
                ahead
            };
            let interval = (value.min(next), value.max(next));
            if self
                .members
                .within(interval, samples)?
                .avoids_circle((samples + 1.0, samples + 1.0))
            {
                value = next;
                step = (LONGER * step).min(LONGEST * self.size(value));
                if next == limit && limit != last && self.jumps(limit, sign)? {
                    return Ok(limit);
                }
                continue;
            }
            step = 0.5 * (next - value).abs();
            if step > RESOLVED * self.size(value) {
                continue;
            }
            if value == 0.0 && self.start == 0.0 {
                // A lag of zero has no pole for it.
                value = sign * NEARLY_ZERO * self.times.1;
                if self.loses(value)? == Some(false) {
                    step = FIRST * value.abs();
                    continue;
                }
            }
            return self.lost(value, sign);
        }
        refuse!(
            "from {} to {value} the loop was stable in {STEPS} intervals. To examine values \
             above, use is_stable()",
            self.start
        )
    }

    /// What lengths are relative to.
    fn size(&self, value: f64) -> f64 {
        let usual = if self.start == 0.0 {
            self.times.1
        } else {
            self.start.abs()
        };
        if self.keeps_sign {
            value.abs()
        } else {
            value.abs().max(FLOOR * usual)
        }
    }

    /// The samples in the delay on the way from a value, and up to where.
    fn piece(&self, value: f64, sign: f64, last: f64) -> (f64, f64) {
        let (delay, period) = self.times;
        if self.number == Number::Other {
            return (Timing::new(delay, period).samples as f64, last);
        }
        let timing = Timing::new(delay, value);
        let whole = timing.samples as f64;
        // At a whole number of samples a longer one has fewer of them in the delay.
        let is_before = sign > 0.0 && timing.early == 0.0 && whole > 0.0;
        let samples = if is_before { whole - 1.0 } else { whole };
        let end = delay / if sign > 0.0 { samples } else { samples + 1.0 };
        let is_next = end > 0.0 && (last - end) * sign > 0.0;
        (samples, if is_next { end } else { last })
    }

    /// Is stability lost where the delay becomes a whole number of samples?
    fn jumps(&mut self, limit: f64, sign: f64) -> Result<bool, Error> {
        let made = self.members.at(limit)?;
        let is_direct = HeldLoop::new(&made)?.is_direct();
        let beyond = limit * (1.0 + if sign > 0.0 { JUMP } else { 0.0 });
        Ok(is_direct && self.loses(beyond)? != Some(false))
    }

    fn loses(&mut self, value: f64) -> Result<Option<bool>, Error> {
        loses(HeldLoop::new(&self.members.at(value)?)?, self.task)
    }

    /// The loss of stability next to a stable value.
    fn lost(&mut self, stable: f64, sign: f64) -> Result<f64, Error> {
        let size = sign * self.size(stable);
        let found = loss_beside(&mut |value| self.loses(value), stable, (size, HIDDEN))?;
        let Some(end) = found else {
            refuse!(
                "the loop is stable from {} to {stable}. Above, its stability is not known, \
                 because a pole is closer to the unit circle than rounding errors, or double \
                 precision is not sufficient",
                self.start
            );
        };
        // A value that is zero but for rounding is zero.
        let is_zero = end.abs() <= ZERO * self.start.abs();
        Ok(if is_zero { 0.0 } else { end })
    }

    /// The last value that is looked at on the way to `bound`.
    fn last(&mut self, bound: f64) -> Result<f64, Error> {
        if bound == 0.0 && self.keeps_sign {
            return Ok(NEARLY_ZERO * self.start);
        }
        if bound.is_finite() {
            return Ok(bound);
        }
        let size = if self.start == 0.0 {
            1.0
        } else {
            self.start.abs()
        };
        let slowest = match self.number {
            Number::SampleTime => HeldLoop::new(&self.members.at(self.start)?)?.slowest(),
            Number::Other => 0.0,
        };
        Ok(FARTHEST * size.max(slowest).copysign(bound))
    }

    /// What a bound is where the loop is stable up to the last value.
    fn at_last(&mut self, bound: f64, last: f64) -> Result<f64, Error> {
        if bound.is_finite() {
            return Ok(bound);
        }
        let mut distances = [0.0; 3];
        for (distance, part) in distances.iter_mut().zip([1e-2, 1e-1, 1.0]) {
            *distance = self.distance(part * last)?;
        }
        let [first, second, third] = distances;
        let (before, loss) = (first - second, second - third);
        let rests = loss <= RESTS * third || (loss <= 0.5 * before.abs() && third > 2.0 * loss);
        refuse_if!(
            !rests,
            "the loop is stable from {} to {last}. Above, its stability is not known",
            self.start
        );
        Ok(bound)
    }

    /// What the end is where so many samples are in the delay that they are not looked at one by one.
    fn at_short_samples(&mut self, value: f64, last: f64) -> Result<f64, Error> {
        let here = self.distance(value)?;
        for part in SHORTER {
            let is_kept = part * value < last || {
                let shorter = part * value;
                self.loses(shorter)? == Some(false) && self.distance(shorter)? >= KEPT * here
            };
            refuse_if!(
                !is_kept,
                "the loop is stable from {} to {value}, where the delay has {MOST_SAMPLES} \
                 samples. Above, its stability is not known",
                self.start
            );
        }
        Ok(0.0)
    }

    /// The distance to a loss of stability, without an upper limit that matters.
    fn distance(&mut self, value: f64) -> Result<f64, Error> {
        let made = self.members.at(value)?;
        let held = HeldLoop::new(&made)?;
        let numbers = held.at(held.delay())?;
        let factors = numbers
            .factors((1.0 / FAR, FAR), self.task)?
            .unwrap_or_default();
        let sizes = factors.iter().map(|factor| factor.gain.ln().abs());
        let turns = crossovers(&numbers, self.task)?;
        let whole = held.sample_time() + held.delay();
        let turns = turns.iter().map(|at| at.margin(whole));
        Ok(sizes.chain(turns).fold(ALIKE, f64::min))
    }

    /// Do shorter samples change nothing?
    fn is_continuous(&mut self, value: f64) -> Result<bool, Error> {
        if self.number == Number::Other {
            return Ok(false);
        }
        let made = self.members.at(value)?;
        let held = HeldLoop::new(&made)?;
        let period = held.sample_time();
        if held.is_direct() || held.fastest() * period >= CONTINUOUS {
            return Ok(false);
        }
        let numbers = held.at(held.delay())?;
        let turns = crossovers(&numbers, self.task)?;
        let factors = numbers.factors(NEAR, self.task)?.unwrap_or_default();
        let turns = turns.iter().map(|at| (at.omega, at.distance()));
        let factors = factors.iter().map(|at| (at.omega, at.gain.ln().abs()));
        let start = (held.fastest_oscillation(DECAYED), 1.0f64);
        let (fastest, distance) = turns
            .chain(factors)
            .fold(start, |(most, least), (omega, margin)| {
                (most.max(omega), least.min(margin))
            });
        Ok((held.fastest() + fastest) * period < CONTINUOUS * distance)
    }
}
