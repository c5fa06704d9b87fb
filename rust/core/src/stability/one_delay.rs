//! Do all roots of a(s) + b(s) e^(−s T) lie left of a line?
//!
//! With s moved to the line as axis, p(s) = a(s + σ) and q(s) = b(s + σ) e^(−σ T), and with any delay
//! τ in p + q e^(−s τ), roots are on the axis only where |p(jω)|² = |q(jω)|², for every τ with
//! ω τ = arg(−q/p) + 2πn; they go right as τ grows where |p|² − |q|² rises with ω, left where it falls
//! (Cooke and van den Driessche 1986; Walton and Marshall 1987). Without a delay the roots right of the
//! axis are counted by Routh's scheme, and each pair that comes or goes until τ = T changes the count
//! by two. Nothing here bounds rounding, which decides for roots within about 1e-8 of the line.

use std::f64::consts::TAU;

use num_complex::Complex64;

use crate::elementary::angle;

/// Coefficients of polynomials, ascending.
const SIZE: usize = 10;

/// Largest degree.
const MOST_DEGREE: usize = SIZE - 1;

type Terms = [f64; SIZE];

/// Steps of Newton's method, or halvings, until a zero is found.
const MOST_STEPS: u32 = 200;

/// Share of the leading coefficient from which on the delayed one moves chains to the line.
const CHAINS: f64 = 1.0 - 1e-9;

/// Are all roots left of Re s = `line`? None where rounding may decide, or the degree is too high.
///
/// a and b are given by ascending coefficients, a of the higher degree or with the larger leading
/// coefficient.
pub(super) fn are_left_of(a: &[f64], b: &[f64], delay: f64, line: f64) -> Option<bool> {
    let degree = a.len().checked_sub(1)?;
    if degree > MOST_DEGREE || b.len() > a.len() {
        return None;
    }
    let (p, q) = (moved(a, line), moved(b, line));
    let decay = (-line * delay).exp();
    let q = q.map(|c| c * decay);
    if q[degree].abs() > CHAINS * p[degree].abs() {
        return None;
    }
    let mut difference = squares(&p, degree);
    for (c, other) in difference.iter_mut().zip(squares(&q, degree)) {
        *c -= other;
    }
    let mut sum = p;
    for (c, other) in sum.iter_mut().zip(&q) {
        *c += other;
    }
    let mut right = right_of_axis(&sum, degree)?;
    let (zeros, count) = positive_zeros(&difference, degree)?;
    for &x in zeros.get(..count)? {
        let omega = x.sqrt();
        let ratio = -at(&q, omega) * at(&p, omega).conj();
        let mut first = angle(ratio.im, ratio.re);
        if first < 0.0 {
            first += TAU;
        }
        let turns = ((omega * delay - first) / TAU).floor() + 1.0;
        let (_, slope) = value_and_slope(&difference, degree, x);
        right += 2.0 * slope.signum() * turns.max(0.0);
    }
    (right >= 0.0).then_some(right == 0.0)
}

/// c(s + `by`).
fn moved(c: &[f64], by: f64) -> Terms {
    let mut out = [0.0; SIZE];
    for (place, c) in out.iter_mut().zip(c) {
        *place = *c;
    }
    // Repeated synthetic division by s − `by`.
    for first in 0..c.len() {
        for j in (first..c.len().saturating_sub(1)).rev() {
            out[j] += by * out[j + 1];
        }
    }
    out
}

/// |c(jω)|² as a polynomial in ω².
fn squares(c: &Terms, degree: usize) -> Terms {
    let mut out = [0.0; SIZE];
    for i in 0..=degree {
        for j in (i % 2..=degree).step_by(2) {
            let product = c[i] * c[j];
            out[usize::midpoint(i, j)] += if i.abs_diff(j) % 4 == 0 {
                product
            } else {
                -product
            };
        }
    }
    out
}

/// c(jω).
fn at(c: &Terms, omega: f64) -> Complex64 {
    let s = Complex64::new(0.0, omega);
    c.iter()
        .rev()
        .fold(Complex64::default(), |sum, c| sum * s + c)
}

/// c(x) and c′(x).
fn value_and_slope(c: &Terms, degree: usize, x: f64) -> (f64, f64) {
    c.iter()
        .take(degree + 1)
        .rev()
        .fold((0.0, 0.0), |(value, slope), c| {
            (value * x + c, slope * x + value)
        })
}

/// The number of zeros with a positive real part, by Routh's scheme; none where a pivot vanishes.
fn right_of_axis(c: &Terms, degree: usize) -> Option<f64> {
    let mut rows = [[0.0; SIZE]; 2];
    for j in 0..=degree {
        rows[j % 2][j / 2] = c[degree - j];
    }
    let [mut upper, mut lower] = rows;
    let mut changes = 0.0;
    for _ in 0..degree {
        let ratio = upper[0] / lower[0];
        if !(ratio.is_finite() && ratio != 0.0) {
            return None;
        }
        changes += f64::from(u8::from(ratio < 0.0));
        let mut next = [0.0; SIZE];
        for j in 1..SIZE {
            next[j - 1] = upper[j] - ratio * lower[j];
        }
        (upper, lower) = (lower, next);
    }
    Some(changes)
}

