//! Margins of a loop with a hold.
//!
//! Gain crossovers are those of `gain_crossovers`. The factors on L at which a pole is on the circle
//! are the crossings of a z^(m+1) − k b.

use std::f64::consts::{PI, TAU};

use super::circle::is_stable;
use super::further_delay::further_delay;
use super::gain_crossovers::{Crossover, FAR, crossovers, is_zero};
use super::margins::{Margins, least};
use crate::order::sort_up;
use crate::stability::{HeldLoop, HeldNumbers};
use crate::{Error, Task};

/// Margins of a loop with a hold; without `delay_margin` that is NaN. Further delays change the
/// crossings, so that there is no list of them.
///
/// # Errors
/// [`Error::Argument`] where numbers are beyond double precision; [`Error::Interrupted`].
pub fn held_margins(held: HeldLoop<'_>, delay_margin: bool, task: &Task) -> Result<Margins, Error> {
    let numbers = held.at(held.delay())?;
    let found = crossovers(&numbers, task)?;
    let stable = match is_stable(&numbers, &found, task)? {
        Some(stable) => stable,
        None => held.abscissa(task)?.is_some_and(|abscissa| abscissa < 0.0),
    };
    let late = match (stable, delay_margin) {
        (true, true) => further_delay(held, task)?,
        _ => (f64::NAN, f64::NAN),
    };
    with_verdict(&numbers, &found, stable, late, task)
}

/// [`held_margins`] without the delay margin, of a loop that is known to be stable.
///
/// # Errors
/// As [`held_margins`].
pub fn held_margins_of_stable(held: HeldLoop<'_>, task: &Task) -> Result<Margins, Error> {
    let numbers = held.at(held.delay())?;
    let found = crossovers(&numbers, task)?;
    with_verdict(&numbers, &found, true, (f64::NAN, f64::NAN), task)
}

/// The margins where stability, gain crossovers and delay margin are known.
fn with_verdict(
    numbers: &HeldNumbers,
    found: &[Crossover],
    stable: bool,
    late: (f64, f64),
    task: &Task,
) -> Result<Margins, Error> {
    let (places, turns): (Vec<f64>, Vec<f64>) = found.iter().map(|at| (at.omega, at.turn)).unzip();
    let degrees: Vec<f64> = turns
        .iter()
        .map(|turn| if *turn > PI { turn - TAU } else { *turn }.to_degrees())
        .collect();
    let Some(factors) = numbers.factors((0.0, FAR), task)? else {
        refuse!(
            "the phase crossovers of this sampled loop are beyond double precision: a pole and a \
             zero of its loop gain may cancel on the unit circle; change a number by a little"
        );
    };
    let mut factors: Vec<(f64, f64)> = factors
        .iter()
        .filter(|at| at.gain > 0.0 && !is_zero(at, 1.0))
        .map(|at| (at.omega, at.gain))
        .collect();
    sort_up(&mut factors, |factor| factor.0);
    let (phase_crossovers, gains): (Vec<f64>, Vec<f64>) = factors.into_iter().unzip();
    let up = least(&gains, &phase_crossovers, |k| (k > 1.0).then_some(k));
    let mut down = least(&gains, &phase_crossovers, |k| (k < 1.0).then_some(-k));
    down.0 = if down.0 == f64::INFINITY {
        0.0
    } else {
        -down.0
    };
    let turned = least(&degrees, &places, |turn| Some(turn.abs()));
    let shown = |pair: (f64, f64)| if stable { pair } else { (f64::NAN, f64::NAN) };
    let [up, down, turned] = [up, down, turned].map(shown);
    Ok(Margins {
        stable,
        gain_margin: up.0,
        gain_reduction: down.0,
        phase_margin: turned.0,
        delay_margin: late.0,
        gain_margin_omega: up.1,
        gain_reduction_omega: down.1,
        phase_margin_omega: turned.1,
        delay_margin_omega: late.1,
        gain_crossovers: places,
        phase_margins: degrees,
        delay_margins: Vec::new(),
        phase_crossovers,
        gain_margins: gains,
        searched: (f64::INFINITY, f64::INFINITY),
        hidden: Vec::new(),
    })
}
