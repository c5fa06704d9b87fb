//! Taylor coefficients of g(s) = h(s) e^(s τ_c) in double-double arithmetic, for roots that lie
//! close together.
//!
//! With d = τ_j − τ_c and b_i = p_j⁽ⁱ⁾(s)/i!, the k-th coefficient of a term is e^(−s d) Σ_i b_i
//! (−d)^(k−i)/(k−i)!. With the bounds of `double_double` (u = 2⁻⁵³) the errors are: of the b_i, by
//! repeated synthetic division, (20n + 4) u² P_i, where P_i is the same with moduli; powers of d
//! over factorials 10 u² each, the sum of products 7 u² + 3.1 (k + 1) u², the exponential (27 +
//! 3|d| (|x| + |y|)) u², the product with it 13.1 u², the sum of m terms 4m u². Together, for C_k =
//! Σ P_i |d|^(k−i)/(k−i)!,
//!     |error| ≤ u² Σ_j (20n + 14k + 60 + 4m + 3|d| (|x| + |y|)) C_k e^(−x d), and u for rounding.
//! `remainder` bounds the coefficient after the last one in a disc.

use num_complex::Complex64;

use super::double_double::{Complex, LAST_ROUNDING, ROUNDING, Turn, turn};
use super::jet::{FLOOR, TINY, modulus};
use super::probe::{ENLARGED, Probe};
use super::quasi_polynomial::QuasiPolynomial;
use crate::elementary::{DoubleDouble, exp_above};

/// Added to an exponent: larger than its rounding errors where the exponential does not overflow.
const EXPONENT_ROUNDING: f64 = 1e-12;

/// Taylor coefficients of g(s) = h(s) e^(s τ) at a point, lowest first.
#[derive(Debug, Clone, PartialEq)]
pub struct Expansion {
    /// g⁽ᵏ⁾/k!.
    pub coefficients: Vec<Complex64>,
    /// Bounds on their errors.
    pub errors: Vec<f64>,
    /// τ, the delay of the term that dominates there, in seconds.
    pub delay: f64,
}

impl QuasiPolynomial {
    /// h around `s` without its largest exponential: h(s + t) = e^(−(s + t) τ) Σ a_k tᵏ, in
    /// double-double arithmetic.
    ///
    /// The error bounds are infinite or NaN where an exponential of the others leaves double
    /// precision.
    ///
    /// ```
    /// # use deadtime::quasipoly::QuasiPolynomial;
    /// # use num_complex::Complex64;
    /// // s − 1 + e^(−s) = s²/2 − s³/6 + …
    /// let h = QuasiPolynomial::new(vec![vec![-1.0, 1.0], vec![1.0]], vec![0.0, 1.0])?;
    /// let near = h.expansion(Complex64::ZERO, 2);
    /// assert!(near.coefficients[0].norm() <= near.errors[0] && near.errors[0] < 1e-29);
    /// assert_eq!(near.coefficients[2], Complex64::new(0.5, 0.0));
    /// # Ok::<(), deadtime::Error>(())
    /// ```
    pub fn expansion(&self, s: Complex64, order: usize) -> Expansion {
        let mut probe = Probe::new(self);
        probe.refer_to_dominant(s);
        expansion(self, probe.reference(), s, order)
    }
}

/// p(s + t) as a polynomial in t, by powers up to `order`, and the same with moduli.
fn shifted(row: &[f64], s: Complex64, order: usize) -> (Vec<Complex>, Vec<f64>) {
    let (place, size) = (Complex::from(s), modulus(s));
    let mut values: Vec<Complex> = row
        .iter()
        .map(|c| Complex::from(Complex64::from(*c)))
        .collect();
    let mut bounds: Vec<f64> = row.iter().map(|c| c.abs() + TINY).collect();
    for lowest in 0..row.len().min(order + 1) {
        let mut carried = (Complex::default(), 0.0);
        for (value, bound) in values.iter_mut().zip(&mut bounds).skip(lowest).rev() {
            *value = carried.0.times(place).plus(*value);
            *bound += carried.1 * size;
            carried = (*value, *bound);
        }
    }
    values.truncate(order + 1);
    bounds.truncate(order + 1);
    (values, bounds)
}

