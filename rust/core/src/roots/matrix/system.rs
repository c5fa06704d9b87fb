//! The characteristic matrix M(s) = s E + Σ (s N_j − A_j) e^(−s τ_j), checked once.
//!
//! Rows and columns are scaled by powers of two before anything else: each row by the largest
//! entry of E and N in it, then row i by 1/f_i and column i by f_i as balancing does. That is exact
//! and moves no root, and the inequalities of the proofs, which compare norms, hold over longer
//! steps.

use crate::Error;
use crate::linear_algebra::balance::balanced_above;

/// Largest exponent of the scaling, so that nothing underflows or overflows.
const MOST_EXPONENT: i32 = 200;

/// Sizes of entries whose products are numbers in double precision.
const USABLE: std::ops::Range<f64> = 1e-100..1e100;

/// The contribution of one delay to one row of M: `(s · slope + value) e^(−s τ)` in each column.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Term {
    /// Index of the delay.
    pub(super) delay: usize,
    pub(super) entries: Vec<Entry>,
}

/// Column, factor on s, and the rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Entry {
    pub(super) column: usize,
    pub(super) slope: f64,
    pub(super) value: f64,
}

/// A matrix by rows, and matrices by their delays in s.
pub(super) type Matrix = Vec<Vec<f64>>;
pub(super) type ByDelay = Vec<(f64, Matrix)>;

/// A square matrix of quasi-polynomials of first degree, real, scaled.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Irreducible {
    rows: Vec<Vec<Term>>,
    /// Sorted, distinct, ≥ 0, the first one 0.
    delays: Vec<f64>,
    /// Largest row sum of A after the rows are scaled to E and N: a typical rate of the system,
    /// 1/s.
    rate: f64,
}

impl Irreducible {
    /// From E, and N and A with their delays in s: all matrices square and of one size, by rows.
    ///
    /// # Errors
    /// [`Error::Argument`] where a number is not finite or far from 1 in size.
    pub(super) fn new(e: Matrix, n: ByDelay, a: ByDelay) -> Result<Self, Error> {
        let size = e.len();
        let mut delays = vec![0.0];
        for (delay, matrix) in n.iter().chain(&a) {
            // A matrix of zeros adds no delay.
            if matrix.iter().flatten().any(|x| *x != 0.0) {
                delays.push(delay + 0.0);
            }
        }
        delays.sort_by(f64::total_cmp);
        delays.dedup();
        let mut slopes = vec![vec![vec![0.0; size]; size]; delays.len()];
        let mut values = slopes.clone();
        let place = |delay: f64| delays.iter().position(|d| *d == delay);
        let all = std::iter::once((0.0, &e, true))
            .chain(n.iter().map(|(delay, m)| (*delay, m, true)))
            .chain(a.iter().map(|(delay, m)| (*delay, m, false)));
        for (delay, matrix, is_slope) in all {
            let group = if is_slope { &mut slopes } else { &mut values };
            let Some(target) = place(delay).and_then(|place| group.get_mut(place)) else {
                continue;
            };
            for (sums, row) in target.iter_mut().zip(matrix) {
                for (sum, x) in sums.iter_mut().zip(row) {
                    refuse_if!(
                        *x != 0.0 && !USABLE.contains(&x.abs()),
                        "an entry is {x:e}, but entries other than zero must have a modulus \
                         between 1e-100 and 1e100: choose other units"
                    );
                    *sum += if is_slope { *x } else { -x };
                }
            }
        }
        let rate = match scale(&mut slopes, &mut values) {
            0.0 => delays.last().filter(|d| **d > 0.0).map_or(1.0, |d| 1.0 / d),
            rate => rate,
        };
        let mut rows = vec![Vec::new(); size];
        for (delay, (slope, value)) in slopes.iter().zip(&values).enumerate() {
            for (terms, (slopes, values)) in rows.iter_mut().zip(slope.iter().zip(value)) {
                let entries: Vec<Entry> = slopes
                    .iter()
                    .zip(values)
                    .enumerate()
                    .filter(|(_, (slope, value))| **slope != 0.0 || **value != 0.0)
                    .map(|(column, (slope, value))| Entry {
                        column,
                        slope: *slope,
                        value: *value,
                    })
                    .collect();
                if !entries.is_empty() {
                    terms.push(Term { delay, entries });
                }
            }
        }
        Ok(Self { rows, delays, rate })
    }

