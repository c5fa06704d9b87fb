//! Roots so close together that Newton's iteration cannot separate them: one disc for all of them.
//!
//! As in `simple_root`, det G = det B · g with B(s) = [G(s) b; cᵀ 0] and g the last entry on the
//! diagonal of B⁻¹, which is regular next to a root with one null vector, of any multiplicity. With
//! G(z + δ) = Σ G_k δᵏ, the last column x of B⁻¹ has the Taylor coefficients x_0 = B⁻¹ e and
//! x_k = −B⁻¹ Σ_{j≥1} B_j x_{k−j}. Let x̂ be the computed ones up to k = K, ĝ their last entries, and
//! r_k = Σ_j B_j x̂_{k−j} − e their residuals, which have terms beyond K as well. Then
//!     g(z + δ) − Σ ĝ_k δᵏ = −a(δ) Σ r_k δᵏ,  a(δ) the last row of B(z + δ)⁻¹.
//! Where |(B(z + δ) − B(z)) B⁻¹| ≤ 1/2, B is regular and |a(δ)| ≤ 2 |a(0)|, so that on |δ| = ρ
//!     |ĝ_m| ρᵐ > Σ_{k≠m} |ĝ_k| ρᵏ + 2 |a(0)| Σ |r_k| ρᵏ
//! proves exactly m roots within ρ (Pellet 1881, by Rouché's theorem). B_j is at most
//! p Γʲ/j! + q Γʲ⁻¹/(j − 1)! in norm, Γ being the longest gap, which bounds what lies beyond K.
//! The smallest m for which a radius is found is taken, about the zero of the (m − 1)-st derivative.

use num_complex::Complex64;

use super::balance::Balanced;
use super::factor::{FLOOR, Factored, ROUNDING, factor};
use super::local_enclosure::Weights;
use super::simple_root::{Dense, border, examined};
use super::system::Irreducible;
use super::walker::RESOLUTION;
use crate::elementary::exp;
use crate::linear_algebra::rows::{Rows, norm};
use crate::quasipoly::modulus;
use crate::roots::disc::Disc;

/// Upper limit on the number of roots in one disc.
const MOST: usize = 20;

/// K. The terms beyond the m-th decide how wide a disc can be; those beyond K are bounded by norms.
const ORDER: usize = MOST + 6;

/// Steps towards the zero of a derivative. The first one is as long as the cluster is wide.
const CENTRINGS: usize = 3;

/// Largest residual of the inverse. Larger: B may be nearly singular; smaller: fewer clusters are
/// enclosed.
const MOST_RESIDUAL: f64 = 0.01;

/// Coefficients whose products with the inverse are formed; of the others only norms are multiplied.
/// Larger: wider discs are examined; smaller: fewer products.
const MULTIPLIED: usize = 3;

/// Ratio of the radii tried. Larger: wider discs, and none where few radii hold; smaller: more tries.
const GROWTH: f64 = 1.3;

/// Covers the rounding errors of sums of bounds.
const MARGIN: f64 = 1.0 + 1e-9;

/// Taylor coefficients of g about a point, with what is needed to bound their errors.
struct Series {
    place: Complex64,
    /// ĝ_k.
    values: Vec<Complex64>,
    /// Bounds on 2 |a(0)| |r_k|.
    errors: Vec<f64>,
    /// Bounds on 2 |a(0)| |x̂_k|.
    columns: Vec<f64>,
    /// Norms p and q, and Γ.
    norms: (f64, f64),
    longest: f64,
    /// |δ| up to which |(B(z + δ) − B(z)) B⁻¹| ≤ 1/2.
    reach: f64,
}

/// The disc of the cluster next to `z`, Im z ≥ 0; `None` where none is proved.
pub(super) fn cluster(system: &Irreducible, balanced: &Balanced, z: Complex64) -> Option<Disc> {
    let first = Series::new(system, balanced, z)?;
    (1..=MOST).find_map(|m| {
        let mut center = first.centre(m)?;
        for _ in 0..CENTRINGS {
            center = first.moved(center).centre(m)?;
        }
        // Worth a proof only where it would hold with the coefficients moved there.
        first.moved(center).disc(m)?;
        let mut disc = None;
        for _ in 0..CENTRINGS {
            let Some(series) = Series::new(system, balanced, center) else {
                break;
            };
            disc = smaller(series.disc(m), disc);
            center = series.centre(m)?;
        }
        let disc = disc?;
        if !disc.is_on_axis() {
            return (disc.center.im > 0.0).then_some(disc);
        }
        // A disc that contains its own mirror image is centred on the axis.
        let center = Complex64::new(disc.center.re, 0.0);
        Series::new(system, balanced, center)?.disc(m)
    })
}

fn smaller(a: Option<Disc>, b: Option<Disc>) -> Option<Disc> {
    let discs = a.into_iter().chain(b);
    discs.min_by(|a, b| a.radius.total_cmp(&b.radius))
}

