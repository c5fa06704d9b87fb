//! The poles of a loop with a hold outside the unit circle, by work that its delay does not enlarge.
//!
//! On the circle h = a − e^(−s d) b, d = (m + 1) Ts, and w = e^(−s d) b/a. Between two neighbouring gain
//! crossovers |w| keeps to one side of 1, so that the argument of one of
//!     h = a (1 − w)    or    h = −e^(−s d) b (1 − 1/w)
//! grows by that of a, or of b less d times the way in ω, and by the change of the principal argument
//! of the bracket, whose real part is positive. The arguments of a and b are followed by Taylor's
//! formula: with r the distance to the ends of a stretch and Σ |p⁽ᵏ⁾(m)| rᵏ/k! < |p(m)| from k = 1 on, p
//! stays within a right angle of p(m). Neither polynomial knows the delay. From ω = 0 to π/Ts the
//! argument of h grows by a multiple of π, and the poles outside number n less that multiple
//! (`stability::crossings::held`).
//!
//! Where w is as close to 1 at a crossover as rounding, or the sum is not close to a multiple of π,
//! nothing is known.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use num_complex::Complex64;

use super::gain_crossovers::Crossover;
use crate::elementary::angle;
use crate::quasipoly::modulus;
use crate::stability::HeldNumbers;
use crate::{Error, Task};

/// Halvings of a stretch before a zero of the polynomial counts as on the circle, and before one is
/// passed there: the latter leave enough of its value beside rounding for its argument.
const HALVINGS: u32 = 200;
const PASSED: u32 = 36;

/// Upper limit on the stretches between two crossovers.
const STRETCHES: u32 = 100_000;

/// Distance of w from 1 at the ends of the circle, above the rounding of a few sums.
const APART: f64 = 1e-12;

/// Largest distance of the sum of arguments from a multiple of π, in units of π: a larger one trusts
/// longer sums.
const OFF: f64 = 1e-3;

/// Covers rounding in the comparison of sums of moduli.
const ROOM: f64 = 1.0 + 1e-9;

/// Most samples in the delay for which the poles are counted one turn after the other where their
/// number is not known otherwise: a larger one decides closer to the circle and takes longer.
const SAMPLES: f64 = 1e5;

/// Are all poles inside? `None` where rounding decides.
///
/// # Errors
/// [`Error::Interrupted`] alone.
pub(super) fn is_stable(
    numbers: &HeldNumbers,
    crossovers: &[Crossover],
    task: &Task,
) -> Result<Option<bool>, Error> {
    match unstable_poles(numbers, crossovers) {
        Some(count) => Ok(Some(count == 0)),
        None if numbers.delay() > SAMPLES * numbers.sample_time() => Ok(None),
        None => numbers.is_stable(task),
    }
}

/// The number of poles outside, from all gain crossovers; `None` where rounding decides.
pub(super) fn unstable_poles(numbers: &HeldNumbers, crossovers: &[Crossover]) -> Option<i32> {
    let (a, b) = numbers.polynomials();
    let ends = [0.0, PI / numbers.sample_time()];
    let apart = |omega: f64, distance: f64| {
        let (of_a, of_b) = numbers.parts(omega);
        let size = modulus(of_a) + modulus(of_b);
        modulus(of_a - of_b) > (APART + distance) * size
    };
    if !ends.iter().all(|end| apart(*end, numbers.errors()))
        || !crossovers.iter().all(|at| apart(at.omega, at.error))
    {
        return None;
    }
    let places = crossovers.iter().map(|at| at.omega);
    let places: Vec<f64> = [ends[0]]
        .into_iter()
        .chain(places)
        .chain([ends[1]])
        .collect();
    let mut sum = 0.0;
    for pair in places.windows(2) {
        let &[low, high] = pair else { continue };
        if high > low {
            sum += growth(numbers, (a, b), low, high)?;
        }
    }
    let turns = (sum / PI).round();
    let count = a.len() as f64 - 1.0 - turns;
    let is_sure = (sum / PI - turns).abs() <= OFF && (0.0..=f64::from(i32::MAX)).contains(&count);
    is_sure.then_some(count as i32)
}

/// The growth of the argument of h between two frequencies with no crossover between them.
fn growth(numbers: &HeldNumbers, (a, b): (&[f64], &[f64]), low: f64, high: f64) -> Option<f64> {
    let (of_a, of_b) = numbers.parts(0.5 * (low + high));
    let is_small = modulus(of_b) < modulus(of_a);
    // 1 − w or 1 − 1/w.
    let bracket = |omega: f64| {
        let (of_a, of_b) = numbers.parts(omega);
        let rest = if is_small {
            1.0 - of_b / of_a
        } else {
            1.0 - of_a / of_b
        };
        angle(rest.im, rest.re)
    };
    let leading = if is_small { a } else { b };
    let own = turned(numbers, leading, low, high, false)?;
    let delayed = if is_small {
        0.0
    } else {
        numbers.delay() * (high - low)
    };
    Some(own - delayed + bracket(high) - bracket(low))
}

/// The growth of the argument of a polynomial in σ between two frequencies. Where it has a zero on
/// the circle that is `None`, or half a turn, as past one just inside, if it `passes`.
pub(super) fn turned(
    numbers: &HeldNumbers,
    p: &[f64],
    low: f64,
    high: f64,
    passes: bool,
) -> Option<f64> {
    let at = |omega: f64| shifted(p, numbers.variable(omega));
    let value = |omega: f64| at(omega).first().copied().unwrap_or_default();
    let mut open = vec![(low, high, 0)];
    let mut sum = 0.0;
    for _ in 0..STRETCHES {
        let Some((from, to, halvings)) = open.pop() else {
            return Some(sum);
        };
        let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
        let terms = at(middle);
        // |dσ/dω| = 1 on the circle.
        let change = terms
            .iter()
            .skip(1)
            .rev()
            .fold(0.0, |sum, c| (sum + modulus(*c)) * half);
        let here = terms.first().copied().unwrap_or_default();
        if change * ROOM < modulus(here) {
            let change = [to, from].map(|omega| {
                let ratio = value(omega) * here.conj();
                angle(ratio.im, ratio.re)
            });
            sum += change[0] - change[1];
        } else if passes && halvings >= PASSED {
            let ratio = value(to) * value(from).conj();
            let change = angle(ratio.im, ratio.re);
            sum += if change < -FRAC_PI_2 {
                change + TAU
            } else {
                change
            };
        } else if halvings < HALVINGS {
            open.push((middle, to, halvings + 1));
            open.push((from, middle, halvings + 1));
        } else {
            return None;
        }
    }
    None
}

/// The coefficients of p(σ₀ + x) in ascending powers of x, by Horner's rule.
fn shifted(p: &[f64], sigma: Complex64) -> Vec<Complex64> {
    let mut found: Vec<Complex64> = p.iter().map(|c| Complex64::new(*c, 0.0)).collect();
    for start in 0..found.len() {
        let mut carry = Complex64::ZERO;
        for entry in found.iter_mut().skip(start).rev() {
            *entry += carry * sigma;
            carry = *entry;
        }
    }
    found
}