/// The zeros x > 0 at which c changes its sign, and how many they are.
///
/// Between two neighbouring zeros of a derivative the one before is monotone, from the last derivative
/// to c itself; all zeros are within the bound of Fujiwara (1916), those of derivatives too (Lucas).
fn positive_zeros(c: &Terms, degree: usize) -> Option<(Terms, usize)> {
    let lead = c[degree];
    let powers = (1..=degree).map(|k| (c[degree - k] / lead).abs().powf(1.0 / k as f64));
    let bound = 2.0 * powers.fold(0.0, f64::max);
    if !bound.is_finite() {
        return None;
    }
    let (mut splits, mut many) = ([0.0; SIZE], 0);
    for order in (0..degree).rev() {
        let mut derivative = [0.0; SIZE];
        for (j, place) in derivative.iter_mut().take(degree + 1 - order).enumerate() {
            *place = (1..=order).fold(c[j + order], |c, k| c * (j + k) as f64);
        }
        let (mut zeros, mut found) = ([0.0; SIZE], 0);
        let mut low = 0.0;
        for high in splits.into_iter().take(many).chain([bound]) {
            if let Some(zero) = zero_between(&derivative, degree - order, (low, high)) {
                *zeros.get_mut(found)? = zero;
                found += 1;
            }
            low = high;
        }
        (splits, many) = (zeros, found);
    }
    Some((splits, many))
}

/// The zero of c between two points of different signs, where c is monotone.
fn zero_between(c: &Terms, degree: usize, (mut low, mut high): (f64, f64)) -> Option<f64> {
    let is_above = value_and_slope(c, degree, high).0 > 0.0;
    if (value_and_slope(c, degree, low).0 > 0.0) == is_above {
        return None;
    }
    let mut x = f64::midpoint(low, high);
    for _ in 0..MOST_STEPS {
        let (value, slope) = value_and_slope(c, degree, x);
        if (value > 0.0) == is_above {
            high = x;
        } else {
            low = x;
        }
        let mut next = x - value / slope;
        if !(low < next && next < high) {
            next = f64::midpoint(low, high);
        }
        if (next - x).abs() <= 2.0 * f64::EPSILON * x {
            return Some(next);
        }
        x = next;
    }
    Some(x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Task;
    use crate::quasipoly::QuasiPolynomial;
    use crate::roots::spectral_abscissa;
    use proptest::prelude::*;

    fn abscissa(a: &[f64], b: &[f64], delay: f64) -> Option<f64> {
        let function = QuasiPolynomial::new(vec![a.to_vec(), b.to_vec()], vec![0.0, delay]).ok()?;
        spectral_abscissa(&function, true, &Task::new()).ok()
    }

    #[test]
    fn the_integrator_is_stable_up_to_a_quarter_turn() {
        let limit = 0.5 * std::f64::consts::PI;
        let stable = |gain: f64| are_left_of(&[0.0, 1.0], &[gain, 0.0], 1.0, 0.0);
        assert_eq!(stable(limit * (1.0 - 1e-9)), Some(true));
        assert_eq!(stable(limit * (1.0 + 1e-9)), Some(false));
        assert_eq!(stable(-0.1), Some(false));
        // Five turns later, two roots more have come each time.
        assert_eq!(stable(limit + 5.0 * TAU + 0.1), Some(false));
    }

    #[test]
    fn what_rounding_decides_is_left_open() {
        assert_eq!(are_left_of(&[0.0, 1.0], &[0.0, 0.0], 1.0, 0.0), None); // a root on the line
        assert_eq!(are_left_of(&[1.0, 1.0], &[1.0, 1.0], 1.0, 0.0), None); // chains on it
        assert_eq!(are_left_of(&[0.0, 1.0], &[1.0, 0.0], 1.0, -1e4), None); // overflow
        assert_eq!(are_left_of(&[1.0; 12], &[1.0], 1.0, 0.0), None);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]

        /// Right and left of the rightmost root, which another method finds.
        #[test]
        fn lines_are_on_the_side_of_the_rightmost_root(
            a in prop::collection::vec(-2.0_f64..4.0, 1..5),
            b in prop::collection::vec(-3.0_f64..3.0, 5),
            direct in prop_oneof![Just(0.0), -0.9_f64..0.9],
            delay in prop_oneof![Just(0.0), 0.05_f64..3.0],
            share in -2.0_f64..2.0,
        ) {
            let (a, mut b) = ([&a[..], &[1.0]].concat(), b[..=a.len()].to_vec());
            let degree = b.len() - 1;
            b[degree] = direct;
            let Some(rightmost) = abscissa(&a, &b, delay) else {
                return Ok(());
            };
            let line = rightmost + share * (0.1 + rightmost.abs());
            prop_assume!(share.abs() > 1e-6);
            if let Some(found) = are_left_of(&a, &b, delay, line) {
                prop_assert_eq!(found, rightmost < line);
            } else {
                // Only chains right of the line, or next to it, are left open.
                let chains = (direct != 0.0).then(|| direct.abs().ln() / delay);
                prop_assert!(chains.is_some_and(|chains| chains > line - 1e-6));
            }
        }
    }
}
