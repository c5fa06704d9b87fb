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
use crate::elementary::Enclosed;
use crate::linear_algebra::lu::Lu;
use crate::stability::enclosed_step;

use super::entry::Number;

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

/// What a filter on samples can be computed in.
pub trait Sampled: Number {
    /// Φ and Γ of x′ = F x + G v over a time.
    fn held(f: &[Self], g: &[Self], time: Self) -> (Vec<Self>, Vec<Self>);

    /// Replace right-hand sides by the solutions of a system; false where there are none.
    fn solve(matrix: Vec<Self>, columns: &mut [Vec<Self>]) -> bool;
}

impl Sampled for f64 {
    fn held(f: &[Self], g: &[Self], time: Self) -> (Vec<Self>, Vec<Self>) {
        let held = Propagator::new(f, &[g], time);
        (held.phi(), held.gamma(0).to_vec())
    }

    fn solve(matrix: Vec<Self>, columns: &mut [Vec<Self>]) -> bool {
        let size = columns.first().map_or(0, Vec::len);
        let factors = Lu::regular(matrix, size);
        let solved = factors.map(|factors| columns.iter_mut().for_each(|x| factors.solve(x)));
        solved.is_some()
    }
}

impl Sampled for Enclosed {
    fn held(f: &[Self], g: &[Self], time: Self) -> (Vec<Self>, Vec<Self>) {
        enclosed_step(f, g, time)
    }

    /// By elimination without exchanges: a pivot that may be zero gives an unbounded result.
    fn solve(mut matrix: Vec<Self>, columns: &mut [Vec<Self>]) -> bool {
        let n = columns.first().map_or(0, Vec::len);
        for pivot in 0..n {
            for row in (0..n).filter(|row| *row != pivot) {
                let factor = matrix[row * n + pivot] / matrix[pivot * n + pivot];
                for j in pivot..n {
                    let product = factor * matrix[pivot * n + j];
                    matrix[row * n + j] = matrix[row * n + j] - product;
                }
                for column in columns.iter_mut() {
                    column[row] = column[row] - factor * column[pivot];
                }
            }
        }
        for column in columns {
            for (i, x) in column.iter_mut().enumerate() {
                *x = *x / matrix[i * n + i];
            }
        }
        true
    }
}

/// Fd, Gd, Cd, Dd.
#[derive(Debug, Clone, PartialEq)]
pub struct SampledFilter<S = f64> {
    /// Fd, n × n.
    pub f: Vec<S>,
    /// Gd, n.
    pub g: Vec<S>,
    /// Cd, n.
    pub c: Vec<S>,
    /// Dd.
    pub d: S,
}

impl<S: Sampled> SampledFilter<S> {
    /// The filter F, G, C for a sample time in s.
    ///
    /// # Errors
    /// [`Error::Argument`] where the rule has no result for this sample time.
    pub fn new(f: &[S], g: &[S], c: &[S], sample_time: S, rule: Rule) -> Result<Self, Error> {
        let n = g.len();
        refuse_if!(
            f.len() != n * n || c.len() != n,
            "the filter has {} entries of F and {} of C, which do not fit {n} states",
            f.len(),
            c.len()
        );
        // s for (z − 1)/(Ts (w z + 1 − w)), w the weight of the later end of a sample.
        let later = match rule {
            Rule::Hold => {
                let (f, g) = S::held(f, g, sample_time);
                let (c, d) = (c.to_vec(), S::from(0.0));
                return Ok(Self { f, g, c, d });
            }
            Rule::Tustin => 0.5,
            Rule::Backward => 1.0,
        };
        let unit = |i: usize| S::from(f64::from(u8::from(i / n == i % n)));
        let with = |share: f64| -> Vec<S> {
            let step = S::from(share) * sample_time.clone();
            let entries = f.iter().enumerate();
            entries
                .map(|(i, x)| unit(i) + step.clone() * x.clone())
                .collect()
        };
        let (left, right) = (with(-later), with(1.0 - later));
        let transposed = (0..n * n).map(|i| left[(i % n) * n + i / n].clone());
        let mut row = [c.to_vec()];
        let mut columns: Vec<Vec<S>> = (0..n)
            .map(|j| (0..n).map(|i| right[i * n + j].clone()).collect())
            .collect();
        columns.push(g.iter().map(|x| sample_time.clone() * x.clone()).collect());
        let is_solved = S::solve(transposed.collect(), &mut row) && S::solve(left, &mut columns);
        refuse_if!(
            !is_solved,
            "for this sample_time, the filter has no discrete form by this rule"
        );
        let ([row], Some(into)) = (row, columns.pop()) else {
            refuse!("a filter without states");
        };
        let through = c.iter().zip(&into).map(|(c, g)| c.clone() * g.clone());
        Ok(Self {
            d: S::from(later) * through.fold(S::from(0.0), |sum, part| sum + part),
            f: (0..n * n).map(|i| columns[i % n][i / n].clone()).collect(),
            g: into,
            c: row,
        })
    }
}
