//! The stable range of a gain of a loop with a hold: its feedback is affine in the gain, so the range
//! ends at the next of all its crossings, which are proved.

use super::gain_crossovers::{FAR, is_zero};
use crate::dde::LinearLoop;
use crate::stability::HeldLoop;
use crate::{Error, Task};

/// First range of gains, relative to the value, and the factor by which it grows to [`FAR`].
const RANGE: f64 = 4.0;
const WIDER: f64 = 32.0;

/// Relative width of the interval of a crossing, from which on it is made shorter by the discs of
/// the poles: a smaller one gives more digits and takes longer.
const SHARP: f64 = 1e-9;

/// Largest relative error of such a crossing.
const BLURRED: f64 = 0.1;

/// The stable range of a gain around `value`, between `bounds`: `constant` is the loop without it,
/// and the feedback of `slope` is its factor.
///
/// # Errors
/// [`Error::Argument`] where an end is beyond double precision; [`Error::Interrupted`].
pub fn gain_range_held(
    constant: &LinearLoop,
    slope: &LinearLoop,
    value: f64,
    bounds: (f64, f64),
    task: &Task,
) -> Result<(f64, f64), Error> {
    let held = HeldLoop::new(constant)?;
    let size = if value == 0.0 { 1.0 } else { value.abs() };
    let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
    let mut sharp = [true; 2];
    let mut reach = RANGE * size;
    while reach < FAR * size && (low.is_infinite() || high.is_infinite()) {
        let Some(found) = held.gain_crossings(slope, (-reach, reach), task)? else {
            refuse!(
                "double precision cannot determine at which gains up to {reach:e} a pole of this \
                 sampled loop is on the unit circle. A pole and a zero of its loop gain may \
                 cancel there"
            );
        };
        for at in found {
            let gain = if is_zero(&at, size) { 0.0 } else { at.gain };
            let is_sharp = at.high - at.low <= SHARP * gain.abs();
            if gain <= value && gain >= low {
                (low, sharp[0]) = (gain, is_sharp);
            }
            if gain >= value && gain <= high {
                (high, sharp[1]) = (gain, is_sharp);
            }
        }
        reach *= WIDER;
    }
    for (end, is_sharp) in [&mut low, &mut high].into_iter().zip(sharp) {
        if !is_sharp && *end != 0.0 && *end != value {
            *end = sharper(constant, slope, *end, value, task)?;
        }
    }
    Ok((low.max(bounds.0), high.min(bounds.1)))
}

/// Where a gain loses stability by the discs of the poles, next to a crossing towards `value`; the
/// crossing where they do not decide.
fn sharper(
    constant: &LinearLoop,
    slope: &LinearLoop,
    crossing: f64,
    value: f64,
    task: &Task,
) -> Result<f64, Error> {
    let (own, factor) = (constant.equations(), slope.equations());
    let known = |gain: f64| -> Result<Option<bool>, Error> {
        task.check()?;
        let k = own
            .k
            .iter()
            .zip(&factor.k)
            .map(|(k, slope)| k + gain * slope);
        let feedback = (k.collect(), own.l + gain * factor.l);
        let made = constant.clone().with_feedback(feedback.0, feedback.1);
        match HeldLoop::new(&made)?.are_inside() {
            Err(error) if error.ends_all() => Err(error),
            found => Ok(found.unwrap_or(None)),
        }
    };
    let mut step = SHARP * crossing.abs().copysign(value - crossing);
    let (mut stable, mut end) = loop {
        let around = (crossing + step, crossing - step);
        if known(around.0)? == Some(true) && known(around.1)? == Some(false) {
            break around;
        }
        step *= 10.0;
        if step.abs() > BLURRED * crossing.abs() {
            return Ok(crossing);
        }
    };
    while (end - stable).abs() > SHARP * end.abs() {
        let middle = 0.5 * (stable + end);
        if known(middle)? == Some(true) {
            stable = middle;
        } else {
            end = middle;
        }
    }
    Ok(end)
}
