//! Values and phase of the loop gain of a loop with a hold.
//!
//! L = −e^(−s d) b(σ)/a(σ) on the circle z = e^(jω Ts), exact for the hold and any delay. The phase is
//! continuous from ω = 0 on: that of σ, π/2 + ω Ts/2, for each power of it, and those of the rests
//! of a and b, which are followed by Taylor's formula (`circle`). A zero of them on the circle is passed as one
//! just inside.

use std::f64::consts::{FRAC_PI_2, PI};

use num_complex::Complex64;

use super::circle::turned;
use crate::Error;
use crate::stability::{HeldLoop, HeldNumbers};

/// Rounding of a highest frequency π/Ts, relative to it.
const ROUNDING: f64 = 1e-12;

/// The loop gain at frequencies in rad/s from 0 to π/Ts; infinite at a pole.
///
/// # Errors
/// [`Error::Argument`] for other frequencies, or coefficients beyond double precision.
pub fn held_gain(held: HeldLoop<'_>, omega: &[f64]) -> Result<Vec<Complex64>, Error> {
    let numbers = held.at(held.delay())?;
    let omega = within(&numbers, omega)?;
    Ok(omega.into_iter().map(|omega| numbers.gain(omega)).collect())
}

/// Its argument in rad, continuous from zero frequency on, where n poles at z = 1 turn it by −nπ/2.
///
/// # Errors
/// As [`held_gain`]; [`Error::Argument`] where it cannot be followed, or the loop gain is zero.
pub fn held_phase(held: HeldLoop<'_>, omega: &[f64]) -> Result<Vec<f64>, Error> {
    let numbers = held.at(held.delay())?;
    let omega = within(&numbers, omega)?;
    let (a, b) = numbers.polynomials();
    let split = |p: &[f64]| {
        let powers = p.iter().take_while(|c| **c == 0.0).count();
        (powers as f64, p[powers..].to_vec())
    };
    let ((poles, a), (zeros, b)) = (split(a), split(b));
    let (Some(first), Some(last)) = (a.first(), b.first()) else {
        refuse!(
            "the loop gain is zero at every frequency, so it has no phase: give gains other than zero"
        );
    };
    let powers = zeros - poles;
    // L is −b/a.
    let start = if first * last > 0.0 { PI } else { 0.0 };
    let mut order: Vec<usize> = (0..omega.len()).collect();
    order.sort_by(|i, j| omega[*i].total_cmp(&omega[*j]));
    let mut found = vec![0.0; omega.len()];
    let (mut from, mut rest) = (0.0, start);
    for place in order {
        let to = omega[place];
        if to > from {
            let [of_a, of_b] = [&a, &b].map(|p| turned(&numbers, p, from, to, true));
            let (Some(of_a), Some(of_b)) = (of_a, of_b) else {
                refuse!("up to {to} rad/s, the phase of the loop gain cannot be computed");
            };
            rest += of_b - of_a;
            from = to;
        }
        let turn = FRAC_PI_2 + 0.5 * to * numbers.sample_time();
        found[place] = rest + powers * turn - numbers.delay() * to;
    }
    Ok(found)
}

/// Frequencies up to π/Ts.
fn within(numbers: &HeldNumbers, omega: &[f64]) -> Result<Vec<f64>, Error> {
    let (sample_time, top) = (numbers.sample_time(), PI / numbers.sample_time());
    if let Some(beyond) = omega
        .iter()
        .find(|omega| !(0.0..=top * (1.0 + ROUNDING)).contains(*omega))
    {
        refuse!(
            "omega={beyond} rad/s: a loop with a sample time of {sample_time} s has frequencies \
             from 0 to {top:.6} rad/s"
        );
    }
    Ok(omega.iter().map(|omega| omega.min(top)).collect())
}
