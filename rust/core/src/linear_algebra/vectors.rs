//! Products of vectors, and sums of their multiples.

/// Sums that a dot product is split into, so that they are computed side by side.
const SUMS: usize = 8;

/// Σ x_i y_i.
#[inline(always)]
pub(crate) fn dot(x: &[f64], y: &[f64]) -> f64 {
    let mut sums = [0.0; SUMS];
    let (left, right) = (x.chunks_exact(SUMS), y.chunks_exact(SUMS));
    let rest: f64 = left
        .remainder()
        .iter()
        .zip(right.remainder())
        .map(|(x, y)| x * y)
        .sum();
    if x.len() < SUMS {
        return 0.0 + rest;
    }
    for (x, y) in left.zip(right) {
        for (sum, (x, y)) in sums.iter_mut().zip(x.iter().zip(y)) {
            *sum += x * y;
        }
    }
    sums.iter().sum::<f64>() + rest
}

/// Add a multiple of one vector to another.
#[inline]
pub(crate) fn add_multiple(out: &mut [f64], factor: f64, vector: &[f64]) {
    for (out, entry) in out.iter_mut().zip(vector) {
        *out += factor * entry;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dot_product_of_any_length_is_one() {
        for length in 0..40 {
            let x: Vec<f64> = (0..length).map(f64::from).collect();
            let n = f64::from(length);
            assert_eq!(dot(&x, &x), (n - 1.0) * n * (2.0 * n - 1.0) / 6.0);
        }
    }
}
