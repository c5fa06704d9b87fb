//! Frequencies beyond which nothing is left to find.
//!
//! The positive zero of lead ωⁿ − Σ_{k<n} c_k ωᵏ, c_k ≥ 0, is at most 2 max (c_k/lead)^(1/(n−k))
//! (Fujiwara 1916); beyond it the leading term outweighs the others. It is enlarged by 1e-9 for the
//! rounding of logarithms, exponentials and of the sums of moduli that enter.

use crate::elementary::{exp, log};
use crate::quasipoly::QuasiPolynomial;

/// A radius beyond which `lead` ωⁿ > Σ `lower`_k ωᵏ, n being the length of `lower`; infinite unless
/// `lead` is above zero.
pub(super) fn fujiwara(lower: &[f64], lead: f64) -> f64 {
    if lead.is_nan() || lead <= 0.0 {
        return f64::INFINITY;
    }
    let powers = (1..=lower.len()).rev();
    let radii = lower.iter().zip(powers).filter(|(c, _)| **c > 0.0);
    radii
        .map(|(c, power)| 2.0 * exp((log(*c) - log(lead)) / power as f64) * (1.0 + 1e-9))
        .fold(0.0, f64::max)
}

/// Sums of the moduli of the coefficients of each power.
pub(super) fn moduli(h: &QuasiPolynomial) -> Vec<f64> {
    let mut sizes = vec![0.0; h.degree() + 1];
    for row in h.coefficients() {
        for (size, c) in sizes.iter_mut().zip(row) {
            *size += c.abs();
        }
    }
    sizes
}

/// The largest modulus of a coefficient of the highest power.
pub(super) fn leading(h: &QuasiPolynomial) -> f64 {
    let degree = h.degree();
    let moduli = h.coefficients().iter().filter_map(|row| row.get(degree));
    moduli.fold(0.0, |most, c| c.abs().max(most))
}

/// A frequency beyond which |s^`shift` n| < `level` |d| is certain; infinite where that is not.
///
/// |d| is at least the modulus of its leading term less those of all others, |n| at most the sum
/// of its own; their difference, a polynomial, changes its sign once (Descartes).
pub fn end_of_gain(n: &QuasiPolynomial, d: &QuasiPolynomial, level: f64, shift: i32) -> f64 {
    let places = |shift: i32| usize::try_from(shift).unwrap_or(0);
    let (up, down) = (places(shift), places(-shift));
    let top = down + d.degree();
    let mut sizes = vec![0.0; (up + n.degree()).max(top) + 1];
    for (size, c) in sizes.iter_mut().skip(up).zip(moduli(n)) {
        *size += c;
    }
    for (size, c) in sizes.iter_mut().skip(down).zip(moduli(d)) {
        *size += level * c;
    }
    if sizes.iter().skip(top + 1).any(|size| *size > 0.0) {
        return f64::INFINITY;
    }
    let excess = 2.0 * level * leading(d) - sizes.get(top).copied().unwrap_or(0.0);
    // The sums of moduli in the highest power cancel down to their rounding where they balance.
    if excess <= 1e-13 * level * leading(d) {
        return f64::INFINITY;
    }
    fujiwara(sizes.get(..top).unwrap_or_default(), excess)
}

/// Largest of the frequencies at which terms of n or d, or turns of their delays, change.
pub(super) fn highest_corner(n: &QuasiPolynomial, d: &QuasiPolynomial) -> f64 {
    let mut highest = 1e-300f64;
    let turn = |gap: f64| std::f64::consts::TAU / gap;
    for h in [n, d] {
        highest =
            highest.max(0.5 * fujiwara(moduli(h).split_last().map_or(&[], |x| x.1), leading(h)));
        let pairs = h.delays().iter().zip(h.delays().iter().skip(1));
        highest = pairs.fold(highest, |most, (a, b)| most.max(turn(b - a)));
    }
    match (n.delays().first(), d.delays().first()) {
        (Some(a), Some(b)) if a != b => highest.max(turn((a - b).abs())),
        _ => highest,
    }
}
