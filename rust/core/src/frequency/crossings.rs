//! Values of one number at which an equation has roots on the imaginary axis, in a range.
//!
//! Those of a delay: see `delays`. Those of a gain k in h = A + k B are those of
//! `stability::crossings_along`, which proves that none is missed wherever the leading coefficient
//! outweighs the later ones of that power. Around the parts of the range where it does not, chains of
//! infinitely many roots reach the axis or come close: they are left out.

use super::chains::{Lead, ROOM};
use super::delays::crossings_of_delay;
use super::equation::Equation;
use super::passage::Crossing;
use crate::stability::{Family, crossings_along};
use crate::{Error, Task};

/// Crossings are not listed within this part of the range of where chains reach the axis: the
/// frequencies at which they may lie grow without bound there.
const NEAR_CHAINS: f64 = 1e-3;

/// Crossings over a range of a parameter.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Crossings {
    /// Those that are listed, by increasing value and frequency.
    pub crossings: Vec<Crossing>,
    /// Parts of the range in which none are.
    pub unlisted: Vec<(f64, f64)>,
}

/// All crossings as the one parameter of `family`, a gain or a delay, varies from `low` to `high`.
///
/// # Errors
/// [`Error::Argument`] where the parameter enters otherwise, chains may reach the axis in the whole
/// range (for a delay: anywhere), a root stays on the axis, or there is no end to the frequencies; as
/// [`crossings_along`].
pub fn crossings(family: &Family, ends: (f64, f64), task: &Task) -> Result<Crossings, Error> {
    let equation = Equation::new(family)?;
    let mut found = if equation.is_delay()? {
        Crossings {
            crossings: crossings_of_delay(&equation, ends, task)?,
            unlisted: Vec::new(),
        }
    } else {
        crossings_of_gain(&equation, ends, task)?
    };
    found.crossings.sort_by(|one, other| {
        let by_value = one.value.total_cmp(&other.value);
        by_value.then(one.omega.total_cmp(&other.omega))
    });
    Ok(found)
}

fn crossings_of_gain(
    equation: &Equation<'_>,
    (low, high): (f64, f64),
    task: &Task,
) -> Result<Crossings, Error> {
    let lead = Lead::of(&equation.factor(0)?, &equation.factor(1)?, ROOM);
    let margin = NEAR_CHAINS * (high - low);
    let mut unlisted: Vec<(f64, f64)> = Vec::new();
    for (start, end) in lead.lost(low, high) {
        let (start, end) = ((start - margin).max(low), (end + margin).min(high));
        match unlisted.last_mut() {
            Some(last) if start <= last.1 => last.1 = end,
            _ => unlisted.push((start, end)),
        }
    }
    let starts = std::iter::once(low).chain(unlisted.iter().map(|part| part.1));
    let ends = unlisted
        .iter()
        .map(|part| part.0)
        .chain(std::iter::once(high));
    let listed: Vec<(f64, f64)> = starts
        .zip(ends)
        .filter(|(start, end)| start < end)
        .collect();
    refuse_if!(
        listed.is_empty(),
        "for every {} from {low} to {high}, chains of infinitely many roots may reach the \
         imaginary axis. The highest power of s has large delayed coefficients",
        equation.name
    );
    let mut crossings = Vec::new();
    for part in listed {
        let found = crossings_along(equation.family, &[0.0], 0, part, task)?;
        crossings.extend(found.iter().map(|place| Crossing {
            // Adding 0.0 makes a negative zero a positive one.
            value: place.gain + 0.0,
            omega: place.omega,
            direction: place.jump.unwrap_or(0),
        }));
    }
    Ok(Crossings {
        crossings,
        unlisted,
    })
}
