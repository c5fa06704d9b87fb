//! Delays that are whole multiples of one base, and the difference part whose period that base
//! gives.

use crate::Error;
use crate::quasipoly::QuasiPolynomial;

/// Largest denominator of the ratios of delays that are tried. A larger one finds more bases and
/// makes the period of the difference part, which is sampled, longer.
const MAX_DENOMINATOR: u32 = 64;

/// The largest number of which all differences of delays are whole multiples, up to rounding.
/// `None` where there is no such number, or fewer than two delays.
///
///
/// ```
/// use deadtime::{quasipoly::QuasiPolynomial, roots::base_delay};
/// let h = |delays: [f64; 3]| QuasiPolynomial::new(vec![vec![1.0]; 3], delays.to_vec());
/// assert_eq!(base_delay(&h([0.0, 1.0, 1.5])?), Some(0.5));
/// assert_eq!(base_delay(&h([0.0, 1.0, 2f64.sqrt()])?), None);
/// # Ok::<(), deadtime::Error>(())
/// ```
pub fn base_delay(h: &QuasiPolynomial) -> Option<f64> {
    let first = h.delays().first().copied()?;
    let gaps: Vec<f64> = h
        .delays()
        .iter()
        .skip(1)
        .map(|delay| delay - first)
        .collect();
    let least = gaps.first().copied()?;
    // The differences carry the rounding errors of the delays themselves.
    let size = h.delays().last().copied().unwrap_or(0.0);
    (1..=MAX_DENOMINATOR)
        .map(|q| least / f64::from(q))
        .find(|base| {
            gaps.iter().all(|gap| {
                let multiple = gap / base;
                (multiple - multiple.round()).abs() <= 8.0 * f64::EPSILON * (size / base)
            })
        })
}

/// The terms with the highest power of s, after the smallest delay is factored out.
pub(crate) fn difference_part(h: &QuasiPolynomial) -> Result<QuasiPolynomial, Error> {
    let degree = h.degree();
    let leading = |row: &[f64]| row.get(degree).copied().filter(|c| *c != 0.0);
    let chain = h
        .terms()
        .filter_map(|(row, delay)| Some((vec![leading(row)?], delay)));
    let (rows, delays): (Vec<Vec<f64>>, Vec<f64>) = chain.unzip();
    let first = delays.first().copied().unwrap_or(0.0);
    QuasiPolynomial::new(rows, delays.iter().map(|delay| delay - first).collect())
}
