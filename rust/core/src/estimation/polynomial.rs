//! Roots of polynomials: eigenvalues of the companion matrix.

use num_complex::Complex64;

use crate::linear_algebra::eigenvalues::eigenvalues;

/// The roots, of coefficients that begin with that of the highest power; `None` where they are not found.
pub(super) fn roots(coefficients: &[f64]) -> Option<Vec<Complex64>> {
    let first = coefficients.iter().position(|c| *c != 0.0)?;
    let last = coefficients.iter().rposition(|c| *c != 0.0)?;
    let (own, at_zero) = (&coefficients[first..=last], coefficients.len() - 1 - last);
    let n = own.len() - 1;
    let mut companion = vec![0.0; n * n];
    for i in 0..n {
        companion[i] = -own[i + 1] / own[0];
        if i + 1 < n {
            companion[(i + 1) * n + i] = 1.0;
        }
    }
    let mut found = match n {
        0 => Vec::new(),
        1 => vec![Complex64::from(companion[0])],
        _ => eigenvalues(&companion, n)?,
    };
    found.extend(vec![Complex64::ZERO; at_zero]);
    Some(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zeros_at_either_end_are_no_further_roots() {
        // z (2 z − 1) (z² + 1), with a leading coefficient of zero.
        let mut found = roots(&[0.0, 2.0, -1.0, 2.0, -1.0, 0.0]).unwrap();
        found.sort_by(|one, other| one.norm().total_cmp(&other.norm()));
        assert_eq!(found.len(), 4);
        assert_eq!(found[0], Complex64::ZERO);
        assert!((found[1] - 0.5).norm() < 1e-14);
        assert!(found[2..].iter().all(|z| (z.norm() - 1.0).abs() < 1e-14));
        assert_eq!(roots(&[3.0]), Some(Vec::new()));
        assert_eq!(roots(&[0.0]), None);
    }
}
