//! The type of equation that a quasi-polynomial belongs to.

use super::quasi_polynomial::QuasiPolynomial;

/// The type, determined by the degrees of the rows after the smallest delay is factored out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Kind {
    /// One row: a polynomial, or one times e^(−sτ). Finitely many roots.
    Polynomial,
    /// The row without delay alone has the highest degree. Finitely many roots right of any line.
    Retarded,
    /// Delayed rows share the highest degree, which is at least 1. Chains of roots run along
    /// vertical lines.
    Neutral,
    /// Every row is a constant: the equation has no derivative.
    Difference,
    /// Only a delayed row has the highest degree. Roots extend arbitrarily far to the right: no
    /// causal system.
    Advanced,
}

impl Kind {
    /// Its name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Polynomial => "polynomial",
            Self::Retarded => "retarded",
            Self::Neutral => "neutral",
            Self::Difference => "difference",
            Self::Advanced => "advanced",
        }
    }
}

impl QuasiPolynomial {
    /// Polynomial, retarded, neutral, difference or advanced.
    ///
    /// ```
    /// use deadtime::quasipoly::{Kind, QuasiPolynomial};
    /// let late = QuasiPolynomial::new(vec![vec![0.0, 1.0], vec![1.0]], vec![2.0, 3.0])?;
    /// assert_eq!(late.kind(), Kind::Retarded);
    /// # Ok::<(), deadtime::Error>(())
    /// ```
    pub fn kind(&self) -> Kind {
        let mut lengths = self.coefficients.iter().map(Vec::len);
        let first = lengths.next().unwrap_or(0);
        match lengths.max() {
            None => Kind::Polynomial,
            Some(others) if others < first => Kind::Retarded,
            Some(others) if others > first => Kind::Advanced,
            Some(1) => Kind::Difference,
            Some(_) => Kind::Neutral,
        }
    }
}
