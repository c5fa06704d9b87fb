//! How many roots of a disc of d are roots of n as well, to the rounding of the coefficients.
//!
//! The numbers of n and d are rounded, those of 1 − e^h e^(−hs) for one. With relative changes of
//! all coefficients and delays by ε, the k-th Taylor coefficients change by at most ε `changes`.
//!
//! 1. The cluster of d about the centre c of the disc is the least M, not below the multiplicity
//!    of the disc, for which Pellet's inequality (`locating::clusters`) holds at 4 max_j
//!    (|a_j|/|a_M|)^(1/(M−j)), j < M, whatever these changes are: d has exactly M roots so close to c
//!    that the numbers do not distinguish their places.
//! 2. The zero z of the (M − 1)-st derivative of d next to c is the mean of the cluster. It is known
//!    within δ = (|a_(M−1)| + e)/(M |a_M|), with the error and the changes in e.
//! 3. n has as many of the M roots as it has leading Taylor coefficients b_j at z that are zero
//!    within their errors, their changes, and Σ_(l>j) C(l, j) |b_l| δ^(l−j) for the place.
//!
//! A numerator that is small but not zero within these bounds hides nothing.

use num_complex::Complex64;

use crate::quasipoly::{Expansion, Probe, QuasiPolynomial, changes, expansion, modulus, remainder};

/// Relative change of every coefficient and delay within which a root counts as common. A larger
/// one hides poles beside which the numerator has a zero; a smaller one keeps poles of coefficients
/// that went through several products and sums.
const ROUNDING: f64 = 4.0 * f64::EPSILON;

/// A numerator above this share of its terms at a root of the denominator is not zero there. A
/// smaller share misses clusters of many roots, whose discs are wide; a larger one costs time.
const CLEARLY: f64 = 1e-6;

/// Upper limit on the roots of a cluster, that of `locating::clusters`.
const MOST: usize = 20;

/// Taylor coefficients of a function, with their errors and changes.
struct Series {
    near: Expansion,
    /// Bounds on errors and changes together.
    unsure: Vec<f64>,
    reference: usize,
}

impl Series {
    fn new(h: &QuasiPolynomial, place: Complex64, order: usize) -> Self {
        let mut probe = Probe::new(h);
        probe.refer_to_dominant(place);
        let reference = probe.reference();
        let near = expansion(h, reference, place, order);
        let changes = changes(h, reference, place, order);
        let unsure = near.errors.iter().zip(changes);
        Self {
            unsure: unsure.map(|(e, change)| e + ROUNDING * change).collect(),
            near,
            reference,
        }
    }

    fn value(&self, k: usize) -> Complex64 {
        let found = self.near.coefficients.get(k);
        found.copied().unwrap_or_default()
    }

    fn size(&self, k: usize) -> f64 {
        modulus(self.value(k))
    }

    fn unsure(&self, k: usize) -> f64 {
        self.unsure.get(k).copied().unwrap_or(0.0)
    }
}

/// n/d.
#[derive(Debug, Clone)]
pub struct Ratio {
    pub(super) n: QuasiPolynomial,
    pub(super) d: QuasiPolynomial,
}

impl Ratio {
    /// The ratio of two functions. The zero function as numerator hides nothing.
    pub const fn new(n: QuasiPolynomial, d: QuasiPolynomial) -> Self {
        Self { n, d }
    }

    /// Can the numerator have a root at all?
    pub(super) fn can_share(&self) -> bool {
        !self.n.is_zero() && (self.n.degree() > 0 || self.n.delays().len() > 1)
    }

    /// Of the `multiplicity` roots of d about `center`, how many has n as well?
    pub(super) fn shared(&self, center: Complex64, multiplicity: u32) -> u32 {
        let rough = Series::new(&self.n, center, 0);
        let terms = rough.unsure(0) / ROUNDING;
        // Also where a bound is infinite or not a number.
        if !self.can_share() || !terms.is_finite() || rough.size(0) > CLEARLY * terms {
            return 0;
        }
        let Some((whole, place, within)) = self.cluster(center, multiplicity as usize) else {
            return 0;
        };
        let common = self.zeros_at(place, within, whole);
        if common == whole {
            multiplicity
        } else if whole == multiplicity as usize {
            common as u32
        } else {
            // Which of several discs would lose a root cannot be told.
            0
        }
    }

