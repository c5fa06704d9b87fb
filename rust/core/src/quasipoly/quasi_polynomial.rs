//! The type of quasi-polynomials, checked at construction.

use crate::Error;
use crate::order::sort_up;

/// A quasi-polynomial with real coefficients.
///
/// Row j of the coefficients holds the ascending powers of s that are multiplied by
/// e^(−s `delays[j]`). The zero function keeps one row `[0]` at delay 0.
///
/// ```
/// use deadtime::quasipoly::{Kind, QuasiPolynomial};
/// let h = QuasiPolynomial::new(vec![vec![0.0, 1.0], vec![2.0, 0.3]], vec![0.0, 0.36])?;
/// assert_eq!(h.kind(), Kind::Neutral);
/// assert_eq!(h.degree(), 1);
/// # Ok::<(), deadtime::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct QuasiPolynomial {
    pub(super) coefficients: Vec<Vec<f64>>,
    pub(super) delays: Vec<f64>,
}

impl QuasiPolynomial {
    /// Check and normalise: equal delays are merged, zero rows dropped, trailing zeros trimmed.
    ///
    /// # Errors
    /// [`Error::Argument`] when rows and delays differ in number, there is none, a coefficient is
    /// not finite, or a delay is negative or not finite.
    pub fn new(coefficients: Vec<Vec<f64>>, delays: Vec<f64>) -> Result<Self, Error> {
        refuse_if!(
            coefficients.len() != delays.len(),
            "{} rows of coefficients and {} delays are given: give one delay for each row",
            coefficients.len(),
            delays.len()
        );
        refuse_if!(
            delays.is_empty(),
            "a quasi-polynomial needs at least one row of coefficients and its delay"
        );
        if let Some(delay) = delays.iter().find(|d| !(d.is_finite() && **d >= 0.0)) {
            refuse!("a delay is {delay} s, but delays must be finite and not negative");
        }
        if let Some(value) = coefficients.iter().flatten().find(|c| !c.is_finite()) {
            refuse!("a coefficient is {value}, but coefficients must be finite");
        }
        let rows = coefficients.into_iter().zip(delays).collect();
        Self::from_rows(rows)
    }

    /// Sort and merge finite rows; sums that overflow are refused.
    pub(super) fn from_rows(mut rows: Vec<(Vec<f64>, f64)>) -> Result<Self, Error> {
        sort_up(&mut rows, |row| row.1);
        let mut merged: Vec<(Vec<f64>, f64)> = Vec::with_capacity(rows.len());
        for (row, delay) in rows {
            match merged.last_mut() {
                Some((sum, known)) if *known == delay => accumulate(sum, &row),
                // Adding 0.0 turns a negative zero into a positive one.
                _ => merged.push((row, delay + 0.0)),
            }
        }
        for (row, _) in &mut merged {
            while row.last() == Some(&0.0) {
                row.pop();
            }
        }
        merged.retain(|(row, _)| !row.is_empty());
        if merged.is_empty() {
            return Ok(Self::zero());
        }
        refuse_if!(
            merged
                .iter()
                .any(|(row, _)| row.iter().any(|c| !c.is_finite())),
            "a coefficient of the result is too large for double precision: scale the \
             equation or its unit of time"
        );
        let (coefficients, delays) = merged.into_iter().unzip();
        Ok(Self {
            coefficients,
            delays,
        })
    }

    /// The zero function.
    pub fn zero() -> Self {
        Self::constant(0.0)
    }

    pub(super) fn constant(value: f64) -> Self {
        Self {
            coefficients: vec![vec![value]],
            delays: vec![0.0],
        }
    }

    /// Rows of ascending coefficients, one for each delay, without trailing zeros.
    pub fn coefficients(&self) -> &[Vec<f64>] {
        &self.coefficients
    }

    /// The delays in seconds, ascending and distinct.
    pub fn delays(&self) -> &[f64] {
        &self.delays
    }

    /// The highest power of s in any row; 0 for the zero function.
    pub fn degree(&self) -> usize {
        self.coefficients
            .iter()
            .map(|row| row.len().saturating_sub(1))
            .max()
            .unwrap_or(0)
    }

    /// Is this the zero function?
    pub fn is_zero(&self) -> bool {
        self.coefficients.iter().flatten().all(|c| *c == 0.0)
    }

    /// Rows with their delays.
    pub(crate) fn terms(&self) -> impl Iterator<Item = (&[f64], f64)> {
        self.coefficients
            .iter()
            .map(Vec::as_slice)
            .zip(self.delays.iter().copied())
    }
}

/// `sum += row`.
fn accumulate(sum: &mut Vec<f64>, row: &[f64]) {
    if sum.len() < row.len() {
        sum.resize(row.len(), 0.0);
    }
    for (total, value) in sum.iter_mut().zip(row) {
        *total += value;
    }
}
