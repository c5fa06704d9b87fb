//! The stable range of one number of an equation around a value: up to the nearest crossings.
//!
//! Most numbers are a factor k in h = A + k B, which has roots on the axis only where Im(A conj B) = 0;
//! `zeros` misses no such frequency up to a radius that no unstable root exceeds while k is in a range,
//! and the ranges grow until there is a crossing. Where B leads, one radius holds for all k beyond a
//! value: that of μA + B, μ = 1/k. Without delay Im(A conj B) is a polynomial, and all its zeros are
//! known at once. The corner p of a filter s² + 2dps + p² enters as h = A + p B + p² C; real p that
//! solve it on the axis exist only where the resultant of the real and the imaginary part vanishes,
//!     Im(A conj C)² − Im(A conj B) Im(B conj C) = 0.
//! The ends carry rounding only, which is not bounded. Delays: see `delays`.

use num_complex::Complex64;

use super::chains::{Lead, ROOM};
use super::equation::Equation;
use super::margins::over;
use super::polynomial::roots;
use super::two_sided::TwoSided;
use super::waves::Waves;
use super::zeros::zeros_between;
use crate::quasipoly::QuasiPolynomial;
use crate::stability::{Family, radius_of_members};
use crate::{Error, Task};

/// The first range of a gain is this part of its value, the following ones reach so much farther.
const FIRST: f64 = 0.25;
const GROWTH: f64 = 4.0;

/// Ranges of a gain that are looked at: from a quarter of the value to 1e11 times it.
const RANGES: u32 = 20;

/// A number that has no meaning at zero is followed down to this part of its value.
const NEARLY_ZERO: f64 = 1e-6;

/// Imaginary part of a number that is real, as a part of it: double roots have the root of the
/// rounding.
const REAL: f64 = 1e-6;

/// Part of the way to where chains of roots reach the axis that is searched for all crossings.
const BEFORE_CHAINS: f64 = 0.99;

/// Part of the way from a stable value to where chains of roots reach the axis by which the last
/// value tried stays short of it. Larger: crossings next to the end are missed; smaller: stability
/// is harder to decide there.
const SHORT_OF_CHAINS: f64 = 1e-9;

/// Halvings between a stable value and the one at which chains of roots reach the axis.
const HALVINGS: u32 = 60;

/// Around `value`, within `bounds`, for the factor that is the one parameter of `family`.
///
/// # Errors
/// [`Error::Argument`] where the end of a range is neither found nor ruled out;
/// [`Error::Interrupted`].
pub fn gain_range(
    family: &Family,
    value: f64,
    bounds: (f64, f64),
    task: &Task,
) -> Result<(f64, f64), Error> {
    let equation = Equation::new(family)?;
    if equation.highest_power() == 0 {
        return Ok(bounds);
    }
    let search = Search::new(equation, value, task)?;
    // Adding 0.0 makes a negative zero a positive one.
    Ok((
        search.end(-1.0, bounds.0)? + 0.0,
        search.end(1.0, bounds.1)? + 0.0,
    ))
}

/// Around the damping `value` of a filter; beyond `highest` the loop gain is below one for all larger ones.
///
/// # Errors
/// As [`gain_range`].
pub fn damping_range(
    family: &Family,
    value: f64,
    highest: f64,
    task: &Task,
) -> Result<(f64, f64), Error> {
    let search = Search::new(Equation::new(family)?, value, task)?;
    let low = search.end(-1.0, 0.0)?;
    if highest == f64::INFINITY {
        return Ok((low, search.end(1.0, f64::INFINITY)?));
    }
    if search.b.is_zero() {
        return Ok((0.0, f64::INFINITY));
    }
    let found = gains(&search.a, &search.b, highest, task)?;
    Ok((low, nearest(&found, value, 1.0)))
}

