//! The filter of a derivative, on samples, as a computer runs it.
//!
//! The filter x′ = F x + G v, d = C x, driven by the samples v_k of what it filters, becomes
//!
//! ```text
//! x_{k+1} = Fd x_k + Gd v_k,   d_k = Cd x_k + Dd v_k.
//! ```
//!
//! Zero-order hold: v held between samples, exact for it. Tustin: the trapezoidal rule, s for
//! (2/Ts)(z − 1)/(z + 1). Backward: Euler's implicit rule, s for (z − 1)/(Ts z). Åström and
//! Wittenmark, Computer-Controlled Systems (3rd ed. 1997), sections 2.3 and 8.2.

use crate::Error;
use crate::dde::propagator::Propagator;
use crate::linear_algebra::lu::Lu;

/// How a filter runs on samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rule {
    /// Zero-order hold.
    Hold,
    /// The trapezoidal rule.
    Tustin,
    /// Euler's implicit rule.
    Backward,
}

impl Rule {
    /// The rule of a name: `hold`, `tustin` or `backward`.
    pub fn named(name: &str) -> Option<Self> {
        match name {
            "hold" => Some(Self::Hold),
            "tustin" => Some(Self::Tustin),
            "backward" => Some(Self::Backward),
            _ => None,
        }
    }
}

/// Fd, Gd, Cd, Dd.
#[derive(Debug, Clone, PartialEq)]
pub struct SampledFilter {
    /// Fd, n × n.
    pub f: Vec<f64>,
    /// Gd, n.
    pub g: Vec<f64>,
    /// Cd, n.
    pub c: Vec<f64>,
    /// Dd.
    pub d: f64,
}

impl SampledFilter {
    /// The filter F, G, C for a sample time in s.
    ///
    /// # Errors
    /// [`Error::Argument`] where the rule has no result for this sample time.
    pub fn new(
        f: &[f64],
        g: &[f64],
        c: &[f64],
        sample_time: f64,
        rule: Rule,
    ) -> Result<Self, Error> {
        let n = g.len();
        refuse_if!(
            f.len() != n * n || c.len() != n,
            "a filter with {} entries of F and {} of C for {n} states",
            f.len(),
            c.len()
        );
        // s for (z − 1)/(Ts (w z + 1 − w)), w the weight of the later end of a sample.
        let later = match rule {
            Rule::Hold => {
                let held = Propagator::new(f, &[g], sample_time);
                return Ok(Self {
                    f: held.phi(),
                    g: held.gamma(0).to_vec(),
                    c: c.to_vec(),
                    d: 0.0,
                });
            }
            Rule::Tustin => 0.5,
            Rule::Backward => 1.0,
        };
        let unit = |i: usize| f64::from(u8::from(i / n == i % n));
        let with = |share: f64| -> Vec<f64> {
            let entries = f.iter().enumerate();
            entries
                .map(|(i, x)| unit(i) + share * sample_time * x)
                .collect()
        };
        let left = with(-later);
        let solved = |transposed: bool| {
            let place = |i: usize| if transposed { (i % n) * n + i / n } else { i };
            Lu::regular((0..n * n).map(|i| left[place(i)]).collect(), n).ok_or_else(|| {
                Error::argument(format!(
                    "sample_time={sample_time}: the filter has no discrete form by this rule"
                ))
            })
        };
        let factors = solved(false)?;
        let right = with(1.0 - later);
        let mut found = vec![0.0; n * n];
        let mut column = vec![0.0; n];
        for j in 0..n {
            (0..n).for_each(|i| column[i] = right[i * n + j]);
            factors.solve(&mut column);
            (0..n).for_each(|i| found[i * n + j] = column[i]);
        }
        let mut into: Vec<f64> = g.iter().map(|x| sample_time * x).collect();
        factors.solve(&mut into);
        let mut row = c.to_vec();
        solved(true)?.solve(&mut row);
        let through: f64 = c.iter().zip(&into).map(|(c, g)| c * g).sum();
        Ok(Self {
            f: found,
            g: into,
            c: row,
            d: later * through,
        })
    }
}
