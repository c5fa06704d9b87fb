//! Overshoot of the exact step response of z′(t) = K (r − z)(t − Td), which depends on x = K Td alone.
//!
//! With θ = t/Td the error is e(θ) = Σ_j (−x)^j (θ − j + 1)^j/j! over j ≤ θ + 1 (method of steps); z
//! peaks one delay after the first zero of e.

use super::zero::zero;

/// x from which searches start: the overshoot there is below 1e-7, close to rounding.
const LEAST_X: f64 = 0.375;

/// Delays after which no overshoot is looked for: x is then within 3e-4 of 1/e and it is below 1e-60.
const LATEST: f64 = 200.0;

/// e(θ).
fn error(theta: f64, x: f64) -> f64 {
    let mut base = 1.0;
    let mut terms = Vec::new();
    for j in 0..theta.floor() as i32 + 2 {
        if j > 0 {
            base *= -x / f64::from(j);
        }
        terms.push(base * (theta - f64::from(j) + 1.0).powi(j));
    }
    // With a correction for what each sum loses (Neumaier 1974).
    let (mut sum, mut lost) = (0.0_f64, 0.0);
    for term in terms {
        let next = sum + term;
        lost += if sum.abs() >= f64::abs(term) {
            (sum - next) + term
        } else {
            (term - next) + sum
        };
        sum = next;
    }
    sum + lost
}

/// The overshoot; 0 where there is none.
fn exact_overshoot(x: f64) -> f64 {
    if x >= 1.0 {
        return x - 0.5;
    }
    if x <= libm::exp(-1.0) {
        return 0.0;
    }
    let mut low = 0.0;
    while error(low + 0.5, x) > 0.0 {
        low += 0.5;
        if low > LATEST {
            return 0.0;
        }
    }
    let first = zero(|theta| error(theta, x), low, low + 0.5);
    (-error(first + 1.0, x)).max(0.0)
}

/// The x of an overshoot; none where that is too small to tell it.
pub fn exact_x(overshoot: f64) -> Option<f64> {
    if overshoot >= 0.5 {
        return Some(overshoot + 0.5);
    }
    if overshoot <= exact_overshoot(LEAST_X) {
        return None;
    }
    Some(zero(|x| exact_overshoot(x) - overshoot, LEAST_X, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_overshoot_and_its_inverse_are_inverse_to_each_other() {
        for i in 1..300 {
            let overshoot = 1e-5 + 0.01 * f64::from(i);
            let x = exact_x(overshoot).unwrap();
            assert!((exact_overshoot(x) - overshoot).abs() < 1e-12);
        }
        assert_eq!(exact_overshoot(0.2), 0.0);
        assert_eq!(exact_overshoot(libm::exp(-1.0)), 0.0);
        assert_eq!(exact_x(1e-9), None);
    }
}