/// Around the corner `value` of a filter; beyond `highest` the loop gain is below one for any corner.
///
/// # Errors
/// As [`gain_range`].
pub fn corner_range(
    family: &Family,
    value: f64,
    highest: f64,
    task: &Task,
) -> Result<(f64, f64), Error> {
    let equation = Equation::new(family)?;
    let (a, b, c) = (
        equation.factor(0)?,
        equation.factor(1)?,
        equation.factor(2)?,
    );
    if c.is_zero() {
        return Ok((0.0, f64::INFINITY));
    }
    refuse_if!(
        highest == f64::INFINITY,
        "the range of the corner is not known, because for some corners the loop gain does not \
         stay below one at high frequencies"
    );
    // Im X Im Y = Re(X conj Y − X Y)/2.
    let both = |x: &TwoSided, y: &TwoSided| x.times(&y.mirrored()).plus(-1.0, &x.times(y));
    let (ac, ab, bc) = (product(&a, &c), product(&a, &b), product(&b, &c));
    let resultant = both(&ac, &ac).plus(-1.0, &both(&ab, &bc));
    let mut found = Vec::new();
    for omega in zeros_between(&mut Waves::cleaned(&resultant, 1), 0.0, highest, task)? {
        let s = Complex64::new(0.0, omega);
        // One of them is real, but for rounding.
        let corners = roots(&[a.value(s), b.value(s), c.value(s)]);
        let real = |p: &Complex64| p.re > 0.0 && p.im.abs() <= REAL * p.norm();
        found.extend(corners.into_iter().filter(real).map(|p| p.re));
    }
    Ok((
        nearest(&found, value, -1.0).max(0.0),
        nearest(&found, value, 1.0),
    ))
}

/// What is sought around a value of a factor.
struct Search<'a> {
    equation: Equation<'a>,
    a: QuasiPolynomial,
    b: QuasiPolynomial,
    value: f64,
    task: &'a Task,
}

impl<'a> Search<'a> {
    fn new(equation: Equation<'a>, value: f64, task: &'a Task) -> Result<Self, Error> {
        Ok(Self {
            a: equation.factor(0)?,
            b: equation.factor(1)?,
            equation,
            value,
            task,
        })
    }

    /// The end of the range above (`sign` 1) or below (−1), no farther than `last`.
    fn end(&self, sign: f64, last: f64) -> Result<f64, Error> {
        let (value, name) = (self.value, self.equation.name);
        let within = |known: f64| {
            if sign < 0.0 {
                known.max(last)
            } else {
                known.min(last)
            }
        };
        if let Some(found) = self.without_end(sign)? {
            return Ok(within(nearest(&found, value, sign)));
        }
        if value == last {
            return Ok(last);
        }
        let size = if value == 0.0 { 1.0 } else { value.abs() };
        let is_toward_zero = last == 0.0;
        let last = if is_toward_zero {
            -sign * NEARLY_ZERO * size
        } else {
            last
        };
        let (mut width, mut reach) = (FIRST * size, value);
        for _ in 0..RANGES {
            // Radii may grow without bound next to zero: it is approached by a factor at a time.
            let nearer = reach / GROWTH;
            reach = value + sign * width;
            if is_toward_zero && sign * (reach - nearer) > 0.0 {
                reach = nearer;
            }
            if sign * (last - reach) <= 0.0 {
                reach = last;
            }
            let free = self.free_of_chains(reach);
            let stop = if free == reach {
                reach
            } else {
                value + BEFORE_CHAINS * (free - value)
            };
            if stop != value {
                let highest = radius_of_members(&self.a, &self.b, (value, stop), name)?;
                let found = nearest(&gains(&self.a, &self.b, highest, self.task)?, value, sign);
                if sign * (stop - found) >= 0.0 {
                    return Ok(found);
                }
            }
            if free != reach {
                return self.before_chains(stop, free);
            }
            if reach == last {
                return Ok(if last.abs() <= NEARLY_ZERO * size {
                    0.0
                } else {
                    last
                });
            }
            width *= GROWTH;
        }
        refuse!(
            "the loop is stable from {name}={value} to {reach}. Beyond, its stability is not \
            known"
        )
    }

