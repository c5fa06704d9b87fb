//! The change of arg h down a vertical line, in long steps while one row exceeds all the others
//! together.
//!
//! Where |p_c| > Σ_{j≠c} |p_j| e^(−x d_j), g = h e^(s τ_c) = p_c (1 + ζ) with |ζ| < 1: arg g
//! follows arg p_c, up to the principal argument of g/p_c at the two ends. The arguments of the
//! exponentials do not enter this condition, only their moduli and the polynomials. The steps
//! therefore grow with the height and are not limited by 2π/d. From s down to s − i t, with v =
//! p(s), w = p′(s) and C = P″(|s|), P having the moduli of the coefficients,
//!     |p| ≥ |v| − t Re(i w v̄)/|v| − C t²/2   and   |p| ≤ |v| − t Re(i w v̄)/|v| + (|w|²/|v| + C) t²/2,
//! so the condition holds while a quadratic A + B t − K t² is positive; and while
//! |w| t + C t²/2 < |v|, p_c stays in one half plane.

use num_complex::Complex64;

use super::turn::Turn;
use super::winding::{STEP_ERROR, Walker, angle_error, is_clear};
use crate::elementary::{angle, exp_above};
use crate::quasipoly::modulus;

/// Share of the proved step length that is used; the rest covers rounding errors.
const SHARE: f64 = 0.9;

/// Shortest step, in radians of the fastest exponential, for which this method costs less than the
/// steps of `winding`.
const WORTH: f64 = 6.0;

/// Rounding error of a polynomial, relative to the sum of its moduli and for each coefficient.
const ROUNDING: f64 = 1e-14;

const MAX_STEPS: usize = 100_000;

/// A row whose value is below this share of its slope times the height is bounded by its slope.
const SMALL_VALUE: f64 = 0.1;

/// Covers the rounding errors of weights and of sums of moduli.
const ENLARGED: f64 = 1.0 + 1e-9;

/// A polynomial at a point: value, slope, and the same sums with moduli, up to the second
/// derivative.
struct Row {
    value: Complex64,
    slope: Complex64,
    rounding: f64,
    slope_rounding: f64,
    bend: f64,
}

impl Row {
    fn at(row: &[f64], s: Complex64) -> Self {
        let size = modulus(s);
        let (mut value, mut slope) = (Complex64::ZERO, Complex64::ZERO);
        let (mut p, mut dp, mut ddp) = (0.0, 0.0, 0.0);
        for c in row.iter().rev() {
            slope = slope * s + value;
            value = value * s + c;
            ddp = ddp * size + dp;
            dp = dp * size + p;
            p = p * size + c.abs();
        }
        let rounding = ROUNDING * row.len() as f64;
        Self {
            value,
            slope,
            rounding: rounding * p,
            slope_rounding: 2.0 * rounding * dp,
            bend: 2.0 * ddp * ENLARGED,
        }
    }

    /// Derivative of the modulus in the downward direction.
    fn lean(&self) -> f64 {
        -(Complex64::I * self.slope * self.value.conj()).re / modulus(self.value)
    }
}

/// From `from`, Im > 0, go down as long as row `leader` is proved to dominate in steps of
/// sufficient length. Returns the point reached and the change of arg h on the way; the point may
/// be `from` itself.
pub(crate) fn descend(
    walker: &mut Walker<'_>,
    leader: usize,
    from: Complex64,
) -> (Complex64, Turn) {
    let nowhere = (from, Turn::default());
    let h = walker.probe.function();
    let Some(own_delay) = h.delays().get(leader).copied() else {
        return nowhere;
    };
    let weights: Vec<f64> = h
        .delays()
        .iter()
        .map(|delay| exp_above(-(delay - own_delay) * from.re) * ENLARGED)
        // A weight that underflows to zero is replaced by a positive number, because the term is
        // not zero.
        .map(|weight| weight.max(f64::MIN_POSITIVE))
        .collect();
    let span = h
        .delays()
        .iter()
        .map(|delay| (delay - own_delay).abs())
        .fold(0.0, f64::max);
    let mut here = from;
    let mut turned = 0.0;
    let mut slack = 0.0;
    let mut first: Option<Complex64> = None;
    let mut last = Complex64::ZERO;
    for _ in 0..MAX_STEPS {
        let rows: Vec<Row> = h.terms().map(|(row, _)| Row::at(row, here)).collect();
        let Some(own) = rows.get(leader) else {
            return nowhere;
        };
        let size = modulus(own.value);
        if first.is_some() {
            let ratio = own.value * last.conj() / (modulus(last) * size);
            turned += angle(ratio.im, ratio.re);
            slack += STEP_ERROR + f64::EPSILON * turned.abs();
        } else {
            first = Some(own.value);
            slack += angle_error(own.rounding, size);
        }
        last = own.value;
        let step = step(&rows, leader, &weights, here.im).min(here.im);
        if step * span < WORTH {
            slack += angle_error(own.rounding, size);
            break;
        }
        here.im -= step;
    }
    let Some(first) = first.filter(|_| here != from) else {
        return nowhere;
    };
    walker.probe.refer_to(leader);
    let (top, bottom) = (walker.jet(from), walker.jet(here));
    if !(is_clear(&top) && is_clear(&bottom) && turned.is_finite()) {
        return nowhere;
    }
    let excess = |value: Complex64, leading: Complex64| {
        let ratio = (value / modulus(value)) * (leading / modulus(leading)).conj();
        angle(ratio.im, ratio.re)
    };
    turned += excess(bottom.value, last) - excess(top.value, first);
    turned -= own_delay * (here.im - from.im);
    slack += angle_error(top.value_error, modulus(top.value))
        + angle_error(bottom.value_error, modulus(bottom.value))
        + STEP_ERROR * (4.0 + own_delay * (from.im + here.im));
    let angle = turned;
    (here, Turn { angle, slack })
}