impl Series {
    fn new(system: &Irreducible, balanced: &Balanced, z: Complex64) -> Option<Self> {
        let (size, reach) = examined(system, z);
        let dense = Dense::new(system, balanced, z, reach);
        let border = border(&dense, size)?;
        let Factored {
            inverse,
            norms,
            residual,
            ..
        } = factor(border.of(&dense.g))?;
        let whole = norm((&inverse.re, &inverse.im)) * MARGIN;
        let alpha = (residual + norm((&dense.lost, &[])) * whole) * MARGIN;
        if !(alpha <= MOST_RESIDUAL && whole.is_finite()) {
            return None;
        }
        let all = whole / (1.0 - alpha) * MARGIN;
        let row = 2.0 * norms.last()? / (1.0 - alpha) * MARGIN;
        let parts = Parts::new(system, balanced, z);
        let n = system.size();
        let units = (2 * n + ORDER + 10) as f64 * ROUNDING + parts.loss;
        let mut columns: Vec<Vec<Complex64>> = Vec::new();
        let mut sizes: Vec<f64> = Vec::new();
        let mut errors = Vec::new();
        for k in 0..=ORDER {
            // Σ_{j≥1} B_j x̂_{k−j} − e, without the border, which is constant.
            let mut right = vec![Complex64::ZERO; n + 1];
            let mut moduli = FLOOR;
            for (column, (j, size)) in columns.iter().zip((1..=k).rev().zip(&sizes)) {
                parts.add_product(j, column, &mut right);
                moduli += parts.bound(j) * size;
            }
            if k == 0 {
                *right.last_mut()? -= 1.0;
                moduli += 1.0;
            }
            let column: Vec<Complex64> = (0..=n)
                .map(|i| {
                    let products = right.iter().enumerate();
                    -products
                        .map(|(l, x)| inverse.get(i, l) * x)
                        .sum::<Complex64>()
                })
                .collect();
            let size = length(&column);
            // What is left of the equation is at most as large as its rounding errors are seen to be.
            border.add_product(&dense.g, &column, &mut right);
            moduli += (parts.bound(0) + border.size()) * size;
            errors.push(row * (length(&right) + units * moduli) * MARGIN);
            sizes.push(size);
            columns.push(column);
        }
        let mut found = Self {
            place: z,
            values: columns.iter().filter_map(|x| x.last().copied()).collect(),
            errors,
            columns: sizes.iter().map(|size| row * size * MARGIN).collect(),
            norms: parts.norms,
            longest: parts.longest,
            reach,
        };
        let products: Vec<f64> = (1..=MULTIPLIED)
            .map(|k| parts.product_bound(k, &inverse, whole) / (1.0 - alpha) * MARGIN)
            .collect();
        let change = |t: f64| {
            let norms = (MULTIPLIED + 1..=ORDER).map(|k| all * parts.bound(k));
            let sizes: Vec<f64> = products.iter().copied().chain(norms).collect();
            let sum = sizes.iter().rev().fold(0.0, |sum, size| (sum + size) * t);
            (sum + all * found.beyond(ORDER, t)) * MARGIN
        };
        let mut reach = found.reach;
        while change(reach) > 0.5 {
            reach *= 0.5;
            if reach.is_nan() || reach <= RESOLUTION * size {
                return None;
            }
        }
        found.reach = reach;
        Some(found)
    }

    /// The series about another point, without bounds on the change of its errors: no proof.
    fn moved(&self, place: Complex64) -> Self {
        let step = place - self.place;
        let mut values = self.values.clone();
        for lowest in 0..values.len() {
            let mut above = Complex64::ZERO;
            for value in values.iter_mut().skip(lowest).rev() {
                *value += above * step;
                above = *value;
            }
        }
        Self {
            place,
            values,
            errors: self.errors.clone(),
            columns: self.columns.clone(),
            ..*self
        }
    }

    /// Bound on Σ_{j>k} |B_j| ρʲ.
    fn beyond(&self, k: usize, radius: f64) -> f64 {
        let (p, q) = self.norms;
        let step = self.longest * radius;
        let power = (1..=k).fold(1.0, |power, j| power * step / j as f64);
        (p * power * step / (k + 1) as f64 + q * radius * power) * exp(step) * MARGIN
    }

    /// Are there exactly m roots within `radius`?
    fn holds(&self, m: usize, radius: f64) -> bool {
        let (mut own, mut others, mut power) = (0.0, 0.0, 1.0);
        let parts = self.values.iter().zip(&self.errors).zip(&self.columns);
        for (k, ((value, error), column)) in parts.enumerate() {
            if k == m {
                own = modulus(*value) * power;
            } else {
                others += modulus(*value) * power;
            }
            others += (error + column * self.beyond(ORDER - k, radius)) * power;
            power *= radius;
        }
        others * MARGIN < own
    }

