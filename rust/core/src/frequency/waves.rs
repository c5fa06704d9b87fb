//! Real functions f(ω) = Im(j^q Σ_δ P_δ(jω) e^(−jωδ)) with their derivatives, errors and bounds.
//!
//! Im(j^q X) is the same for X and (−1)^(q+1) conj X, so that the delays δ < 0 are folded onto those
//! above zero; without delay half of the powers have no imaginary part. The derivative by ω of
//! j^q P e^(−sδ) is j^(q+1) (P′ − δP) e^(−sδ). With S the moduli of all that was added up in the
//! coefficients, u = 2⁻⁵³, n + 1 coefficients and m rows, a value of the k-th derivative loses
//! `roundings` + 3k u of S in the coefficients, 1.5n + 1 in Horner's rule by −ω², 6 in the two
//! products with cosine and sine (u each, `elementary`) and their sum, m in the sum of rows; and
//! phases are wrong by ω times SAME_DELAY and two roundings of the longest delay, 10 u in all:
//!     |error| ≤ u Σ (roundings + 3k + 2n + m + 8 + 10 ω longest) S_k(ω).
//! Coefficients that are zero but for rounding are taken as zero where a function is `cleaned`,
//! and a power of ω that is common to all rows is divided out: it has no sign for ω > 0.

use super::two_sided::{Row, SAME_DELAY, TwoSided};
use super::zeros::{ORDER, RealFunction, Taylor};
use crate::elementary::sin_cos;

/// u, enlarged by what the bounds themselves lose in being computed.
const ROUNDING: f64 = 1.02 * 0.5 * f64::EPSILON;

/// Coefficients of less than this part of what was added up in them are zero but for rounding.
const ZERO: f64 = 64.0 * f64::EPSILON;

/// f and its first derivatives.
#[derive(Debug, Clone)]
pub(super) struct Waves {
    /// q, modulo 4.
    turns: usize,
    delays: Vec<f64>,
    /// P_δ of each derivative, by derivative and delay.
    polynomials: Vec<Vec<Vec<f64>>>,
    /// S of each derivative.
    sizes: Vec<Vec<f64>>,
    /// Bounds the moduli of the coefficients of the last derivative.
    last: Vec<f64>,
    longest: f64,
    /// What the errors have in common.
    operations: f64,
    /// (sin, cos) of the phases at the last frequency.
    turned: Vec<(f64, f64)>,
}

impl Waves {
    /// Im(j^`turns` `sum`), every coefficient as it is.
    pub(super) fn new(sum: &TwoSided, turns: usize) -> Self {
        Self::folded(sum, turns, false)
    }

    /// The same without coefficients that are zero but for rounding, and without common powers.
    pub(super) fn cleaned(sum: &TwoSided, turns: usize) -> Self {
        Self::folded(sum, turns, true)
    }

    fn folded(sum: &TwoSided, turns: usize, clean: bool) -> Self {
        let sign = if turns.is_multiple_of(2) { -1.0 } else { 1.0 };
        let margin = SAME_DELAY * sum.longest;
        let rows = sum.rows.iter().map(|row| {
            let mut row = if row.delay < -margin {
                row.mirrored(sign)
            } else {
                row.clone()
            };
            if row.delay.abs() <= margin {
                row.delay = 0.0;
                for k in (0..row.values.len()).filter(|k| (k + turns).is_multiple_of(2)) {
                    erase(&mut row, k);
                }
            }
            row
        });
        let mut folded = TwoSided::merged(rows.collect(), sum.longest, sum.roundings);
        let mut turns = turns;
        if clean {
            for row in &mut folded.rows {
                for k in 0..row.values.len() {
                    if row.values[k].abs() <= ZERO * row.sizes[k] {
                        erase(row, k);
                    }
                }
            }
            let first = |row: &Row| row.values.iter().position(|value| *value != 0.0);
            folded.rows.retain(|row| first(row).is_some());
            let common = folded.rows.iter().filter_map(first).min().unwrap_or(0);
            turns += common;
            for row in &mut folded.rows {
                row.values.drain(..common);
                row.sizes.drain(..common);
            }
        }
        Self::with_derivatives(folded, turns)
    }

