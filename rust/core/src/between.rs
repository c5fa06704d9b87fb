//! The minimum of a function of one variable between two ends, by golden section and parabolas.
//!
//! Brent, *Algorithms for Minimization without Derivatives* (1973), ch. 5. It is the minimum where
//! there is one only, kinked or not.

use crate::Error;

/// Root of the rounding of a double: no minimum of a smooth function is known better, relatively.
const ROOT_OF_ROUNDING: f64 = 1.483_239_697_419_132_5e-8;

/// A place and the value there.
type Place = (f64, f64);

/// The place of the minimum of `cost` to `tolerance`, after `evaluations` or a few more at most.
///
/// # Errors
/// Those of `cost`.
pub(crate) fn minimum(
    mut cost: impl FnMut(f64) -> Result<f64, Error>,
    (mut low, mut high): (f64, f64),
    tolerance: f64,
    evaluations: usize,
) -> Result<Place, Error> {
    let golden = 0.5 * (3.0 - 5.0f64.sqrt());
    let first = low + golden * (high - low);
    let mut best = (first, cost(first)?);
    // The second and third best.
    let (mut next, mut last) = (best, best);
    let (mut step, mut before) = (0.0f64, 0.0f64);
    for _ in 1..evaluations {
        let middle = 0.5 * (low + high);
        let least = ROOT_OF_ROUNDING * best.0.abs() + tolerance / 3.0;
        if (best.0 - middle).abs() <= 2.0 * least - 0.5 * (high - low) {
            break;
        }
        let parabola = (before.abs() > least).then(|| vertex(best, next, last));
        let fitting = parabola.filter(|(p, q)| {
            p.abs() < (0.5 * q * before).abs()
                && *p > q * (low - best.0)
                && *p < q * (high - best.0)
        });
        if let Some((p, q)) = fitting {
            (before, step) = (step, p / q);
            let place = best.0 + step;
            if place - low < 2.0 * least || high - place < 2.0 * least {
                step = least * sign(middle - best.0);
            }
        } else {
            before = if best.0 >= middle { low } else { high } - best.0;
            step = golden * before;
        }
        let place = best.0 + sign(step) * step.abs().max(least);
        let found = (place, cost(place)?);
        let (above, is_better) = (place >= best.0, found.1 <= best.1);
        let end = if is_better { best.0 } else { place };
        if above == is_better {
            low = end;
        } else {
            high = end;
        }
        if is_better {
            (last, next, best) = (next, best, found);
        } else if found.1 <= next.1 || next.0 == best.0 {
            (last, next) = (next, found);
        } else if found.1 <= last.1 || last.0 == best.0 || last.0 == next.0 {
            last = found;
        }
    }
    Ok(best)
}

/// p and q > 0: the vertex of the parabola through three places is p/q beyond the first.
fn vertex(best: Place, next: Place, last: Place) -> (f64, f64) {
    let r = (best.0 - next.0) * (best.1 - last.1);
    let q = (best.0 - last.0) * (best.1 - next.1);
    let p = (best.0 - last.0) * q - (best.0 - next.0) * r;
    let q = 2.0 * (q - r);
    (if q > 0.0 { -p } else { p }, q.abs())
}

/// The sign, one of zero.
fn sign(x: f64) -> f64 {
    if x < 0.0 { -1.0 } else { 1.0 }
}

/// Most steps of a search for a zero: bisection alone needs fewer to separate any two doubles.
const MOST_STEPS: usize = 2200;

/// The zero, to `tolerance`, of a function between two places where its signs differ.
///
/// By inverse quadratic interpolation where that is safe, and bisection elsewhere: T. R. Chandrupatla,
/// Advances in Engineering Software 28 (1997).
///
/// # Errors
/// Those of `function`.
pub(crate) fn zero(
    mut function: impl FnMut(f64) -> Result<f64, Error>,
    low: Place,
    high: Place,
    tolerance: f64,
) -> Result<f64, Error> {
    let (mut newest, mut other) = (low, high);
    let mut share = 0.5;
    for _ in 0..MOST_STEPS {
        let place = newest.0 + share * (other.0 - newest.0);
        let found = (place, function(place)?);
        let is_same_side = (found.1 > 0.0) == (newest.1 > 0.0);
        let last = if is_same_side { newest } else { other };
        if !is_same_side {
            other = newest;
        }
        newest = found;
        let best = if newest.1.abs() < other.1.abs() {
            newest
        } else {
            other
        };
        let width = other.0 - newest.0;
        let least = (2.0 * f64::EPSILON).mul_add(best.0.abs(), 0.5 * tolerance) / width.abs();
        if best.1 == 0.0 || least.is_nan() || least > 0.5 {
            return Ok(best.0);
        }
        share = interpolated(newest, other, last).clamp(least, 1.0 - least);
    }
    Ok(newest.0)
}

/// The share of the way from the newest place to the other one at which the zero is guessed.
fn interpolated(newest: Place, other: Place, last: Place) -> f64 {
    let ((a, fa), (b, fb), (c, fc)) = (newest, other, last);
    let (xi, phi) = ((a - b) / (c - b), (fa - fb) / (fc - fb));
    if phi * phi < xi && (1.0 - phi) * (1.0 - phi) < 1.0 - xi {
        fa / (fb - fa) * fc / (fb - fc) + (c - a) / (b - a) * fa / (fc - fa) * fb / (fc - fb)
    } else {
        0.5
    }
}