    /// The smallest disc about the place with exactly m roots.
    fn disc(&self, m: usize) -> Option<Disc> {
        let mut radius = RESOLUTION * modulus(self.place).max(RESOLUTION * self.reach);
        while !self.holds(m, radius) {
            radius *= GROWTH;
            if radius.is_nan() || radius > self.reach {
                return None;
            }
        }
        let mut isolation = radius;
        while GROWTH * isolation <= self.reach && self.holds(m, GROWTH * isolation) {
            isolation *= GROWTH;
        }
        Some(Disc {
            center: self.place,
            radius,
            isolation,
            multiplicity: u32::try_from(m).ok()?,
        })
    }

    /// The zero of the (m − 1)-st derivative next to the place, by one step of Newton's iteration.
    fn centre(&self, m: usize) -> Option<Complex64> {
        let (below, own) = (self.values.get(m - 1)?, self.values.get(m)?);
        let size = modulus(*own);
        let step = (below / size) * (own.conj() / size) / m as f64;
        let center = self.place - step;
        (center.is_finite() && modulus(step) <= self.reach).then_some(center)
    }
}

/// The Taylor coefficients G_k, k ≤ K.
struct Parts {
    coefficients: Vec<Rows>,
    norms: (f64, f64),
    longest: f64,
    /// Largest error of an entry of G_k, relative to the sum of moduli.
    loss: f64,
}

impl Parts {
    fn new(system: &Irreducible, balanced: &Balanced, z: Complex64) -> Self {
        let n = system.size();
        let mut coefficients = vec![Rows::zeros(n); ORDER + 1];
        let (mut on_one, mut on_s) = (vec![FLOOR; n * n], vec![FLOOR; n * n]);
        let (mut loss, mut longest) = (0.0f64, 0.0f64);
        let mut weights = Weights::new(system, balanced, z);
        let rows = balanced.rows.iter().zip(&balanced.references);
        for (i, (terms, reference)) in rows.enumerate() {
            for term in terms {
                let (gap, weight, factor) = weights.get(term.delay, *reference);
                loss = loss.max(weights.loss(term, terms.len(), gap));
                longest = longest.max(gap.abs());
                for entry in &term.entries {
                    let value = z * entry.slope + entry.value;
                    // (−d)ᵏ/k! e^(−z d), and the same for k − 1.
                    let (mut power, mut before) = (factor, Complex64::ZERO);
                    for (k, part) in coefficients.iter_mut().enumerate() {
                        part.add(i, entry.column, value * power + entry.slope * before);
                        before = power;
                        power *= -gap / (k + 1) as f64;
                    }
                    let at = i * n + entry.column;
                    if let (Some(one), Some(s)) = (on_one.get_mut(at), on_s.get_mut(at)) {
                        let (slope, rest) = (entry.slope.abs(), entry.value.abs());
                        *one += weight * (modulus(z) * slope + rest);
                        *s += weight * slope;
                    }
                }
            }
        }
        Self {
            coefficients,
            norms: (norm((&on_one, &[])) * MARGIN, norm((&on_s, &[])) * MARGIN),
            longest,
            // Powers of gaps over factorials have an error of 2 u each.
            loss: loss + 2.0 * (ORDER + 2) as f64 * ROUNDING,
        }
    }

    /// Bound on |B_k|, the border left out.
    fn bound(&self, k: usize) -> f64 {
        let (p, q) = self.norms;
        let before = (1..k).fold(1.0, |power, j| power * self.longest / j as f64);
        if k == 0 {
            return p;
        }
        (p * before * self.longest / k as f64 + q * before) * MARGIN
    }

    /// Bound on |B_k R| in the 2-norm, |R| ≤ `whole`.
    fn product_bound(&self, k: usize, inverse: &Rows, whole: f64) -> f64 {
        let Some(part) = self.coefficients.get(k) else {
            return f64::NAN;
        };
        let n = part.size;
        let mut columns = vec![0.0f64; n + 1];
        let mut largest_row = 0.0f64;
        for i in 0..n {
            let mut row = 0.0;
            for (l, column) in columns.iter_mut().enumerate() {
                let sum: Complex64 = (0..n).map(|j| part.get(i, j) * inverse.get(j, l)).sum();
                let size = modulus(sum);
                row += size;
                *column += size;
            }
            largest_row = largest_row.max(row);
        }
        let largest_column = columns.iter().fold(0.0f64, |a, b| a.max(*b));
        // |X|₂² ≤ |X|₁ |X|∞.
        let units = (2 * n + 10) as f64 * ROUNDING + self.loss;
        ((largest_row * largest_column).sqrt() + units * self.bound(k) * whole) * MARGIN
    }

    /// Add G_k x to `sums`; the last entry of x belongs to the border.
    fn add_product(&self, k: usize, x: &[Complex64], sums: &mut [Complex64]) {
        let Some(part) = self.coefficients.get(k) else {
            return;
        };
        for (i, sum) in sums.iter_mut().take(part.size).enumerate() {
            for (j, x) in x.iter().take(part.size).enumerate() {
                *sum += part.get(i, j) * x;
            }
        }
    }
}

fn length(column: &[Complex64]) -> f64 {
    column.iter().map(|x| x.norm_sqr()).sum::<f64>().sqrt() * MARGIN
}
