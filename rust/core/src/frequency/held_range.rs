//! The values of one number, around its present one, for which a loop with a hold is stable.
//!
//! Nothing is a polynomial in a time constant or a sample time. From a stable value, steps are
//! taken towards either end. At each value all gain crossovers, the factors on L close to 1 that
//! bring a pole to the circle, and the number of poles outside are found with the proofs of `held`
//! and `circle`. The distance to a loss of stability is the least turn in rad, or logarithm of a
//! factor. Of a crossover slower than delay and sample time it is the further delay, in units of
//! both, since the turn itself tends to zero with the frequency. A step is a share of this distance,
//! in a unit in which nothing turns by more than about a radian: the fastest oscillation of plant
//! and controller that has not died out within a sample, and the fastest crossover, over delay and
//! sample time. Where a number moves such a mode close to another pole on the circle, its share in L
//! changes faster, by the distance between both. Where poles are outside, halving ends at the loss of stability.
//!
//! A gain in which the feedback is affine needs no steps: its range ends at the next of all its
//! crossings, which are proved (`gain_range_held`).
//!
//! *What is not looked at.* Between two values nothing is proved. A loss of stability that is regained
//! within a step is passed over: within half the distance to it, or `LEAST` rad. Where a mode is
//! faster than a sample, or the command acts at once, L changes fast, or jumps, at whole numbers of
//! samples in the delay: both sides are looked at, of a sample time up to `MOST_JUMPS` samples.
//!
//! *No end.* At `FARTHEST` times the value and the time constants, and at a tenth and a hundredth of
//! that, the distance is compared, without an upper limit. Where it grows, or comes to rest well
//! above zero, the end is infinite. This is no proof either. A sample time is followed down to where
//! the hold delays the fastest mode and crossover by a small part of the distance.

use super::circle::is_stable;
use super::gain_crossovers::{FAR, crossovers};
use crate::dde::LinearLoop;
use crate::stability::HeldLoop;
use crate::{Error, Task};

/// Share of the distance to a loss of stability that a step takes, and the smallest and the largest
/// step, rad: smaller ones see narrower windows of instability and take longer.
const SHARE: f64 = 0.5;
const LEAST: f64 = 1e-4;
const MOST: f64 = 0.5;

/// Factor on the speed with which a distance changed in the last step, and the least speed that counts,
/// rad a rad: smaller ones trust the past more and take less time.
const FASTER: f64 = 3.0;
const SLOWEST: f64 = 0.1;

/// A step that reduces the distance below this share of it is taken again, shorter by the other.
const KEPT: f64 = 0.5;
const SHORTER: f64 = 0.4;

/// Upper limit on the steps in one direction.
const STEPS: u32 = 20_000;

/// Factors on L that are looked at in each step: beyond, the distance is taken as 1.
const NEAR: (f64, f64) = (0.36, 2.72);

/// Largest and smallest value, relative to the present one, and to the time constants.
const FARTHEST: f64 = 1e6;
const NEARLY_ZERO: f64 = 1e-6;

/// Size that a value counts as having where it may be zero, relative to the present one, or to the
/// sample time where that is zero.
const FLOOR: f64 = 0.05;

/// An oscillation counts until it has decayed to e^(−DECAYED) within a sample.
const DECAYED: f64 = 3.0;

/// Product of the fastest mode and the sample time beyond which the loop gain changes much with the
/// fraction of a sample in the delay; steps of a delay in a sample then.
const ABRUPT: f64 = 0.5;
const PARTS: f64 = 8.0;

/// Relative distance at which a jump of the loop gain is looked at from the other side, and the most
/// samples in the delay at which jumps are looked at one by one as the sample time varies.
const JUMP: f64 = 1e-11;
const MOST_JUMPS: f64 = 200.0;

/// Halvings of a step in which stability is lost, and where they end.
const HALVINGS: u32 = 200;
const RESOLUTION: f64 = 2.0 * f64::EPSILON;

/// Largest distance that is compared: further ones are alike.
const ALIKE: f64 = 25.0;

/// Share of the distance that may be lost over the last decade where it rests.
const RESTS: f64 = 1e-3;

