//! Where roots cannot be: proved bounds that close the open sides of a region.
//!
//! 1. Let n be the highest degree and c a row of that degree. On the strip a ≤ Re s ≤ b,
//!    |e^(−s(τ_j−τ_c))| ≤ w_j, the larger of its values on the two edges. Where
//!    |s|ⁿ (|b_cn| − Σ w_j |b_jn|) > Σ_{k<n} |s|ᵏ Σ_j w_j |b_jk| the leading term of row c exceeds
//!    all the others together. Both sides divided by |s|ⁿ, this holds beyond a radius if the
//!    bracket is positive (Cauchy's bound with weights). For b = ∞ it is the condition that the
//!    line Re s = a lies right of the chains; where it fails, nothing is said.
//! 2. Near the chains of a neutral equation bound 1 is wide. It compares only moduli of the leading
//!    terms, so that the next powers count with 1/|s| although, along the line, they change the
//!    argument of p_j and hardly its modulus. With p_j = b_jn sⁿ (1 + w_j), all |s| ≥ r and Re s =
//!    x ≥ σ, |1 + w_j|² differs from 1 by at most 2 β_j1 |x|/r² + O(1/r²), β_jk = |b_j,n−k / b_jn|.
//!    As long as r² d_j ≥ β_j1 + 2 β_01 the exponentials e^(−x d_j) outrun the growth of that with
//!    x, and the sum of |p_j e^(−s d_j) / p_0| is bounded by its terms at x = |σ|. For terms of
//!    almost equal delays that cancel, see `close_delays`.
//! 3. In a strip |Im s| ≤ H, the first row exceeds the others far to the right whatever the
//!    kind, since each of them carries an e^(−x d). Far to the left: the same for h(−s).
//!
//! Inequalities are tested with a relative margin of 1e-9. It covers their rounding: sums of
//! non-negative numbers lose u per summand, weights are upper bounds (`exp_above`) of exponents
//! that are wrong by 746 · 3 u at most, or by what `right_edge` adds to them. `cauchy_radius`
//! starts from a guess but ends with a radius at which the inequality itself was tested.

use num_complex::Complex64;

use super::cauchy::{MARGIN, cauchy_radius};
use super::close_delays::radius_by_groups;
use crate::elementary::{exp_above, log};
use crate::quasipoly::{QuasiPolynomial, modulus};

/// Upper limit on the radii tried by bound 2.
const MAX_ROUNDS: usize = 40;

/// Ratio of two radii at which bound 2 ends: the radius is at most five per cent too large.
const LEAST_RATIO: f64 = 1.05;

/// Error of an exponent that is a sum of logarithms, relative to 1 and its parts.
const LOGARITHM_ROUNDING: f64 = 1e-14;

/// First real part tried by bound 3.
const NEAREST_EDGE: f64 = 1e-6;

/// Real part at which bound 3 is given up.
const FARTHEST_EDGE: f64 = 1e150;

/// The leading term that exceeds all others together outside a disc.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Dominance {
    /// Index of the row.
    pub(crate) row: usize,
    /// The leading term exceeds all the others where |s| is at least this.
    pub(crate) radius: f64,
}

/// A method of finding a [`Dominance`].
pub(crate) type Bound = fn(&QuasiPolynomial, (f64, f64)) -> Option<Dominance>;

/// Bounds 1 and 2 on the strip `re` and the bound for close delays; `None` where no single term
/// dominates.
pub(crate) fn dominance(h: &QuasiPolynomial, re: (f64, f64)) -> Option<Dominance> {
    nearest(h, re, |row, radius| match row {
        0 => along_the_chains(h, re.0, radius).min(radius_by_groups(h, re.0)),
        _ => radius,
    })
}

/// Bounds 1 and 2 alone. They also hold when the coefficients become smaller in modulus.
fn dominance_of_moduli(h: &QuasiPolynomial, re: (f64, f64)) -> Option<Dominance> {
    nearest(h, re, |row, radius| match row {
        0 => along_the_chains(h, re.0, radius),
        _ => radius,
    })
}

/// A radius beyond which no root has Re s ≥ `sigma`, even if all coefficients except the leading
/// one become smaller in modulus. `None` where chains may lie there.
pub(crate) fn radius_right_of(h: &QuasiPolynomial, sigma: f64) -> Option<f64> {
    let found = dominance_of_moduli(h, (sigma, f64::INFINITY))?;
    (found.row == 0).then_some(found.radius * (1.0 + MARGIN))
}

/// Bound 1 alone, which a checker can confirm by evaluating one sum.
pub(crate) fn plain_dominance(h: &QuasiPolynomial, re: (f64, f64)) -> Option<Dominance> {
    nearest(h, re, |_, radius| radius)
}

