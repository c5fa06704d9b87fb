//! The likelihood of an output that is rounded: each row tells an interval, not a value.
//!
//! A row that reads r, rounded to steps of q, tells that output and noise together were within q/2 of r
//! (Gjeddebæk 1949):
//!
//! ```text
//! P = Φ((r + q/2 − m)/σ) − Φ((r − q/2 − m)/σ),
//! ```
//!
//! m the output of the model, σ the deviation of white noise before the rounding. Where the noise is
//! smaller than a step, rows at which the reading changes tell far more than a rounding error of q/√12
//! would, and rows that stay on a step rule out the models that would have left it. The search takes
//! Fisher's information for the curvature (scoring), damped and within bounds.

use std::f64::consts::{PI, SQRT_2};

use super::joint::{Joint, Space};
use super::tolerances::{ROUNDED, SEARCH};
use crate::elementary::{exp, log};
use crate::estimation::flight::FlightRun;
use crate::estimation::statistics::normal_beyond;
use crate::linear_algebra::cholesky::inverse_of_positive;
use crate::{Error, Task};

/// The readings of all recordings, one after the other.
#[derive(Debug, Clone, PartialEq)]
pub struct Readings {
    /// What was read.
    pub output: Vec<f64>,
    /// The recording of each row.
    pub recording: Vec<usize>,
    /// Which rows count.
    pub used: Vec<bool>,
    /// The step to which each recording is rounded.
    pub steps: Vec<f64>,
}

impl Readings {
    /// The rows of recordings as they were first and as they were fitted: all but outliers, and those that
    /// repeat the one before.
    pub fn of_rows(first: &[FlightRun], fitted: &[FlightRun], repeated: &[Vec<usize>]) -> Self {
        let mut found = Self {
            output: Vec::new(),
            recording: Vec::new(),
            used: Vec::new(),
            steps: fitted.iter().map(|run| run.rounding).collect(),
        };
        for (place, ((before, after), repeated)) in
            first.iter().zip(fitted).zip(repeated).enumerate()
        {
            let pairs = before.rows.used.iter().zip(&after.rows.used);
            let mut used: Vec<bool> = pairs.map(|(before, after)| !before || *after).collect();
            for row in repeated.iter().filter(|row| **row < before.rows.used.len()) {
                used[*row] = false;
            }
            found.recording.extend(vec![place; used.len()]);
            found.output.extend(&before.rows.output);
            found.used.extend(used);
        }
        found
    }
}

/// The least −2 ln L, where it is, and the logarithms of the noise of each recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Peak {
    /// −2 ln L.
    pub value: f64,
    /// The parameters of the model.
    pub point: Vec<f64>,
    /// Of the deviations.
    pub logs: Vec<f64>,
}

impl Peak {
    /// Deviation of the noise of each recording.
    pub fn deviations(&self) -> Vec<f64> {
        self.logs.iter().map(|one| exp(*one)).collect()
    }
}

/// Information of a row about its mean, mean and noise, and the logarithm of the noise.
type Information = [f64; 3];

/// −2 ln L with its derivatives by the mean of each row and by the logarithms of the noise.
struct Slopes {
    value: f64,
    by_mean: Vec<f64>,
    by_logs: Vec<f64>,
}

/// The likelihood of readings under a model.
pub struct Rounded<'a> {
    /// The model, without weights.
    pub model: &'a Joint<'a>,
    /// The readings.
    pub readings: &'a Readings,
}

