//! Are residuals white? The portmanteau test of Ljung and Box (1978).

use super::tolerances::{LEVELS, WHITE};
use crate::estimation::statistics::chi_squared_beyond;
use crate::linear_algebra::vectors::dot;

/// What the test says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Whiteness {
    /// Q, chi-squared for white residuals with `lags` degrees of freedom, less the parameters that
    /// were fitted, summed over recordings.
    pub statistic: f64,
    /// Probability that white residuals have a statistic at least as large.
    pub p_value: f64,
    /// Number of autocorrelations in Q, of one recording.
    pub lags: usize,
    /// The autocorrelation at lag one.
    pub autocorrelation: f64,
}

impl Whiteness {
    /// Do the residuals pass for white?
    pub fn is_white(&self) -> bool {
        self.p_value > LEVELS.test
    }
}

/// Test the residuals of each recording after a fit of so many parameters; residuals of zero pass.
pub fn whiteness(pieces: &[&[f64]], parameters: usize) -> Whiteness {
    let (mut statistic, mut first, mut weight, mut excess) = (0.0, 0.0, 0.0, 0.0);
    let (mut longest, mut freedom) = (1, 0);
    for piece in pieces.iter().filter(|piece| !piece.is_empty()) {
        let n = piece.len() as f64;
        let mean = piece.iter().sum::<f64>() / n;
        let centred: Vec<f64> = piece.iter().map(|value| value - mean).collect();
        let power = dot(&centred, &centred);
        let lags = (piece.len() / WHITE.rows).clamp(1, WHITE.lags);
        longest = longest.max(lags);
        freedom += lags;
        excess += WHITE.excess * (lags * lags) as f64 / n;
        if power == 0.0 {
            continue;
        }
        let rho = |lag: usize| autocovariance(&centred, lag) / power;
        let terms = (1..=lags).map(|lag| rho(lag) * rho(lag) / (n - lag as f64));
        statistic += n * (n + 2.0) * terms.sum::<f64>();
        first += n * rho(1);
        weight += n;
    }
    // A multiple of chi-squared with that mean and variance.
    let freedom = freedom.saturating_sub(parameters).max(1) as f64;
    let wider = 1.0 + excess / freedom;
    Whiteness {
        statistic,
        p_value: chi_squared_beyond(statistic / wider, freedom / wider),
        lags: longest,
        autocorrelation: if weight > 0.0 { first / weight } else { 0.0 },
    }
}

/// Sum of products of values so many places apart.
pub(super) fn autocovariance(values: &[f64], lag: usize) -> f64 {
    let count = values.len().saturating_sub(lag);
    dot(&values[values.len() - count..], &values[..count])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimation::tests::gaussian;

    #[test]
    fn white_residuals_pass_as_often_as_the_level_says_and_coloured_ones_do_not() {
        let refused = (0..600)
            .filter(|seed| !whiteness(&[&gaussian(*seed, 120)], 0).is_white())
            .count();
        // Six are expected; more than 14 once in 500.
        assert!(refused <= 14, "{refused}");
        let mut coloured = gaussian(3, 200);
        for i in 1..coloured.len() {
            coloured[i] += 0.6 * coloured[i - 1];
        }
        let found = whiteness(&[&coloured], 2);
        assert!(found.p_value < 1e-6 && found.autocorrelation > 0.4);
        assert!(whiteness(&[&[0.0; 50]], 0).is_white());
    }

    #[test]
    fn recordings_are_tested_one_at_a_time() {
        let (one, other) = (gaussian(1, 90), gaussian(2, 40));
        let [alone, beside, both] =
            [vec![&one[..]], vec![&other], vec![&one, &other]].map(|pieces| whiteness(&pieces, 0));
        assert!((both.statistic - alone.statistic - beside.statistic).abs() < 1e-12);
        assert_eq!((alone.lags, beside.lags, both.lags), (20, 10, 20));
    }
}
