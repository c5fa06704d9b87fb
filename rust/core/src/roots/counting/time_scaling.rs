//! A unit of time in which the numbers of an equation are moderate.
//!
//! With z = s T and T a power of two next to the span of the delays, or for a polynomial next to
//! one over the size of its roots, h(s) = Σ c_jk T^−k zᵏ e^(−z τ_j/T). Scaling by powers of two is
//! exact, so that the roots keep every bit, and powers of s stay within the range of double
//! precision. Equations in a reasonable unit are not scaled.

use crate::Error;
use crate::quasipoly::QuasiPolynomial;
use crate::roots::region::Region;
use crate::roots::root_set::RootSet;

/// No scaling is done if T differs from 1 by less than two to this power.
const REASONABLE: i32 = 30;

/// Ratios of coefficients beyond two to this power would underflow; such equations are not scaled.
const WIDEST: i64 = 1000;

/// Range of edges of regions for which counting in a scaled unit makes sense.
const MODERATE: std::ops::Range<f64> = 1e-60..1e60;

/// An equation in a scaled unit of time.
#[derive(Debug, Clone)]
pub(crate) struct TimeScaling {
    pub(crate) h: QuasiPolynomial,
    /// T in seconds, a power of two.
    unit: f64,
}

impl TimeScaling {
    /// The scaled equation; `None` where the given unit is good enough or no other one is better.
    pub(crate) fn of(h: &QuasiPolynomial) -> Option<Self> {
        let power = unit_of_time(h)?;
        if power.abs() <= REASONABLE {
            return None;
        }
        let unit = libm::ldexp(1.0, power);
        // Exponents of c T^-k.
        let exponent = |k: usize, c: f64| i64::from(libm::ilogb(c)) - k as i64 * i64::from(power);
        let exponents = h.coefficients().iter().flat_map(|row| {
            let parts = row.iter().enumerate().filter(|(_, c)| **c != 0.0);
            parts.map(move |(k, c)| exponent(k, *c))
        });
        let (least, most) = exponents.fold((i64::MAX, i64::MIN), |(low, high), e| {
            (low.min(e), high.max(e))
        });
        if most.checked_sub(least)? > WIDEST {
            return None;
        }
        let scaled = |k: usize, c: f64| {
            if c == 0.0 {
                return c;
            }
            let mantissa = libm::ldexp(c, -libm::ilogb(c));
            let target = i32::try_from(exponent(k, c) - most).unwrap_or(i32::MIN);
            libm::ldexp(mantissa, target)
        };
        let rows = h.coefficients().iter();
        let rows = rows.map(|row| row.iter().enumerate().map(|(k, c)| scaled(k, *c)).collect());
        let delays = h.delays().iter().map(|delay| delay / unit).collect();
        let h = QuasiPolynomial::new(rows.collect(), delays).ok()?;
        Some(Self { h, unit })
    }

    /// As [`of`](Self::of), if the edges of `region` are moderate in the scaled unit as well.
    pub(crate) fn within(h: &QuasiPolynomial, region: &Region) -> Option<Self> {
        let own = Self::of(h)?;
        let Region { re, im } = own.region(region);
        let moderate = |end: f64| end == 0.0 || end.is_infinite() || MODERATE.contains(&end.abs());
        let ends = [re.0, re.1, im.0, im.1];
        ends.into_iter().all(moderate).then_some(own)
    }

    /// A real part or frequency in the scaled unit.
    pub(crate) fn scaled(&self, x: f64) -> f64 {
        x * self.unit
    }

    /// A region in the scaled unit.
    pub(crate) fn region(&self, region: &Region) -> Region {
        let range = |(low, high)| (self.scaled(low), self.scaled(high));
        Region {
            re: range(region.re),
            im: range(region.im),
        }
    }

    /// Roots in the given unit. `region` is where they were sought, if it was given.
    pub(crate) fn returned(&self, mut set: RootSet, region: Option<Region>) -> RootSet {
        for root in &mut set.roots {
            *root /= self.unit;
        }
        for radius in &mut set.radii {
            *radius /= self.unit;
        }
        let range = |(low, high)| (low / self.unit, high / self.unit);
        set.region = region.unwrap_or(Region {
            re: range(set.region.re),
            im: range(set.region.im),
        });
        set
    }

    /// An error in the given unit.
    pub(crate) fn explained(&self, error: Error) -> Error {
        match error {
            Error::Contour { place, distance } => {
                Error::contour(place / self.unit, distance / self.unit)
            }
            Error::CountMismatch {
                counted,
                found,
                advice,
            } => Error::CountMismatch {
                counted,
                found: found
                    .into_iter()
                    .map(|(root, m)| (root / self.unit, m))
                    .collect(),
                advice,
            },
            other => other,
        }
    }
}

/// log2 T, rounded; `None` for a constant.
fn unit_of_time(h: &QuasiPolynomial) -> Option<i32> {
    let (first, last) = (h.delays().first()?, h.delays().last()?);
    if last > first {
        return Some(libm::ilogb(last - first));
    }
    let row = h.coefficients().first()?;
    let lowest = row.iter().position(|c| *c != 0.0)?;
    let highest = row.len().checked_sub(1)?;
    if highest == lowest {
        return None;
    }
    // The roots are of the order of this quotient to the power 1/(highest − lowest).
    let fall = libm::ilogb(*row.last()?) - libm::ilogb(*row.get(lowest)?);
    let powers = i32::try_from(highest - lowest).ok()?;
    Some(fall / powers)
}
