//! What the command still explains beside a class of plants: the plant times 1 + Σ c_j L_j(s).
//!
//! ```text
//! L_j(s) = a/(s + a) ((s − a)/(s + a))^j,   j = 0 … 5      (Laguerre functions, L_0(0) = 1)
//! ```
//! with c ~ N(0, s²), and s of the largest marginal likelihood (Goodwin, Gevers & Ninness 1992). Where the
//! class holds, s is zero and nothing changes. The functions act on the rows of the response, with
//! Tustin's transform, so that their gain and phase are known exactly: s = (2/h) tan(ω h/2).

use super::rows::Rows;
use super::tolerances::SERIES;
use crate::elementary::{angle, log};
use crate::linear_algebra::vectors::add_multiple;

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
    /// Without an error, for a plant this late: its pole is so many times one over that.
    pub(super) fn beside(late: f64, row: f64, pole: f64) -> Self {
        Self {
            pole: pole / late.max(row),
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

    /// 1 + Σ c L(0).
    pub(super) fn at_rest(&self) -> f64 {
        let terms = self.factors.iter().enumerate();
        let signed = terms.map(|(at, c)| if at % 2 == 0 { *c } else { -c });
        1.0 + signed.sum::<f64>()
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

    /// L_j of a column of the rows of all records.
    pub(super) fn terms(&self, rows: &Rows, column: &[f64]) -> Vec<Vec<f64>> {
        let mut out: Vec<Vec<f64>> = (0..TERMS)
            .map(|_| Vec::with_capacity(column.len()))
            .collect();
        for (part, place) in rows.parts.iter().zip(rows.places()) {
            let own = self.columns(&column[place], &part.gaps);
            for (out, own) in out.iter_mut().zip(own) {
                out.extend(own);
            }
        }
        out
    }

    /// A column of the rows of all records behind 1 + Σ c L.
    pub(super) fn passed(&self, rows: &Rows, column: &[f64]) -> Vec<f64> {
        let mut out = column.to_vec();
        for (factor, term) in self.factors.iter().zip(self.terms(rows, column)) {
            add_multiple(&mut out, *factor, &term);
        }
        out
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::elementary::sin_cos;

    #[test]
    fn the_functions_of_rows_have_their_gain_and_phase() {
        let series = Series::beside(1.0, 0.1, 2.0);
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
