//! A family expanded about the centre of a box of parameters: values, slopes, and bounds on both
//! over the box.
//!
//! Row j of h e^(s τ_r) is P_j(s; p) e^(−s d_j(p)), P_j = Σ_k b_jk(p) s^k. For each b = b_jk a box
//! with centre c and half widths r holds b(c), its slopes ∂_i b(c), and majorants over the box: of
//! |b|, |∂_i b| and |∂_i ∂_l b|, all formed from the moduli of the terms at |c_i| + r_i. Majorants
//! are sums and products of numbers ≥ 0 with a relative error of at most `digits` u; their users
//! leave a margin of 1e-9.

use super::reduced::{Monomial, Reduced};

/// A box, given by its two corners.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Range<const D: usize> {
    pub(crate) low: [f64; D],
    pub(crate) high: [f64; D],
}

impl<const D: usize> Range<D> {
    pub(crate) fn centre(&self) -> [f64; D] {
        std::array::from_fn(|i| self.low[i] + 0.5 * (self.high[i] - self.low[i]))
    }

    /// Upper bounds on the distance from `centre` to the faces of the box.
    fn half(&self, centre: &[f64; D]) -> [f64; D] {
        std::array::from_fn(|i| {
            let reach = (centre[i] - self.low[i]).max(self.high[i] - centre[i]);
            reach * (1.0 + 2.0 * f64::EPSILON)
        })
    }

    /// The two halves along a parameter; `None` where there is no number between its ends.
    pub(crate) fn halves(&self, parameter: usize) -> Option<(f64, [Self; 2])> {
        let (low, high) = (*self.low.get(parameter)?, *self.high.get(parameter)?);
        let middle = low + 0.5 * (high - low);
        if !(low < middle && middle < high) {
            return None;
        }
        let (mut left, mut right) = (*self, *self);
        *left.high.get_mut(parameter)? = middle;
        *right.low.get_mut(parameter)? = middle;
        Some((middle, [left, right]))
    }
}

/// A coefficient of a power of s in a row.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Coefficient<const D: usize> {
    pub(crate) value: f64,
    pub(crate) slopes: [f64; D],
    /// Majorant of |b|.
    pub(crate) most: f64,
    pub(crate) most_slopes: [f64; D],
    pub(crate) bends: [[f64; D]; D],
}

impl<const D: usize> Coefficient<D> {
    const ZERO: Self = Self {
        value: 0.0,
        slopes: [0.0; D],
        most: 0.0,
        most_slopes: [0.0; D],
        bends: [[0.0; D]; D],
    };

    /// Bounds on |b| over the box, from below and from above.
    pub(crate) fn modulus(&self, half: &[f64; D]) -> (f64, f64) {
        let spread: f64 = self.most_slopes.iter().zip(half).map(|(s, r)| s * r).sum();
        let size = self.value.abs();
        ((size - spread).max(0.0), (size + spread).min(self.most))
    }

    fn add(&mut self, monomial: &Monomial<D>, centre: &[f64; D], reach: &[f64; D]) {
        let c = monomial.coefficient;
        let exponents = &monomial.exponents;
        self.value += c * product(exponents, centre, None, None);
        self.most += c.abs() * product(exponents, reach, None, None);
        for i in 0..D {
            if exponents[i] == 0 {
                continue;
            }
            self.slopes[i] += c * product(exponents, centre, Some(i), None);
            self.most_slopes[i] += c.abs() * product(exponents, reach, Some(i), None);
            for l in 0..D {
                self.bends[i][l] += c.abs() * product(exponents, reach, Some(i), Some(l));
            }
        }
    }
}

/// Π p_i^e_i, differentiated once or twice.
fn product<const D: usize>(
    exponents: &[u32; D],
    point: &[f64; D],
    first: Option<usize>,
    second: Option<usize>,
) -> f64 {
    let mut result = 1.0;
    for (i, (exponent, value)) in exponents.iter().zip(point).enumerate() {
        let mut left = *exponent;
        for _ in [first, second].iter().filter(|by| **by == Some(i)) {
            if left == 0 {
                return 0.0;
            }
            result *= f64::from(left);
            left -= 1;
        }
        for _ in 0..left {
            result *= value;
        }
    }
    result
}

/// A row over the box.
#[derive(Debug, Clone)]
pub(crate) struct ExpansionRow<const D: usize> {
    /// d_j at the centre of the box.
    pub(crate) delay: f64,
    pub(crate) slopes: [f64; D],
    /// |∂_i d_j|.
    pub(crate) rates: [f64; D],
    /// Bound on the change of d_j over the box.
    pub(crate) spread: f64,
    /// Majorant of |d_j|.
    pub(crate) longest: f64,
    /// Sum of the moduli from which `delay` was added up: at least `longest`.
    pub(crate) size: f64,
    /// Ascending powers of s.
    pub(crate) coefficients: Vec<Coefficient<D>>,
    /// Does the row depend on the parameters?
    pub(crate) moves: bool,
}

/// A family on a box.
#[derive(Debug, Clone)]
pub(crate) struct BoxExpansion<const D: usize> {
    pub(crate) rows: Vec<ExpansionRow<D>>,
    pub(crate) half: [f64; D],
    /// Number of roundings to count for each value, in addition to those of the delays: see
    /// `value_set`.
    pub(crate) roundings: f64,
}

impl<const D: usize> BoxExpansion<D> {
    /// Memory for the expansion of `reduced` about a box.
    pub(crate) fn new(reduced: &Reduced<'_, D>) -> Self {
        let rows: Vec<ExpansionRow<D>> = reduced
            .rows
            .iter()
            .map(|row| {
                let degree = row.monomials.iter().map(|m| m.power).max().unwrap_or(0);
                let fixed = |m: &Monomial<D>| m.exponents.iter().all(|e| *e == 0);
                ExpansionRow {
                    delay: 0.0,
                    slopes: row.slopes,
                    rates: row.slopes.map(f64::abs),
                    spread: 0.0,
                    longest: 0.0,
                    size: 0.0,
                    coefficients: vec![Coefficient::ZERO; degree + 1],
                    moves: row.slopes.iter().any(|s| *s != 0.0) || !row.monomials.iter().all(fixed),
                }
            })
            .collect();
        let count = rows.len() as f64;
        Self {
            rows,
            half: [0.0; D],
            roundings: 64.0
                + 16.0 * (reduced.degree + 1) as f64
                + 4.0 * count
                + 4.0 * reduced.digits,
        }
    }

    /// Compute the expansion about the box `range`.
    pub(crate) fn adopt(&mut self, reduced: &Reduced<'_, D>, range: &Range<D>) {
        let centre = range.centre();
        self.half = range.half(&centre);
        let reach: [f64; D] = std::array::from_fn(|i| centre[i].abs() + self.half[i]);
        for (own, row) in self.rows.iter_mut().zip(&reduced.rows) {
            own.delay = row.delay;
            own.size = row.size;
            let mut spread = 0.0;
            for i in 0..D {
                own.delay += row.slopes[i] * centre[i];
                own.size += row.slope_sizes[i] * reach[i];
                spread += own.rates[i] * self.half[i];
            }
            own.spread = spread + 8.0 * f64::EPSILON * own.size;
            own.longest = own.delay.abs() + own.spread;
            own.coefficients.fill(Coefficient::ZERO);
            for monomial in &row.monomials {
                if let Some(slot) = own.coefficients.get_mut(monomial.power) {
                    slot.add(monomial, &centre, &reach);
                }
            }
        }
    }
}
