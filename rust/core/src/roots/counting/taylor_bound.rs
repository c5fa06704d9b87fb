//! Bounds by the Taylor polynomial of g, for points next to several roots.
//!
//! There g″ is as small as a power of the distance to the roots, but a bound by moduli does not
//! become small. With the Taylor coefficients a_k of g at m up to the n-th, in double-double
//! arithmetic, their errors e_k, and the bound R of `remainder` on the next one in the disc of
//! radius r about m (Taylor's formula for g and for g′):
//!     |g − g(m)| ≤ Σ_{1≤k≤n} (|a_k| + e_k) rᵏ + R rⁿ⁺¹,
//!     |g′| ≤ Σ_{1≤k≤n} k (|a_k| + e_k) rᵏ⁻¹ + (n + 1) R rⁿ.
//! The sums have the relative error 4n u, u = 2⁻⁵³, which MARGIN covers.

use num_complex::Complex64;

use crate::quasipoly::{Probe, QuasiPolynomial, expansion, modulus, remainder};

/// Order of the Taylor polynomial. A higher order reaches further next to more roots and costs
/// more.
const ORDER: usize = 8;

/// Covers the rounding of the sums.
const MARGIN: f64 = 1e-12;

/// Ratio of two radii that are tried.
const SHRINKAGE: f64 = 0.7;

/// Upper limit on the radii that are tried.
const MAX_ROUNDS: usize = 60;

/// Moduli of the Taylor coefficients about a point.
pub(crate) struct TaylorBound<'a> {
    h: &'a QuasiPolynomial,
    reference: usize,
    place: Complex64,
    value: f64,
    error: f64,
    /// |a_k| + e_k from k = 1.
    sizes: Vec<f64>,
}

impl<'a> TaylorBound<'a> {
    pub(crate) fn new(probe: &Probe<'a>, place: Complex64) -> Self {
        let (h, reference) = (probe.function(), probe.reference());
        let near = expansion(h, reference, place, ORDER);
        let mut sizes = near.coefficients.iter().copied().map(modulus);
        let value = sizes.next().unwrap_or(0.0);
        let errors = near.errors.iter().skip(1);
        Self {
            h,
            reference,
            place,
            value,
            error: near.errors.first().copied().unwrap_or(f64::INFINITY),
            sizes: sizes
                .zip(errors)
                .map(|(size, error)| size + error)
                .collect(),
        }
    }

    /// Bound on |g′| within `radius`.
    pub(crate) fn slope(&self, radius: f64) -> f64 {
        let rest = (ORDER + 1) as f64 * self.next(radius);
        let numbered = self.sizes.iter().enumerate().rev();
        let sum = numbered.fold(rest, |sum, (k, size)| sum * radius + (k + 1) as f64 * size);
        sum * (1.0 + MARGIN)
    }

    /// The distance, at most `most`, within which g is proved to change by less than `share` of its
    /// value.
    pub(crate) fn reach(&self, share: f64, most: f64) -> f64 {
        let margin = share * self.value - self.error;
        self.largest(margin, most, |taylor, r| taylor.change(r))
    }

    /// The same with the bound on |g′| times the distance in place of the change.
    pub(crate) fn steady_reach(&self, share: f64, most: f64) -> f64 {
        let margin = share * self.value - self.error;
        self.largest(margin, most, |taylor, r| taylor.slope(r) * r)
    }

    fn change(&self, r: f64) -> f64 {
        let sizes = self.sizes.iter().rev();
        let sum = sizes.fold(self.next(r), |sum, size| sum * r + size);
        sum * r * (1.0 + MARGIN)
    }

    /// Bound on the coefficient after the last one, within distance r.
    fn next(&self, r: f64) -> f64 {
        remainder(self.h, self.reference, self.place, r, ORDER + 1)
    }

    /// A radius for which `bound` is below `margin`. The first radius tried is the one that the slope
    /// alone allows.
    fn largest(&self, margin: f64, most: f64, bound: impl Fn(&Self, f64) -> f64) -> f64 {
        let slope = self.sizes.first().copied().unwrap_or(f64::INFINITY);
        let first = (margin / slope).min(most).max(0.0);
        std::iter::successors(Some(first), |r| Some(SHRINKAGE * r))
            .take(MAX_ROUNDS)
            .find(|r| bound(self, *r) < margin)
            .map_or(0.0, |r| r * (1.0 - MARGIN))
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_8;

    use super::*;
    use crate::quasipoly::make;

    /// (s + 1)³ (s + 2 e^(−s/2)), whose third root lies at −1.
    fn triple() -> QuasiPolynomial {
        let rows: &[&[f64]] = &[&[0.0, 1.0, 3.0, 3.0, 1.0], &[2.0, 6.0, 6.0, 2.0]];
        make(rows, &[0.0, 0.5])
    }

    #[test]
    fn the_slope_in_a_disc_is_bounded_closely() {
        let h = triple();
        for distance in [1e-2, 1e-4, 1e-6] {
            let place = Complex64::new(-1.0 + distance, 0.0);
            let mut probe = Probe::new(&h);
            probe.refer_to_dominant(place);
            let taylor = TaylorBound::new(&probe, place);
            for share in [0.1, 0.5, 1.0] {
                let radius = share * distance;
                let bound = taylor.slope(radius);
                let mut steepest = 0.0f64;
                for k in 0..16 {
                    let rim = place + Complex64::from_polar(radius, f64::from(k) * FRAC_PI_8);
                    steepest = steepest.max(modulus(probe.double_double_jet(rim).slope));
                }
                // Along the line away from the root the bound is attained, except for the remaining
                // terms.
                assert!(steepest <= bound && bound < 1.2 * steepest);
            }
        }
    }

    #[test]
    fn the_reach_is_a_share_of_the_distance() {
        let h = triple();
        for distance in [1e-3, 1e-6, 1e-9] {
            let place = Complex64::new(-1.0 + distance, 0.0);
            let mut probe = Probe::new(&h);
            probe.refer_to_dominant(place);
            let taylor = TaylorBound::new(&probe, place);
            // (1 + x)³ − 1 = 0.95 and 3 x (1 + x)² = 0.95; the radii tried differ by factors of
            // 0.7.
            let (far, steady) = (taylor.reach(0.95, 1.0), taylor.steady_reach(0.95, 1.0));
            assert!((0.17..0.25).contains(&(far / distance)));
            assert!((0.14..0.21).contains(&(steady / distance)));
            assert!(taylor.reach(0.95, 0.01 * distance) > 0.0099 * distance);
        }
    }
}
