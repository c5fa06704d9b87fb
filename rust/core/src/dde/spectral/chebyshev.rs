//! Chebyshev polynomials T_k on [−1, 1]: values, sums, derivatives, integrals.
//!
//! Coefficients of a vector function are stored component by component, `n` for each. With
//! p = Σ c_k T_k the derivative p′ = Σ d_k T_k has d_{k−1} = d_{k+1} + 2 k c_k, d_0 halved
//! (Mason and Handscomb, Chebyshev Polynomials, 2003, eq. 2.52), and
//! ∫ T_k = T_{k+1} / (2 (k + 1)) − T_{k−1} / (2 (k − 1)) for k ≥ 2 (eq. 2.43).

use pulp::{Simd, WithSimd};

use crate::simd::Instructions;

/// Fill row k of `table` with T_k at all `points`, for k below `n`.
pub(super) fn basis(points: &[f64], n: usize, table: &mut Vec<f64>) {
    let m = points.len();
    table.clear();
    table.resize(n.max(2) * m, 1.0);
    table[m..2 * m].copy_from_slice(points);
    Instructions::chosen().run(Recurrence { points, table });
}

/// The rows of a table from the third on; those before are known.
struct Recurrence<'a> {
    points: &'a [f64],
    table: &'a mut [f64],
}

impl WithSimd for Recurrence<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let m = self.points.len().max(1);
        let mut rows = self.table.chunks_exact_mut(m);
        let (Some(mut older), Some(mut old)) = (rows.next(), rows.next()) else {
            return;
        };
        for next in rows {
            let above = next.iter_mut().zip(self.points);
            for ((next, x), (old, older)) in above.zip(old.iter().zip(older.iter())) {
                *next = 2.0 * x * old - older;
            }
            (older, old) = (old, next);
        }
    }
}

/// Σ_k c_k T_k(x) by Clenshaw's recurrence.
pub(super) fn value(coefficients: &[f64], x: f64) -> f64 {
    let (mut next, mut after) = (0.0, 0.0);
    for c in coefficients.iter().skip(1).rev() {
        (next, after) = (2.0 * x * next - after + c, next);
    }
    x * next - after + coefficients.first().copied().unwrap_or(0.0)
}

/// Coefficients of the derivative, times `scale`; as many as there are in `coefficients`.
pub(super) fn derivative(coefficients: &[f64], scale: f64, out: &mut [f64]) {
    let n = coefficients.len();
    out.fill(0.0);
    for k in (1..n).rev() {
        let above = if k + 1 < n { out[k + 1] } else { 0.0 };
        out[k - 1] = above + 2.0 * k as f64 * coefficients[k];
    }
    if let Some(first) = out.first_mut() {
        *first *= 0.5;
    }
    out.iter_mut().for_each(|d| *d *= scale);
}

/// ∫ from −1 to x of T_k, where `t` returns T_0 … T_{k+1} at x.
pub(super) fn integral(k: usize, t: impl Fn(usize) -> f64) -> f64 {
    let sign = if k.is_multiple_of(2) { 1.0 } else { -1.0 };
    match k {
        0 => t(1) + 1.0,
        1 => 0.5 * (t(1) * t(1) - 1.0),
        _ => {
            let (above, below) = (k as f64 + 1.0, k as f64 - 1.0);
            // At −1 the two terms are −sign of T_k over twice their denominators.
            0.5 * ((t(k + 1) + sign) / above - (t(k - 1) + sign) / below)
        }
    }
}
