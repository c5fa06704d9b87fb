//! Sums F(s) = Σ P_δ(s) e^(−s δ) with real polynomials P_δ and delays δ of either sign.
//!
//! On the imaginary axis the conjugate of h(jω) is h(−s), such a sum, and so are all products of
//! quasi-polynomials with conjugates. Beside each coefficient stands the sum of the moduli of
//! everything that was added up in it, and `roundings` counts the operations of the longest chain:
//! with u = 2⁻⁵³ a coefficient is within `roundings` · u · size of its value. Delays that agree to
//! SAME_DELAY of the longest sum of delays are one sum in another order, and are merged.

use crate::order::sort_up;
use crate::quasipoly::{QuasiPolynomial, convolve};

/// Delays closer than this, relative to the longest one, are the same.
pub(super) const SAME_DELAY: f64 = 4.0 * f64::EPSILON;

/// One polynomial, by ascending powers of s.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Row {
    pub(super) delay: f64,
    pub(super) values: Vec<f64>,
    pub(super) sizes: Vec<f64>,
}

impl Row {
    /// `self`(−s), times `sign`.
    pub(super) fn mirrored(&self, sign: f64) -> Self {
        let mut row = self.clone();
        row.delay = -row.delay;
        let mut sign = sign;
        for value in &mut row.values {
            *value *= sign;
            sign = -sign;
        }
        row
    }

    fn add(&mut self, other: &Self) {
        let width = self.values.len().max(other.values.len());
        self.values.resize(width, 0.0);
        self.sizes.resize(width, 0.0);
        for (total, value) in self.values.iter_mut().zip(&other.values) {
            *total += value;
        }
        for (total, size) in self.sizes.iter_mut().zip(&other.sizes) {
            *total += size;
        }
    }
}

/// A sum of such rows, by increasing delay.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct TwoSided {
    pub(super) rows: Vec<Row>,
    /// Largest modulus of any sum of delays that led to one of `rows`.
    pub(super) longest: f64,
    pub(super) roundings: f64,
}

impl TwoSided {
    pub(super) fn of(h: &QuasiPolynomial) -> Self {
        let rows = h.coefficients().iter().zip(h.delays());
        Self {
            rows: rows
                .map(|(row, delay)| Row {
                    delay: *delay,
                    values: row.clone(),
                    sizes: row.iter().map(|c| c.abs()).collect(),
                })
                .collect(),
            longest: h.delays().last().copied().unwrap_or(0.0),
            roundings: 0.0,
        }
    }

    /// Rows in any order, merged.
    pub(super) fn merged(mut rows: Vec<Row>, longest: f64, roundings: f64) -> Self {
        sort_up(&mut rows, |row| row.delay);
        let mut kept: Vec<Row> = Vec::with_capacity(rows.len());
        let (mut chain, mut most) = (0.0, 0.0f64);
        for row in rows {
            match kept.last_mut() {
                Some(last) if row.delay - last.delay <= SAME_DELAY * longest => {
                    last.add(&row);
                    chain += 1.0;
                    most = most.max(chain);
                }
                _ => {
                    kept.push(row);
                    chain = 0.0;
                }
            }
        }
        Self {
            rows: kept,
            longest,
            roundings: roundings + most,
        }
    }

    /// `self`(−s): on the imaginary axis the conjugate.
    pub(super) fn mirrored(&self) -> Self {
        Self {
            rows: self
                .rows
                .iter()
                .rev()
                .map(|row| row.mirrored(1.0))
                .collect(),
            ..*self
        }
    }

    /// `self` + `sign` · `other`.
    pub(super) fn plus(&self, sign: f64, other: &Self) -> Self {
        let mut rows = self.rows.clone();
        rows.extend(other.rows.iter().cloned().map(|mut row| {
            row.values.iter_mut().for_each(|value| *value *= sign);
            row
        }));
        Self::merged(
            rows,
            self.longest.max(other.longest),
            self.roundings.max(other.roundings),
        )
    }

    pub(super) fn times(&self, other: &Self) -> Self {
        let mut rows = Vec::with_capacity(self.rows.len() * other.rows.len());
        for a in &self.rows {
            for b in &other.rows {
                rows.push(Row {
                    delay: a.delay + b.delay,
                    values: convolve(&a.values, &b.values),
                    sizes: convolve(&a.sizes, &b.sizes),
                });
            }
        }
        let width = |sum: &Self| sum.rows.iter().map(|row| row.values.len()).max();
        let summands = width(self).min(width(other)).unwrap_or(0) as f64;
        Self::merged(
            rows,
            self.longest + other.longest,
            self.roundings + other.roundings + summands,
        )
    }
}
