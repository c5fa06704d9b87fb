//! Losses of ARX models with every whole number of samples of delay.
//!
//! y_k + a₁ y_{k−1} + … = b₁ u_{k−n} + b₂ u_{k−n−1} + … + e_k is fitted by least squares for each n. Sums of
//! products at all delays come from one correlation, and normal equations, which lose half of the
//! digits, find the delays that are fitted again by least squares. Before the record, all is zero.

use super::super::columns::Columns;
use super::correlation::correlation;
use crate::linear_algebra::vectors::dot;
use crate::{Error, Task};

/// Fits of one scan.
struct Fits {
    /// Delays, those with the least losses, that are fitted again: more costs as much time.
    refined: usize,
    /// Pivot of the scaled normal equations below which a column depends on the others.
    pivot: f64,
    /// The same for what is left of a column, as a share of it.
    dependent: f64,
}

const FITS: Fits = Fits {
    refined: 100,
    pivot: 1e-13,
    dependent: 1e-10,
};

/// Loss at each number of samples; that of the best, and that without any command.
///
/// The last two models have a constant term too: the noise of the first sample shifts all others, and a
/// step of the command could otherwise explain that shift.
///
/// # Errors
/// Where the work has to end.
pub fn arx_losses(
    output: &[f64],
    command: &[f64],
    (na, nb): (usize, usize),
    (least, longest): (usize, usize),
    task: &Task,
) -> Result<(Vec<f64>, f64, f64), Error> {
    let size = output.len();
    let past: Vec<Vec<f64>> = (1..=na).map(|lag| delayed(output, lag, size)).collect();
    // The hold itself delays by one sample.
    let inputs = |late: usize| (0..nb).map(move |lag| delayed(command, late + 1 + lag, size));
    let order = na + nb;
    let lags = longest + nb + 1;
    let with_past: Vec<Vec<f64>> = past.iter().map(|x| correlation(x, command, lags)).collect();
    let with_output = correlation(output, command, lags);
    let with_itself: Vec<Vec<f64>> = (0..nb)
        .map(|apart| products(command, apart, size, lags))
        .collect();
    let mut losses = Vec::new();
    for late in 0..longest {
        let mut matrix = vec![0.0; order * order];
        let mut right = vec![0.0; order];
        for i in 0..na {
            right[i] = dot(&past[i], output);
            for j in 0..na {
                matrix[i * order + j] = dot(&past[i], &past[j]);
            }
            for lag in 0..nb {
                let x = with_past[i][late + 1 + lag];
                matrix[i * order + na + lag] = x;
                matrix[(na + lag) * order + i] = x;
            }
        }
        for lag in 0..nb {
            right[na + lag] = with_output[late + 1 + lag];
            for apart in 0..nb - lag {
                let x = with_itself[apart][late + 1 + lag];
                matrix[(na + lag) * order + na + lag + apart] = x;
                matrix[(na + lag + apart) * order + na + lag] = x;
            }
        }
        losses.push(loss(dot(output, output), &matrix, &right));
    }
    refine(&mut losses, least, |late| {
        task.check()?;
        Ok(left_over(past.iter().cloned().chain(inputs(late)), output))
    })?;
    let place = lowest(&losses, least);
    let constant = || past.iter().cloned().chain([vec![1.0; size]]);
    let best = left_over(constant().chain(inputs(place)), output);
    Ok((losses, best, left_over(constant(), output)))
}

/// Best delay of a held command in samples, between them too, the loss at each whole number of them, and
/// that without a command: with a delay of d + f samples the weights of both are 1 − f and f, of one sign.
///
/// # Errors
/// Where the work has to end.
pub fn held_losses(
    response: &[f64],
    command: &[f64],
    (least, longest): (usize, usize),
    task: &Task,
) -> Result<(f64, Vec<f64>, f64), Error> {
    let size = response.len();
    let none = dot(response, response);
    let seen = correlation(response, command, longest + 1);
    let powers = products(command, 0, size, longest + 1);
    let mixed = products(command, 1, size, longest);
    let single = |late: usize| {
        let power = if powers[late] > 0.0 {
            powers[late]
        } else {
            1.0
        };
        none - seen[late].max(0.0).powi(2) / power
    };
    let mut losses: Vec<f64> = (0..longest)
        .map(|late| {
            let matrix = [powers[late], mixed[late], mixed[late], powers[late + 1]];
            let [p, m, _, q] = matrix;
            // Both weights are positive, by Cramer's rule; else the best has one weight of zero.
            let inside =
                seen[late] * q >= seen[late + 1] * m && seen[late + 1] * p >= seen[late] * m;
            let found = if inside {
                loss(none, &matrix, &[seen[late], seen[late + 1]])
            } else {
                single(late).min(single(late + 1))
            };
            found.max(0.0)
        })
        .collect();
    let fitted = |late: usize| held_fit(response, command, late);
    refine(&mut losses, least, |late| {
        task.check()?;
        Ok(fitted(late).0)
    })?;
    let best = lowest(&losses, least);
    Ok((best as f64 + fitted(best).1, losses, none))
}

