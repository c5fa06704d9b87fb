//! A function prepared for counting: exact roots at 0 are taken out and the coefficients are
//! scaled.

use num_complex::Complex64;

use crate::Error;
use crate::quasipoly::QuasiPolynomial;
use crate::roots::region::Region;

/// The power of two to which coefficients may be scaled down at most, so that the smallest one does
/// not underflow.
const LOWEST_EXPONENT: i32 = -1000;

/// A prepared function: h(s) = factor · sᵏ · `rest`(s) with k = `zeros`.
///
/// Common powers of s are exact roots at 0 and are taken out. Coefficients are scaled by a power
/// of two, to a largest one between 1 and 2 unless that would make the smallest one underflow.
/// Neither changes a root.
#[derive(Debug, Clone)]
pub(crate) struct Prepared {
    pub(crate) rest: QuasiPolynomial,
    pub(crate) zeros: u32,
    /// The power of two in the factor: `rest` = 2^`scale` h/sᵏ.
    pub(crate) scale: i32,
}

impl Prepared {
    /// # Errors
    /// [`Error::Argument`] for the zero function.
    pub(crate) fn new(h: &QuasiPolynomial) -> Result<Self, Error> {
        let sizes = || {
            h.coefficients()
                .iter()
                .flatten()
                .map(|c| c.abs())
                .filter(|c| *c > 0.0)
        };
        let (smallest, largest) = sizes().fold((f64::INFINITY, 0.0f64), |(low, high), c| {
            (low.min(c), high.max(c))
        });
        refuse_if!(
            largest == 0.0,
            "the function is zero everywhere, so its roots cannot be counted"
        );
        // Exponents and powers of two are exact.
        let shift = (-libm::ilogb(largest)).max((LOWEST_EXPONENT - libm::ilogb(smallest)).min(0));
        // The factor is applied in two steps, because 2^1074 itself overflows.
        let half = shift / 2;
        let (first, second) = (libm::ldexp(1.0, half), libm::ldexp(1.0, shift - half));
        let lowest = |row: &Vec<f64>| row.iter().take_while(|c| **c == 0.0).count();
        let common = h.coefficients().iter().map(lowest).min().unwrap_or(0);
        let rows = h
            .coefficients()
            .iter()
            .map(|row| {
                row.iter()
                    .skip(common)
                    .map(|c| c * first * second)
                    .collect()
            })
            .collect();
        Ok(Self {
            rest: QuasiPolynomial::new(rows, h.delays().to_vec())?,
            zeros: u32::try_from(common).unwrap_or(u32::MAX),
            scale: shift,
        })
    }

    /// Number of exact roots at 0 in the region.
    ///
    /// # Errors
    /// [`Error::Contour`] where 0 lies on an edge other than one on the real axis.
    pub(crate) fn zeros_in(&self, region: &Region) -> Result<u32, Error> {
        let Region { re, im } = *region;
        if self.zeros == 0 || re.0 > 0.0 || re.1 < 0.0 || im.0 > 0.0 || im.1 < 0.0 {
            return Ok(0);
        }
        if re.0 == 0.0 || re.1 == 0.0 {
            return Err(Error::contour(Complex64::ZERO, f64::MIN_POSITIVE));
        }
        Ok(self.zeros)
    }
}
