//! g(s) = h(s) e^(s τ_c) and its slope in double-double arithmetic, for points where rounding
//! errors of double precision exceed the value.
//!
//! The terms are those of `probe`. With u = 2⁻⁵³ a complex product has the relative error 7 √2 +
//! 3.1 < 13.1 u², a sum 3.1 u²: Horner's rule for degree n 17 n u² P_j, its derivative 34 n u²
//! P_j′. The difference d of two delays is exact; d x and d y have errors of 2 u² each, which
//! changes the exponential by less than 3 u² |d| (|x| + |y|). The errors are 8 u² of e^(−x d), 12
//! u² of sine and cosine together, 7 u² of their products with it, 13.1 u² of the product with p_j,
//! 23.2 u² of the factor d and the difference in g′, and 3.1 (m − 1) u² of the sum of m terms.
//! Hence
//!     |error of g| ≤ u² Σ (17n + 4m + 64 + 3|d| (|x| + |y|)) P_j(|s|) e^(−x d_j),
//! with 34n and P_j′ + |d| P_j for g′, and u |g| for rounding the result to doubles. Underflow is
//! covered as in `probe`.

use num_complex::Complex64;

use super::jet::{FLOOR, Jet, TINY, modulus};
use super::quasi_polynomial::QuasiPolynomial;
use crate::elementary::DoubleDouble;
use crate::elementary::precise::{self, LARGEST_EXPONENT};

/// u², enlarged by the rounding errors of computing the bounds.
pub(super) const ROUNDING: f64 = 1.02 * 0.25 * f64::EPSILON * f64::EPSILON;

/// Relative error of rounding a double-double to a double, enlarged in the same way.
pub(super) const LAST_ROUNDING: f64 = 1.02 * 0.5 * f64::EPSILON;

/// Largest relative error of an exponential, in units of u²: its phase is wrong by at most half a
/// turn.
const OPPOSITE: f64 = 10.0 / (f64::EPSILON * f64::EPSILON);

/// Larger than e^−600, which counts as zero.
const VANISHING: f64 = 1e-260;

/// A complex number whose parts are double-doubles.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Complex {
    re: DoubleDouble,
    im: DoubleDouble,
}

impl From<Complex64> for Complex {
    fn from(s: Complex64) -> Self {
        Self {
            re: s.re.into(),
            im: s.im.into(),
        }
    }
}

impl Complex {
    pub(super) fn times(self, other: Self) -> Self {
        Self {
            re: self.re * other.re - self.im * other.im,
            im: self.re * other.im + self.im * other.re,
        }
    }

    pub(super) fn plus(self, other: Self) -> Self {
        Self {
            re: self.re + other.re,
            im: self.im + other.im,
        }
    }

    pub(super) fn times_real(self, factor: DoubleDouble) -> Self {
        Self {
            re: self.re * factor,
            im: self.im * factor,
        }
    }

    pub(super) fn rounded(self) -> Complex64 {
        Complex64::new(self.re.high, self.im.high)
    }
}

/// e^(−s d).
pub(super) struct Turn {
    pub(super) factor: Complex,
    /// Its modulus, or a larger number: the factor of relative errors.
    pub(super) weight: f64,
}

/// e^(−s `gap`) within (27 + 3 |d| (|x| + |y|)) u².
pub(super) fn turn(gap: DoubleDouble, s: Complex64) -> Turn {
    if gap.high == 0.0 {
        let factor = Complex::from(Complex64::ONE);
        return Turn {
            factor,
            weight: 1.0,
        };
    }
    let exponent = gap * -s.re;
    if exponent.high < -LARGEST_EXPONENT {
        // The factor is lost completely, with an error of its own size.
        return Turn {
            factor: Complex::default(),
            weight: VANISHING / ROUNDING,
        };
    }
    let size = precise::exp(exponent);
    let (sine, cosine) = precise::sin_cos(gap * s.im);
    Turn {
        factor: Complex {
            re: cosine * size,
            im: -(sine * size),
        },
        weight: size.high * (1.0 + 1e-15) + TINY,
    }
}

/// e^(−s (`delay` − `own`)) to double precision for any size of the exponent.
pub(crate) fn relative_turn(delay: f64, own: f64, s: Complex64) -> Complex64 {
    turn(DoubleDouble::difference(delay, own), s)
        .factor
        .rounded()
}

/// The jet of h e^(s τ_c) at `s`, τ_c being the delay of term `reference`.
///
/// Its error bounds are about 2⁻⁵² times those of a jet in double precision, plus the rounding of
/// the result. NaN where an exponential or a product leaves the range of double precision.
pub(super) fn jet(h: &QuasiPolynomial, reference: usize, s: Complex64) -> Jet {
    let own = h.delays().get(reference).copied().unwrap_or(0.0);
    let place = Complex::from(s);
    let size = modulus(s);
    let reach = s.re.abs() + s.im.abs();
    let count = h.delays().len() as f64;
    let (mut value, mut slope) = (Complex::default(), Complex::default());
    let (mut value_error, mut slope_error, mut gaps) = (0.0, 0.0, 0.0);
    for (row, delay) in h.terms() {
        let gap = DoubleDouble::difference(delay, own);
        let (mut p, mut dp) = (Complex::default(), Complex::default());
        let (mut bound, mut slope_bound) = (0.0, 0.0);
        for c in row.iter().rev() {
            dp = dp.times(place).plus(p);
            p = p.times(place);
            p.re = p.re + *c;
            slope_bound = slope_bound * size + bound;
            bound = bound * size + (c.abs() + TINY);
        }
        let Turn { factor, weight } = turn(gap, s);
        let (term, turned) = (p.times(factor), dp.times(factor));
        value = value.plus(term);
        let lag = term.times_real(-gap);
        slope = slope.plus(turned).plus(lag);
        let length = row.len() as f64;
        let gap = gap.high.abs();
        let shared = 4.0 * count + 64.0 + (3.0 * gap * reach).min(OPPOSITE);
        gaps += gap;
        value_error += (17.0 * length + shared) * bound * weight;
        slope_error += (34.0 * length + shared) * (slope_bound + gap * bound) * weight;
    }
    let (value, slope) = (value.rounded(), slope.rounded());
    Jet {
        value,
        slope,
        value_error: ROUNDING * value_error + FLOOR + LAST_ROUNDING * modulus(value),
        slope_error: ROUNDING * slope_error + FLOOR * (1.0 + gaps) + LAST_ROUNDING * modulus(slope),
        overtaken_by: None,
    }
}
