//! How many pairs of marked rows there are at each distance, by the fast Fourier transform (Cooley &
//! Tukey 1965).

use num_complex::Complex64;

use crate::elementary::sin_cos;

/// Pairs of marks so many places apart, from none on.
pub(super) fn pairs(marks: &[bool]) -> Vec<f64> {
    let size = (2 * marks.len()).next_power_of_two();
    let mut values = vec![Complex64::ZERO; size];
    for (value, mark) in values.iter_mut().zip(marks) {
        value.re = f64::from(u8::from(*mark));
    }
    transform(&mut values);
    for value in &mut values {
        *value = Complex64::new(value.norm_sqr(), 0.0);
    }
    // The transform of an even sequence is its own inverse, but for a factor.
    transform(&mut values);
    let counts = values.iter().take(marks.len());
    counts
        .map(|value| (value.re / size as f64).round())
        .collect()
}

/// The discrete Fourier transform of as many values as a power of two, in place.
fn transform(values: &mut [Complex64]) {
    let size = values.len();
    let bits = size.trailing_zeros();
    for i in 0..size {
        let other = i.reverse_bits() >> (usize::BITS - bits).min(usize::BITS - 1);
        if i < other {
            values.swap(i, other);
        }
    }
    let turns: Vec<Complex64> = (0..size / 2)
        .map(|k| {
            let (sine, cosine) = sin_cos(-std::f64::consts::TAU * k as f64 / size as f64);
            Complex64::new(cosine, sine)
        })
        .collect();
    let mut half = 1;
    while half < size {
        for block in values.chunks_exact_mut(2 * half) {
            let (low, high) = block.split_at_mut(half);
            let stride = turns.iter().step_by(size / (2 * half));
            for ((one, other), turn) in low.iter_mut().zip(high).zip(stride) {
                let turned = *turn * *other;
                (*one, *other) = (*one + turned, *one - turned);
            }
        }
        half *= 2;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_are_those_that_are_counted() {
        for count in [1, 2, 7, 64, 333] {
            let marks: Vec<bool> = (0..count).map(|i| i * i % 7 < 3).collect();
            let found = pairs(&marks);
            for (apart, found) in found.iter().enumerate() {
                let both = marks.iter().zip(&marks[apart..]);
                let expected = both.filter(|(one, other)| **one && **other).count();
                assert_eq!(*found, expected as f64, "{count} {apart}");
            }
        }
    }
}
