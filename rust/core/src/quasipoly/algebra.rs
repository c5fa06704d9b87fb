//! Sums, products and derivatives of quasi-polynomials.
//!
//! Everything is exact except for the rounding of coefficients and of the sums of delays in a
//! product. Such sums depend on the order of their summands by an ulp or two, so that a product
//! merges delays that agree to 4 ulp. Where one factor has no delays, no delay is rounded or
//! merged.

use super::quasi_polynomial::QuasiPolynomial;
use crate::Error;
use crate::order::sort_up;

/// Upper limit on the coefficients of a product (bounds memory and time).
const MAX_COEFFICIENTS: usize = 1_000_000;

/// Upper limit on the order of a derivative of anything other than a polynomial (bounds the time).
const MAX_ORDER: u32 = 10_000;

/// Relative difference of delays of a product below which they are merged.
const SAME_DELAY: f64 = 4.0 * f64::EPSILON;

/// The coefficients of a product of polynomials.
pub(crate) fn convolve(a: &[f64], b: &[f64]) -> Vec<f64> {
    let mut product = vec![0.0; (a.len() + b.len()).saturating_sub(1)];
    for (shift, x) in a.iter().enumerate() {
        for (total, y) in product.iter_mut().skip(shift).zip(b) {
            *total += x * y;
        }
    }
    product
}

/// Sort rows by their delays, and give delays that agree to 4 ulp the same value: they are one sum
/// in different orders.
pub(crate) fn equate_close_delays(rows: &mut [(Vec<f64>, f64)]) {
    sort_up(rows, |row| row.1);
    let mut last = f64::NEG_INFINITY;
    for (_, delay) in rows {
        if *delay - last <= SAME_DELAY * *delay {
            *delay = last;
        } else {
            last = *delay;
        }
    }
}

impl QuasiPolynomial {
    /// The function s.
    pub fn variable() -> Self {
        Self {
            coefficients: vec![vec![0.0, 1.0]],
            delays: vec![0.0],
        }
    }

    /// The highest k such that sᵏ divides every row exactly; 0 for the zero function.
    pub fn powers_of_s(&self) -> usize {
        let first = |row: &Vec<f64>| row.iter().position(|c| *c != 0.0);
        self.coefficients
            .iter()
            .filter_map(first)
            .min()
            .unwrap_or(0)
    }

    /// `self` divided by s^`k`, which must divide it.
    pub fn without_powers(&self, k: usize) -> Self {
        let mut rest = self.clone();
        for row in &mut rest.coefficients {
            row.drain(..k.min(row.len().saturating_sub(1)));
        }
        rest
    }

    fn rows(&self) -> Vec<(Vec<f64>, f64)> {
        self.terms()
            .map(|(row, delay)| (row.to_vec(), delay))
            .collect()
    }

    /// `self + other`.
    ///
    /// # Errors
    /// [`Error::Argument`] when a coefficient overflows.
    pub fn add(&self, other: &Self) -> Result<Self, Error> {
        let mut rows = self.rows();
        rows.extend(other.rows());
        Self::from_rows(rows)
    }

    /// `factor · self`.
    ///
    /// # Errors
    /// [`Error::Argument`] when `factor` is not finite or a coefficient overflows.
    pub fn scale(&self, factor: f64) -> Result<Self, Error> {
        refuse_if!(
            !factor.is_finite(),
            "a factor is {factor}: give a finite number"
        );
        let mut rows = self.rows();
        for value in rows.iter_mut().flat_map(|(row, _)| row) {
            *value *= factor;
        }
        Self::from_rows(rows)
    }

    /// `self − other`.
    ///
    /// # Errors
    /// [`Error::Argument`] when a coefficient overflows.
    pub fn sub(&self, other: &Self) -> Result<Self, Error> {
        self.add(&other.scale(-1.0)?)
    }

    /// `self · other`.
    ///
    /// # Errors
    /// [`Error::Argument`] when a coefficient or a delay overflows, [`Error::TooMuch`] when the
    /// product has too many coefficients.
    pub fn mul(&self, other: &Self) -> Result<Self, Error> {
        let size = self
            .delays
            .len()
            .saturating_mul(other.delays.len())
            .saturating_mul(self.degree() + other.degree() + 1);
        if size > MAX_COEFFICIENTS {
            return Err(Error::TooMuch {
                what: "the product of two quasi-polynomials",
                limit: MAX_COEFFICIENTS as u64,
                unit: "coefficients",
                advice: "keep the factors separate, because the roots of a product are the roots \
                    of its factors"
                    .into(),
            });
        }
        let mut rows = Vec::with_capacity(self.delays.len() * other.delays.len());
        for (a, first) in self.terms() {
            for (b, second) in other.terms() {
                let delay = first + second;
                refuse_if!(
                    !delay.is_finite(),
                    "the sum of the delays {first} s and {second} s exceeds double precision"
                );
                rows.push((convolve(a, b), delay));
            }
        }
        let rounded = |h: &Self| h.delays.iter().any(|delay| *delay > 0.0);
        if rounded(self) && rounded(other) {
            equate_close_delays(&mut rows);
        }
        Self::from_rows(rows)
    }

    /// `self` to a whole power.
    ///
    /// # Errors
    /// As [`QuasiPolynomial::mul`].
    pub fn pow(&self, exponent: u32) -> Result<Self, Error> {
        let mut result = Self::constant(1.0);
        for bit in (0..u32::BITS - exponent.leading_zeros()).rev() {
            result = result.mul(&result)?;
            if exponent >> bit & 1 == 1 {
                result = result.mul(self)?;
            }
        }
        Ok(result)
    }

    /// The `order`-th derivative by s: row p becomes p′ − τp, `order` times.
    ///
    /// # Errors
    /// [`Error::Argument`] when a coefficient overflows, [`Error::TooMuch`] for an order above the
    /// limit.
    pub fn derivative(&self, order: u32) -> Result<Self, Error> {
        let mut rows = self.rows();
        for taken in 0..order {
            if taken >= MAX_ORDER {
                return Err(Error::TooMuch {
                    what: "the derivative",
                    limit: MAX_ORDER.into(),
                    unit: "orders",
                    advice: "give a lower order".into(),
                });
            }
            for (row, delay) in &mut rows {
                let mut power = 0.0;
                for k in 0..row.len() {
                    power += 1.0;
                    let above = row.get(k + 1).copied().unwrap_or(0.0);
                    if let Some(value) = row.get_mut(k) {
                        *value = power * above - *delay * *value;
                    }
                }
            }
            if rows.iter().all(|(row, _)| row.iter().all(|c| *c == 0.0)) {
                return Ok(Self::zero());
            }
        }
        Self::from_rows(rows)
    }
}
