//! The largest modulus of a ratio over all frequencies, by level sets.
//!
//! At a level γ just above the largest value known, all frequencies with |n| = γ |d| are found by
//! `zeros_between`, which misses none (Boyd and Balakrishnan 1990, Systems & Control Letters 15;
//! Bruinsma and Steinbuch 1990, ibid. 14). Where there are none, nothing is larger; else the ratio is
//! larger somewhere between two of them, and a search there gives the next level. Each round at least
//! halves the distance to the maximum in the exponent, so that few are needed.

use crate::between::minimum;
use crate::{Error, Task};

/// Relative distance of the level from the largest value known: what the result is known to.
/// Smaller: rounding hides whether the level is reached; larger: the result is less exact.
pub(super) const CLOSE: f64 = 5e-11;

/// Levels before the search is given up.
const LEVELS: usize = 60;

/// Most evaluations of a search between two frequencies, and its relative accuracy.
const EVALUATIONS: usize = 60;
const PLACE_KNOWN: f64 = 1e-9;

/// What is asked of a largest value.
#[derive(Debug, Clone, Copy)]
pub enum Sought {
    /// The value, but for this part of it.
    Value(f64),
    /// Whether it is above a level: what is found is above if it is, and some value below if it is not.
    Above(f64),
}

/// A largest value and where it is taken.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Peak {
    /// The value.
    pub value: f64,
    /// rad/s; infinite where it is only come close to at high frequencies, NaN where there is none.
    pub omega: f64,
}

impl Peak {
    /// That of a function that is zero everywhere.
    pub(super) const NONE: Self = Self {
        value: 0.0,
        omega: f64::NAN,
    };

    /// The larger of two.
    pub(super) fn or(self, other: Self) -> Self {
        if other.value > self.value {
            other
        } else {
            self
        }
    }
}

/// A modulus over frequency, whose levels can be found.
pub(super) trait Modulus {
    /// The modulus at a frequency.
    fn at(&self, omega: f64) -> f64;

    /// All frequencies at which it is `level`, and one beyond which it is smaller.
    ///
    /// # Errors
    /// As [`zeros_between`](super::zeros::zeros_between).
    fn reaching(&self, level: f64, task: &Task) -> Result<(Vec<f64>, f64), Error>;
}

/// The largest value, as well as it is sought. `known` is one that is taken, `places` are frequencies to
/// look at first.
///
/// # Errors
/// As [`Modulus::reaching`]; [`Error::Argument`] where levels do not come to an end.
pub(super) fn highest(
    of: &impl Modulus,
    known: Peak,
    places: &mut [f64],
    sought: Sought,
    task: &Task,
) -> Result<Peak, Error> {
    let mut best = first(of, known, places)?;
    if best.value == f64::INFINITY || best.value == 0.0 {
        return Ok(best);
    }
    for _ in 0..LEVELS {
        let level = match sought {
            Sought::Value(close) => best.value * (1.0 + close),
            Sought::Above(level) if best.value > level => return Ok(best),
            Sought::Above(level) => level,
        };
        let (zeros, top) = of.reaching(level, task)?;
        let places: Vec<f64> = [0.0].into_iter().chain(zeros).chain([top]).collect();
        let before = best;
        for pair in places.windows(2) {
            let &[low, high] = pair else { continue };
            if of.at(0.5 * (low + high)) > level {
                best = best.or(between(of, (low, high))?);
            }
        }
        // Zeros with nothing above the level between them only touch it.
        if best == before {
            return Ok(best);
        }
    }
    refuse!(
        "the largest gain over frequency, {:.6e} near {:.6e} rad/s, does not converge, because a \
         pole may be on the imaginary axis within rounding errors",
        best.value,
        best.omega
    )
}

/// The largest of the values at some frequencies, and around the best of these.
fn first(of: &impl Modulus, known: Peak, places: &mut [f64]) -> Result<Peak, Error> {
    places.sort_unstable_by(f64::total_cmp);
    let (mut best, mut index) = (known, None);
    for (place, omega) in places.iter().enumerate() {
        let value = of.at(*omega);
        if value > best.value {
            best = Peak {
                value,
                omega: *omega,
            };
            index = Some(place);
        }
    }
    let Some(index) = index.filter(|index| *index > 0) else {
        return Ok(best);
    };
    match (places.get(index - 1), places.get(index + 1)) {
        (Some(low), Some(high)) if low < high => Ok(best.or(between(of, (*low, *high))?)),
        _ => Ok(best),
    }
}

/// A largest value between two frequencies.
fn between(of: &impl Modulus, (low, high): (f64, f64)) -> Result<Peak, Error> {
    let cost = |omega: f64| Ok(-of.at(omega));
    let (omega, size) = minimum(cost, (low, high), PLACE_KNOWN * high, EVALUATIONS)?;
    Ok(Peak {
        value: -size,
        omega,
    })
}