/// The smallest radius by bound 1 over all rows, after `improved` was applied to the radius of each
/// row.
fn nearest(
    h: &QuasiPolynomial,
    re: (f64, f64),
    improved: impl Fn(usize, f64) -> f64,
) -> Option<Dominance> {
    let degree = h.degree();
    let leading = |row: &[f64]| row.get(degree).copied().unwrap_or(0.0).abs();
    let mut best: Option<Dominance> = None;
    for (index, (own_row, own_delay)) in h.terms().enumerate() {
        let own = leading(own_row);
        if own == 0.0 {
            continue;
        }
        let mut others = vec![0.0; degree + 1];
        for (row, delay) in h.terms() {
            let gap = delay - own_delay;
            let weight = if gap == 0.0 {
                1.0
            } else {
                let edge = if gap > 0.0 { re.0 } else { re.1 };
                exp_above(-gap * edge) * (1.0 + MARGIN)
            };
            for (total, c) in others.iter_mut().zip(row).filter(|(_, c)| **c != 0.0) {
                *total += weight * c.abs();
            }
        }
        let rest: f64 = others.pop().map_or(0.0, |sum| (sum - own) * (1.0 + MARGIN));
        let rest = rest.max(0.0) + MARGIN * own;
        if own > rest {
            let radius = improved(index, cauchy_radius(own - rest, &others));
            if radius.is_finite() && best.is_none_or(|b| radius < b.radius) {
                best = Some(Dominance { row: index, radius });
            }
        }
    }
    best
}

/// Bound 2: a radius, at most the radius `known` from bound 1, beyond which the first row exceeds
/// the others where Re s ≥ `sigma` and its leading term exceeds the rest of the row.
fn along_the_chains(h: &QuasiPolynomial, sigma: f64, known: f64) -> f64 {
    let degree = h.degree();
    let Some((first, own_delay)) = h.terms().next() else {
        return known;
    };
    let neutral = h.terms().skip(1).any(|(row, _)| row.len() == first.len());
    if !(neutral && known.is_finite() && sigma.is_finite()) {
        return known;
    }
    let own = first.last().copied().unwrap_or(0.0).abs();
    // Σ_{k ≥ from} |b_{n−k} / b_n| r^−k
    let tail = |row: &[f64], top: f64, from: usize, r: f64| {
        let size = |k: usize| row.get(k).map_or(0.0, |c| c.abs() / top);
        let lower = 0..(degree + 1).saturating_sub(from);
        lower.fold(0.0, |sum, k| (sum + size(k)) / r) / raised(r, from.saturating_sub(1))
    };
    let next = |row: &[f64], top: f64| {
        let index = degree.checked_sub(1);
        index
            .and_then(|k| row.get(k))
            .map_or(0.0, |c| c.abs() / top)
    };
    let own_next = next(first, own);
    let holds = |r: f64| {
        let square = r * r;
        let lean = (sigma.abs() / square).min(1.0 / r);
        let rest = 2.0 * tail(first, own, 2, r);
        // |1 + w_0|² at x = |σ|, and wherever x ≥ σ.
        let denominator = 1.0 - 2.0 * own_next * lean - rest;
        if 2.0 * own_next / r + rest > 0.5 {
            return false;
        }
        let mut sum = 0.0;
        for (row, delay) in h.terms().skip(1) {
            let gap = delay - own_delay;
            let leads = row.len() == first.len();
            let top = row.last().copied().unwrap_or(0.0).abs();
            let slope = if leads { next(row, top) } else { 0.0 };
            if square * gap < (slope + 2.0 * own_next) * (1.0 + MARGIN) {
                return false;
            }
            let size = if leads {
                let stretch = tail(row, top, 1, r);
                let numerator =
                    1.0 + 2.0 * slope * lean + 2.0 * tail(row, top, 2, r) + stretch * stretch;
                top / own * numerator.sqrt()
            } else {
                tail(row, own, 1, r)
            };
            sum += size * exp_above(-gap * sigma) / denominator.sqrt();
        }
        sum * (1.0 + MARGIN) < 1.0 - MARGIN
    };
    let mut high = known;
    let mut ratio = 2.0;
    for _ in 0..MAX_ROUNDS {
        if holds(high / ratio) {
            high /= ratio;
        } else if ratio < LEAST_RATIO {
            break;
        } else {
            ratio = ratio.sqrt();
        }
    }
    high
}

/// rᵏ by repeated products, the same bits on every machine.
fn raised(r: f64, k: usize) -> f64 {
    (0..k).fold(1.0, |power, _| power * r)
}

