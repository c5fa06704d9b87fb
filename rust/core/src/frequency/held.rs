//! Margins of a loop with a hold.
//!
//! Gain crossovers are those of `gain_crossovers`. The factors on L at which a pole is on the circle
//! are the crossings of a z^(m+1) − k b.

use super::circle::is_stable;
use super::further_delay::further_delay;
use super::gain_crossovers::{Crossover, FAR, crossovers, is_zero};
use super::held_peaks::{held_peak, held_peaks};
use super::margins::{Margins, degrees, least};
use super::norms::Peaks;
use super::peaks::Peak;
use crate::order::sort_up;
use crate::stability::{Crossing, HeldLoop, HeldNumbers};
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
        None => match held.abscissa(task) {
            Err(error) if error.ends_all() => return Err(error),
            found => found.is_ok_and(|abscissa| abscissa < 0.0),
        },
    };
    let late = match (stable, delay_margin) {
        (true, true) => further_delay(held, task)?,
        _ => (f64::NAN, f64::NAN),
    };
    with_verdict(&numbers, &found, stable, late, task)
}

/// The largest modulus of the sensitivity of a loop with a hold; `None` where it is not stable.
///
/// # Errors
/// As [`held_margins`].
pub fn held_sensitivity(held: HeldLoop<'_>, task: &Task) -> Result<Option<Peak>, Error> {
    let numbers = held.at(held.delay())?;
    let found = crossovers(&numbers, task)?;
    if is_stable(&numbers, &found, task)? != Some(true) {
        return Ok(None);
    }
    let places: Vec<f64> = found.iter().map(|at| at.omega).collect();
    held_peak(&numbers, &places, task).map(Some)
}

/// Gain margin, phase margin in degrees and delay margin in s of a loop that is known to be stable.
/// A gain margin above `most` may come out larger than it is; the other two are infinite without
/// `turns`. The delay margin leaves out that the hold's share of a delay changes with it.
///
/// # Errors
/// As [`held_margins`].
pub fn held_margins_of_stable(
    held: HeldLoop<'_>,
    most: f64,
    turns: bool,
    task: &Task,
) -> Result<[f64; 3], Error> {
    let numbers = held.at(held.delay())?;
    let mut found = [f64::INFINITY; 3];
    if most > 1.0 {
        let factors = factors(&numbers, (1.0, most.min(FAR)), task)?;
        let gains = factors.iter().map(|at| at.gain).filter(|gain| *gain > 1.0);
        found[0] = gains.fold(found[0], f64::min);
    }
    if turns {
        for at in crossovers(&numbers, task)? {
            found[1] = found[1].min(degrees(at.turn).abs());
            found[2] = found[2].min(at.turn / at.omega);
        }
    }
    Ok(found)
}

/// The places with factors in `range` at which a pole is on the circle.
fn factors(numbers: &HeldNumbers, range: (f64, f64), task: &Task) -> Result<Vec<Crossing>, Error> {
    let Some(factors) = numbers.factors(range, task)? else {
        refuse!(
            "double precision cannot determine the phase crossovers of this sampled loop. A pole \
             and a zero of its loop gain may cancel on the unit circle. Change a parameter by a \
             little"
        );
    };
    Ok(factors)
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
    let degrees: Vec<f64> = turns.iter().map(|turn| degrees(*turn)).collect();
    let factors = factors(numbers, (0.0, FAR), task)?;
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
    let peaks = if stable {
        let all = [&places[..], &phase_crossovers].concat();
        Peaks::if_known(held_peaks(numbers, &all, task))?
    } else {
        Peaks::UNKNOWN
    };
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
        peaks,
    })
}
