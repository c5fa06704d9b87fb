//! Crossings of the imaginary axis as one gain varies.
//!
//! The members h = A + k B, k in [low, high], have all their roots with Re s ≥ 0 within one radius:
//! there the moduli of the exponentials are at most one, so that with p the least modulus of the
//! leading coefficient of the smallest delay, q the sum of the largest ones of all other terms in
//! sⁿ and c_j that of all terms in sʲ, h = 0, Re s ≥ 0 and |s| = r imply (p − q) rⁿ ≤ Σ_{j<n} c_j
//! rʲ, which holds for no r beyond the positive zero of the difference (Cauchy 1829). The moduli of
//! a + k b, greatest at the ends of the range, are widened by SLACK (|a| + |k b|), which covers the
//! two roundings of each; p, q and c_j are then sums of numbers ≥ 0, of m terms at most, and with
//! Horner's rule in 1/r each side has a relative error of at most (m + 2n + 4) u. For m ≤ 10⁵ and n
//! ≤ 1000, the limits of families, this is less than 2e-11, which ROOM covers. Up to that r,
//! `crossing` finds every crossing, with proof. Where p ≤ q there is no such radius, because the
//! leading term vanishes or chains of a neutral equation may be rightmost; this case is refused.

use num_complex::Complex64;

use super::crossing::{Crossing, Varied, crossings};
use super::pencil::{Factor, Pencil, united};
use crate::quasipoly::QuasiPolynomial;
use crate::stability::family::Family;
use crate::stability::specification::Piece;
use crate::{Error, Task};

/// Relative margin for the rounding errors of sums of moduli.
const ROOM: f64 = 1e-9;

/// Relative error of four roundings.
const SLACK: f64 = 2.0 * f64::EPSILON;

/// All values in `range` of the parameter with index `parameter` at which the member of `family`
/// has a root on the imaginary axis, by increasing frequency. `values` holds the other parameters.
///
/// # Errors
/// [`Error::Argument`] where the family is not affine in the parameter, its leading terms do not
/// outweigh all others in the whole range, a root stays at 0, or precision does not suffice;
/// [`Error::Interrupted`].
///
/// ```
/// use deadtime::{Task, stability::{Affine, Family, Term, crossings_along}};
/// // s + K e^(−0.36 s)
/// let term = |exponent, power, delay| Term {
///     coefficient: 1.0,
///     exponents: vec![exponent],
///     power,
///     delay: Affine { constant: delay, slopes: vec![0.0] },
/// };
/// let family = Family::new(vec!["K".into()], vec![term(0, 1, 0.0), term(1, 0, 0.36)])?;
/// let found = crossings_along(&family, &[0.0], 0, (0.5, 10.0), &Task::new())?;
/// assert_eq!(found.len(), 1);
/// assert!((found[0].gain - std::f64::consts::PI / 0.72).abs() < 1e-14);
/// assert_eq!(found[0].jump, Some(2));
/// # Ok::<(), deadtime::Error>(())
/// ```
pub fn crossings_along(
    family: &Family,
    values: &[f64],
    parameter: usize,
    range: (f64, f64),
    task: &Task,
) -> Result<Vec<Crossing>, Error> {
    let name = family.names().get(parameter).map_or("", String::as_str);
    let mut ranges: Vec<(f64, f64)> = values.iter().map(|value| (*value, *value)).collect();
    if let Some(place) = ranges.get_mut(parameter) {
        *place = range;
    }
    family.check_delays(&ranges)?;
    let Some((constant, slope)) = family.split(parameter) else {
        refuse!("{name} does not appear only as a factor of terms");
    };
    let mut bare = values.to_vec();
    if let Some(value) = bare.get_mut(parameter) {
        *value = 0.0;
    }
    let (a, b) = (constant.at(&bare)?, slope.at(&bare)?);
    if b.is_zero() {
        return Ok(Vec::new());
    }
    refuse_if!(
        at_zero(&a) == 0.0 && at_zero(&b) == 0.0,
        "a root stays at s = 0 for all values of {name}: divide the equation by s"
    );
    let top = radius_of_members(&a, &b, range, name)?;
    if top == 0.0 {
        return Ok(Vec::new());
    }
    let axis = Piece {
        from: Complex64::ZERO,
        along: Complex64::I,
        length: top,
    };
    let found = match Pencil::new(&a, &b, axis, Factor::Gain, None) {
        Some(pencil) => crossings(&pencil, true, top, Varied::Gain(range), task)?,
        None => None,
    };
    let Some(found) = found else {
        refuse!(
            "double precision cannot find the crossings over {name}. Either a root stays on the \
             imaginary axis for all values of {name}, or the sizes of the coefficients differ too \
             much"
        );
    };
    Ok(found)
}

/// h(0).
fn at_zero(h: &QuasiPolynomial) -> f64 {
    h.coefficients().iter().filter_map(|row| row.first()).sum()
}

