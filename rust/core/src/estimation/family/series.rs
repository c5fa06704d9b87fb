//! What the command still explains beside a class of plants: the plant times 1 + Σ c_j L_j(s).
//!
//! ```text
//! L_j(s) = a/(s + a) ((s − a)/(s + a))^j,   j = 0 … 5      (Laguerre functions, L_0(0) = 1)
//! ```
//! with c ~ N(0, s²), and s of the largest marginal likelihood (Goodwin, Gevers & Ninness 1992). Where the
//! class holds, s is zero and nothing changes. The functions act on the rows of the response, with
//! Tustin's transform, so that their gain and phase are known exactly: s = (2/h) tan(ω h/2).

use super::minima::Minimum;
use super::model::{Model, Point};
use super::projection::Projection;
use super::tolerances::SERIES;
use crate::elementary::{angle, log};
use crate::linear_algebra::eigenvalues::eigenvalues;
use crate::linear_algebra::lu::Lu;
use crate::linear_algebra::vectors::dot;

/// Terms of the series: more see finer errors of a plant, and take rows for them.
pub(super) const TERMS: usize = 6;

/// A series around a plant.
#[derive(Debug, Clone, Copy)]
pub(super) struct Series {
    /// a, 1/s.
    pole: f64,
    /// The distance of rows, s.
    row: f64,
    pub(super) factors: [f64; TERMS],
}

impl Series {
    /// Without an error, for a plant this late.
    pub(super) fn beside(late: f64, row: f64) -> Self {
        Self {
            pole: SERIES.pole / late.max(row),
            row,
            factors: [0.0; TERMS],
        }
    }

    /// 1 + Σ c L(jω) as real and imaginary part.
    fn at(&self, omega: f64) -> (f64, f64) {
        let half = (0.5 * omega * self.row).min(SERIES.highest);
        let x = 2.0 / self.row * half.tan() / self.pole;
        // L_0 = 1/(1 + jx), and (jx − 1)/(jx + 1) to go on.
        let square = 1.0 + x * x;
        let (mut re, mut im) = (1.0 / square, -x / square);
        let (pass_re, pass_im) = ((x * x - 1.0) / square, 2.0 * x / square);
        let (mut sum_re, mut sum_im) = (1.0, 0.0);
        for factor in self.factors {
            sum_re += factor * re;
            sum_im += factor * im;
            (re, im) = (re * pass_re - im * pass_im, re * pass_im + im * pass_re);
        }
        (sum_re, sum_im)
    }

    /// ln of its gain.
    pub(super) fn log_gain(&self, omega: f64) -> f64 {
        let (re, im) = self.at(omega);
        0.5 * log(re * re + im * im)
    }

    /// Its phase, rad.
    pub(super) fn phase(&self, omega: f64) -> f64 {
        let (re, im) = self.at(omega);
        angle(im, re)
    }

    /// L_j of a column whose rows are these distances apart; it was constant before.
    fn columns(&self, values: &[f64], gaps: &[usize]) -> Vec<Vec<f64>> {
        let ratio = 0.5 * self.pole * self.row;
        let (own, keep) = (ratio / (1.0 + ratio), (1.0 - ratio) / (1.0 + ratio));
        let first = values.first().copied().unwrap_or(0.0);
        let mut out: Vec<Vec<f64>> = vec![Vec::new(); TERMS];
        // Of each stage the last input and output; a constant passes the first with gain 1 and the others
        // with −1.
        let mut states = [(0.0, 0.0); TERMS];
        let mut before = 0.0;
        for (value, gap) in values.iter().zip(gaps) {
            let target = value - first;
            for step in 1..=*gap {
                let input = before + (target - before) * step as f64 / *gap as f64;
                let (last, output) = states[0];
                let mut next = keep * output + own * (input + last);
                states[0] = (input, next);
                for (last, output) in states.iter_mut().skip(1) {
                    // (s − a)/(s + a) = 1 − 2 a/(s + a).
                    let slow = keep * (*last - *output) + 2.0 * own * (next + *last);
                    let passed = next - slow;
                    (*last, *output) = (next, passed);
                    next = passed;
                }
            }
            before = target;
            for (at, (column, state)) in out.iter_mut().zip(&states).enumerate() {
                let sign = if at % 2 == 0 { 1.0 } else { -1.0 };
                column.push(state.1 + sign * first);
            }
        }
        out
    }
}

