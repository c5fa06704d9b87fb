//! Factors and inverse of a complex matrix, with bounds on their rounding errors.
//!
//! Gaussian elimination with partial pivoting, written out here because the proofs rest on the
//! rounding errors of exactly these operations. u = 2⁻⁵³; a complex product has the relative error
//! √5 u (Brent, Percival and Zimmermann 2007), a sum u, a quotient, computed as the product with
//! the reciprocal, 6 u. An entry of L or U is a sum of at most n products and a quotient: the
//! computed factors of the n × n matrix Ĝ, rows permuted, fulfil |Ĝ − L U| ≤ γ |L| |U| with γ =
//! 1.02 (n + 12) u. Each column of the computed R solves (L + ΔL)(U + ΔU) r = e with |ΔL| ≤ γ |L|,
//! |ΔU| ≤ γ |U| (Higham 2002, theorems 8.5 and 9.3), so that |Ĝ R − I| ≤ 3.01 γ |L| |U| |R|. The
//! Frobenius norm of the last product is bounded by row norms: that of Σ_k a_k R_k is at most Σ
//! |a_k| |R_k|. Underflow adds far less than FLOOR to what is bounded, while pivots are in the
//! usable range.

use num_complex::Complex64;

use crate::quasipoly::modulus;

/// Moduli of pivots whose squares and reciprocals are normal numbers.
const USABLE: std::ops::Range<f64> = 1e-140..1e140;

/// Larger than every effect of underflow.
const FLOOR: f64 = 1e-150;

/// u, enlarged by the rounding errors of computing the bounds themselves.
pub(super) const ROUNDING: f64 = 1.02 * 0.5 * f64::EPSILON;

/// A complex matrix by rows, real and imaginary parts apart.
#[derive(Debug, Clone, Default)]
pub(super) struct Rows {
    pub(super) size: usize,
    pub(super) re: Vec<f64>,
    pub(super) im: Vec<f64>,
}

impl Rows {
    pub(super) fn zeros(size: usize) -> Self {
        Self {
            size,
            re: vec![0.0; size * size],
            im: vec![0.0; size * size],
        }
    }

    #[inline(always)]
    pub(super) fn get(&self, row: usize, column: usize) -> Complex64 {
        let at = row * self.size + column;
        match (self.re.get(at), self.im.get(at)) {
            (Some(re), Some(im)) => Complex64::new(*re, *im),
            _ => Complex64::ZERO,
        }
    }

    pub(super) fn add(&mut self, row: usize, column: usize, x: Complex64) {
        let at = row * self.size + column;
        if let (Some(re), Some(im)) = (self.re.get_mut(at), self.im.get_mut(at)) {
            *re += x.re;
            *im += x.im;
        }
    }

    pub(super) fn row(&self, row: usize) -> (&[f64], &[f64]) {
        let range = row * self.size..(row + 1) * self.size;
        (
            self.re.get(range.clone()).unwrap_or(&[]),
            self.im.get(range).unwrap_or(&[]),
        )
    }

    fn swap(&mut self, a: usize, b: usize) {
        for k in 0..self.size {
            self.re.swap(a * self.size + k, b * self.size + k);
            self.im.swap(a * self.size + k, b * self.size + k);
        }
    }

    /// Subtract `factor` times row `from` from row `to`, from column `start` on.
    #[inline(always)]
    fn eliminate(&mut self, to: usize, from: usize, factor: Complex64, start: usize) {
        let size = self.size;
        subtract(&mut self.re, &mut self.im, size, (to, from), factor, start);
    }

    /// Euclidean norms of the rows.
    pub(super) fn norms(&self) -> Vec<f64> {
        (0..self.size).map(|row| norm(self.row(row))).collect()
    }
}

/// Euclidean norm with a relative error of n u; infinite or NaN where squares overflow.
pub(super) fn norm((re, im): (&[f64], &[f64])) -> f64 {
    re.iter().chain(im).map(|x| x * x).sum::<f64>().sqrt()
}

