//! Legendre series on an element, in ξ ∈ [−1, 1].
//!
//! A function is Σ c_k P_k(ξ), k ≤ [`DEGREE`]. Values come from Clenshaw's recurrence; series from
//! values at the Gauss nodes ξ_i with weights w_i by c_k = (2k + 1)/2 Σ w_i P_k(ξ_i) v_i, exact
//! for polynomials of degree [`DEGREE`]. Both are stable: an error of one unit in a value moves
//! coefficients and sums by a few units, whereas Taylor coefficients of a function known by pieces
//! would lose all digits.

use std::sync::LazyLock;

use crate::elementary::DoubleDouble;

/// Degree of the series. An exponential e^{λt} fits one element as long as |λ| h is below about 7.
pub(super) const DEGREE: usize = 24;

/// Number of coefficients, and of Gauss nodes.
pub(crate) const TERMS: usize = DEGREE + 1;

static TABLES: LazyLock<Tables> = LazyLock::new(Tables::new);

/// One series, or values at the nodes.
pub(crate) type Series = [f64; TERMS];

struct Tables {
    nodes: Series,
    /// (2k + 1)/2 w_i P_k(ξ_i) at `[i][k]`.
    transform: [Series; TERMS],
    /// (2k + 1)/(k + 1) and (k + 1)/(k + 2) of Clenshaw's recurrence.
    slope: Series,
    back: Series,
}

impl Tables {
    fn new() -> Self {
        let mut tables = Self {
            nodes: [0.0; TERMS],
            transform: [[0.0; TERMS]; TERMS],
            slope: [0.0; TERMS],
            back: [0.0; TERMS],
        };
        for k in 0..TERMS {
            tables.slope[k] = (2 * k + 1) as f64 / (k + 1) as f64;
            tables.back[k] = (k + 1) as f64 / (k + 2) as f64;
        }
        for i in 0..TERMS {
            // Newton's method from Tricomi's estimate; the nodes come in pairs, and one is zero.
            let angle = std::f64::consts::PI * (i as f64 + 0.75) / (TERMS as f64 + 0.5);
            let mut x = -libm::cos(angle);
            if 2 * i + 1 == TERMS {
                x = 0.0;
            }
            let mut legendre = polynomials(x);
            for _ in 0..8 {
                let (value, derivative) = next_polynomial(x, &legendre);
                x -= value / derivative;
                legendre = polynomials(x);
            }
            let (_, derivative) = next_polynomial(x, &legendre);
            let weight = 2.0 / ((1.0 - x * x) * derivative * derivative);
            tables.nodes[i] = x;
            for (k, value) in legendre.iter().enumerate() {
                tables.transform[i][k] = 0.5 * (2 * k + 1) as f64 * weight * value;
            }
        }
        tables.refine();
        tables
    }

    /// One step of Newton's method for the inverse of P_k(ξ_i), with the residual in double-double
    /// arithmetic: P_k changes by k²/2 units where a node is rounded.
    fn refine(&mut self) {
        let exact = self.nodes.map(precise_polynomials);
        let old = self.transform;
        for (row, column) in (0..TERMS).flat_map(|row| (0..TERMS).map(move |column| (row, column)))
        {
            let mut rest = DoubleDouble::from(f64::from(u8::from(row == column)));
            for (old, exact) in old.iter().zip(&exact) {
                rest = rest - exact[column] * old[row];
            }
            for (new, old) in self.transform.iter_mut().zip(&old) {
                new[row] += rest.high * old[column];
            }
        }
    }
}

/// P_0(x) … P_DEGREE(x) in double-double arithmetic.
fn precise_polynomials(x: f64) -> [DoubleDouble; TERMS] {
    let mut values = [DoubleDouble::ONE; TERMS];
    values[1] = x.into();
    for k in 1..DEGREE {
        let forward = values[k] * x * (2 * k + 1) as f64;
        values[k + 1] = (forward - values[k - 1] * k as f64).over((k + 1) as f64);
    }
    values
}

/// P_0(x) … P_DEGREE(x).
fn polynomials(x: f64) -> Series {
    let mut values = [1.0; TERMS];
    values[1] = x;
    for k in 1..DEGREE {
        let k_ = k as f64;
        values[k + 1] = ((2.0 * k_ + 1.0) * x * values[k] - k_ * values[k - 1]) / (k_ + 1.0);
    }
    values
}