/// Turn by the hold, as a part of the distance, below which shorter samples change nothing.
const CONTINUOUS: f64 = 0.05;

/// Distance between the last stable and the first unstable value, relative, between which rounding
/// may hide which is which.
const HIDDEN: f64 = 1e-5;

/// Relative distances beyond a value at which rounding decides, where a loss of stability is seen.
const BEYOND: [f64; 4] = [1e-11, 1e-9, 1e-7, 1e-5];

/// Value, relative to the present one, that is zero but for rounding.
const ZERO: f64 = 1e-13;

/// Changes of a number, relative to it, for which the loop is compared to find whether its poles
/// depend on it: any two that are not special values.
const CHANGES: [f64; 2] = [0.37, 0.71];

/// What varies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Number {
    /// The delay, which does not change the equations.
    Delay,
    /// The sample time.
    SampleTime,
    /// Another number: it moves the equations of plant and controller.
    Other,
}

/// A loop with one value of the number.
struct Look {
    value: f64,
    /// `None` where rounding decides.
    is_stable: Option<bool>,
    /// To a loss of stability, at most 1 rad.
    distance: f64,
    /// The same of each crossover and factor, where a slow crossover counts by its further delay.
    rooms: Vec<f64>,
    /// Do shorter samples change nothing?
    is_continuous: bool,
    /// The change of the value that turns something by a radian.
    unit: f64,
    /// The longest step.
    longest: f64,
    /// Values at which L may change at once.
    jumps: Vec<f64>,
}

impl Look {
    /// The turn within which stability is not expected to be lost, at most 1 rad: each distance over
    /// its speed, which is one, or what it was since the look `before`, a turn ago, with a factor.
    fn room(&self, before: Option<(&Self, f64)>) -> f64 {
        let alike = before.filter(|(look, _)| look.rooms.len() == self.rooms.len());
        let speed = |place: usize, room: f64| match alike {
            Some((look, turn)) if turn > 0.0 => {
                let change = look
                    .rooms
                    .get(place)
                    .map_or(turn, |last| (room - last).abs());
                (FASTER * change / turn).clamp(SLOWEST, 1.0)
            }
            _ => 1.0,
        };
        let rooms = self.rooms.iter().enumerate();
        rooms.fold(1.0, |least, (place, room)| {
            least.min(room / speed(place, *room))
        })
    }
}

struct Search<'a> {
    at: &'a mut dyn FnMut(f64) -> Result<LinearLoop, Error>,
    number: Number,
    start: f64,
    /// Does the number keep its sign?
    keeps_sign: bool,
    task: &'a Task,
}

/// The stable range of a number around `start`, between bounds that may be infinite. `at` gives the
/// loop for a value. A bound of zero is reached in steps relative to the value.
///
/// # Errors
/// Those of `at`; [`Error::Argument`] where the loop is not stable at `start`, or an end is neither
/// found nor ruled out; [`Error::Interrupted`].
pub fn held_range(
    at: &mut dyn FnMut(f64) -> Result<LinearLoop, Error>,
    number: Number,
    start: f64,
    (low, high): (f64, f64),
    task: &Task,
) -> Result<(f64, f64), Error> {
    if number == Number::Other && is_idle(at, start)? {
        return Ok((low, high));
    }
    let keeps_sign = number != Number::Delay && (low == 0.0 || high == 0.0) && start != 0.0;
    let mut search = Search {
        at,
        number,
        start,
        keeps_sign,
        task,
    };
    Ok((search.end(low)?, search.end(high)?))
}

/// Do the poles not depend on the number?
fn is_idle(
    at: &mut dyn FnMut(f64) -> Result<LinearLoop, Error>,
    start: f64,
) -> Result<bool, Error> {
    let here = at(start)?;
    let size = if start == 0.0 { 1.0 } else { start.abs() };
    for part in CHANGES {
        if !at(start + part * size)?.has_poles_of(&here) {
            return Ok(false);
        }
    }
    Ok(true)
}

