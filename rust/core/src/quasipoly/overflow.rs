//! Values at points where powers of s overflow, or are cancelled by an exponential that underflows.
//!
//! With s = 2ᵉ m, |m| near 1, a row is p(s) = 2^(en) q(m), the coefficients of q being those of p
//! times 2^(−e(n−k)): numbers that underflow there are negligible. The terms are added relative to
//! the largest one, by their logarithms en log 2 + log |q| − x τ and their directions. The
//! logarithm of a large value has a large absolute error, so that the relative error of the value
//! is about 1e-13.

use num_complex::Complex64;

use super::jet::modulus;
use super::quasi_polynomial::QuasiPolynomial;

/// h(s) for finite s; infinite where it exceeds the range of double precision.
pub(super) fn value(h: &QuasiPolynomial, s: Complex64) -> Complex64 {
    let exponent = libm::ilogb(s.re.abs().max(s.im.abs()).max(f64::MIN_POSITIVE));
    // In two steps: 2^1023 and its inverse are not both normal numbers.
    let half = exponent / 2;
    let shrunk = |part: f64| libm::ldexp(libm::ldexp(part, -half), half - exponent);
    let m = Complex64::new(shrunk(s.re), shrunk(s.im));
    let terms: Vec<(f64, Complex64)> = h
        .terms()
        .filter_map(|(row, delay)| {
            let degree = row.len().saturating_sub(1);
            let scaled = row.iter().enumerate().map(|(k, c)| {
                let shift = i64::from(exponent) * (degree - k) as i64;
                libm::ldexp(*c, -(shift.clamp(-5000, 5000) as i32))
            });
            let q = scaled.rev().fold(Complex64::ZERO, |sum, c| sum * m + c);
            let size = modulus(q);
            let growth = f64::from(exponent) * degree as f64 * std::f64::consts::LN_2;
            let (sine, cosine) = libm::sincos(delay * s.im);
            let direction = q / size * Complex64::new(cosine, -sine);
            (size > 0.0).then_some((growth + libm::log(size) - s.re * delay, direction))
        })
        .collect();
    let largest = terms
        .iter()
        .fold(f64::NEG_INFINITY, |most, (log, _)| most.max(*log));
    if largest == f64::NEG_INFINITY {
        return Complex64::ZERO;
    }
    let sum: Complex64 = terms
        .iter()
        .map(|(log, direction)| direction * libm::exp(log - largest))
        .sum();
    // In two factors, because the sum may be small where its largest term overflows.
    let half = libm::exp(0.5 * largest);
    let grow = |part: f64| {
        if part == 0.0 {
            part
        } else {
            part * half * half
        }
    };
    Complex64::new(grow(sum.re), grow(sum.im))
}