    fn with_derivatives(folded: TwoSided, turns: usize) -> Self {
        let width = folded.rows.iter().map(|row| row.values.len()).max();
        let width = width.unwrap_or(0);
        let mut found = Self {
            turns: turns % 4,
            delays: folded.rows.iter().map(|row| row.delay).collect(),
            polynomials: Vec::with_capacity(ORDER),
            sizes: Vec::with_capacity(ORDER),
            last: Vec::new(),
            longest: folded.longest,
            operations: folded.roundings
                + 3.0 * ORDER as f64
                + 2.0 * width as f64
                + folded.rows.len() as f64
                + 8.0,
            turned: Vec::with_capacity(folded.rows.len()),
        };
        let total = |parts: &[Vec<f64>]| {
            let mut total = vec![0.0; width];
            for part in parts {
                for (sum, size) in total.iter_mut().zip(part) {
                    *sum += size.abs();
                }
            }
            total
        };
        let mut values: Vec<Vec<f64>> = folded.rows.iter().map(|row| row.values.clone()).collect();
        let mut sizes: Vec<Vec<f64>> = folded.rows.iter().map(|row| row.sizes.clone()).collect();
        for _ in 0..ORDER {
            let next = |rows: &[Vec<f64>], sign: f64| {
                let pairs = rows.iter().zip(&found.delays);
                pairs
                    .map(|(row, delay)| derivative(row, sign * delay))
                    .collect()
            };
            let (following, larger) = (next(&values, -1.0), next(&sizes, 1.0));
            found.polynomials.push(values);
            found.sizes.push(total(&sizes));
            (values, sizes) = (following, larger);
        }
        found.last = total(&values);
        let errors = total(&sizes);
        for (bound, error) in found.last.iter_mut().zip(errors) {
            *bound += ROUNDING * found.operations * error;
        }
        found
    }

    /// Is the function zero everywhere?
    pub(super) fn is_zero(&self) -> bool {
        self.delays.is_empty()
    }

    /// The `k`-th derivative at `omega`, to which `turn` has been called.
    fn sum(&self, k: usize, omega: f64) -> f64 {
        let square = -omega * omega;
        let rows = self.polynomials[k].iter().zip(&self.turned);
        rows.fold(0.0, |total, (row, (sine, cosine))| {
            let (mut even, mut odd) = (0.0, 0.0);
            for pair in row.chunks(2).rev() {
                even = even * square + pair[0];
                odd = odd * square + pair.get(1).copied().unwrap_or(0.0);
            }
            odd *= omega;
            total
                + match (self.turns + k) % 4 {
                    0 => odd * cosine - even * sine,
                    1 => even * cosine + odd * sine,
                    2 => even * sine - odd * cosine,
                    _ => -(even * cosine + odd * sine),
                }
        })
    }

    fn turn(&mut self, omega: f64) {
        let phases = self.delays.iter().map(|delay| sin_cos(omega * delay));
        self.turned.clear();
        self.turned.extend(phases);
    }

    /// Bound on the zeros, where the row without delay leads; infinite where it does not.
    pub(super) fn last_zero(&self) -> f64 {
        let Some(rows) = self.polynomials.first() else {
            return f64::INFINITY;
        };
        let size = |k: usize| -> f64 {
            let moduli = rows.iter().filter_map(|row| row.get(k));
            moduli.map(|value| value.abs()).sum()
        };
        let width = rows.iter().map(Vec::len).max().unwrap_or(0);
        let Some(degree) = (0..width).rev().find(|k| size(*k) > 0.0) else {
            return 0.0;
        };
        let own = match (self.delays.first(), rows.first()) {
            (Some(0.0), Some(row)) => row.get(degree).map_or(0.0, |value| value.abs()),
            _ => 0.0,
        };
        let lower: Vec<f64> = (0..degree).map(size).collect();
        super::bounds::fujiwara(&lower, 2.0 * own * (1.0 - 1e-12) - size(degree))
    }
}

impl RealFunction for Waves {
    fn value(&mut self, omega: f64) -> f64 {
        self.turn(omega);
        self.sum(0, omega)
    }

    fn taylor(&mut self, omega: f64) -> Taylor {
        self.turn(omega);
        let share = ROUNDING * (self.operations + 10.0 * omega * self.longest);
        let mut found = Taylor::default();
        for (k, (value, error)) in found.values.iter_mut().zip(&mut found.errors).enumerate() {
            *value = self.sum(k, omega);
            *error = share * polynomial(&self.sizes[k], omega);
        }
        found
    }

    fn bound(&self, omega: f64) -> f64 {
        polynomial(&self.last, omega) * (1.0 + 1e-9)
    }
}

fn erase(row: &mut Row, k: usize) {
    row.values[k] = 0.0;
    row.sizes[k] = 0.0;
}

/// p′ + `factor` p.
fn derivative(row: &[f64], factor: f64) -> Vec<f64> {
    let above = row.iter().skip(1).chain(std::iter::once(&0.0));
    let pairs = row.iter().zip(above).enumerate();
    pairs
        .map(|(k, (own, above))| (k + 1) as f64 * above + factor * own)
        .collect()
}

/// Horner's rule, ascending coefficients.
pub(super) fn polynomial(coefficients: &[f64], x: f64) -> f64 {
    coefficients.iter().rev().fold(0.0, |sum, c| sum * x + c)
}