impl Rounded<'_> {
    /// The lowest minimum from a start, from much noise and from little.
    ///
    /// # Errors
    ///
    /// As those of the misfit; so for all below.
    pub fn likeliest(&self, start: &[f64], task: &Task) -> Result<Peak, Error> {
        let space = Space::without(self.model, start.to_vec(), &[]);
        let starts = ROUNDED.noises.map(|noise| self.under(start, noise));
        let best = self.least(&starts, &space, task)?;
        self.least(&[best], &space, task)
    }

    /// The least −2 ln L with the sum of the parameters at these places held.
    ///
    /// # Errors
    ///
    /// See `likeliest`.
    pub fn held(
        &self,
        peak: &Peak,
        places: &[usize],
        value: f64,
        task: &Task,
    ) -> Result<f64, Error> {
        let (base, free) = self.model.held(&peak.point, places, value);
        let space = Space::new(self.model, base, free);
        let starts = [peak.clone(), self.under(&peak.point, ROUNDED.noises[0])];
        Ok(self.least(&starts, &space, task)?.value)
    }

    /// A point under so much noise, in steps.
    fn under(&self, point: &[f64], noise: f64) -> Peak {
        let steps = self.readings.steps.iter();
        Peak {
            value: f64::INFINITY,
            point: point.to_vec(),
            logs: steps.map(|step| log(noise * step)).collect(),
        }
    }

    /// The lowest of the minima from these starts.
    fn least(&self, starts: &[Peak], space: &Space, task: &Task) -> Result<Peak, Error> {
        let mut best: Option<Peak> = None;
        for start in starts {
            let found = self.minimum(start, space, task)?;
            if best.as_ref().is_none_or(|best| found.value < best.value) {
                best = Some(found);
            }
        }
        match best {
            Some(best) => Ok(best),
            None => refuse!("there is no starting point for the search"),
        }
    }

    /// A search over the noise and the points of a space.
    fn minimum(&self, start: &Peak, space: &Space, task: &Task) -> Result<Peak, Error> {
        let mut z = space.place(&start.point);
        let count = z.len();
        z.extend(&start.logs);
        let clamp = |z: &mut [f64]| {
            let (q, logs) = z.split_at_mut(count);
            space.clamp(q);
            for (log_, step) in logs.iter_mut().zip(&self.readings.steps) {
                *log_ = log_.clamp(log(ROUNDED.least * step), log(ROUNDED.most * step));
            }
        };
        clamp(&mut z);
        let at = |z: &[f64]| {
            let point = space.point(&z[..count]);
            let misfit = self.model.misfit(&point, task)?;
            Ok::<_, Error>((self.slopes(&misfit, &z[count..]), point, misfit))
        };
        let (mut found, mut point, mut misfit) = at(&z)?;
        let mut damping = 0.0;
        for _ in 0..ROUNDED.iterations {
            let columns = space.along(&self.model.slopes(&point, task)?);
            let information = self.information(&misfit, &z[count..]);
            let whole = self.whole(&columns, &information);
            let gradient = self.gradient(&columns, &found);
            let mut fall = None;
            while damping < SEARCH.most_damping {
                let step = free_step(&whole, &gradient, damping, &z, &clamp);
                let mut next: Vec<f64> = z.iter().zip(&step).map(|(z, step)| z + step).collect();
                clamp(&mut next);
                let taken: Vec<f64> = next.iter().zip(&z).map(|(to, from)| to - from).collect();
                let promised: f64 = -taken.iter().zip(&gradient).map(|(d, g)| d * g).sum::<f64>();
                if promised <= ROUNDED.promised {
                    break;
                }
                let (own, there, left) = at(&next)?;
                if own.value < found.value {
                    fall = Some(found.value - own.value);
                    (z, found, point, misfit) = (next, own, there, left);
                    damping /= SEARCH.change;
                    break;
                }
                damping = (damping * SEARCH.change * SEARCH.change).max(SEARCH.damping);
            }
            if fall.is_none_or(|fall| fall <= ROUNDED.promised) {
                break;
            }
        }
        Ok(Peak {
            value: found.value,
            point,
            logs: z.split_off(count),
        })
    }

    /// −2 ln L and its derivatives.
    fn slopes(&self, misfit: &[f64], logs: &[f64]) -> Slopes {
        let own = self.readings;
        let (mut value, mut by_mean, mut by_logs) = (0.0, Vec::new(), vec![0.0; logs.len()]);
        for (row, misfit) in misfit.iter().enumerate() {
            if !own.used[row] {
                by_mean.push(0.0);
                continue;
            }
            let (place, away) = (own.recording[row], -misfit);
            let deviation = exp(logs[place]);
            let half = 0.5 * own.steps[place] / deviation;
            // Of both signs that of the smaller probabilities, whose logarithms are exact.
            let size = (away.abs() / deviation).min(ROUNDED.farthest);
            let (low, high) = (-size - half, -size + half);
            let upper = log_below(high);
            let probability = upper + libm::log1p(-exp(log_below(low) - upper));
            let density = |z: f64| exp(-0.5 * z * z - probability) / (2.0 * PI).sqrt();
            let (at_low, at_high) = (density(low), density(high));
            value -= 2.0 * probability;
            let sign = if away == 0.0 { 0.0 } else { away.signum() };
            by_mean.push(-2.0 * sign * (at_high - at_low) / deviation);
            by_logs[place] += 2.0 * (high * at_high - low * at_low);
        }
        Slopes {
            value,
            by_mean,
            by_logs,
        }
    }

    /// Derivatives along columns, and by the logarithms of the noise.
    fn gradient(&self, columns: &[Vec<f64>], slopes: &Slopes) -> Vec<f64> {
        let along = |column: &Vec<f64>| {
            column
                .iter()
                .zip(&slopes.by_mean)
                .map(|(x, by)| x * by)
                .sum()
        };
        let own: Vec<f64> = columns.iter().map(along).collect();
        [own, slopes.by_logs.clone()].concat()
    }

    /// The information of each row: its readings have probabilities P; it is the sum of (dP)²/P over
    /// them.
    fn information(&self, misfit: &[f64], logs: &[f64]) -> Vec<Information> {
        let own = self.readings;
        let of_row = |(row, misfit): (usize, &f64)| {
            let mut sum = [0.0; 3];
            if !own.used[row] {
                return sum;
            }
            let (place, output) = (own.recording[row], own.output[row]);
            let (step, deviation, mean) = (own.steps[place], exp(logs[place]), misfit + output);
            // Steps lie around the readings.
            let nearest = output + step * ((mean - output) / step).round_ties_even();
            let reach = ROUNDED.readings;
            for k in -reach..=reach {
                let away = nearest + step * f64::from(k) - mean;
                let (low, high) = (
                    (away - 0.5 * step) / deviation,
                    (away + 0.5 * step) / deviation,
                );
                let probability = normal_beyond(-high) - normal_beyond(-low);
                if probability <= ROUNDED.impossible {
                    continue;
                }
                let density = |z: f64| exp(-0.5 * z * z) / (2.0 * PI).sqrt();
                let (at_low, at_high) = (density(low), density(high));
                let by_mean = (at_low - at_high) / deviation;
                let by_log = low * at_low - high * at_high;
                let parts = [by_mean * by_mean, by_mean * by_log, by_log * by_log];
                for (sum, part) in sum.iter_mut().zip(parts) {
                    *sum += part / probability;
                }
            }
            sum
        };
        misfit.iter().enumerate().map(of_row).collect()
    }

    /// Twice the information about columns and the logarithms of the noise: the curvature of −2 ln L.
    fn whole(&self, columns: &[Vec<f64>], rows: &[Information]) -> Vec<f64> {
        let (count, own) = (columns.len(), self.readings);
        let n = count + own.steps.len();
        let mut whole = vec![0.0; n * n];
        for (row, [of_mean, mixed, of_noise]) in rows.iter().enumerate() {
            let noise = count + own.recording[row];
            for i in 0..count {
                for j in 0..=i {
                    whole[i * n + j] += 2.0 * of_mean * columns[i][row] * columns[j][row];
                }
                whole[noise * n + i] += 2.0 * mixed * columns[i][row];
            }
            whole[noise * n + noise] += 2.0 * of_noise;
        }
        for i in 0..n {
            for j in 0..i {
                whole[j * n + i] = whole[i * n + j];
            }
        }
        whole
    }

    /// Inverse of Fisher's information of the parameters, the noise unknown too.
    ///
    /// # Errors
    ///
    /// If readings do not tell them, and see `likeliest`.
    pub fn covariance(&self, peak: &Peak, task: &Task) -> Result<Vec<f64>, Error> {
        let columns = self.model.slopes(&peak.point, task)?;
        let misfit = self.model.misfit(&peak.point, task)?;
        let (count, n) = (columns.len(), columns.len() + peak.logs.len());
        let mut whole = self.whole(&columns, &self.information(&misfit, &peak.logs));
        for place in 0..n {
            // A noise that readings do not tell has no part in the others.
            let own = &mut whole[place * n + place];
            *own = own.max(f64::MIN_POSITIVE);
        }
        let Some(inverse) = inverse_of_positive(&whole, n, 0.0) else {
            return Err(Error::NotIdentifiable(
                "the rounded rows do not determine these parameters".into(),
            ));
        };
        let entry = |place: usize| 2.0 * inverse[(place / count) * n + place % count];
        Ok((0..count * count).map(entry).collect())
    }
}

