//! Chains of roots of neutral equations.
//!
//! Let a be the coefficient of sⁿ without delay (the smallest delay factored out) and b_j those
//! with delays d_j. Roots of large modulus lie near the roots of the difference part a + Σ b_j
//! e^(−s d_j), whose real parts are at most C_D, the root of Σ |b_j| e^(−c d_j) = |a| (Avellar and
//! Hale 1980). C_D is attained or approached if the delays are rationally independent, and is in
//! any case the supremum over arbitrarily small changes of the delays: C_D < 0 is what strong
//! stability asks for (Hale and Verduyn Lunel 2002). For commensurate delays taken as exact, as for
//! every difference equation with one base, the chains may end further left;
//! `counting::exact_delays` computes where. C_D is computed to rounding. No proof depends on it:
//! where a line must lie right of the chains, `bounds::dominance` tests the inequality itself.

use crate::elementary::{exp, log};
use crate::quasipoly::{Kind, QuasiPolynomial};

/// Upper limit on the steps of Newton's method or bisection.
const MAX_STEPS: usize = 200;

/// C_D: −∞ where there is no chain (polynomial, retarded), +∞ for an advanced equation.
///
/// ```
/// use deadtime::{quasipoly::QuasiPolynomial, roots::chain_abscissa};
/// let h = QuasiPolynomial::new(vec![vec![0.0, 1.0], vec![2.0, 0.3]], vec![0.0, 0.36])?;
/// assert!((chain_abscissa(&h) - 0.3f64.ln() / 0.36).abs() < 1e-14);
/// # Ok::<(), deadtime::Error>(())
/// ```
pub fn chain_abscissa(h: &QuasiPolynomial) -> f64 {
    match h.kind() {
        Kind::Polynomial | Kind::Retarded => return f64::NEG_INFINITY,
        Kind::Advanced => return f64::INFINITY,
        Kind::Neutral | Kind::Difference => {}
    }
    let degree = h.degree();
    let mut leading = h
        .terms()
        .map(|(row, delay)| (row.get(degree).copied().unwrap_or(0.0).abs(), delay));
    let Some((own, first)) = leading.next() else {
        return f64::NEG_INFINITY;
    };
    let chain: Vec<(f64, f64)> = leading
        .filter(|(size, _)| *size > 0.0)
        .map(|(size, delay)| (log(size) - log(own), delay - first))
        .collect();
    // log Σ e^(log|b_j/a| − c d_j) = 0: falling and convex in c. Each summand alone gives a lower
    // bound of the root; with m summands log m more, an upper one.
    let spread = log(chain.len() as f64);
    let bound = |extra: f64| {
        chain
            .iter()
            .map(|(size, d)| (size + extra) / d)
            .fold(f64::NEG_INFINITY, f64::max)
    };
    let (mut low, mut high) = (bound(0.0), bound(spread));
    let excess = |c: f64| {
        let top = chain
            .iter()
            .map(|(size, d)| size - c * d)
            .fold(f64::NEG_INFINITY, f64::max);
        let (mut sum, mut slope) = (0.0, 0.0);
        for (size, d) in &chain {
            let part = exp(size - c * d - top);
            sum += part;
            slope += d * part;
        }
        (top + log(sum), slope / sum)
    };
    // Newton from the left of the root of a convex falling function never oversteps it.
    let mut c = low;
    for _ in 0..MAX_STEPS {
        let (value, slope) = excess(c);
        if value >= 0.0 {
            low = c;
        } else {
            high = c;
        }
        let next = (c + value / slope).min(high).max(low);
        if (next - c).abs() <= f64::EPSILON * c.abs() {
            return next;
        }
        c = next;
    }
    c
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quasipoly::make;

    fn chain(rows: &[&[f64]], delays: &[f64]) -> f64 {
        chain_abscissa(&make(rows, delays))
    }

    #[test]
    fn only_neutral_and_difference_equations_have_chains() {
        let retarded = chain(&[&[0.0, 1.0], &[1.0]], &[0.0, 1.0]);
        assert_eq!(retarded, f64::NEG_INFINITY);
        assert_eq!(chain(&[&[1.0], &[0.0, 1.0]], &[0.0, 1.0]), f64::INFINITY);
    }

    #[test]
    fn several_delays_solve_the_equation_of_the_moduli() {
        let c = chain(&[&[1.0], &[-0.75], &[0.5]], &[0.0, 1.0, 2.0]);
        // 0.75 x + 0.5 x² = 1 with x = e^(−c).
        let x = (-0.75 + (0.75f64 * 0.75 + 2.0).sqrt()) / 1.0;
        assert!((c + x.ln()).abs() < 1e-15);
        assert_eq!(c, chain(&[&[1.0], &[-0.75], &[0.5]], &[3.0, 4.0, 5.0]));
    }

    #[test]
    fn extreme_coefficients_do_not_overflow() {
        let c = chain(&[&[0.0, 1e-300], &[0.0, 1e300]], &[0.0, 1e-3]);
        assert!((c / (600.0 * 10f64.ln() / 1e-3) - 1.0).abs() < 1e-12);
    }
}