/// The coefficients of g = h e^(s τ_c) at `s` up to `order`, τ_c being the delay of `reference`.
pub(crate) fn expansion(
    h: &QuasiPolynomial,
    reference: usize,
    s: Complex64,
    order: usize,
) -> Expansion {
    let own = h.delays().get(reference).copied().unwrap_or(0.0);
    let reach = s.re.abs() + s.im.abs();
    let count = h.delays().len() as f64;
    let mut sums = vec![Complex::default(); order + 1];
    let mut errors = vec![FLOOR; order + 1];
    for (row, delay) in h.terms() {
        let gap = DoubleDouble::difference(delay, own);
        let (values, bounds) = shifted(row, s, order);
        let mut powers = vec![(DoubleDouble::ONE, 1.0)];
        for l in 1..=order {
            let (last, size) = powers.last().copied().unwrap_or_default();
            let l = l as f64;
            powers.push(((last * -gap).over(l), size * gap.high.abs() / l));
        }
        let Turn { factor, weight } = turn(gap, s);
        for (k, (sum, error)) in sums.iter_mut().zip(&mut errors).enumerate() {
            let (mut coefficient, mut bound) = (Complex::default(), 0.0);
            let pairs = values
                .iter()
                .zip(&bounds)
                .zip(powers.iter().take(k + 1).rev());
            for ((value, size), (power, power_size)) in pairs {
                coefficient = coefficient.plus(value.times_real(*power));
                bound += size * power_size;
            }
            *sum = sum.plus(coefficient.times(factor));
            let share = 20.0 * row.len() as f64
                + 14.0 * k as f64
                + 60.0
                + 4.0 * count
                + 3.0 * gap.high.abs() * reach;
            *error += ROUNDING * share * bound * weight;
        }
    }
    let coefficients: Vec<Complex64> = sums.iter().map(|sum| sum.rounded()).collect();
    for (error, value) in errors.iter_mut().zip(&coefficients) {
        *error += LAST_ROUNDING * modulus(*value);
    }
    Expansion {
        coefficients,
        errors,
        delay: own,
    }
}

/// Bounds on the changes of the coefficients of [`expansion`] per relative change of all
/// coefficients and delays of h.
///
/// With C_k as above, a change of c_j by a part ε changes the k-th coefficient by at most ε C_k, one
/// of τ_j, which multiplies the term by −s δτ, by at most ε τ_j (|s| C_k + C_(k−1)).
pub(crate) fn changes(
    h: &QuasiPolynomial,
    reference: usize,
    s: Complex64,
    order: usize,
) -> Vec<f64> {
    let own = h.delays().get(reference).copied().unwrap_or(0.0);
    let mut totals = vec![0.0; order + 1];
    for (row, delay) in h.terms() {
        let gap = delay - own;
        let (_, bounds) = shifted(row, s, order);
        let weight = exp_above(EXPONENT_ROUNDING - gap * s.re);
        let mut before = 0.0;
        for (k, total) in totals.iter_mut().enumerate() {
            let size = with_powers(&bounds, gap.abs(), k);
            *total += ((1.0 + delay * modulus(s)) * size + delay * before) * weight;
            before = size;
        }
    }
    totals
}

/// Σ P_i |d|^(k − i)/(k − i)!.
fn with_powers(bounds: &[f64], gap: f64, k: usize) -> f64 {
    let mut power = 1.0;
    let mut sum = 0.0;
    for i in (0..=k).rev() {
        sum += bounds.get(i).copied().unwrap_or(0.0) * power;
        power *= gap / (k - i + 1) as f64;
    }
    sum
}

/// Bound on |g⁽ᵏ⁾|/k! for k = `order`, within `radius` of `s`.
pub(crate) fn remainder(
    h: &QuasiPolynomial,
    reference: usize,
    s: Complex64,
    radius: f64,
    order: usize,
) -> f64 {
    let own = h.delays().get(reference).copied().unwrap_or(0.0);
    let size = modulus(s) + radius;
    let mut total = 0.0;
    for (row, delay) in h.terms() {
        let gap = delay - own;
        let mut bounds: Vec<f64> = row.iter().map(|c| c.abs() + TINY).collect();
        for lowest in 0..row.len().min(order + 1) {
            let mut carried = 0.0;
            for bound in bounds.iter_mut().skip(lowest).rev() {
                *bound += carried * size;
                carried = *bound;
            }
        }
        let sum = with_powers(&bounds, gap.abs(), order);
        // The exponent is below 1500 in modulus; otherwise the result is infinite or negligible.
        total += sum * exp_above(gap.abs() * radius - gap * s.re + EXPONENT_ROUNDING);
    }
    (total + FLOOR) * ENLARGED
}