/// The first loss of stability of a loop as its delay alone goes from one to another, or `None`.
///
/// # Errors
/// As for [`held_range`].
pub(super) fn loss_of_delay(
    held: HeldLoop<'_>,
    (from, to): (f64, f64),
    task: &Task,
) -> Result<Option<f64>, Error> {
    let mut at = |delay: f64| Ok(held.with_delay(delay));
    let mut search = Search {
        at: &mut at,
        number: Number::Delay,
        start: from,
        keeps_sign: false,
        task,
    };
    let end = search.end(to)?;
    Ok((end != to).then_some(end))
}

impl Search<'_> {
    /// The first loss of stability towards `bound`, or `bound`.
    fn end(&mut self, bound: f64) -> Result<f64, Error> {
        if bound == self.start {
            return Ok(bound);
        }
        let sign = (bound - self.start).signum();
        let mut here = self.look(self.start)?;
        refuse_if!(
            here.is_stable != Some(true),
            "the loop is not stable at {}, to working precision",
            self.start
        );
        let last = self.last(bound)?;
        let (mut share, mut room) = (1.0, here.room(None));
        for _ in 0..STEPS {
            if here.value == last {
                return self.at_last(bound, last);
            }
            if here.is_continuous && sign < 0.0 {
                return Ok(bound);
            }
            let turn = (SHARE * share * room).clamp(LEAST, MOST);
            let step = (turn * here.unit).min(here.longest);
            let next = self.next(&here, sign * step, last);
            let there = self.look(next)?;
            match there.is_stable {
                Some(true) => {}
                Some(false) => return self.loss(here.value, next),
                None => return self.past(here.value, next),
            }
            if there.distance < KEPT * here.distance && turn > LEAST && !here.jumps.contains(&next)
            {
                share *= SHORTER;
            } else {
                room = there.room(Some((&here, step / here.unit)));
                here = there;
                share = (2.0 * share).min(1.0);
            }
        }
        refuse!(
            "no loss of stability was met from {} to {} in {STEPS} steps, and none beyond is ruled \
             out: look at single values with is_stable()",
            self.start,
            here.value
        )
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
            Number::SampleTime => HeldLoop::new(&(self.at)(self.start)?)?.slowest(),
            Number::Delay | Number::Other => 0.0,
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
            "the loop is stable from {} to {last}, and nothing beyond is ruled out",
            self.start
        );
        Ok(bound)
    }

    /// The distance to a loss of stability, without an upper limit that matters.
    fn distance(&mut self, value: f64) -> Result<f64, Error> {
        let made = (self.at)(value)?;
        let held = HeldLoop::new(&made)?;
        let numbers = held.at(held.delay())?;
        let factors = numbers
            .factors((1.0 / FAR, FAR), self.task)?
            .unwrap_or_default();
        let sizes = factors.iter().map(|factor| factor.gain.ln().abs());
        let turns = crossovers(&numbers, self.task)?;
        let whole = held.sample_time() + held.delay();
        let turns = turns.iter().map(|at| at.room(whole));
        Ok(sizes.chain(turns).fold(ALIKE, f64::min))
    }

    fn look(&mut self, value: f64) -> Result<Look, Error> {
        self.task.check()?;
        let made = (self.at)(value)?;
        let held = HeldLoop::new(&made)?;
        let numbers = held.at(held.delay())?;
        let found = crossovers(&numbers, self.task)?;
        let mut fastest = held.fastest_oscillation(DECAYED);
        let period = held.sample_time();
        let whole = period + held.delay();
        let mut places: Vec<(f64, f64)> =
            found.iter().map(|at| (at.omega, at.distance())).collect();
        let factors = numbers.factors(NEAR, self.task)?.unwrap_or_default();
        places.extend(factors.iter().map(|at| (at.omega, at.gain.ln().abs())));
        fastest = places.iter().fold(fastest, |most, place| most.max(place.0));
        let mut distance = 1.0f64;
        let mut rooms = Vec::with_capacity(places.len());
        for (omega, size) in &places {
            // The turn of a slow crossover is small beside that of the fastest, or of one.
            let slow = match self.number {
                Number::Delay => fastest / omega,
                Number::SampleTime | Number::Other => 1.0 / (omega * whole),
            };
            distance = distance.min(*size);
            rooms.push(size * slow.max(1.0));
        }
        let is_abrupt = held.is_direct() || held.fastest() * period > ABRUPT;
        let usual = if self.start == 0.0 {
            period
        } else {
            self.start.abs()
        };
        let size = if self.keeps_sign {
            value.abs()
        } else {
            value.abs().max(FLOOR * usual)
        };
        Ok(Look {
            value,
            is_stable: is_stable(&numbers, &found, self.task)?,
            distance,
            rooms,
            is_continuous: self.number == Number::SampleTime
                && !held.is_direct()
                && (held.fastest() + fastest) * period < CONTINUOUS * distance,
            unit: match self.number {
                Number::Delay => 1.0 / fastest,
                _ => size / (1.0 + fastest * whole + held.fastest_meeting(DECAYED)),
            },
            longest: if is_abrupt && self.number == Number::Delay {
                period / PARTS
            } else {
                f64::INFINITY
            },
            jumps: if is_abrupt {
                self.jumps(held.delay(), period)
            } else {
                Vec::new()
            },
        })
    }

    /// Values next to the present one with a whole number of samples in the delay, and just before
    /// or after.
    fn jumps(&self, delay: f64, period: f64) -> Vec<f64> {
        let samples = (delay / period).round();
        let near = [samples - 1.0, samples, samples + 1.0];
        let near = near.into_iter();
        match self.number {
            Number::Delay => near
                .filter(|k| *k >= 0.0)
                .flat_map(|k| [k * period, k * period * (1.0 - JUMP)])
                .collect(),
            Number::SampleTime => near
                .filter(|k| *k >= 1.0 && *k <= MOST_JUMPS && delay > 0.0)
                .flat_map(|k| [delay / k, delay / k * (1.0 + JUMP)])
                .collect(),
            Number::Other => Vec::new(),
        }
    }

    /// The next value: a step ahead, not beyond a jump or the last value.
    fn next(&self, here: &Look, step: f64, last: f64) -> f64 {
        let stops = here.jumps.iter().copied().chain([last]);
        let ahead = stops.filter(|stop| (stop - here.value) * step > 0.0);
        let way = |stop: &f64| (stop - here.value).abs();
        match ahead.min_by(|p, q| way(p).total_cmp(&way(q))) {
            Some(stop) if way(&stop) <= step.abs() => stop,
            _ => here.value + step,
        }
    }

    /// The loss of stability next to a value at which rounding decides, if there is one.
    fn past(&mut self, stable: f64, hidden: f64) -> Result<f64, Error> {
        for part in BEYOND {
            let value = hidden + part * hidden.abs().copysign(hidden - stable);
            if value * self.start > 0.0 && self.look(value)?.is_stable == Some(false) {
                return self.loss(stable, value);
            }
        }
        refuse!(
            "the loop is stable from {} to {stable}, and at {hidden} a pole is as near to the unit \
             circle as rounding: nothing beyond is ruled out",
            self.start
        )
    }

    /// Where stability is lost between two values.
    fn loss(&mut self, mut stable: f64, unstable: f64) -> Result<f64, Error> {
        let (mut end, mut lost) = (unstable, unstable);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (stable + end);
            let is_last = (end - stable).abs() <= RESOLUTION * middle.abs();
            if is_last || middle == stable || middle == end {
                break;
            }
            self.task.check()?;
            let made = (self.at)(middle)?;
            let held = HeldLoop::new(&made)?;
            let numbers = held.at(held.delay())?;
            match is_stable(&numbers, &crossovers(&numbers, self.task)?, self.task)? {
                Some(true) => stable = middle,
                known => {
                    end = middle;
                    if known == Some(false) {
                        lost = middle;
                    }
                }
            }
        }
        refuse_if!(
            (lost - stable).abs() > HIDDEN * lost.abs().max(FLOOR * self.start.abs()),
            "stability is lost between {stable} and {lost}, and where is beyond double precision"
        );
        // A value that is zero but for rounding is zero.
        let is_zero = end.abs() <= ZERO * self.start.abs();
        Ok(if is_zero { 0.0 } else { end })
    }
}