/// Loss with the command of two delays, weights not negative, and the share of the later one.
fn held_fit(response: &[f64], command: &[f64], late: usize) -> (f64, f64) {
    let size = response.len();
    let (now, before) = (
        delayed(command, late, size),
        delayed(command, late + 1, size),
    );
    let (p, m, q) = (dot(&now, &now), dot(&now, &before), dot(&before, &before));
    let (a, b) = (dot(&now, response), dot(&before, response));
    let det = p * q - m * m;
    let dependent = det.is_nan() || det <= FITS.pivot * p * q;
    let mut weights = [(a * q - b * m) / det, (b * p - a * m) / det];
    if dependent || weights[0] < 0.0 || weights[1] < 0.0 {
        let alone = |x: f64, power: f64| x.max(0.0) / if power > 0.0 { power } else { 1.0 };
        let (x, y) = (alone(a, p), alone(b, q));
        weights = if x * x * p >= y * y * q {
            [x, 0.0]
        } else {
            [0.0, y]
        };
    }
    let rows = response.iter().zip(now.iter().zip(&before));
    let loss = rows
        .map(|(r, (n, b))| (r - weights[0] * n - weights[1] * b).powi(2))
        .sum();
    let total = weights[0] + weights[1];
    (loss, if total > 0.0 { weights[1] / total } else { 0.0 })
}

/// The least of some losses computed again; rounding in the others must not bring them below those.
fn refine(
    losses: &mut [f64],
    least: usize,
    exact: impl Fn(usize) -> Result<f64, Error>,
) -> Result<(), Error> {
    let mut places: Vec<usize> = (least..losses.len()).collect();
    places.sort_by(|one, other| losses[*one].total_cmp(&losses[*other]));
    let (best, rest) = places.split_at(FITS.refined.min(places.len()));
    let mut most: f64 = 0.0;
    for place in best {
        losses[*place] = exact(*place)?;
        most = most.max(losses[*place]);
    }
    for place in rest {
        losses[*place] = losses[*place].max(most);
    }
    Ok(())
}

fn lowest(losses: &[f64], least: usize) -> usize {
    let places = least..losses.len();
    places
        .min_by(|one, other| losses[*one].total_cmp(&losses[*other]))
        .unwrap_or(least)
}

/// The values, delayed by whole samples, with zeros before the first one.
fn delayed(values: &[f64], samples: usize, size: usize) -> Vec<f64> {
    let zeros = std::iter::repeat_n(0.0, samples);
    let mut late: Vec<f64> = zeros.chain(values.iter().copied()).take(size).collect();
    late.resize(size, 0.0);
    late
}

/// What is left of a target's sum of squares by columns.
fn left_over(columns: impl Iterator<Item = Vec<f64>>, target: &[f64]) -> f64 {
    let mut taken = Columns::new(target, FITS.dependent);
    for column in columns {
        taken.take(column);
    }
    taken.power()
}

/// What normal equations leave of a power: by Cholesky's factor, without columns that depend on others.
fn loss(power: f64, matrix: &[f64], right: &[f64]) -> f64 {
    let n = right.len();
    let scale: Vec<f64> = (0..n)
        .map(|i| matrix[i * n + i].sqrt())
        .map(|s| if s > 0.0 { s } else { 1.0 })
        .collect();
    let mut l = vec![0.0; n * n];
    let mut explained = 0.0;
    let mut solved = vec![0.0; n];
    for i in 0..n {
        for j in 0..=i {
            let scaled = matrix[i * n + j] / (scale[i] * scale[j]);
            let left = scaled - dot(&l[i * n..][..j], &l[j * n..][..j]);
            l[i * n + j] = if i > j {
                if l[j * n + j] > 0.0 {
                    left / l[j * n + j]
                } else {
                    0.0
                }
            } else if left > FITS.pivot {
                left.sqrt()
            } else {
                0.0
            };
        }
        if l[i * n + i] > 0.0 {
            let rest = right[i] / scale[i] - dot(&l[i * n..][..i], &solved[..i]);
            solved[i] = rest / l[i * n + i];
            explained += solved[i] * solved[i];
        }
    }
    (power - explained).max(0.0)
}

/// Σ of products of the command at each of the first `lags` delays and that `apart` samples later.
fn products(command: &[f64], apart: usize, size: usize, lags: usize) -> Vec<f64> {
    let mut sums = vec![0.0];
    let mut sum = 0.0;
    for (k, now) in command.iter().enumerate() {
        sum += now * k.checked_sub(apart).map_or(0.0, |at| command[at]);
        sums.push(sum);
    }
    (0..lags)
        .map(|lag| sums[size.saturating_sub(lag).min(command.len())])
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_loss_of_a_delay_is_that_of_least_squares() {
        let command: Vec<f64> = (0..60).map(|i| libm::sin(f64::from(i * i))).collect();
        let output: Vec<f64> = (0..61_i32)
            .map(|i| 0.3 * libm::sin(f64::from((i - 4) * (i - 4))) + 0.1 * libm::cos(f64::from(i)))
            .collect();
        let (losses, best, none) =
            arx_losses(&output, &command, (2, 2), (0, 30), &Task::new()).unwrap();
        let past = (1..3).map(|lag| delayed(&output, lag, 61));
        let inputs = (8..10).map(|lag| delayed(&command, lag, 61));
        let expected = left_over(past.chain(inputs), &output);
        assert!((losses[7] / expected - 1.0).abs() < 1e-9);
        assert!(best < none);
    }
}