/// A damped step of scoring, with what would leave its bounds held.
fn free_step(
    whole: &[f64],
    gradient: &[f64],
    damping: f64,
    z: &[f64],
    clamp: &dyn Fn(&mut [f64]),
) -> Vec<f64> {
    let n = gradient.len();
    // A tiny step down the slope stays where a bound is.
    let moved = |i: &usize| {
        let mut next = z.to_vec();
        next[*i] -= gradient[*i].signum() * (1e-9 * (1.0 + z[*i].abs()));
        clamp(&mut next);
        next[*i] != z[*i]
    };
    let mut free: Vec<usize> = (0..n).filter(moved).collect();
    let mut step = vec![0.0; n];
    while !free.is_empty() {
        let m = free.len();
        let entry = |place: usize| {
            let (i, j) = (free[place / m], free[place % m]);
            whole[i * n + j] * if i == j { 1.0 + damping } else { 1.0 }
        };
        let matrix: Vec<f64> = (0..m * m).map(entry).collect();
        if let Some(inverse) = inverse_of_positive(&matrix, m, 1e-14) {
            for (row, i) in free.iter().enumerate() {
                let along = free.iter().enumerate();
                step[*i] = -along
                    .map(|(k, j)| inverse[row * m + k] * gradient[*j])
                    .sum::<f64>();
            }
            return step;
        }
        // What has no curvature does not move.
        let flattest = (0..m).min_by(|p, q| {
            let own = |k: usize| whole[free[k] * n + free[k]];
            own(*p).total_cmp(&own(*q))
        });
        free.remove(flattest.unwrap_or(0));
    }
    step
}

/// ln Φ(z), also far below zero.
fn log_below(z: f64) -> f64 {
    if z > -5.0 {
        return log(0.5 * libm::erfc(-z / SQRT_2));
    }
    // The continued fraction of Mills' ratio (Olver et al. 2010, 7.9.3).
    let x = -z;
    let fraction = (1..=40).rev().fold(x, |below, k| x + f64::from(k) / below);
    -0.5 * x * x - log(fraction) - 0.5 * log(2.0 * PI)
}

#[cfg(test)]
mod tests;