#[inline(always)]
fn subtract(
    re: &mut [f64],
    im: &mut [f64],
    size: usize,
    (to, from): (usize, usize),
    factor: Complex64,
    start: usize,
) {
    let (low, high) = (to.min(from), to.max(from));
    let (Some((re_low, re_high)), Some((im_low, im_high))) = (
        re.split_at_mut_checked(high * size),
        im.split_at_mut_checked(high * size),
    ) else {
        return;
    };
    let (Some(re_low), Some(im_low), Some(re_high), Some(im_high)) = (
        re_low.get_mut(low * size + start..(low + 1) * size),
        im_low.get_mut(low * size + start..(low + 1) * size),
        re_high.get_mut(start..size),
        im_high.get_mut(start..size),
    ) else {
        return;
    };
    let (a, b) = (factor.re, factor.im);
    let off = |tr: &mut [f64], ti: &mut [f64], fr: &[f64], fi: &[f64]| {
        for (((tr, ti), fr), fi) in tr.iter_mut().zip(ti).zip(fr).zip(fi) {
            *tr -= a * fr - b * fi;
            *ti -= a * fi + b * fr;
        }
    };
    if to > from {
        off(re_high, im_high, re_low, im_low);
    } else {
        off(re_low, im_low, re_high, im_high);
    }
}

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
    // The same operations in the same order, in wider registers where the machine has them.
    pulp::Arch::new().dispatch(|| eliminated(g))
}

#[inline(always)]
fn eliminated(mut g: Rows) -> Option<Factored> {
    let n = g.size;
    let mut order: Vec<usize> = (0..n).collect();
    let mut direction = Complex64::ONE;
    let mut reciprocals = Vec::with_capacity(n);
    for k in 0..n {
        let (mut best, mut largest) = (k, 0.0);
        for i in k..n {
            let size = g.get(i, k).norm_sqr();
            if size > largest {
                (best, largest) = (i, size);
            }
        }
        if best != k {
            g.swap(k, best);
            order.swap(k, best);
            direction = -direction;
        }
        let pivot = g.get(k, k);
        let size = modulus(pivot);
        if !USABLE.contains(&size) {
            return None;
        }
        direction *= pivot / size;
        let reciprocal = pivot.conj() / pivot.norm_sqr();
        reciprocals.push(reciprocal);
        for i in k + 1..n {
            let entry = g.get(i, k);
            if entry == Complex64::ZERO {
                continue;
            }
            let factor = entry * reciprocal;
            g.eliminate(i, k, factor, k + 1);
            let at = i * n + k;
            if let (Some(re), Some(im)) = (g.re.get_mut(at), g.im.get_mut(at)) {
                (*re, *im) = (factor.re, factor.im);
            }
        }
    }
    let inverse = solve(&g, &order, &reciprocals);
    let norms = inverse.norms();
    let residual = residual(&g, &norms);
    let length = modulus(direction);
    Some(Factored {
        inverse,
        norms,
        direction: direction / length,
        residual,
    })
}

/// R with L U R = P, the permuted identity.
#[inline(always)]
fn solve(lu: &Rows, order: &[usize], reciprocals: &[Complex64]) -> Rows {
    let n = lu.size;
    let mut r = Rows::zeros(n);
    for (row, column) in order.iter().enumerate() {
        r.add(row, *column, Complex64::ONE);
    }
    for i in 0..n {
        for k in 0..i {
            let factor = lu.get(i, k);
            if factor != Complex64::ZERO {
                r.eliminate(i, k, factor, 0);
            }
        }
    }
    for (i, reciprocal) in reciprocals.iter().enumerate().rev() {
        for k in i + 1..n {
            let factor = lu.get(i, k);
            if factor != Complex64::ZERO {
                r.eliminate(i, k, factor, 0);
            }
        }
        let range = i * n..(i + 1) * n;
        let (Some(re), Some(im)) = (r.re.get_mut(range.clone()), r.im.get_mut(range)) else {
            continue;
        };
        for (re, im) in re.iter_mut().zip(im) {
            let x = Complex64::new(*re, *im) * reciprocal;
            (*re, *im) = (x.re, x.im);
        }
    }
    r
}

/// 3.01 γ times the Frobenius norm of |L| |U| |R|, from the row norms of R.
fn residual(lu: &Rows, norms: &[f64]) -> f64 {
    let n = lu.size;
    let size = |row: usize, column: usize| modulus(lu.get(row, column));
    let upper: Vec<f64> = (0..n)
        .map(|i| {
            (i..n)
                .zip(norms.iter().skip(i))
                .map(|(k, x)| size(i, k) * x)
                .sum()
        })
        .collect();
    let squares: f64 = upper
        .iter()
        .enumerate()
        .map(|(i, own)| {
            let below: f64 = upper
                .iter()
                .take(i)
                .enumerate()
                .map(|(k, x)| size(i, k) * x)
                .sum();
            (own + below) * (own + below)
        })
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