/// A series that the record shows.
pub(super) struct Shown {
    pub(super) series: Series,
    /// Whitened columns of its terms, beside the linear numbers.
    pub(super) columns: Vec<Vec<f64>>,
    /// The deviation of their factors.
    pub(super) deviation: f64,
    /// What is left of the whitened residuals.
    pub(super) left: Vec<f64>,
    /// The fall of −2 ln of the marginal likelihood.
    fall: f64,
}

/// BIC of a minimum whose class may be in error.
pub(super) fn flexible_bic(found: &Minimum<'_>) -> f64 {
    let (model, point) = (&found.model, &found.point);
    let rows = model.rows.count();
    let free = rows.saturating_sub(model.parameters()).max(1) as f64;
    let late = model.numbers(&point.x).low_delay();
    let series = Series::beside(late, model.rows.row);
    let sensitivities = model.sensitivities(point);
    let shown = shown(model, point, &sensitivities, series, point.squares / free);
    let fall = shown.map_or(0.0, |shown| shown.fall);
    found.bic - (fall - log(rows as f64)).max(0.0)
}

/// The series that the record shows beside a point, if it shows one.
pub(super) fn shown(
    model: &Model<'_>,
    point: &Point,
    sensitivities: &[Vec<f64>],
    series: Series,
    variance: f64,
) -> Option<Shown> {
    let response = model.commanded(point);
    let mut raw: Vec<Vec<f64>> = vec![Vec::new(); TERMS];
    for (part, place) in model.rows.parts.iter().zip(model.rows.places()) {
        let own = series.columns(&response[place], &part.gaps);
        for (column, own) in raw.iter_mut().zip(own) {
            column.extend(own);
        }
    }
    let columns = model.beside_linear(point, raw);
    let plant = Projection::new(sensitivities.to_vec());
    let mut own = columns.clone();
    own.iter_mut().for_each(|column| {
        plant.taken(column);
    });
    let mut left = point.whitened.clone();
    plant.taken(&mut left);
    let mut products = Vec::with_capacity(TERMS * TERMS);
    for one in &own {
        products.extend(own.iter().map(|other| dot(one, other) / variance));
    }
    let scores: Vec<f64> = own.iter().map(|one| dot(one, &left) / variance).collect();
    let values: Vec<f64> = eigenvalues(&products, TERMS)?
        .iter()
        .map(|value| value.re.max(0.0))
        .collect();
    let mut best = (0.0, 0.0, vec![0.0; TERMS]);
    for step in 0..SERIES.sizes {
        let share = step as f64 / (SERIES.sizes - 1) as f64;
        let size = SERIES.least * (SERIES.most / SERIES.least).powf(share);
        let square = size * size;
        let mut matrix: Vec<f64> = products.iter().map(|entry| square * entry).collect();
        (0..TERMS).for_each(|at| matrix[at * (TERMS + 1)] += 1.0);
        let mut solved = scores.clone();
        Lu::regular(matrix, TERMS)?.solve(&mut solved);
        let determinant: f64 = values.iter().map(|value| log(1.0 + square * value)).sum();
        let fall = square * dot(&scores, &solved) - determinant;
        if fall > best.0 {
            let factors = solved.iter().map(|one| square * one).collect();
            best = (fall, size, factors);
        }
    }
    let (fall, deviation, factors) = best;
    if fall <= SERIES.fall {
        return None;
    }
    for (column, factor) in own.iter().zip(&factors) {
        for (left, entry) in left.iter_mut().zip(column) {
            *left -= factor * entry;
        }
    }
    Some(Shown {
        series,
        columns,
        deviation,
        left,
        fall,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::elementary::sin_cos;

    #[test]
    fn the_functions_of_rows_have_their_gain_and_phase() {
        let series = Series::beside(1.0, 0.1);
        let omega = 2.0;
        let count = 4000;
        let wave = |at: usize| sin_cos(omega * 0.1 * at as f64).0;
        let values: Vec<f64> = (0..count).map(wave).collect();
        for (at, column) in series.columns(&values, &vec![1; count]).iter().enumerate() {
            let mut one = series;
            one.factors[at] = 1.0;
            let (re, im) = one.at(omega);
            let (re, im) = (re - 1.0, im);
            for (row, value) in column.iter().enumerate().skip(count - 50) {
                let (sine, cosine) = sin_cos(omega * 0.1 * row as f64);
                assert!((value - (re * sine + im * cosine)).abs() < 1e-9, "{at}");
            }
        }
        // What rests stays where it is.
        let still = series.columns(&[2.0; 20], &[1; 20]);
        assert!(still[0].iter().all(|y| (y - 2.0).abs() < 1e-12));
        assert!(still[1].iter().all(|y| (y + 2.0).abs() < 1e-12));
    }
}
