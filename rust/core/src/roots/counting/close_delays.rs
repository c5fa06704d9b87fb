//! Cauchy's bound where terms of almost equal delays cancel.
//!
//! Let the delays of a group be τ + δ_j with δ_j ≥ 0. By Taylor's formula, for Re s ≥ σ,
//!     e^(−sδ) = Σ_{i<m} (−sδ)ⁱ/i! + θ,  |θ| ≤ |sδ|ᵐ/m! · max(1, e^(−σδ)),
//! so that the terms of the group with the power sᵏ are e^(−sτ) times
//!     Σ_{i<m} sᵏ⁺ⁱ Σ_j b_jk (−δ_j)ⁱ/i! + ϑ,  |ϑ| ≤ |s|ᵏ⁺ᵐ Σ_j |b_jk| δ_jᵐ/m! · max(1, e^(−σδ_j)).
//! Sums over j replace the sums of moduli of bound 1 (`bounds`): coefficients of the size 1/δ whose
//! differences cancel do not make the radius as large as 1/δ. With k + m ≤ n the bound involves no
//! power above the degree n; for the terms with sⁿ themselves it uses the moduli.

use super::cauchy::{MARGIN, cauchy_radius};
use crate::elementary::exp_above;
use crate::quasipoly::QuasiPolynomial;

/// Two delays are almost equal when their distance is below this share of the longest one. A larger
/// share treats more delays as a group, for which the Taylor remainder is larger.
const CLOSE: f64 = 0.05;

/// A radius beyond which the leading term of the first row exceeds all the others together where Re
/// s ≥ `sigma`. Infinite where no delays are close or the bound fails.
pub(crate) fn radius_by_groups(h: &QuasiPolynomial, sigma: f64) -> f64 {
    let delays = h.delays();
    let (Some(first), Some(last)) = (delays.first(), delays.last()) else {
        return f64::INFINITY;
    };
    let limit = CLOSE * (last - first);
    let gaps = delays.iter().zip(delays.iter().skip(1));
    gaps.map(|(a, b)| b - a)
        .filter(|gap| *gap <= limit)
        .flat_map(|gap| [0, 1].map(|below| bound(h, sigma, gap, below)))
        .fold(f64::INFINITY, f64::min)
}

/// The radius when delays at most `gap` apart form a group and the Taylor polynomials end `below`
/// the degree.
fn bound(h: &QuasiPolynomial, sigma: f64, gap: f64, below: usize) -> f64 {
    let degree = h.degree();
    let terms: Vec<(&[f64], f64)> = h.terms().collect();
    let Some((own_row, first)) = terms.first().copied() else {
        return f64::INFINITY;
    };
    let own = own_row.get(degree).copied().unwrap_or(0.0).abs();
    let rounding = 4.0 * f64::EPSILON * (degree + terms.len() + 4) as f64;
    let mut sums = vec![0.0; degree + 1];
    for group in terms.chunk_by(|a, b| b.1 - a.1 <= gap) {
        let Some(base) = group.first().map(|(_, delay)| *delay) else {
            continue;
        };
        let weight = exp_above(-(base - first) * sigma) * (1.0 + MARGIN);
        let mut signed = vec![0.0; degree + 1];
        let mut lost = vec![0.0; degree + 1];
        for (row, delay) in group {
            let offset = delay - base;
            let stretch = exp_above(-offset * sigma).max(1.0);
            for (k, c) in row.iter().enumerate().filter(|(_, c)| **c != 0.0) {
                let order = degree.saturating_sub(k + below);
                // c (−δ)ⁱ/i!
                let mut part = *c;
                let mut factorial_next = 1.0;
                for (sum, off) in signed.iter_mut().zip(&mut lost).skip(k).take(order) {
                    *sum += part;
                    *off += rounding * part.abs();
                    part *= -offset / factorial_next;
                    factorial_next += 1.0;
                }
                if let Some(rest) = lost.get_mut(k + order) {
                    *rest += part.abs() * stretch * (1.0 + rounding);
                }
            }
        }
        for (total, (sum, off)) in sums.iter_mut().zip(signed.iter().zip(&lost)) {
            *total += weight * (sum.abs() + off);
        }
    }
    // A sum that overflowed, or 0 · ∞, proves nothing.
    if !sums.iter().all(|sum| sum.is_finite()) {
        return f64::INFINITY;
    }
    let rest = sums.pop().map_or(0.0, |sum| (sum - own) * (1.0 + MARGIN));
    let rest = rest.max(0.0) + 2.0 * MARGIN * own;
    if own > rest {
        cauchy_radius(own - rest, &sums)
    } else {
        f64::INFINITY
    }
}

#[cfg(test)]
mod tests {
    use num_complex::Complex64;

    use super::*;
    use crate::quasipoly::{Probe, make};

    #[test]
    fn differences_count_and_not_the_coefficients_themselves() {
        for gap in [1e-3, 1e-6, 1e-9, 1e-12] {
            let g = 0.1 / gap;
            let rows: [&[f64]; 3] = [
                &[-1.0, -0.75, 1.0],
                &[-0.2 * g, 0.3 * g, 0.3],
                &[0.2 * g, -0.3 * g, -0.28],
            ];
            let h = make(&rows, &[0.0, 1.344, 1.344 + gap]);
            let radius = radius_by_groups(&h, 0.0);
            assert!((1.0..10.0).contains(&radius), "{gap}: {radius}");
            // The leading term exceeds the rest on the circle.
            let mut probe = Probe::new(&h);
            for step in 0..200 {
                let angle = std::f64::consts::PI * (f64::from(step) / 199.0 - 0.5);
                let s = radius * Complex64::new(angle.cos().max(0.0), angle.sin());
                let jet = probe.double_double_jet(s);
                assert!((jet.value - s * s).norm() < (s * s).norm());
            }
        }
    }

    #[test]
    fn delays_far_apart_say_nothing() {
        let h = make(&[&[0.0, 1.0], &[2.0]], &[0.0, 1.0]);
        assert_eq!(radius_by_groups(&h, 0.0), f64::INFINITY);
    }
}
