//! The change of arg det M along a line.
//!
//! The reaches of two neighbouring points meet at a point between them (`local_enclosure`): the
//! true change of arg det M is that expected from both, up to less than 2.5, and computed arguments
//! are wrong by 0.1 at most. So the difference of the computed ones that is next to the expected
//! change is the true one up to their errors, which cancel in the sum but at the two ends of the
//! line.

use num_complex::Complex64;

use super::local_enclosure::{LocalEnclosure, Reach};
use super::walker::{LEAST_SIZE, MatrixWalker, ON_LINE, RESOLUTION};
use crate::Error;
use crate::quasipoly::modulus;
use crate::roots::counting::{Turn, Walk};

use std::f64::consts::{PI, TAU};

/// Upper limit on the hints kept of one line; the first ones are kept.
const MAX_HINTS: usize = 1000;

/// Error of the arithmetic of one step, relative to the angles that occur in it.
const STEP_ERROR: f64 = 16.0 * f64::EPSILON;

/// Summands of the error of a step, apart from one for each row.
const OTHER_SUMMANDS: f64 = 8.0;

/// Covers the rounding error of the length of a step.
const ENLARGED: f64 = 1.0 + 1e-12;

/// Covers the rounding errors of two reaches, which have to overlap.
const OVERLAP: f64 = 1.0 + 1e-9;

/// Points next to a root that are tried before a line counts as blocked.
const MOST_UNCLEAR: u32 = 5;

/// Longest step that is tried, relative to the reach of its first point.
const STRETCH: f64 = 1.9;

/// Upper limit on the distances at which a line is proved to be free of roots.
const MAX_ASIDE: usize = 40;

/// First of these distances, as a multiple of Newton's step, because the root is about that far
/// away. Larger: the advice moves a line farther than it has to; smaller: more attempts.
const BEYOND_ROOT: f64 = 2.0;

/// Factor from one of these distances to the next. Larger: fewer attempts, advice to move a line
/// farther; smaller: the reverse.
const ASIDE_GROWTH: f64 = 4.0;

/// Upper limit on the lengths tried for one step.
const MAX_STEP_ATTEMPTS: usize = 60;

/// Factors on the length of steps after one that was proved and one that was not, and its least
/// value.
const STRETCHES: (f64, f64, f64) = (1.05, 0.9, 1.2);

/// Factor on the reach for a step that could not be proved.
const SHORTENED: f64 = 0.999;

/// Upper limit on the points kept that are too far ahead (bounds memory).
const MOST_AHEAD: usize = 64;

impl MatrixWalker<'_> {
    /// The error for a line that cannot be proved to be free of roots at `place`.
    fn blocked(&mut self, place: Complex64) -> Result<Error, Error> {
        let mut distance = RESOLUTION * modulus(place).max(LEAST_SIZE * self.system.rate());
        // The point itself may be free of roots, and the root as far away as Newton's step leads.
        if let Some(here) = self.tried(place, ON_LINE) {
            let correction = modulus(here.correction);
            if correction.is_finite() {
                distance = distance.max(BEYOND_ROOT * correction);
            }
        }
        for _ in 0..MAX_ASIDE {
            let mut clear = true;
            for step in [Complex64::ONE, -Complex64::ONE, Complex64::I] {
                clear &= self.enclosure(place + step * distance)?.is_some();
            }
            if clear {
                break;
            }
            distance *= ASIDE_GROWTH;
        }
        Ok(Error::Contour { place, distance })
    }

    /// The next point, with the distance from `here` of the point where both reaches meet.
    ///
    /// Points that turn out to be too far away are kept in `ahead`, the nearest one last.
    fn step(
        &mut self,
        here: &LocalEnclosure,
        (to, along): (Complex64, Complex64),
        (stretch, ahead): (&mut f64, &mut Vec<LocalEnclosure>),
    ) -> Result<(LocalEnclosure, Meeting), Error> {
        let rest = (to - here.s).re.abs() + (to - here.s).im.abs();
        let reach = here.reach(along, rest);
        let mut length = *stretch * reach.length;
        if let Some(next) = ahead.pop() {
            match Meeting::of(here, reach, &next, along) {
                Ok(meeting) => return Ok((next, meeting)),
                Err(middle) => length = middle,
            }
            ahead.push(next);
        } else if reach.length >= rest {
            length = rest;
        }
        let mut unclear = 0;
        for attempt in 0..MAX_STEP_ATTEMPTS {
            let place = if length >= rest {
                to
            } else {
                here.s + along * length
            };
            if place == here.s {
                break;
            }
            let Some(next) = self.enclosure(place)? else {
                // Points that are free of roots exist at any distance from a root, with shorter and
                // shorter reaches.
                unclear += 1;
                if unclear > MOST_UNCLEAR {
                    break;
                }
                length *= 0.5;
                continue;
            };
            match Meeting::of(here, reach, &next, along) {
                Ok(meeting) => {
                    if attempt == 0 {
                        *stretch = (STRETCHES.0 * *stretch).min(STRETCH);
                    }
                    return Ok((next, meeting));
                }
                Err(middle) => {
                    *stretch = (STRETCHES.1 * *stretch).max(STRETCHES.2);
                    length = if attempt == 0 {
                        middle
                    } else {
                        (SHORTENED * reach.length).max(0.5 * length.min(reach.length))
                    };
                    if ahead.len() < MOST_AHEAD {
                        ahead.push(next);
                    }
                }
            }
        }
        Err(self.blocked(here.s)?)
    }
}

