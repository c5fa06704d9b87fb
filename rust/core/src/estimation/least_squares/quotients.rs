//! Derivatives of a misfit by difference quotients.

use super::tolerances::QUOTIENT;
use crate::Error;

/// One column for each number of a point, in steps of a share of it or of its unit; one-sided of second
/// order where a number may not be negative.
pub(crate) fn quotients(
    misfit: impl Fn(&[f64]) -> Result<Vec<f64>, Error>,
    point: &[f64],
    units: &[f64],
    not_negative: impl Fn(usize) -> bool,
) -> Result<Vec<Vec<f64>>, Error> {
    let mut columns = Vec::new();
    for (index, unit) in units.iter().enumerate() {
        let step = QUOTIENT.step * point[index].abs().max(*unit);
        let at = |by: f64| {
            let mut moved = point.to_vec();
            moved[index] += by * step;
            misfit(&moved)
        };
        let column = if not_negative(index) && point[index] < step {
            let (here, one, two) = (at(0.0)?, at(1.0)?, at(2.0)?);
            let triples = here.iter().zip(&one).zip(&two);
            triples
                .map(|((a, b), c)| (4.0 * b - 3.0 * a - c) / (2.0 * step))
                .collect()
        } else {
            let (upper, lower) = (at(1.0)?, at(-1.0)?);
            let pairs = upper.iter().zip(&lower);
            pairs.map(|(u, l)| (u - l) / (2.0 * step)).collect()
        };
        columns.push(column);
    }
    Ok(columns)
}
