//! The zeros of a polynomial, separated from each other.
//!
//! A cell is halved until the Chebyshev coefficients on it prove that the polynomial has no zero
//! there, |c_0| > Σ |c_k|, or that it is monotonic, the same of its derivative: |T_k| ≤ 1. Cells
//! that are undecided at the smallest size hold zeros that rounding errors do not separate.

use super::chebyshev;
use super::nodes::nodes;

/// Upper limit on the halvings of [−1, 1]: beyond it rounding errors hide the gap between two
/// zeros.
const DEEPEST: u32 = 26;
/// Upper limit on the cells of one polynomial; no polynomial of these degrees needs more.
const MOST: usize = 4096;
/// Rounding error of a sum of coefficients, relative to their moduli.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// Append, in ascending order, points of [−1, 1] with at most one zero between neighbours.
pub(super) fn separators(coefficients: &[f64], out: &mut Vec<f64>) {
    let Some((first, others)) = coefficients.split_first() else {
        return;
    };
    let largest = total(coefficients);
    if first.abs() > total(others) + ROUNDING * largest {
        return;
    }
    let table = nodes(24);
    let mut values = vec![0.0; table.order + 1];
    let mut local = values.clone();
    let mut slopes = values.clone();
    // (start, end, halvings), the first on top.
    let mut open = vec![(-1.0, 1.0, 0)];
    let mut cells = 0;
    while let Some((start, end, halvings)) = open.pop() {
        cells += 1;
        let (middle, half) = (0.5 * (start + end), 0.5 * (end - start));
        for (value, x) in values.iter_mut().zip(&table.points) {
            *value = chebyshev::value(coefficients, middle + half * x);
        }
        table.coefficients(&values, &mut local);
        if local[0].abs() > total(&local[1..]) + ROUNDING * largest {
            continue;
        }
        chebyshev::derivative(&local, 1.0, &mut slopes);
        let monotonic = slopes[0].abs() > total(&slopes[1..]) + ROUNDING * largest;
        if monotonic || halvings >= DEEPEST || cells > MOST || total(&local) <= ROUNDING * largest {
            if out.last().is_none_or(|last| *last < start) {
                out.push(start);
            }
            out.push(end);
        } else {
            open.push((middle, end, halvings + 1));
            open.push((start, middle, halvings + 1));
        }
    }
}

fn total(coefficients: &[f64]) -> f64 {
    coefficients.iter().map(|c| c.abs()).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Coefficients of Π (x − r) by interpolation.
    fn product(zeros: &[f64]) -> Vec<f64> {
        let table = nodes(24);
        let values = table
            .points
            .iter()
            .map(|x| zeros.iter().map(|r| x - r).product());
        let mut coefficients = vec![0.0; table.order + 1];
        table.coefficients(&values.collect::<Vec<f64>>(), &mut coefficients);
        coefficients
    }

    #[test]
    fn no_two_zeros_share_a_cell() {
        let cases: [&[f64]; 5] = [
            &[0.1],
            &[-0.5, -0.499, 0.3, 0.300_001],
            &[-1.0, 1.0],
            &[-0.9, -0.7, -0.3, -0.1, 0.2, 0.21, 0.6, 0.95],
            &[1.5],
        ];
        for zeros in cases {
            let mut found = Vec::new();
            separators(&product(zeros), &mut found);
            assert!(found.is_sorted());
            for pair in found.windows(2) {
                let inside = zeros.iter().filter(|r| pair[0] < **r && **r < pair[1]);
                assert!(inside.count() <= 1, "{zeros:?} {found:?}");
            }
            let covered = |r: f64| found.windows(2).any(|pair| pair[0] <= r && r <= pair[1]);
            assert!(zeros.iter().filter(|r| r.abs() < 1.0).all(|r| covered(*r)));
        }
    }

    #[test]
    fn a_double_zero_and_the_zero_polynomial_end() {
        let mut found = Vec::new();
        separators(&product(&[0.25, 0.25]), &mut found);
        assert!(found.len() < 100, "{}", found.len());
        found.clear();
        separators(&[0.0; 25], &mut found);
        assert!(found.len() <= 2);
    }
}