    /// The number of states.
    pub(super) fn size(&self) -> usize {
        self.rows.len()
    }

    /// Delays in s, ascending, the first one 0.
    pub(super) fn delays(&self) -> &[f64] {
        &self.delays
    }

    /// A typical rate of the system, in 1/s.
    pub(super) fn rate(&self) -> f64 {
        self.rate
    }

    pub(super) fn rows(&self) -> &[Vec<Term>] {
        &self.rows
    }

    /// The longest delay.
    pub(super) fn longest(&self) -> f64 {
        self.delays.last().copied().unwrap_or(0.0)
    }

    /// Factors of s and the remaining entries for one delay, after scaling: dense, by rows.
    pub(super) fn dense(&self, delay: usize) -> (Vec<Vec<f64>>, Vec<Vec<f64>>) {
        let size = self.size();
        let mut slopes = vec![vec![0.0; size]; size];
        let mut values = slopes.clone();
        for (terms, (slopes, values)) in self.rows.iter().zip(slopes.iter_mut().zip(&mut values)) {
            for entry in terms
                .iter()
                .filter(|term| term.delay == delay)
                .flat_map(|term| &term.entries)
            {
                if let (Some(slope), Some(value)) =
                    (slopes.get_mut(entry.column), values.get_mut(entry.column))
                {
                    *slope = entry.slope;
                    *value = entry.value;
                }
            }
        }
        (slopes, values)
    }

    /// Is there a delayed derivative?
    pub(super) fn is_neutral(&self) -> bool {
        let late = |term: &&Term| self.delays.get(term.delay).is_some_and(|d| *d > 0.0);
        self.rows
            .iter()
            .flatten()
            .filter(late)
            .flat_map(|term| &term.entries)
            .any(|entry| entry.slope != 0.0)
    }
}

type Matrices = [Vec<Vec<f64>>];

/// Scale rows and columns of all matrices by powers of two. Returns the rate of the scaled system.
fn scale(slopes: &mut Matrices, values: &mut Matrices) -> f64 {
    let size = slopes.first().map_or(0, Vec::len);
    let sum = |group: &Matrices| {
        let mut total = vec![vec![0.0f64; size]; size];
        for matrix in group {
            for (sums, row) in total.iter_mut().zip(matrix) {
                for (sum, x) in sums.iter_mut().zip(row) {
                    *sum += x.abs();
                }
            }
        }
        total
    };
    let (mut on_s, mut rest) = (sum(slopes), sum(values));
    let mut rows: Vec<i32> = on_s
        .iter()
        .zip(&rest)
        .map(|(on_s, rest)| {
            let largest = |row: &[f64]| row.iter().fold(0.0f64, |a, b| a.max(*b));
            let size = if largest(on_s) > 0.0 {
                largest(on_s)
            } else {
                largest(rest)
            };
            if size > 0.0 { -libm::ilogb(size) } else { 0 }
        })
        .map(|exponent| exponent.clamp(-MOST_EXPONENT, MOST_EXPONENT))
        .collect();
    let mut columns = vec![0; size];
    apply(&mut on_s, &rows, &columns);
    apply(&mut rest, &rows, &columns);
    let norm = |m: &[Vec<f64>]| {
        m.iter()
            .map(|row| row.iter().sum::<f64>())
            .fold(0.0f64, f64::max)
    };
    let rate = norm(&rest);
    let weights = rest.iter().flatten().zip(on_s.iter().flatten());
    let weights: Vec<f64> = weights.map(|(x, y)| x + rate * y).collect();
    let (_, exponents) = balanced_above(&weights, size, 0.0);
    for ((row, column), exponent) in rows.iter_mut().zip(&mut columns).zip(exponents) {
        let most = MOST_EXPONENT.min(MOST_EXPONENT + *row);
        *column = exponent.clamp((*row).max(0) - MOST_EXPONENT, most);
        *row -= *column;
    }
    for matrix in slopes.iter_mut().chain(&mut *values) {
        apply(matrix, &rows, &columns);
    }
    norm(&sum(values))
}

fn apply(matrix: &mut [Vec<f64>], rows: &[i32], columns: &[i32]) {
    for (line, row) in matrix.iter_mut().zip(rows) {
        for (x, column) in line.iter_mut().zip(columns) {
            *x = libm::ldexp(*x, row + column);
        }
    }
}
