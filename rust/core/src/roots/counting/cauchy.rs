//! Cauchy's bound: a radius beyond which the highest power of a polynomial exceeds all lower ones.

use crate::elementary::{exp, log};

/// Relative margin, on the larger side, by which an inequality must hold.
pub(crate) const MARGIN: f64 = 1e-9;

/// Ratio of the bounds at which the bisection ends: the radius is at most one per cent too large.
const WIDTH: f64 = 1.01;

/// Factor on the first bound, which covers its rounding error.
const ENLARGED: f64 = 1.0 + 1e-6;

/// A radius beyond which `top` rⁿ > Σ `lower`_k rᵏ, at most one per cent above the least one.
pub(crate) fn cauchy_radius(top: f64, lower: &[f64]) -> f64 {
    let degree = lower.len() as f64;
    // Fujiwara 1916: twice the largest of the n-th roots is a bound.
    let outer = lower
        .iter()
        .enumerate()
        .filter(|(_, c)| **c > 0.0)
        .map(|(k, c)| 2.0 * exp((log(*c) - log(top)) / (degree - k as f64)))
        .fold(0.0, f64::max);
    let exceeds = |r: f64| {
        let others = lower.iter().fold(0.0, |sum, c| (sum + c) / r);
        others * (1.0 + MARGIN) < top
    };
    if outer == 0.0 {
        return 0.0;
    }
    let mut low = outer / (2.0 * degree.max(1.0)) * 0.5;
    let mut high = outer * ENLARGED;
    if !exceeds(high) {
        // The coefficients span more than double precision does.
        return f64::INFINITY;
    }
    while high > WIDTH * low {
        // The square root of the product is not formed, because the product leaves the range of
        // double precision.
        let middle = low.sqrt() * high.sqrt();
        if !(low < middle && middle < high) {
            break;
        }
        if exceeds(middle) {
            high = middle;
        } else {
            low = middle;
        }
    }
    high
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_radius_is_found_at_either_end_of_double_precision() {
        // Squares of these numbers overflow or underflow. The bisection once did not end.
        for size in [1e-320, 1e-300, 1e-200, 1e200, 1e300] {
            let radius = cauchy_radius(1.0, &[size]);
            assert!((1.0..1.02).contains(&(radius / size)), "{size}: {radius}");
        }
    }
}
