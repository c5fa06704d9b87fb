//! Quantiles and tests.

/// Excess of the variance of Ljung and Box's statistic over that of chi-squared, in lags over rows.
const EXCESS: f64 = 1.6;

/// Normal quantile of 0.975.
const NORMAL: f64 = 1.959_963_984_540_054;

/// Quantile 0.975 of Student's distribution with `freedom` of at least four, to 2e-4 there and better
/// beyond (Abramowitz & Stegun 26.7.5).
pub(crate) fn student_quantile(freedom: f64) -> f64 {
    let z = NORMAL;
    let (z3, z5, z7, z9) = (z.powi(3), z.powi(5), z.powi(7), z.powi(9));
    let terms = [
        (z3 + z) / 4.0,
        (5.0 * z5 + 16.0 * z3 + 3.0 * z) / 96.0,
        (3.0 * z7 + 19.0 * z5 + 17.0 * z3 - 15.0 * z) / 384.0,
        (79.0 * z9 + 776.0 * z7 + 1482.0 * z5 - 1920.0 * z3 - 945.0 * z) / 92160.0,
    ];
    let series = terms
        .iter()
        .rev()
        .fold(0.0, |sum, term| (sum + term) / freedom);
    z + series
}

/// The probability that chi-squared with `freedom` exceeds `value`, by the series of the incomplete
/// gamma function or its continued fraction.
pub(crate) fn chi_squared_beyond(value: f64, freedom: f64) -> f64 {
    let (a, x) = (0.5 * freedom, 0.5 * value);
    if x <= 0.0 {
        return 1.0;
    }
    let scale = (a * x.ln() - x - libm::lgamma(a)).exp();
    if x < a + 1.0 {
        let (mut term, mut sum, mut n) = (1.0 / a, 1.0 / a, a);
        while term > 1e-17 * sum {
            n += 1.0;
            term *= x / n;
            sum += term;
        }
        return (1.0 - scale * sum).max(0.0);
    }
    // Lentz's method, with the even part of the fraction.
    let mut b = x + 1.0 - a;
    let mut c = 1e300;
    let mut d = 1.0 / b;
    let mut h = d;
    for i in 1..500 {
        let i = f64::from(i);
        let an = -i * (i - a);
        b += 2.0;
        d = 1.0 / (an * d + b);
        c = b + an / c;
        let factor = c * d;
        h *= factor;
        if (factor - 1.0).abs() < 1e-15 {
            break;
        }
    }
    scale * h
}

/// The probability of such autocorrelations of white residuals (Ljung & Box 1978), over up to 20 lags.
pub(crate) fn whiteness(residuals: &[f64]) -> f64 {
    let n = residuals.len();
    let count = n as f64;
    let mean = residuals.iter().sum::<f64>() / count;
    let centred: Vec<f64> = residuals.iter().map(|one| one - mean).collect();
    let power: f64 = centred.iter().map(|one| one * one).sum();
    let lags = (n / 4).clamp(1, 20);
    if power == 0.0 {
        return 1.0;
    }
    let terms = (1..=lags).map(|lag| {
        let pairs = centred.iter().skip(lag).zip(&centred);
        let rho = pairs.map(|(one, other)| one * other).sum::<f64>() / power;
        rho * rho / (count - lag as f64)
    });
    let statistic = count * (count + 2.0) * terms.sum::<f64>();
    let freedom = lags as f64;
    let wider = 1.0 + EXCESS * freedom / count;
    chi_squared_beyond(statistic / wider, freedom / wider)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_tables() {
        for (freedom, known) in [
            (4.0, 2.776_445),
            (6.0, 2.446_912),
            (10.0, 2.228_139),
            (30.0, 2.042_272),
            (1e9, NORMAL),
        ] {
            assert!(
                (student_quantile(freedom) - known).abs() < 3e-3,
                "{freedom}"
            );
        }
    }

    #[test]
    fn chi_squared_is_that_of_tables_and_of_closed_forms() {
        // With two degrees of freedom it is an exponential.
        for value in [0.1, 1.0, 2.9, 3.1, 20.0, 200.0] {
            let known = f64::exp(-0.5 * value);
            assert!(
                (chi_squared_beyond(value, 2.0) / known - 1.0).abs() < 1e-12,
                "{value}"
            );
        }
        for (value, freedom, known) in [
            (3.841_458_820_694_124, 1.0, 0.05),
            (6.634_896_601_021_214, 1.0, 0.01),
            (31.410_432_844_230_93, 20.0, 0.05),
        ] {
            assert!(
                (chi_squared_beyond(value, freedom) - known).abs() < 1e-12,
                "{value}"
            );
        }
    }
}
