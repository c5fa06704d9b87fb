//! All roots of a small complex polynomial, for starts of other iterations.
//!
//! Simultaneous iteration (Aberth 1973): Newton's step p/p′ at each root, less the repulsion
//! Σ 1/(z − z_k) of the others. Nothing is proved.

use num_complex::Complex64;

const STEPS: u32 = 200;

/// The roots of Σ c_k zᵏ; leading coefficients that are zero are left out.
pub(crate) fn roots(ascending: &[Complex64]) -> Vec<Complex64> {
    let used = ascending.iter().rposition(|c| *c != Complex64::ZERO);
    let degree = used.unwrap_or(0);
    let (Some(first), Some(last)) = (ascending.first(), ascending.get(degree)) else {
        return Vec::new();
    };
    if degree == 0 {
        return Vec::new();
    }
    // Moduli around their geometric mean, angles that share no symmetry with the coefficients.
    let mean = (first / last).norm().powf(1.0 / degree as f64);
    let start =
        |k: usize| Complex64::from_polar(mean.max(1e-3), 0.4 + 6.3 * k as f64 / degree as f64);
    let mut found: Vec<Complex64> = (0..degree).map(start).collect();
    for _ in 0..STEPS {
        let mut moved = 0.0f64;
        for k in 0..degree {
            let z = found[k];
            let zero = (Complex64::ZERO, Complex64::ZERO);
            let coefficients = ascending[..=degree].iter().rev();
            let (p, slope) = coefficients.fold(zero, |(p, dp), c| (p * z + c, dp * z + p));
            if p == Complex64::ZERO {
                continue;
            }
            let others = found.iter().enumerate().filter(|(other, _)| *other != k);
            let repulsion: Complex64 = others.map(|(_, other)| (z - other).inv()).sum();
            let step = (slope / p - repulsion).inv();
            if step.is_finite() {
                found[k] = z - step;
                moved = moved.max(step.norm() / z.norm().max(f64::MIN_POSITIVE));
            }
        }
        if moved < 4.0 * f64::EPSILON {
            break;
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roots_come_back() {
        let known = [
            (1.0, 0.0),
            (0.0, 1.0),
            (-0.3, 2.0),
            (1e-3, -1e-3),
            (40.0, 1.0),
        ];
        let known = known.map(|(re, im)| Complex64::new(re, im));
        let mut coefficients = vec![Complex64::ONE];
        for root in known {
            let mut next = vec![Complex64::ZERO; coefficients.len() + 1];
            for (k, c) in coefficients.iter().enumerate() {
                next[k] -= c * root;
                next[k + 1] += c;
            }
            coefficients = next;
        }
        coefficients.push(Complex64::ZERO);
        let found = roots(&coefficients);
        assert_eq!(found.len(), known.len());
        for root in known {
            let near = found.iter().map(|z| (z - root).norm()).fold(1.0, f64::min);
            assert!(near < 1e-12 * (1.0 + root.norm()), "{root}: {near}");
        }
        assert!(roots(&[Complex64::ONE]).is_empty() && roots(&[]).is_empty());
    }
}