    /// All crossings there are from the value on, where one search finds them.
    fn without_end(&self, sign: f64) -> Result<Option<Vec<f64>>, Error> {
        let (a, b, value) = (&self.a, &self.b, self.value);
        let late = a.delays().iter().chain(b.delays());
        if late.clone().all(|delay| Some(delay) == a.delays().first()) {
            // Without delay there is no more than a polynomial.
            let mut found = gains(a, b, f64::INFINITY, self.task)?;
            let leading =
                |h: &QuasiPolynomial| h.coefficients().first().and_then(|row| row.last().copied());
            if a.degree() == b.degree() {
                found.extend(leading(a).zip(leading(b)).map(|(a, b)| -a / b));
            }
            return Ok(Some(found));
        }
        if sign * value > 0.0 && b.degree() >= a.degree() {
            // B + μ A, μ from zero to 1/value; beyond zero the sign of the number changes.
            if let Ok(highest) = radius_of_members(b, a, (0.0, 1.0 / value), self.equation.name) {
                let mut found = gains(a, b, highest, self.task)?;
                found.retain(|k| k * value > 0.0);
                found.push(0.0);
                return Ok(Some(found));
            }
        }
        Ok(None)
    }

    /// How far from the value towards `end` the leading coefficient outweighs the others.
    fn free_of_chains(&self, end: f64) -> f64 {
        let lead = Lead::of(&self.a, &self.b, ROOM);
        let reached = lead.lost(self.value.min(end), self.value.max(end));
        if end > self.value {
            reached.first().map_or(end, |part| part.0)
        } else {
            reached.last().map_or(end, |part| part.1)
        }
    }

    /// Halve the last part before chains of roots reach the axis at `free`.
    fn before_chains(&self, stable: f64, free: f64) -> Result<f64, Error> {
        let is_stable = |value| self.equation.is_stable_at(value, self.task);
        let mut stable = stable;
        if !is_stable(stable)? {
            return Ok(stable);
        }
        let mut end = free - SHORT_OF_CHAINS * (free - stable);
        if is_stable(end)? {
            return Ok(free);
        }
        for _ in 0..HALVINGS {
            let middle = 0.5 * (stable + end);
            if is_stable(middle)? {
                stable = middle;
            } else {
                end = middle;
            }
        }
        Ok(stable)
    }
}

/// x(s) y(−s), on the imaginary axis x conj y.
fn product(x: &QuasiPolynomial, y: &QuasiPolynomial) -> TwoSided {
    TwoSided::of(x).times(&TwoSided::of(y).mirrored())
}

/// Every k for which a + k b has a root on the axis up to a frequency, and k for one at zero.
fn gains(
    a: &QuasiPolynomial,
    b: &QuasiPolynomial,
    highest: f64,
    task: &Task,
) -> Result<Vec<f64>, Error> {
    let mut f = Waves::cleaned(&product(a, b), 0);
    let highest = highest.min(f.last_zero());
    let at_zero = |h: &QuasiPolynomial| -> f64 {
        h.coefficients().iter().filter_map(|row| row.first()).sum()
    };
    let mut found = vec![-at_zero(a) / at_zero(b)];
    if highest > 0.0 && !f.is_zero() {
        let places = zeros_between(&mut f, 0.0, highest, task)?;
        found.extend(places.into_iter().map(|omega| -over(a, b, omega).re));
    }
    found.retain(|k| k.is_finite());
    Ok(found)
}

/// The nearest of them above (`sign` 1) or below (−1) the value; infinite where there is none.
fn nearest(found: &[f64], value: f64, sign: f64) -> f64 {
    let apart = found.iter().map(|k| sign * (k - value)).enumerate();
    let least = apart
        .filter(|(_, gap)| *gap > 0.0)
        .min_by(|x, y| x.1.total_cmp(&y.1));
    least.map_or(sign * f64::INFINITY, |(index, _)| found[index])
}
