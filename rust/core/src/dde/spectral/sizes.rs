//! Largest moduli of many numbers.

/// Numbers that are compared side by side, so that no comparison waits for the one before.
const LANES: usize = 8;

/// The largest modulus; NaN is passed over.
pub(super) fn largest(values: &[f64]) -> f64 {
    largest_of(values, &[], |value, _| value)
}

/// The largest modulus of `what` of pairs; a missing second number is zero. NaN is passed over.
#[inline(always)]
pub(super) fn largest_of(first: &[f64], second: &[f64], what: impl Fn(f64, f64) -> f64) -> f64 {
    // Not `f64::max`, whose rule for NaN takes three instructions.
    let larger = |a: f64, b: f64| if b > a { b } else { a };
    let mut most = [0.0; LANES];
    let (whole, rest) = first.as_chunks::<LANES>();
    let (others, last) = second.as_chunks::<LANES>();
    for (i, chunk) in whole.iter().enumerate() {
        let other = others.get(i).unwrap_or(&[0.0; LANES]);
        for ((most, a), b) in most.iter_mut().zip(chunk).zip(other) {
            *most = larger(*most, what(*a, *b).abs());
        }
    }
    for (i, a) in rest.iter().enumerate() {
        let b = last.get(i).copied().unwrap_or_default();
        most[0] = larger(most[0], what(*a, b).abs());
    }
    most.into_iter().fold(0.0, larger)
}

/// Is every number finite?
pub(super) fn all_finite(values: &[f64]) -> bool {
    let mut sums = [0.0; LANES];
    let (whole, rest) = values.as_chunks::<LANES>();
    for chunk in whole {
        for (sum, value) in sums.iter_mut().zip(chunk) {
            // NaN for what is not finite, and from then on.
            *sum += 0.0 * value;
        }
    }
    let sum: f64 = sums.iter().sum::<f64>() + rest.iter().map(|value| 0.0 * value).sum::<f64>();
    sum == 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_place_counts() {
        for length in [1, 7, 8, 9, 31] {
            for at in 0..length {
                let mut values = vec![0.5; length];
                values[at] = -2.0;
                assert_eq!(largest(&values), 2.0);
                let other = vec![1.0; length];
                assert_eq!(largest_of(&values, &other, |a, b| a - b), 3.0);
                assert!(all_finite(&values));
                for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                    values[at] = bad;
                    assert!(!all_finite(&values));
                }
            }
        }
        assert_eq!(largest(&[]), 0.0);
    }
}
