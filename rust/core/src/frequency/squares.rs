//! |d(jω)|² − |n(jω)|², whose zeros are where the gain of n/d is one.
//!
//! Value and slope come from the values and slopes of d and n, with their proved errors: with
//! |g| known to e and |g′| to e′, |g|² is within e (2|g| + e) and 2 Re(conj(g) j g′) within
//! 2 (e |g′| + e′ |g| + e e′) of its value, plus four roundings of each. Higher derivatives and
//! bounds are those of the sum d(s) d(−s) − n(s) n(−s), see `waves`.

use num_complex::Complex64;

use super::two_sided::TwoSided;
use super::waves::Waves;
use super::zeros::{RealFunction, Taylor};
use crate::Error;
use crate::quasipoly::{Probe, QuasiPolynomial};

/// Four roundings, enlarged.
const LAST: f64 = 2.1 * f64::EPSILON;

/// The difference of the squares of two moduli on the imaginary axis.
#[derive(Debug)]
pub(super) struct DifferenceOfSquares<'a> {
    d: Probe<'a>,
    n: Probe<'a>,
    waves: Waves,
}

/// A value and a bound on its error.
type Known = (f64, f64);

impl<'a> DifferenceOfSquares<'a> {
    pub(super) fn new(d: &'a QuasiPolynomial, n: &'a QuasiPolynomial) -> Self {
        let square = |h| {
            let sum = TwoSided::of(h);
            sum.times(&sum.mirrored())
        };
        Self {
            d: Probe::new(d),
            n: Probe::new(n),
            waves: Waves::new(&square(d).plus(-1.0, &square(n)), 1),
        }
    }

    /// A bound on the zeros; infinite where there is none.
    pub(super) fn last_zero(&self) -> f64 {
        self.waves.last_zero()
    }

    fn first_two(&mut self, omega: f64) -> [Known; 2] {
        let [d, n] = [&mut self.d, &mut self.n].map(|probe| square(probe, omega));
        let minus = |d: Known, n: Known| (d.0 - n.0, d.1 + n.1 + LAST * (d.0.abs() + n.0.abs()));
        [minus(d[0], n[0]), minus(d[1], n[1])]
    }
}

/// Both without common powers of s, and with a common factor, a power of two, that keeps their
/// squares within the range of doubles.
pub(super) fn alike(
    n: &QuasiPolynomial,
    d: &QuasiPolynomial,
) -> Result<(QuasiPolynomial, QuasiPolynomial), Error> {
    let common = if n.is_zero() {
        0
    } else {
        n.powers_of_s().min(d.powers_of_s())
    };
    let largest = [n, d]
        .into_iter()
        .flat_map(|h| h.coefficients().iter().flatten());
    let largest = largest.fold(f64::MIN_POSITIVE, |most, c| c.abs().max(most));
    let unit = libm::ldexp(1.0, -libm::ilogb(largest).clamp(-1000, 1000));
    Ok((
        n.without_powers(common).scale(unit)?,
        d.without_powers(common).scale(unit)?,
    ))
}

/// |g|² and its derivative by ω.
fn square(probe: &mut Probe<'_>, omega: f64) -> [Known; 2] {
    let jet = probe.jet(Complex64::new(0.0, omega));
    let size = jet.value.norm_sqr();
    let (modulus, steep) = (size.sqrt(), jet.slope.norm_sqr().sqrt());
    let (error, slope_error) = (jet.value_error, jet.slope_error);
    let slope = 2.0 * (jet.value.im * jet.slope.re - jet.value.re * jet.slope.im);
    let margin = 1.0 + 1e-9;
    [
        (size, margin * error * (2.0 * modulus + error) + LAST * size),
        (
            slope,
            margin * 2.0 * (error * steep + slope_error * modulus + error * slope_error)
                + LAST * 2.0 * modulus * steep,
        ),
    ]
}

impl RealFunction for DifferenceOfSquares<'_> {
    fn value(&mut self, omega: f64) -> f64 {
        self.first_two(omega)[0].0
    }

    fn taylor(&mut self, omega: f64) -> Taylor {
        let mut found = self.waves.taylor(omega);
        for (k, (value, error)) in self.first_two(omega).into_iter().enumerate() {
            found.values[k] = value;
            found.errors[k] = error;
        }
        found
    }

    fn bound(&self, omega: f64) -> f64 {
        self.waves.bound(omega)
    }
}
