//! A simple root enclosed by Newton's theorem for one entry of the inverse of a bordered matrix.
//!
//! With B(s) = [G(s) b; cᵀ 0], G as in `local_enclosure`, det G = det B · g, where g is the last
//! entry on the diagonal of B⁻¹ (Cramer's rule; Keller 1977). b and c are taken from the left and
//! right null vectors of G, so that B is regular next to a simple root. Wherever B is regular, the
//! roots of det G are those of g. With e the last unit vector, g′ = −eᵀB⁻¹ B′ B⁻¹e and g″ = 2
//! eᵀB⁻¹ B′ B⁻¹ B′ B⁻¹e − eᵀB⁻¹ B″ B⁻¹e. If |g″| ≤ C within t of z and |g(z)| + C ρ²/2 < |g′(z)| ρ
//! for both ρ = r and ρ = t, then it holds in between, and by Rouché's theorem exactly one root
//! lies within r of z and no other within t.
//!
//! Let R be the computed inverse at z, B R = I − Y, |Y| ≤ α, |Y e| ≤ η, a its last row and c its
//! last column. Then B⁻¹ = R (I − Y)⁻¹, hence g = R_nn + a (I − Y)⁻¹ Y e. All norms are Frobenius
//! norms. B(s) differs from B(z) by at most t max |B′|, so that B⁻¹ at most doubles within t as
//! long as |B⁻¹| t max |B′| ≤ 1/2.

use num_complex::Complex64;

use super::balance::Balanced;
use super::factor::{FLOOR, Factored, ROUNDING, factor};
use super::local_enclosure::Weights;
use super::system::Irreducible;
use crate::elementary::exp;
use crate::linear_algebra::rows::{Rows, norm};
use crate::quasipoly::modulus;
use crate::roots::disc::Disc;

/// Covers the rounding errors of sums of bounds.
const MARGIN: f64 = 1.0 + 1e-9;
const SHRUNK: f64 = 1.0 - 1e-9;

/// Largest radius of what is examined, in units of one over the longest gap between delays.
/// Larger: wider bounds on derivatives; smaller: the root is shown to be alone in a smaller disc.
const LARGEST_REACH: f64 = 0.25;

/// Distance, relative to |z|, of the point from whose inverse b and c are taken. Larger: they are
/// less accurate; smaller: the matrix may be singular.
const ASIDE: f64 = 1e-6;

/// Modulus that replaces that of points close to 0, in units of the rate of the system.
const LEAST_SIZE: f64 = 1e-3;

/// Largest α. Larger: B may be nearly singular; smaller: roots next to others are refused.
const MOST_RESIDUAL: f64 = 0.01;

/// Least isolation in units of the radius.
const LEAST_ISOLATION: f64 = 4.0;

/// G and G′ at a point, with bounds on the moduli of the entries around it.
pub(super) struct Dense {
    pub(super) g: Rows,
    pub(super) slope: Rows,
    /// Frobenius norms of bounds on G′ and G″ within the radius asked for.
    first: f64,
    second: f64,
    /// Bounds on the errors of G by rows, and that of G′ relative to `first`.
    pub(super) lost: Vec<f64>,
    loss: f64,
}

