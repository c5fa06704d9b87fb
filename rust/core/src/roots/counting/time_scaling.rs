//! A unit of time in which the numbers of an equation are moderate.
//!
//! With z = s T and T a power of two next to the span of the delays, or for a polynomial next to one over the
//! size of its roots, h(s) = Σ c_jk T^−k zᵏ e^(−z τ_j/T). Powers of two lose nothing, so that the roots are the
//! same to the last bit; but powers of s stay within the range of double precision. Equations in a
//! reasonable unit are left alone.

use crate::Error;
use crate::quasipoly::QuasiPolynomial;
use crate::roots::region::Region;
use crate::roots::root_set::RootSet;

/// Units that differ from the own one by less than two to this power are reasonable.
const REASONABLE: i32 = 30;

/// Quotients of coefficients further apart than two to this power would underflow.
const WIDEST: i64 = 1000;

/// Edges of regions that are of use in a unit of time.
const MODERATE: std::ops::Range<f64> = 1e-60..1e60;

/// An equation in its own unit of time.
#[derive(Debug, Clone)]
pub(crate) struct TimeScaling {
    pub(crate) h: QuasiPolynomial,
    /// T in seconds, a power of two.
    unit: f64,
}

impl TimeScaling {
    /// `None` where the unit that h comes in is good enough, or no other is better.
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

    /// As [`of`](Self::of), where the edges of `region` are moderate in that unit, too.
    pub(crate) fn within(h: &QuasiPolynomial, region: &Region) -> Option<Self> {
        let own = Self::of(h)?;
        let Region { re, im } = own.region(region);
        let moderate = |end: f64| end == 0.0 || end.is_infinite() || MODERATE.contains(&end.abs());
        let ends = [re.0, re.1, im.0, im.1];
        ends.into_iter().all(moderate).then_some(own)
    }

    /// A real part or frequency in the own unit.
    pub(crate) fn scaled(&self, x: f64) -> f64 {
        x * self.unit
    }

    /// A region in the own unit.
    pub(crate) fn region(&self, region: &Region) -> Region {
        let range = |(low, high)| (self.scaled(low), self.scaled(high));
        Region {
            re: range(region.re),
            im: range(region.im),
        }
    }

    /// Roots in the unit that h came in; `region` where they were sought, if it was given.
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

    /// An error in the unit that h came in.
    pub(crate) fn explained(&self, error: Error) -> Error {
        match error {
            Error::Contour { place, distance } => Error::Contour {
                place: place / self.unit,
                distance: distance / self.unit,
            },
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
    // The roots are of the size of this quotient to the power 1/(highest − lowest).
    let fall = libm::ilogb(*row.last()?) - libm::ilogb(*row.get(lowest)?);
    let powers = i32::try_from(highest - lowest).ok()?;
    Some(fall / powers)
}