impl Walk for MatrixWalker<'_> {
    fn walk(&mut self, from: Complex64, to: Complex64) -> Result<Turn, Error> {
        let whole = modulus(to - from);
        if whole == 0.0 {
            return Ok(Turn::default());
        }
        let along = (to - from) / ((to - from).re.abs() + (to - from).im.abs());
        let known = self.last.take().filter(|last| last.s == from);
        let first = match known {
            Some(last) => Some(last),
            None => self.enclosure(from)?,
        };
        let Some(mut here) = first else {
            return Err(self.blocked(from)?);
        };
        let mut turn = Turn {
            angle: 0.0,
            slack: here.error,
        };
        let summands = self.system.size() as f64 + OTHER_SUMMANDS;
        let mut stretch = STRETCH;
        let mut known = Vec::new();
        // Newton's corrections at the last two points: a local minimum indicates a root.
        let mut before = (f64::INFINITY, f64::INFINITY);
        while here.s != to {
            let step = self.step(&here, (to, along), (&mut stretch, &mut known))?;
            let (ahead, Meeting { reach, back, gone }) = step;
            let middle = here.s + along * gone;
            let (first, second) = (middle - here.s, middle - ahead.s);
            let expected = here.expected(reach, first) - ahead.expected(back, second);
            let shift = (here.delay - ahead.delay) * middle.im;
            let off = ahead.angle - here.angle - expected + shift;
            let delays = (ahead.delay * second.im, here.delay * first.im);
            turn.angle += expected + principal(off) + delays.0 - delays.1;
            turn.slack += STEP_ERROR
                * summands
                * (1.0 + expected.abs() + shift.abs() + delays.0.abs() + delays.1.abs())
                + f64::EPSILON * turn.angle.abs();
            if here.delay != ahead.delay {
                turn.slack += STEP_ERROR * summands * here.delay.max(ahead.delay) * middle.im.abs();
            }
            let correction = modulus(here.correction);
            if before.1 < before.0 && before.1 < correction && self.hints.len() < MAX_HINTS {
                self.hints.push(here.s - here.correction);
            }
            before = (before.1, correction);
            here = ahead;
        }
        turn.slack += here.error;
        self.last = Some(here);
        Ok(turn)
    }
}

/// How the reaches of two points overlap, and the distance from the first one of a point in both.
struct Meeting {
    reach: Reach,
    back: Reach,
    gone: f64,
}

impl Meeting {
    /// Where the reach of `here` and that of `next` meet; as an error, the middle of the part that
    /// neither covers.
    fn of(
        here: &LocalEnclosure,
        reach: Reach,
        next: &LocalEnclosure,
        along: Complex64,
    ) -> Result<Self, f64> {
        let whole = modulus(next.s - here.s) * ENLARGED;
        let back = next.reach(-along, whole);
        if back.length + reach.length < whole * OVERLAP && reach.length < whole {
            let middle = 0.5 * (whole + reach.length - back.length);
            return Err(middle.min(STRETCH * reach.length));
        }
        // As far from the end of either reach as possible.
        let part = reach.length / (reach.length + back.length);
        let gone = part * whole;
        Ok(Self { reach, back, gone })
    }
}

/// The angle reduced to [−π, π].
fn principal(angle: f64) -> f64 {
    let rest = angle - (angle / TAU).round() * TAU;
    rest.clamp(-PI, PI)
}