/// P_TERMS and its derivative at `x`, where the lower ones are known.
fn next_polynomial(x: f64, lower: &Series) -> (f64, f64) {
    let n = TERMS as f64;
    let value = ((2.0 * n - 1.0) * x * lower[DEGREE] - (n - 1.0) * lower[DEGREE - 1]) / n;
    (value, n * (x * value - lower[DEGREE]) / (x * x - 1.0))
}

/// The Gauss nodes, ascending.
pub(crate) fn nodes() -> &'static Series {
    &TABLES.nodes
}

/// The series that has these values at the nodes.
pub(crate) fn from_values(values: &Series) -> Series {
    let mut out = [0.0; TERMS];
    for (value, row) in values.iter().zip(&TABLES.transform) {
        for (out, factor) in out.iter_mut().zip(row) {
            *out += factor * value;
        }
    }
    out
}

/// Sum of the series at ξ.
pub(super) fn at(series: &[f64], xi: f64) -> f64 {
    let tables = &*TABLES;
    let (mut first, mut second) = (0.0, 0.0);
    for (k, c) in series.iter().enumerate().rev() {
        let next = c + tables.slope[k] * xi * first - tables.back[k] * second;
        second = first;
        first = next;
    }
    first
}

/// Sums of the series at offset + ratio ξ_i for the nodes i of `range`.
pub(super) fn at_nodes(
    series: &[f64],
    offset: f64,
    ratio: f64,
    range: std::ops::Range<usize>,
    out: &mut Series,
) {
    let tables = &*TABLES;
    let mut places = [0.0; TERMS];
    for (place, node) in places.iter_mut().zip(&tables.nodes) {
        *place = offset + ratio * node;
    }
    let (mut first, mut second) = ([0.0; TERMS], [0.0; TERMS]);
    for (k, c) in series.iter().enumerate().rev() {
        let (slope, back) = (tables.slope[k], tables.back[k]);
        for ((first, second), place) in first.iter_mut().zip(&mut second).zip(&places) {
            let next = c + slope * place * *first - back * *second;
            *second = *first;
            *first = next;
        }
    }
    out[range.clone()].copy_from_slice(&first[range]);
}

/// The series of the same polynomial in ξ′, with ξ = offset + ratio ξ′.
pub(super) fn restricted(series: &[f64], offset: f64, ratio: f64) -> Series {
    let mut out = [0.0; TERMS];
    match series {
        [] => {}
        [c] => out[0] = *c,
        [c, slope] => {
            out[0] = c + slope * offset;
            out[1] = slope * ratio;
        }
        _ => {
            let mut values = [0.0; TERMS];
            at_nodes(series, offset, ratio, 0..TERMS, &mut values);
            let all = from_values(&values);
            // A part of a polynomial has its degree; higher coefficients are rounding errors.
            out[..series.len()].copy_from_slice(&all[..series.len()]);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn an_exponential_is_resolved_to_rounding() {
        let values = nodes().map(|x| libm::exp(3.0 * x));
        let series = from_values(&values);
        // Rounding of 25 values up to e^3.
        assert!(series[DEGREE].abs() < 2e-14);
        for xi in [-1.0, -0.3, 0.0, 0.77, 1.0] {
            let truth = libm::exp(3.0 * xi);
            assert!((at(&series, xi) - truth).abs() < 1e-14 * 20.0);
        }
    }

    #[test]
    fn polynomials_of_the_highest_degree_are_exact() {
        for degree in 0..TERMS {
            let values = nodes().map(|x| precise_polynomials(x)[degree].high);
            for (k, c) in from_values(&values).iter().enumerate() {
                let truth = f64::from(u8::from(k == degree));
                assert!((c - truth).abs() < 4e-15, "{k} of {degree}: {c}");
            }
        }
    }

    proptest! {
        #[test]
        fn a_part_of_a_series_is_the_same_function(
            series in prop::collection::vec(-1.0..1.0, 1..=TERMS),
            (left, right, xi) in (-1.0..1.0, -1.0..1.0, -1.0..1.0),
        ) {
            let (offset, ratio) = (0.5 * (left + right), 0.5 * (right - left));
            let part = restricted(&series, offset, ratio);
            let truth = at(&series, offset + ratio * xi);
            prop_assert!((at(&part, xi) - truth).abs() < 1e-13);
        }
    }
}