    /// Number of roots of d that its numbers do not distinguish from one at `center`, their mean,
    /// and a bound on its error.
    fn cluster(&self, center: Complex64, least: usize) -> Option<(usize, Complex64, f64)> {
        let d = Series::new(&self.d, center, MOST + 1);
        let whole = (least..=MOST).find(|m| self.is_cluster(&d, center, *m))?;
        let step = d.value(whole - 1) / d.value(whole) / whole as f64;
        let place = if whole > 1 { center - step } else { center };
        let again = Series::new(&self.d, place, whole);
        let off = again.size(whole - 1) + again.unsure(whole - 1);
        let within = off / again.size(whole) / whole as f64;
        within.is_finite().then_some((whole, place, within))
    }

    fn is_cluster(&self, d: &Series, center: Complex64, m: usize) -> bool {
        let own = d.size(m) - d.unsure(m);
        let radius = (0..m)
            .map(|j| libm::pow((d.size(j) + d.unsure(j)) / own, 1.0 / (m - j) as f64))
            .fold(0.0, f64::max);
        // A quarter of the radius each: the lower coefficients are together below own/3.
        let radius = 4.0 * radius;
        let beyond = remainder(&self.d, d.reference, center, radius, MOST + 2);
        let above = (m + 1..=MOST + 1)
            .rev()
            .fold(beyond, |sum, k| sum * radius + d.size(k) + d.unsure(k));
        own > 0.0 && above * radius < 0.5 * own
    }

    /// Leading Taylor coefficients of n at `place`, known within `within`, that are zero, up to
    /// `most`.
    fn zeros_at(&self, place: Complex64, within: f64, most: usize) -> usize {
        let n = Series::new(&self.n, place, most + 1);
        let is_zero = |j: &usize| {
            let mut binomial = 1.0;
            let mut moved = n.unsure(*j);
            for l in j + 1..=most + 1 {
                binomial *= l as f64 / (l - j) as f64;
                moved += binomial * n.size(l) * libm::pow(within, (l - j) as f64);
            }
            moved.is_finite() && n.size(*j) <= moved
        };
        (0..most).take_while(is_zero).count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quasipoly::make;

    fn shared(n: (&[&[f64]], &[f64]), d: &[f64], at: f64, multiplicity: u32) -> u32 {
        let ratio = Ratio::new(make(n.0, n.1), make(&[d], &[0.0]));
        ratio.shared(Complex64::from(at), multiplicity)
    }

    #[test]
    fn roots_are_common_to_rounding_and_not_beyond() {
        let grown = libm::exp(0.5);
        for (error, wanted) in [(0.0, 1), (1e-16, 1), (1e-12, 0), (-1e-12, 0), (1e-9, 0)] {
            let n: (&[&[f64]], &[f64]) = (&[&[1.0], &[-grown * (1.0 + error)]], &[0.0, 0.5]);
            assert_eq!(shared(n, &[-1.0, 1.0], 1.0, 1), wanted, "{error}");
            let n: (&[&[f64]], &[f64]) = (&[&[1.0 + error], &[-1.0]], &[0.0, 1.0]);
            assert_eq!(shared(n, &[0.0, 1.0], 0.0, 1), wanted, "{error}");
        }
    }

    #[test]
    fn as_many_roots_are_common_as_the_numerator_has() {
        let simple: (&[&[f64]], &[f64]) = (&[&[1.0], &[-1.0]], &[0.0, 1.0]);
        assert_eq!(shared(simple, &[0.0, 0.0, 1.0], 0.0, 2), 1);
        let double: (&[&[f64]], &[f64]) = (&[&[-1.0, 1.0], &[1.0]], &[0.0, 1.0]);
        assert_eq!(shared(double, &[0.0, 0.0, 1.0], 0.0, 2), 2);
        assert_eq!(shared(double, &[0.0, 1.0], 0.0, 1), 1);
        // Two roots 1e-9 apart, of which the numbers do not tell that they are two.
        let near: &[f64] = &[1.0 + 1e-9, -2.0 - 1e-9, 1.0];
        let one: (&[&[f64]], &[f64]) = (&[&[-1.0, 1.0]], &[0.0]);
        assert_eq!(shared(one, near, 1.0, 1), 0);
        let both: (&[&[f64]], &[f64]) = (&[near], &[0.0]);
        assert_eq!(shared(both, near, 1.0, 1), 1);
    }
}