impl Dense {
    pub(super) fn new(
        system: &Irreducible,
        balanced: &Balanced,
        z: Complex64,
        radius: f64,
    ) -> Self {
        let n = system.size();
        let (mut g, mut slope) = (Rows::zeros(n), Rows::zeros(n));
        let mut lost = vec![FLOOR; n * n];
        let (mut first, mut second) = (lost.clone(), lost.clone());
        let mut most_loss = 0.0f64;
        let mut weights = Weights::new(system, balanced, z);
        let size = modulus(z);
        let rows = balanced.rows.iter().zip(&balanced.references);
        for (i, (terms, reference)) in rows.enumerate() {
            for term in terms {
                let (gap, weight, factor) = weights.get(term.delay, *reference);
                let loss = weights.loss(term, terms.len(), gap);
                most_loss = most_loss.max(loss);
                let grown = weight * exp(gap.abs() * radius) * MARGIN;
                for entry in &term.entries {
                    let value = z * entry.slope + entry.value;
                    g.add(i, entry.column, value * factor);
                    slope.add(i, entry.column, (entry.slope - value * gap) * factor);
                    let (on_s, rest) = (entry.slope.abs(), entry.value.abs());
                    let whole = (size + radius) * on_s + rest;
                    let at = i * n + entry.column;
                    if let (Some(lost), Some(first), Some(second)) =
                        (lost.get_mut(at), first.get_mut(at), second.get_mut(at))
                    {
                        *lost += loss * weight * (size * on_s + rest);
                        *first += (on_s + gap.abs() * whole) * grown;
                        *second += (2.0 * gap.abs() * on_s + gap * gap * whole) * grown;
                    }
                }
            }
        }
        Self {
            g,
            slope,
            first: norm((&first, &[])) * MARGIN,
            second: norm((&second, &[])) * MARGIN,
            lost,
            loss: most_loss,
        }
    }
}

/// About |z|, and the radius of what is examined around z.
pub(super) fn examined(system: &Irreducible, z: Complex64) -> (f64, f64) {
    let size = modulus(z).max(LEAST_SIZE * system.rate());
    let longest = system.longest();
    let reach = if longest > 0.0 {
        size.min(LARGEST_REACH / longest)
    } else {
        size
    };
    (size, reach)
}

/// The disc of the simple root next to `z`, Im z ≥ 0; `None` where it is not proved to be simple.
pub(super) fn simple_root(system: &Irreducible, balanced: &Balanced, z: Complex64) -> Option<Disc> {
    let n = system.size();
    let (size, reach) = examined(system, z);
    let dense = Dense::new(system, balanced, z, reach);
    let bordered = border(&dense, size)?.of(&dense.g);
    let Factored {
        inverse,
        norms,
        residual,
        ..
    } = factor(bordered.clone())?;

    let whole = norm((&inverse.re, &inverse.im)) * MARGIN;
    let alpha = (residual + norm((&dense.lost, &[])) * whole) * MARGIN;
    if !(alpha <= MOST_RESIDUAL && whole.is_finite()) {
        return None;
    }
    // Bounds on B⁻¹, and on a B⁻¹ in place of a.
    let all = whole / (1.0 - alpha) * MARGIN;
    let row_norm = norms.last()? * MARGIN;
    let row = row_norm / (1.0 - alpha) * MARGIN;
    let column: Vec<Complex64> = (0..=n).map(|k| inverse.get(k, n)).collect();
    let column_norm = column.iter().map(|x| x.norm_sqr()).sum::<f64>().sqrt() * MARGIN;
    let units = (2 * n + 10) as f64 * ROUNDING;
    let mut squares = 0.0;
    for i in 0..=n {
        let (mut sum, mut off) = (Complex64::ZERO, 0.0);
        for (k, x) in column.iter().enumerate() {
            let entry = bordered.get(i, k);
            sum += entry * x;
            off += modulus(entry) * modulus(*x) * units;
            if i < n && k < n {
                off += dense.lost.get(i * n + k)? * modulus(*x);
            }
        }
        if i == n {
            sum -= 1.0;
            off += units;
        }
        let error = modulus(sum) + off;
        squares += error * error;
    }
    let eta = squares.sqrt() * MARGIN;

    let value = (modulus(inverse.get(n, n)) + row * eta) * MARGIN;
    let mut derivative = Complex64::ZERO;
    for i in 0..n {
        let mut sum = Complex64::ZERO;
        for (k, x) in column.iter().take(n).enumerate() {
            sum += dense.slope.get(i, k) * x;
        }
        derivative += inverse.get(n, i) * sum;
    }
    let column = (column_norm + all * eta) * MARGIN;
    let off = row_norm * dense.first * column_norm * (2.0 * units + dense.loss)
        + row * dense.first * (alpha * column + all * eta);
    let slope = modulus(derivative) * SHRUNK - off * MARGIN;
    // Within `reach` B⁻¹, and with it the row and the column, at most double.
    let reach = reach.min(0.5 / (all * dense.first) * SHRUNK);
    let curvature = (2.0 * row)
        * (2.0 * column)
        * (2.0 * dense.first * dense.first * (2.0 * all) + dense.second)
        * MARGIN;
    let isolation = reach.min(slope / curvature) * SHRUNK;
    let radius = 1.5 * value / slope * MARGIN;
    let holds = slope > 0.0
        && 2.25 * curvature * value * MARGIN < slope * slope
        && 2.0 * value * MARGIN < slope * isolation;
    let radius = radius + f64::EPSILON * modulus(z);
    if !(holds && LEAST_ISOLATION * radius < isolation) {
        return None;
    }
    let disc = Disc {
        center: z,
        radius,
        isolation,
        multiplicity: 1,
    };
    if 2.0 * z.im.abs() + radius < isolation {
        // The complex conjugate, a root as well, can only be the same one.
        return Some(Disc {
            center: Complex64::new(z.re, 0.0),
            isolation: isolation - z.im.abs(),
            ..disc
        });
    }
    (!disc.is_on_axis()).then_some(disc)
}

