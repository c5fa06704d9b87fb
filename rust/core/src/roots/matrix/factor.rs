//! Factors and inverse of a complex matrix, with bounds on their rounding errors.
//!
//! The proofs rest on the rounding errors of exactly the operations of
//! `linear_algebra::elimination`, Gaussian elimination with partial pivoting. u = 2⁻⁵³; a complex product has the relative error
//! √5 u (Brent, Percival and Zimmermann 2007), a sum u, a quotient, computed as the product with
//! the reciprocal, 6 u. An entry of L or U is a sum of at most n products and a quotient: the
//! computed factors of the n × n matrix Ĝ, rows permuted, fulfil |Ĝ − L U| ≤ γ |L| |U| with γ =
//! 1.02 (n + 12) u. Each column of the computed R solves (L + ΔL)(U + ΔU) r = e with |ΔL| ≤ γ |L|,
//! |ΔU| ≤ γ |U| (Higham 2002, theorems 8.5 and 9.3), so that |Ĝ R − I| ≤ 3.01 γ |L| |U| |R|. The
//! Frobenius norm of the last product is bounded by row norms: that of Σ_k a_k R_k is at most Σ
//! |a_k| |R_k|. Underflow adds far less than FLOOR to what is bounded, while pivots are in the
//! usable range.

use num_complex::Complex64;

use crate::linear_algebra::elimination::Eliminated;
use crate::linear_algebra::rows::Rows;
use crate::quasipoly::modulus;

/// Larger than every effect of underflow.
pub(super) const FLOOR: f64 = 1e-150;

/// u, enlarged by the rounding errors of computing the bounds themselves.
pub(super) const ROUNDING: f64 = 1.02 * 0.5 * f64::EPSILON;

/// Inverse and determinant of a matrix.
#[derive(Debug, Clone)]
pub(super) struct Factored {
    /// R.
    pub(super) inverse: Rows,
    /// Euclidean norms of its rows.
    pub(super) norms: Vec<f64>,
    /// Direction of the determinant of L U, within 8 (n + 1) u.
    pub(super) direction: Complex64,
    /// Bound on the Frobenius norm of Ĝ R − I, and of L U R − I.
    pub(super) residual: f64,
}

/// Factor and invert; `None` where a pivot is zero or leaves the usable range.
pub(super) fn factor(g: Rows) -> Option<Factored> {
    let factors = Eliminated::new(g)?;
    let inverse = factors.inverse();
    let norms = inverse.norms();
    let direction = factors.direction;
    Some(Factored {
        residual: residual(&factors.lower, &factors.upper, &norms),
        inverse,
        norms,
        direction: direction / modulus(direction),
    })
}

/// 3.01 γ times the Frobenius norm of |L| |U| |R|, from the row norms of R.
fn residual(lower: &Rows, upper: &Rows, norms: &[f64]) -> f64 {
    let n = lower.size;
    // |re| + |im| bounds the modulus and does not underflow.
    let dot = |(re, im): (&[f64], &[f64]), x: &[f64]| {
        let sizes = re.iter().zip(im).map(|(a, b)| a.abs() + b.abs());
        sizes.zip(x).map(|(size, x)| size * x).sum::<f64>()
    };
    let part = |rows: &Rows, row: usize, range: std::ops::Range<usize>, x: &[f64]| {
        let (re, im) = rows.row(row);
        match (re.get(range.clone()), im.get(range.clone()), x.get(range)) {
            (Some(re), Some(im), Some(x)) => dot((re, im), x),
            _ => f64::NAN,
        }
    };
    let above: Vec<f64> = (0..n).map(|i| part(upper, i, i..n, norms)).collect();
    let sums = above.iter().enumerate();
    let squares: f64 = sums
        .map(|(i, own)| own + part(lower, i, 0..i, &above))
        .map(|sum| sum * sum)
        .sum();
    3.01 * ROUNDING * (n as f64 + 12.0) * squares.sqrt() + FLOOR
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inverses_have_the_residual_they_claim() {
        let mut g = Rows::zeros(7);
        let mut state = 1u64;
        let mut next = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 11) as f64 / 2f64.powi(53) - 0.5
        };
        for i in 0..7 {
            for j in 0..7 {
                g.add(i, j, Complex64::new(next(), next()));
            }
        }
        let found = factor(g.clone()).unwrap();
        assert!(found.residual < 1e-12);
        let mut off = 0.0;
        for i in 0..7 {
            for j in 0..7 {
                let product: Complex64 =
                    (0..7).map(|k| g.get(i, k) * found.inverse.get(k, j)).sum();
                off += (product - f64::from(u8::from(i == j))).norm_sqr();
            }
        }
        assert!(off.sqrt() <= found.residual && off > 0.0);
    }

    #[test]
    fn singular_matrices_are_refused() {
        assert!(factor(Rows::zeros(3)).is_none());
        let mut g = Rows::zeros(2);
        for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            g.add(i, j, Complex64::new(1.0, 2.0));
        }
        assert!(factor(g).is_none());
    }
}
