//! A matrix in units that make its norm small: D⁻¹ A D with D = diag(2^k).
//!
//! Osborne 1960, in powers of two (Parlett and Reinsch 1969): each state in turn is scaled until its
//! row and its column, diagonal left out, are of one size. A scaling is made only where it makes the
//! norm smaller. Powers of two are exact: the eigenvalues are the same.

/// Share of the norm below which a scaling of balancing is made.
const BALANCED: f64 = 0.95;

/// Least size of a row or column in [`balanced`], as a share of the diagonal.
const LEAST_SIDE: f64 = 0.125;

/// Largest exponent of a scaling.
const MOST_EXPONENT: f64 = 500.0;

/// Upper limit on the rounds of balancing; few are needed for few states.
const ROUNDS: usize = 100;

/// D⁻¹ A D and the exponents k, for a small norm alone: sizes far below the diagonal do not matter.
///
/// A state with an empty row or column can be scaled by any factor. It is scaled until the other
/// entry is negligible beside the diagonal; a chain of integrators alone has no rate at which to stop.
pub(crate) fn balanced(a: &[f64], n: usize) -> (Vec<f64>, Vec<i32>) {
    let diagonal = (0..n).fold(0.0_f64, |most, i| most.max(a[i * n + i].abs()));
    balanced_above(a, n, LEAST_SIDE * diagonal)
}

/// D⁻¹ A D and the exponents k, where sizes up to `floor` are left as they are; if it is zero,
/// states with an empty row or column too.
pub(crate) fn balanced_above(a: &[f64], n: usize, floor: f64) -> (Vec<f64>, Vec<i32>) {
    let mut a = a.to_vec();
    let mut exponents = vec![0; n];
    for _ in 0..ROUNDS {
        let mut settled = true;
        for i in 0..n {
            let (mut column, mut row) = (0.0, 0.0);
            for j in (0..n).filter(|&j| j != i) {
                column += a[j * n + i].abs();
                row += a[i * n + j].abs();
            }
            if column.max(row) <= floor || column.min(row).max(floor) == 0.0 {
                continue;
            }
            let (column, row) = (column.max(floor), row.max(floor));
            // Sizes within a factor of two stay as they are.
            if row < 2.0 * column && column < 2.0 * row {
                continue;
            }
            let exponent = (0.5 * libm::log2(row / column))
                .round()
                .clamp(-MOST_EXPONENT, MOST_EXPONENT);
            let factor = libm::exp2(exponent);
            if column * factor + row / factor >= BALANCED * (column + row) {
                continue;
            }
            settled = false;
            exponents[i] += exponent as i32;
            for j in 0..n {
                if j != i {
                    a[j * n + i] *= factor;
                    a[i * n + j] /= factor;
                }
            }
        }
        if settled {
            break;
        }
    }
    (a, exponents)
}

/// ‖D⁻¹ A D‖₁, the largest column sum.
pub(crate) fn balanced_norm(a: &[f64], n: usize) -> f64 {
    norm(&balanced(a, n).0, n)
}

/// ‖A‖₁, the largest column sum.
pub(crate) fn norm(a: &[f64], n: usize) -> f64 {
    (0..n)
        .map(|column| (0..n).map(|row| a[row * n + column].abs()).sum())
        .fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_of_the_states_do_not_matter() {
        // Poles −1000, −1300 and −1 in observable canonical form: entries up to 1.3e6, rates up
        // to 1.3e3.
        let a = [-2301.0, 1.0, 0.0, -1_302_300.0, 0.0, 1.0, -1.3e6, 0.0, 0.0];
        assert!(balanced_norm(&a, 3) < 6e3);
        let slow: Vec<f64> = a.iter().map(|a| a * 2f64.powi(-30)).collect();
        assert_eq!(
            balanced_norm(&slow, 3),
            balanced_norm(&a, 3) * 2f64.powi(-30)
        );
        // A lag before an integrator: the unit of the integrator is arbitrary.
        assert!(balanced_norm(&[-1e-6, 1.0, 0.0, 0.0], 2) < 2e-6);
        assert_eq!(balanced_norm(&[0.0, 3.0, 0.0, 0.0], 2), 3.0);
        assert_eq!(balanced_norm(&[], 0), 0.0);
    }

    #[test]
    fn exponents_undo_the_scaling() {
        let a = [3.0, 1e9, 1e-7, 2e-9, -1.0, 4e-14, 5e7, 7e13, 0.5];
        let (scaled, exponents) = balanced(&a, 3);
        assert!(norm(&scaled, 3) < 20.0);
        for (at, (scaled, a)) in scaled.iter().zip(a).enumerate() {
            let exponent = exponents[at / 3] - exponents[at % 3];
            assert_eq!(libm::ldexp(*scaled, exponent), a);
        }
    }
}