/// Bound 3: no root with |Im s| ≤ `height` has a real part of this or more.
pub(crate) fn right_edge(h: &QuasiPolynomial, height: f64) -> f64 {
    let mut terms = h.terms();
    let Some((first, own_delay)) = terms.next() else {
        return f64::INFINITY;
    };
    let own_degree = first.len().saturating_sub(1) as f64;
    let own = first.last().copied().unwrap_or(0.0).abs();
    let others: Vec<(&[f64], f64)> = terms.map(|(row, tau)| (row, tau - own_delay)).collect();
    // For x from here on, every summand below decreases with x.
    let falling = others
        .iter()
        .map(|(row, gap)| ((row.len() as f64 - 1.0 - own_degree) / gap).max(0.0))
        .fold(0.0, f64::max);
    let holds = |x: f64| {
        let modulus = modulus(Complex64::new(x, height));
        // In logarithms, since high powers of x overflow where the exponential is small.
        let powers = own_degree * log(x);
        let summand = |k: usize, c: f64, gap: f64| {
            let (grown, decay) = (k as f64 * log(modulus), gap * x);
            // Each part is known to 1e-14 of 1 plus its size, even when the parts cancel.
            let slack = LOGARITHM_ROUNDING
                * (1.0 + k as f64 + own_degree + grown.abs() + powers.abs() + decay);
            c.abs() * exp_above(grown - powers - decay + slack)
        };
        let lower = first.iter().rev().skip(1).rev().enumerate();
        let mut sum: f64 = lower.map(|(k, c)| summand(k, *c, 0.0)).sum();
        for (row, gap) in &others {
            for (k, c) in row.iter().enumerate().filter(|(_, c)| **c != 0.0) {
                sum += summand(k, *c, *gap);
            }
        }
        sum * (1.0 + MARGIN) < own
    };
    // A small margin covers the rounding of the quotient.
    let mut x = (falling * (1.0 + MARGIN)).max(NEAREST_EDGE);
    while !holds(x) && x < FARTHEST_EDGE {
        x *= 2.0;
    }
    if x < FARTHEST_EDGE { x } else { f64::INFINITY }
}

/// Bound 3 on the other side: no root with |Im s| ≤ `height` has a real part of this or less.
pub(crate) fn left_edge(h: &QuasiPolynomial, height: f64) -> f64 {
    let last = h.delays().last().copied().unwrap_or(0.0);
    let alternate = |row: &[f64]| {
        row.iter()
            .enumerate()
            .map(|(k, c)| if k % 2 == 0 { *c } else { -c })
            .collect()
    };
    let (rows, delays) = h
        .terms()
        .map(|(row, tau)| (alternate(row), last - tau))
        .unzip();
    QuasiPolynomial::new(rows, delays).map_or(f64::NEG_INFINITY, |h| -right_edge(&h, height))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quasipoly::make;

    #[test]
    fn the_radius_is_close_to_the_least_one() {
        let h = make(&[&[0.0, 1.0], &[2.0]], &[0.0, 1.0]);
        let radius = dominance(&h, (0.0, f64::INFINITY)).map(|d| d.radius);
        assert!(radius.is_some_and(|r| (2.0..2.03).contains(&r)));
        assert!(dominance(&h, (f64::NEG_INFINITY, 0.0)).is_none());
    }

    #[test]
    fn neutral_lines_need_to_be_clear_of_the_chain() {
        let h = make(&[&[0.0, 1.0], &[2.0, 0.3]], &[0.0, 0.36]);
        let chain = 0.3f64.ln() / 0.36;
        assert!(dominance(&h, (chain - 1e-6, f64::INFINITY)).is_none());
        assert_eq!(
            dominance(&h, (chain + 1e-3, f64::INFINITY)).map(|d| d.row),
            Some(0)
        );
        // Left of the chain the delayed term leads.
        assert_eq!(
            dominance(&h, (f64::NEG_INFINITY, chain - 1e-3)).map(|d| d.row),
            Some(1)
        );
    }

    #[test]
    fn no_root_lies_beyond_the_edges_of_a_strip() {
        let h = make(&[&[1.0], &[0.0, 0.0, 1.0]], &[0.0, 0.5]);
        let (left, right) = (left_edge(&h, 10.0), right_edge(&h, 10.0));
        assert!(left < 0.0 && right > 0.0 && right.is_finite() && left.is_finite());
        for x in [right, 2.0 * right, 10.0 * right] {
            let g = h.value(Complex64::new(x, 7.0));
            assert!((g - 1.0).norm() < 1.0);
        }
    }
}
