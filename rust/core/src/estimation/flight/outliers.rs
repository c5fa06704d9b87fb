//! Rows that are outliers.

use super::super::likelihood::Evaluation;
use super::fit::FlightRun;
use super::median::median;
use super::tolerances::OUTLIERS;

/// Rows of these residuals that are far from the median of their neighbours.
///
/// Rows within a step of the rounding are none.
pub(super) fn spikes(residuals: &[f64], rounding: f64) -> Vec<bool> {
    let (away, robust) = from_neighbours(residuals);
    let least = f64::max(OUTLIERS.spike * robust, rounding);
    let found: Vec<bool> = away.iter().map(|away| away.abs() > least).collect();
    if robust > 0.0 && !are_many(count(&found), found.len()) {
        found
    } else {
        vec![false; residuals.len()]
    }
}

/// Difference from the median of the rows around, and its robust deviation.
///
/// At the ends the window is as wide and on one side, because two of its rows may be outliers. A
/// slope of the residuals shows there, so that the deviation is that of the other rows.
fn from_neighbours(residuals: &[f64]) -> (Vec<f64>, f64) {
    let half = OUTLIERS.half_window;
    let wide = (2 * half + 1).min(residuals.len());
    let medians: Vec<f64> = residuals
        .windows(wide.max(1))
        .map(|window| median(window.to_vec()))
        .collect();
    let last = medians.len().saturating_sub(1);
    let middle = |row: usize| medians.get(row.saturating_sub(half).min(last));
    let away: Vec<f64> = residuals
        .iter()
        .enumerate()
        .map(|(row, one)| one - middle(row).copied().unwrap_or(0.0))
        .collect();
    let inner = away.get(half..half + medians.len()).unwrap_or(&[]);
    let moved: Vec<f64> = inner
        .iter()
        .map(|one| one.abs())
        .filter(|one| *one > 0.0)
        .collect();
    let robust = if moved.is_empty() {
        0.0
    } else {
        median(moved) / OUTLIERS.median
    };
    (away.clone(), robust.max(OUTLIERS.least * deviation(inner)))
}

/// Rows whose whitened residual is far from zero, in robust deviations.
///
/// Rows within a step of the rounding are none.
pub(super) fn outliers(part: &Evaluation, run: &FlightRun) -> Vec<bool> {
    let used = &run.rows.used;
    let sizes = part.whitened.iter().zip(used).filter(|(_, used)| **used);
    let robust = median(sizes.map(|(one, _)| one.abs()).collect()) / OUTLIERS.median;
    let most = OUTLIERS.spike * robust.max(OUTLIERS.least);
    let rows = part.whitened.iter().zip(&part.residuals).zip(used);
    let far: Vec<bool> = rows
        .map(|((whitened, residual), used)| {
            *used && whitened.abs() > most && residual.abs() > run.rounding
        })
        .collect();
    if are_many(used.len() - count(used) + count(&far), used.len()) {
        return vec![false; used.len()];
    }
    // The rows after an outlier are predicted from it: only the first of several is one.
    let after = std::iter::once(&false).chain(&far);
    far.iter()
        .zip(after)
        .map(|(own, before)| *own && !before)
        .collect()
}

/// The recording without these rows.
pub(super) fn without(run: &FlightRun, rows: &[bool]) -> FlightRun {
    let used = run.rows.used.iter().zip(rows);
    run.with_used(used.map(|(used, out)| *used && !out).collect())
}

fn count(rows: &[bool]) -> usize {
    rows.iter().filter(|is| **is).count()
}

fn are_many(found: usize, rows: usize) -> bool {
    found as f64 > OUTLIERS.most * rows as f64
}

fn deviation(values: &[f64]) -> f64 {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let squares: f64 = values.iter().map(|one| (one - mean).powi(2)).sum();
    (squares / count).sqrt()
}

#[cfg(test)]
mod tests {
    use super::super::super::tests::gaussian;
    use super::*;

    #[test]
    fn outliers_beside_each_other_are_found_and_no_others() {
        let residuals: Vec<f64> = gaussian(4, 120).iter().map(|one| 0.005 * one).collect();
        let cases: [&[usize]; 6] = [
            &[1, 2],
            &[0, 1],
            &[60, 61],
            &[117, 118],
            &[118, 119],
            &[0, 3, 119],
        ];
        for places in cases {
            let mut spoilt = residuals.clone();
            places.iter().for_each(|row| spoilt[*row] += 0.2);
            let found = spikes(&spoilt, 0.0);
            let found: Vec<usize> = (0..120).filter(|row| found[*row]).collect();
            assert_eq!(found, places);
            assert!(!spikes(&spoilt, 0.3).contains(&true));
        }
    }

    #[test]
    fn where_many_rows_are_far_away_none_is_an_outlier() {
        assert!(!spikes(&[0.0, 0.001, 5.0, -0.001], 0.0).contains(&true));
        assert!(!spikes(&[1.0; 40], 0.0).contains(&true));
    }
}
