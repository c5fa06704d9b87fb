//! Whether the command explains what a fit leaves: a cheap look before other plants are fitted.
//!
//! What another linear plant adds to a fit is, to first order, a combination of the command behind lags
//! and delays. These columns are fitted to the residuals, both whitened by the noise of the fit. If all
//! of them together gain no more than chance and a lead, no single plant does. Residuals that are
//! coloured even so count as fewer independent rows.
//!
//! What a fit takes for air may be what its plant lacks. So the columns are also fitted to the
//! residuals as they are, and may not explain most of them. Of air that walks they explain a part.

use super::columns::Columns;
use super::likelihood::Noise;
use super::literature::HeldPath;
use super::plant::Plant;
use super::statistics::independent_samples;
use super::whiten::whiten;
use crate::linear_algebra::vectors::dot;
use crate::{Error, Task};

/// Lags of the columns, from so many rows to this share of the window, and how many. More: a plant
/// between them is seen better, and chance gains more.
const LAGS: (f64, f64, usize) = (2.0, 0.3, 4);

/// Share of the residuals from which they follow the command, and are no air. More: a plant that air
/// has replaced is not found; less: air alone asks for the family.
const FOLLOWS: f64 = 0.9;

/// What is left of a column, as a share of it, below which it depends on those before.
const DEPENDENT: f64 = 1e-12;

/// What a fit leaves of the rows of a recording.
#[derive(Debug, Clone, Copy)]
pub struct Left<'a> {
    /// Times of the rows, s.
    pub time: &'a [f64],
    /// What is left.
    pub residuals: &'a [f64],
    /// Time between two rows, s.
    pub row_time: f64,
    /// Delay and lag of the fit, s.
    pub delay: f64,
    /// s.
    pub lag: f64,
}

/// Does the command behind lags and delays explain what is left, beyond chance and this lead in BIC?
/// The noise is that of the fit; where there is none, residuals are taken as white.
///
/// # Errors
///
/// As for `whiten`.
pub fn follows_command(
    path: &HeldPath,
    left: Left<'_>,
    plant: &Plant,
    noise: Option<&Noise>,
    lead: f64,
    task: &Task,
) -> Result<bool, Error> {
    let columns = columns_of(path, left);
    let (own, count) = (6, columns.len());
    if left.time.len() <= 2 * (count - 1) {
        return Ok(true);
    }
    let beyond = lead + (count - own) as f64;
    let (gain, share) = gained(&columns, own);
    if gain > beyond && share > FOLLOWS {
        return Ok(true);
    }
    let disturbances = noise.map(Noise::disturbances).unwrap_or_default();
    if disturbances.is_empty() {
        return Ok(gain > beyond);
    }
    let white = whiten(left.time, columns.concat(), plant, &disturbances, task)?;
    let white: Vec<_> = white.chunks(left.time.len()).map(<[_]>::to_vec).collect();
    Ok(gained(&white, own).0 > beyond)
}

/// The first of so many neighbouring rows in which values change most.
pub fn most_moved(values: &[f64], count: usize) -> usize {
    let mut totals = vec![0.0];
    for pair in values.windows(2) {
        totals.push(totals[totals.len() - 1] + (pair[1] - pair[0]).abs());
    }
    let within = count.saturating_sub(1);
    let sums = totals
        .iter()
        .skip(within)
        .zip(&totals)
        .map(|(last, first)| last - first);
    let mut best = (0, f64::NEG_INFINITY);
    for (row, sum) in sums.enumerate() {
        if sum > best.1 {
            best = (row, sum);
        }
    }
    best.0
}

/// The residuals, what their own plant may explain of them, and what others may.
fn columns_of(path: &HeldPath, left: Left<'_>) -> Vec<Vec<f64>> {
    let time = left.time;
    let at = |late: f64, lag: f64| {
        let times: Vec<f64> = time.iter().map(|t| t - late).collect();
        path.at(&times, lag)
    };
    let first = time.first().copied().unwrap_or(0.0);
    let span = time.iter().fold(0.0_f64, |span, t| span.max(t - first));
    let own = at(left.delay, left.lag);
    let mut columns = vec![
        left.residuals.to_vec(),
        vec![1.0; time.len()],
        time.iter().map(|t| t - first).collect(),
        own.value,
        own.rate,
        own.by_lag,
        at(0.0, 0.0).value,
    ];
    let (shortest, longest) = (LAGS.0 * left.row_time, LAGS.1 * span);
    for i in 0..LAGS.2 {
        let share = i as f64 / (LAGS.2 - 1) as f64;
        let lag = shortest * libm::pow(longest / shortest, share);
        columns.extend([0.0, left.delay].map(|late| at(late, lag).rate));
    }
    columns
}

/// What all columns gain in 2 ln L beyond the first `few`, for the first one; the share they explain.
fn gained(columns: &[Vec<f64>], few: usize) -> (f64, f64) {
    let (least, _) = power_left(&columns[..few]);
    let (less, colour) = power_left(columns);
    let rows = independent_samples(columns[0].len() as f64, colour);
    (rows * libm::log(least / less), 1.0 - less / least)
}

/// Sum of squares that the others leave of the first column, and its lag-1 autocorrelation.
fn power_left(columns: &[Vec<f64>]) -> (f64, f64) {
    let mut fitted = Columns::new(&columns[0], DEPENDENT);
    for column in &columns[1..] {
        fitted.take(column.clone());
    }
    let (left, total) = (fitted.left(), fitted.power());
    let colour = if total > 0.0 {
        dot(&left[1..], &left[..left.len() - 1]) / total
    } else {
        0.0
    };
    (total.max(f64::MIN_POSITIVE), colour)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Residuals that are the command behind another lag, and those that have nothing of it.
    fn seen(residual: impl Fn(usize, f64) -> f64) -> bool {
        let time: Vec<f64> = (0..400).map(|i| i as f64 * 0.05).collect();
        let command = time.iter().map(|t| (1.7 * t).sin().signum()).collect();
        let path = HeldPath::new(time.clone(), command);
        let rate = path.at(&time, 0.4).rate;
        let residuals: Vec<f64> = (0..400).map(|i| residual(i, rate[i])).collect();
        let left = Left {
            time: &time,
            residuals: &residuals,
            row_time: 0.05,
            delay: 0.1,
            lag: 0.0,
        };
        let plant = Plant::new(&[1.0], &[1.0, 0.0]).unwrap();
        follows_command(&path, left, &plant, None, 10.0, &Task::new()).unwrap()
    }

    #[test]
    fn the_rows_that_move_most_are_found() {
        assert_eq!(most_moved(&[0.0, 0.0, 1.0, 0.0, 0.0, 0.5], 3), 1);
        assert_eq!(most_moved(&[1.0], 3), 0);
    }

    #[test]
    fn residuals_that_follow_the_command_are_seen() {
        let noise = |i: usize| ((i * 7919) % 1009) as f64 / 1009.0 - 0.5;
        assert!(seen(|i, rate| 0.2 * rate + 0.1 * noise(i)));
        assert!(!seen(|i, _| noise(i)));
    }
}
