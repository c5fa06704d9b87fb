//! Tails and quantiles of the distributions that tests and intervals are held against.
//!
//! Tails are the incomplete gamma and beta functions by their series and continued fractions (Olver et
//! al., NIST Handbook of Mathematical Functions 2010, 8.7.1, 8.9.2 and 8.17.22), accurate to 1e-12 of
//! themselves, and to 1e-9 with a hundred thousand degrees of freedom. Only functions of
//! this crate and of `libm` are used, so that the bits are the same on every machine.

use std::f64::consts::{PI, SQRT_2};

use crate::elementary::{exp, log};

/// Most terms of a series or a fraction: one of a million degrees of freedom needs some thousands.
const TERMS: usize = 100_000;

/// Change of a sum by its last term, as a share of it.
const LAST: f64 = 1e-16;

/// Steps of Newton's method for a quantile, more than it needs from zero up to 1 − 10⁻⁹.
const STEPS: usize = 60;

/// Degrees of freedom beyond which four terms of the expansion of Student's quantile are exact.
const MANY: f64 = 1e4;

/// Largest lag-1 autocorrelation at which samples count as fewer independent ones.
const MOST_ALIKE: f64 = 0.99;

/// Number of independent samples that hold as much as so many of this lag-1 autocorrelation.
pub fn independent_samples(samples: f64, autocorrelation: f64) -> f64 {
    let rho = autocorrelation.clamp(0.0, MOST_ALIKE);
    samples * (1.0 - rho) / (1.0 + rho)
}

/// P(x > value) of a normal variable.
pub fn normal_beyond(value: f64) -> f64 {
    0.5 * libm::erfc(value / SQRT_2)
}

/// The value that a normal variable is below with this probability.
pub fn normal_quantile(probability: f64) -> f64 {
    let level = (2.0 * probability - 1.0).abs();
    let mut x: f64 = 0.0;
    for _ in 0..STEPS {
        let density = exp(-0.5 * x * x) * (2.0 / PI).sqrt();
        x += (level - libm::erf(x / SQRT_2)) / density;
    }
    x.copysign(probability - 0.5)
}

/// P(χ² > value) with this many degrees of freedom.
pub fn chi_squared_beyond(value: f64, freedom: f64) -> f64 {
    let (a, x) = (0.5 * freedom, 0.5 * value);
    if x <= 0.0 {
        return 1.0;
    }
    if x == f64::INFINITY {
        return 0.0;
    }
    let scale = exp(a * log(x) - x - libm::lgamma(a));
    if x < a + 1.0 {
        let (mut term, mut sum, mut n) = (1.0 / a, 1.0 / a, a);
        while term > LAST * sum {
            n += 1.0;
            term *= x / n;
            sum += term;
        }
        return (1.0 - scale * sum).max(0.0);
    }
    let terms = (1..TERMS).map(|i| {
        let i = i as f64;
        (-i * (i - a), x + 2.0 * i + 1.0 - a)
    });
    scale / fraction(x + 1.0 - a, terms)
}

/// P(F > value) with these degrees of freedom of numerator and denominator.
pub fn f_beyond(value: f64, numerator: f64, denominator: f64) -> f64 {
    if value <= 0.0 {
        return 1.0;
    }
    let sum = numerator.mul_add(value, denominator);
    let (x, y) = (denominator / sum, numerator * value / sum);
    incomplete_beta(0.5 * denominator, 0.5 * numerator, x, y)
}

/// The reach that a variable of Student's distribution stays within with probability `level`.
pub fn student_reach(level: f64, freedom: f64) -> f64 {
    // The expansion of Cornish and Fisher (Abramowitz & Stegun 1972, 26.7.5).
    let z = normal_quantile(0.5 + 0.5 * level);
    let z2 = z * z;
    let terms = [
        z * (z2 + 1.0) / 4.0,
        z * ((5.0 * z2 + 16.0) * z2 + 3.0) / 96.0,
        z * (((3.0 * z2 + 19.0) * z2 + 17.0) * z2 - 15.0) / 384.0,
        z * ((((79.0 * z2 + 776.0) * z2 + 1482.0) * z2 - 1920.0) * z2 - 945.0) / 92160.0,
    ];
    let mut reach = z + terms
        .iter()
        .rev()
        .fold(0.0, |sum, term| (sum + term) / freedom);
    if freedom > MANY {
        return reach;
    }
    let norm = libm::lgamma(0.5 * (freedom + 1.0)) - libm::lgamma(0.5 * freedom);
    let norm = exp(norm) / (freedom * PI).sqrt();
    for _ in 0..STEPS {
        let square = reach * reach;
        let sum = freedom + square;
        let beyond = incomplete_beta(0.5 * freedom, 0.5, freedom / sum, square / sum);
        let density = 2.0 * norm * exp(-0.5 * (freedom + 1.0) * libm::log1p(square / freedom));
        let step = (beyond - (1.0 - level)) / density;
        // Beyond the inflection the tail is convex: steps from below do not go past the root.
        reach = (reach + step).max(0.5 * reach);
        if step.abs() <= LAST * reach {
            break;
        }
    }
    reach
}

/// I_x(a, b), y = 1 − x.
fn incomplete_beta(a: f64, b: f64, x: f64, y: f64) -> f64 {
    if x <= 0.0 || y <= 0.0 {
        return if x <= 0.0 { 0.0 } else { 1.0 };
    }
    if x > (a + 1.0) / (a + b + 2.0) {
        return 1.0 - incomplete_beta(b, a, y, x);
    }
    let norm = libm::lgamma(a + b) - libm::lgamma(a) - libm::lgamma(b);
    let scale = exp(norm + a * log(x) + b * log(y)) / a;
    let terms = (1..TERMS).map(|i| {
        let m = (i / 2) as f64;
        let over = (a + i as f64 - 1.0) * (a + i as f64);
        let numerator = if i % 2 == 0 {
            m * (b - m) * x
        } else {
            -(a + m) * (a + b + m) * x
        };
        (numerator / over, 1.0)
    });
    scale / fraction(1.0, terms)
}

/// first + a₁/(b₁ + a₂/(b₂ + …)) of pairs (a, b), by the method of Lentz (1976).
fn fraction(first: f64, terms: impl Iterator<Item = (f64, f64)>) -> f64 {
    let nonzero = |x: f64| if x == 0.0 { f64::MIN_POSITIVE } else { x };
    let mut found = nonzero(first);
    let (mut c, mut d) = (found, 0.0);
    for (a, b) in terms {
        d = 1.0 / nonzero(a.mul_add(d, b));
        c = nonzero(b + a / c);
        let factor = c * d;
        found *= factor;
        if (factor - 1.0).abs() <= f64::EPSILON {
            break;
        }
    }
    found
}

#[cfg(test)]
mod tests;