/// A radius that no root with Re s ≥ 0 of any member a + k b exceeds, k between the ends of `range`.
///
/// # Errors
/// [`Error::Argument`] where the leading coefficient vanishes or does not outweigh the later ones.
pub(crate) fn radius_of_members(
    a: &QuasiPolynomial,
    b: &QuasiPolynomial,
    range: (f64, f64),
    name: &str,
) -> Result<f64, Error> {
    let degree = a.degree().max(b.degree());
    let mut sizes = vec![0.0; degree + 1];
    let mut leading = None;
    for (_, a, b) in united(a, b) {
        for (power, total) in sizes.iter_mut().enumerate() {
            let at = |row: &[f64]| row.get(power).copied().unwrap_or(0.0);
            let ends = [range.0, range.1].map(|k| at(&a) + k * at(&b));
            let slacks = [range.0, range.1].map(|k| SLACK * (at(&a).abs() + (k * at(&b)).abs()));
            let largest = (ends[0].abs() + slacks[0]).max(ends[1].abs() + slacks[1]);
            if power == degree && leading.is_none() {
                let same_sign = ends[0] * ends[1] > 0.0;
                leading = Some(if same_sign {
                    let least = (ends[0].abs() - slacks[0]).min(ends[1].abs() - slacks[1]);
                    least.max(0.0)
                } else {
                    0.0
                });
            } else {
                *total += largest;
            }
        }
    }
    let (others, rest) = (sizes.get(..degree).unwrap_or_default(), sizes.get(degree));
    let (leading, rest) = (leading.unwrap_or(0.0), rest.copied().unwrap_or(0.0));
    refuse_if!(
        leading == 0.0,
        "for some {name} of the range, the coefficient of the highest power of s without further \
         delay is zero: choose a range in which this coefficient keeps its sign"
    );
    let excess = leading * (1.0 - ROOM) - rest * (1.0 + ROOM);
    refuse_if!(
        excess.is_nan() || excess <= 0.0,
        "the equation is neutral, and for some {name} of the range, chains of infinitely many \
         roots may reach the imaginary axis: choose a smaller range"
    );
    Ok(exceeding_radius(others, excess))
}

/// A radius r with `leading` rⁿ > Σ c_j rʲ, close to the smallest one.
fn exceeding_radius(others: &[f64], leading: f64) -> f64 {
    if others.iter().all(|c| *c == 0.0) {
        return 0.0;
    }
    // Divided by rⁿ, by Horner's rule in 1/r.
    let exceeds = |r: f64| others.iter().fold(0.0, |sum, c| (sum + c) / r) < leading * (1.0 - ROOM);
    let mut high = 1.0;
    while exceeds(high) && high > f64::MIN_POSITIVE {
        high *= 0.5;
    }
    while !exceeds(high) && high < f64::MAX {
        high *= 2.0;
    }
    let mut low = 0.5 * high;
    for _ in 0..8 {
        let middle = 0.5 * (low + high);
        if exceeds(middle) {
            high = middle;
        } else {
            low = middle;
        }
    }
    high
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::roots::count_right_of;
    use crate::stability::family::{Affine, Term};

    fn term(coefficient: f64, exponent: u32, power: u32, delay: f64) -> Term {
        Term {
            coefficient,
            exponents: vec![exponent],
            power,
            delay: Affine {
                constant: delay,
                slopes: vec![0.0],
            },
        }
    }

    fn family(terms: Vec<Term>) -> Family {
        Family::new(vec!["k".to_owned()], terms).unwrap()
    }

    #[test]
    fn roots_lie_within_the_radius() {
        for (others, leading) in [
            (vec![2.0], 1.0),
            (vec![1e-200, 3.0], 2.0),
            (vec![0.0, 1e200], 1e-50),
            (vec![5.0, 4.0, 3.0], 1e-3),
        ] {
            let r = exceeding_radius(&others, leading);
            let value = |r: f64| others.iter().fold(0.0, |sum, c| (sum + c) / r);
            assert!(
                value(r) < leading && value(0.98 * r) > 0.98 * leading,
                "{others:?}"
            );
        }
        assert_eq!(exceeding_radius(&[0.0, 0.0], 1.0), 0.0);
    }

    #[test]
    fn what_may_bring_roots_from_infinity_is_refused() {
        let task = Task::new();
        let neutral = family(vec![
            term(1.0, 0, 1, 0.0),
            term(1.0, 1, 1, 0.5),
            term(1.0, 0, 0, 0.0),
        ]);
        assert!(crossings_along(&neutral, &[0.0], 0, (-0.9, 0.9), &task).is_ok());
        assert!(crossings_along(&neutral, &[0.0], 0, (-0.9, 1.0), &task).is_err());
        let vanishing = family(vec![term(1.0, 1, 1, 0.0), term(1.0, 0, 0, 0.0)]);
        assert!(crossings_along(&vanishing, &[0.0], 0, (0.1, 1.0), &task).is_ok());
        assert!(crossings_along(&vanishing, &[0.0], 0, (-0.1, 1.0), &task).is_err());
        let square = family(vec![term(1.0, 2, 0, 0.0), term(1.0, 0, 1, 0.0)]);
        assert!(crossings_along(&square, &[0.0], 0, (0.1, 1.0), &task).is_err());
    }

    proptest! {
        #[test]
        fn counts_at_both_ends_differ_by_the_jumps(
            a in -3.0..3.0f64, b in -3.0..3.0f64, c in -0.9..0.9f64, d in -2.0..2.0f64, tau in 0.05..2.0f64,
        ) {
            let family = family(vec![
                term(1.0, 0, 2, 0.0), term(a, 0, 1, 0.0), term(b, 0, 0, 0.7), term(d, 1, 0, tau),
                term(c, 1, 2, tau),
            ]);
            let task = Task::new();
            if let Ok(found) = crossings_along(&family, &[0.0], 0, (-1.0, 1.0), &task) {
                let jumps: Option<i32> = found.iter().map(|place| place.jump).sum();
                let count = |k| count_right_of(&family.at(&[k]).unwrap(), 0.0, &task);
                if let (Some(jumps), Ok(low), Ok(high)) = (jumps, count(-1.0), count(1.0)) {
                    prop_assert_eq!(high as i64 - low as i64, i64::from(jumps));
                }
            }
        }
    }
}