/// Vectors b and c that make [G b; cᵀ 0] regular next to a root with one null vector.
pub(super) struct Border {
    right: Vec<Complex64>,
    lower: Vec<Complex64>,
}

impl Border {
    /// G with its border.
    pub(super) fn of(&self, g: &Rows) -> Rows {
        let n = g.size;
        let mut whole = Rows::zeros(n + 1);
        for (i, (right, lower)) in self.right.iter().zip(&self.lower).enumerate() {
            for k in 0..n {
                whole.add(i, k, g.get(i, k));
            }
            whole.add(i, n, *right);
            whole.add(n, i, *lower);
        }
        whole
    }

    /// Bound on the norm of the border.
    pub(super) fn size(&self) -> f64 {
        let squares = self.right.iter().chain(&self.lower).map(|x| x.norm_sqr());
        squares.sum::<f64>().sqrt() * MARGIN
    }

    /// Add [G b; cᵀ 0] x to `sums`.
    pub(super) fn add_product(&self, g: &Rows, x: &[Complex64], sums: &mut [Complex64]) {
        let whole = self.of(g);
        for (i, sum) in sums.iter_mut().enumerate() {
            for (k, x) in x.iter().enumerate() {
                *sum += whole.get(i, k) * x;
            }
        }
    }
}

/// b and c from the null vectors of G near the point; `size` is about |s|.
pub(super) fn border(dense: &Dense, size: f64) -> Option<Border> {
    let aside = ASIDE * size;
    let n = dense.g.size;
    let mut near = dense.g.clone();
    let slopes = dense.slope.re.iter().zip(&dense.slope.im);
    for ((re, im), (slope_re, slope_im)) in near.re.iter_mut().zip(&mut near.im).zip(slopes) {
        *re += aside * slope_re;
        *im += aside * slope_im;
    }
    let Factored { inverse, norms, .. } = factor(near)?;
    let largest = |sizes: &[f64]| {
        let sizes = sizes.iter().enumerate();
        sizes.max_by(|a, b| a.1.total_cmp(b.1)).map(|(k, _)| k)
    };
    let columns: Vec<f64> = (0..n)
        .map(|k| (0..n).map(|i| inverse.get(i, k).norm_sqr()).sum())
        .collect();
    let (row, column) = (largest(&norms)?, largest(&columns)?);
    let (left, right) = (*norms.get(row)?, columns.get(column)?.sqrt());
    if !(left.is_finite() && right.is_finite() && left > 0.0 && right > 0.0) {
        return None;
    }
    Some(Border {
        right: (0..n).map(|i| inverse.get(row, i).conj() / left).collect(),
        lower: (0..n)
            .map(|i| inverse.get(i, column).conj() / right)
            .collect(),
    })
}