/// How far down the leader is proved to dominate and to stay in one half plane; NaN or 0 where
/// nothing is proved.
fn step(rows: &[Row], leader: usize, weights: &[f64], height: f64) -> f64 {
    let (mut a, mut b, mut k) = (0.0, 0.0, 0.0);
    let mut half_plane = 0.0;
    for (index, (row, weight)) in rows.iter().zip(weights).enumerate() {
        let size = modulus(row.value);
        let slope = modulus(row.slope);
        if index == leader {
            a += size - row.rounding;
            b += row.lean() - row.slope_rounding;
            k += 0.5 * row.bend;
            let margin = SHARE * size - row.rounding;
            let slope = slope + row.slope_rounding;
            half_plane = 2.0 * margin / (slope + (slope * slope + 2.0 * row.bend * margin).sqrt());
        } else {
            a -= weight * (size + row.rounding);
            k += 0.5 * weight * row.bend;
            if size > SMALL_VALUE * slope * height {
                b -= weight * (row.lean() + row.slope_rounding);
                k += 0.5 * weight * slope * slope / size;
            } else {
                b -= weight * (slope + row.slope_rounding);
            }
        }
    }
    if !(a > 0.0 && half_plane > 0.0) {
        return 0.0;
    }
    // The positive root of a + b t − k t², without cancellation.
    let root = (b * b + 4.0 * a * k).sqrt();
    let most = if b >= 0.0 {
        (b + root) / (2.0 * k)
    } else {
        2.0 * a / (root - b)
    };
    let most = if most.is_nan() { 0.0 } else { most };
    SHARE * most.min(half_plane)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quasipoly::make;
    use crate::{Error, Task};

    /// Both methods give the same angle, and the long steps need fewer evaluations.
    fn compare(rows: &[&[f64]], delays: &[f64], from: Complex64) -> Result<f64, Error> {
        let h = make(rows, delays);
        let task = Task::new();
        let mut walker = Walker::new(&h, &task);
        let (place, long) = descend(&mut walker, 0, from);
        let short = Walker::new(&h, &task).walk(from, place)?;
        assert!((long.angle - short.angle).abs() <= 1e-9 + long.slack + short.slack);
        Ok(place.im)
    }

    #[test]
    fn the_angle_is_that_of_the_walk() -> Result<(), Error> {
        let from = Complex64::new(-1.0, 500.0);
        assert!(compare(&[&[0.0, 1.0], &[2.0]], &[0.0, 1.0], from)? < 20.0);
        assert!(compare(&[&[0.0, 1.0], &[2.0, 0.3]], &[0.0, 1.0], from)? < 40.0);
        let rows: &[&[f64]] = &[
            &[2.0, 5.0, 0.0, 0.2, 1.0],
            &[0.0, -2.0, 0.0, 0.0, 0.5],
            &[3.0],
        ];
        let place = compare(rows, &[0.0, 1.5, 6.3], Complex64::new(-0.3, 900.0))?;
        assert!(place < 100.0, "{place}");
        // Nothing dominates left of the chain.
        let chain = Complex64::new(-2.0, 500.0);
        let place = compare(&[&[0.0, 1.0], &[2.0, 0.3]], &[0.0, 1.0], chain)?;
        assert_eq!(place, 500.0);
        Ok(())
    }
}
