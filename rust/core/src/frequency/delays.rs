//! Values of one delay T of an equation at which roots lie on the imaginary axis.
//!
//! h = A + B e^(−s m T), A and B free of T, has a root jω for some T only where
//!     |A(jω)|² = |B(jω)|², and then for m T ω = arg(−B/A) + 2πn;
//! as T grows the pair goes to the right where d/dω (|A|² − |B|²) > 0, to the left where it is
//! negative, whatever T is (Cooke and van den Driessche 1986; Walton and Marshall 1987). Where T
//! enters as several multiples of one, see `multiples`. No frequency is missed (`zeros`); frequencies
//! and delays carry rounding only, which is not bounded.

use num_complex::Complex64;

use super::bounds::moduli;
use super::equation::Equation;
use super::margins::{gain_crossovers, over};
use super::multiples::crossings_of_multiples;
use super::passage::{Crossing, Passage};
use super::squares::DifferenceOfSquares;
use super::waves::polynomial;
use super::zeros::RealFunction;
use crate::elementary::angle;
use crate::quasipoly::modulus;
use crate::stability::Family;
use crate::{Error, Task};

/// More crossings than anyone can look at.
const MOST: f64 = 1e6;

/// A zero that both parts share is a multiple one of the difference of their squares, and so met to
/// the square or the third root of the rounding only; their quotient means nothing there.
const COMMON: f64 = 1e-4;

/// All crossings as the delay varies from `low` to `high`.
///
/// # Errors
/// [`Error::Argument`] where chains of roots may reach the axis, a root stays on it, or there is no
/// end to the frequencies; [`Error::Interrupted`].
pub(super) fn crossings_of_delay(
    equation: &Equation<'_>,
    (low, high): (f64, f64),
    task: &Task,
) -> Result<Vec<Crossing>, Error> {
    let (lead, rest) = equation.leading(low, high)?;
    refuse_if!(
        lead <= rest,
        "the equation is neutral, and its leading coefficient does not dominate the other \
         coefficients. So chains of infinitely many roots may reach the imaginary axis for some {}",
        equation.name
    );
    let passages = passages(equation, task)?;
    let turns = |passage: &Passage| {
        let from = ((low - passage.first) / passage.period).ceil();
        (
            from,
            ((high - passage.first) / passage.period).floor() - from + 1.0,
        )
    };
    let many: f64 = passages
        .iter()
        .map(|passage| turns(passage).1.max(0.0))
        .sum();
    refuse_if!(
        many > MOST,
        "there are more than {MOST} crossings: give a smaller range of {}",
        equation.name
    );
    let mut found = Vec::with_capacity(many as usize);
    for passage in &passages {
        let (from, many) = turns(passage);
        for turn in 0..many.max(0.0) as u32 {
            let value = passage.first + passage.period * (from + f64::from(turn));
            found.push(Crossing {
                // Adding 0.0 makes a negative zero a positive one.
                value: value.max(low).min(high) + 0.0,
                omega: passage.omega,
                direction: passage.direction,
            });
        }
    }
    Ok(found)
}

/// How much the delay that is the one parameter of `family` can grow from `start` on until the
/// equation is unstable; infinite where it never is, 0 where any growth makes it so.
///
/// # Errors
/// [`Error::Argument`] where the equation is not stable as it is; as [`crossings`](super::crossings).
pub fn delay_margin(family: &Family, start: f64, task: &Task) -> Result<f64, Error> {
    let equation = Equation::new(family)?;
    equation.is_delay()?;
    let name = equation.name;
    refuse_if!(
        equation.slopes().first().is_some_and(|slope| *slope < 0.0),
        "a delay decreases if {name} increases, so the equation has no delay margin"
    );
    refuse_if!(
        !equation.is_stable_at(start, task)?,
        "the equation is not stable at {name}={start}, so it has no delay margin"
    );
    let (_, high) = stable_range_of(&equation, (start, start), task)?;
    Ok(high - start)
}

/// The range of the delay that is the one parameter of `family` around `value`, at which the
/// equation is stable, in which it stays so.
///
/// # Errors
/// As [`crossings`](super::crossings).
pub fn delay_range(family: &Family, value: f64, task: &Task) -> Result<(f64, f64), Error> {
    stable_range_of(&Equation::new(family)?, (0.0, value), task)
}

/// Around `value`, where no delay is less than `least`.
fn stable_range_of(
    equation: &Equation<'_>,
    (least, value): (f64, f64),
    task: &Task,
) -> Result<(f64, f64), Error> {
    let (lead, rest) = equation.leading(least, equation.far_delay(value))?;
    if lead <= rest {
        return Ok((value, value));
    }
    let whole = (0.0, f64::INFINITY);
    Ok(passages(equation, task)?
        .iter()
        .fold(whole, |range, passage| {
            let (low, high) = passage.around(value);
            (range.0.max(low), range.1.min(high))
        }))
}

/// All frequencies at which roots cross as the delay varies.
fn passages(equation: &Equation<'_>, task: &Task) -> Result<Vec<Passage>, Error> {
    let (name, slopes) = (equation.name, equation.slopes());
    let parts: Result<Vec<_>, Error> = slopes
        .iter()
        .map(|slope| equation.with_slope(*slope))
        .collect();
    let parts = parts?;
    let [early, late, ..] = slopes[..] else {
        return Ok(Vec::new());
    };
    let at_zero = parts.iter().flat_map(|part| part.coefficients().iter());
    refuse_if!(
        at_zero.filter_map(|row| row.first()).sum::<f64>() == 0.0,
        "a root stays at s = 0 for all values of {name}: divide the equation by s"
    );
    let [a, b] = &parts[..] else {
        let multiples: Vec<f64> = slopes.iter().map(|slope| slope - early).collect();
        return crossings_of_multiples(&parts, &multiples, name, task);
    };
    let (frequencies, searched) = gain_crossovers(b, a, task)?;
    refuse_if!(
        searched < f64::INFINITY,
        "at high frequencies, neither the terms with {name} nor the terms without {name} dominate \
         the others, so roots may cross at infinitely many frequencies"
    );
    let mut difference = DifferenceOfSquares::new(a, b);
    let sizes = moduli(a);
    let mut found = Vec::with_capacity(frequencies.len());
    for omega in frequencies {
        let direction = direction_at(&mut difference, omega);
        let size = modulus(a.value(Complex64::new(0.0, omega)));
        if direction == 0 && size <= COMMON * polynomial(&sizes, omega) {
            // Six digits are what is known of a multiple zero.
            let omega = format!("{omega:.5e}").parse().unwrap_or(omega);
            refuse!(
                "a root stays at omega = {omega} rad/s for all values of {name}: divide the \
                 equation by the common factor of its terms"
            );
        }
        let quotient = over(b, a, omega);
        let turn = angle(-quotient.im, -quotient.re);
        found.push(Passage::new(omega, turn, late - early, direction));
    }
    Ok(found)
}

/// 2 or −2 where the slope keeps its sign as far as rounding may hide the zero, else 0.
fn direction_at(difference: &mut DifferenceOfSquares<'_>, omega: f64) -> i32 {
    let here = difference.taylor(omega);
    let (value, slope) = (here.values[0].abs() + here.errors[0], here.values[1]);
    let hidden = (2.0 * value / slope.abs().max(f64::MIN_POSITIVE)).min(omega);
    let change = here.change(hidden, difference.bound(omega + hidden)).1;
    match slope.abs() > change + here.errors[1] {
        true if slope > 0.0 => 2,
        true => -2,
        false => 0,
    }
}
