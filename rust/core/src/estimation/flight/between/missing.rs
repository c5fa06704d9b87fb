//! Commands in missing rows, as functions of the plant.
//!
//! Where rows are missing, the commands follow from the controller's law and from the output that the
//! plant predicts there. So they depend on gain, delay and lags, and a response to them tells of these
//! numbers. The likelihood takes commands as given: the numbers of the plant are searched around it, with
//! the commands of each. Their covariance is the inverse of half the curvature of −2 ln L.

use super::super::super::likelihood::Noise;
use super::super::super::point::{Quantity, Timing};
use super::super::fit::{FlightFit, with_noise};
use super::super::numbers::grid;
use super::refilling::{Refilling, is_calm};
use super::tolerances::SEARCH;
use crate::linear_algebra::cholesky::inverse_of_positive;
use crate::linear_algebra::symmetric::Symmetric;
use crate::simplex::least_around;
use crate::{Error, Task};

/// The search for the numbers of a plant with the commands of each.
pub(super) struct Missing<'a> {
    refilling: Refilling<'a>,
    /// Steps of the numbers that all recordings share.
    sizes: Vec<f64>,
    task: &'a Task,
}

impl<'a> Missing<'a> {
    /// The likeliest fit with the commands of its plant, and the covariance of common numbers; none where
    /// the recording does not tell these numbers apart.
    pub(super) fn found(
        fit: &FlightFit,
        refilling: Refilling<'a>,
        sample_time: f64,
        task: &'a Task,
    ) -> Result<Option<(FlightFit, Vec<f64>)>, Error> {
        let n = fit.plant.common().len();
        let known = fit.covariance(task)?;
        let sizes = (0..n).map(|i| known[i * n + i].sqrt()).collect();
        let mut search = Self {
            refilling,
            sizes,
            task,
        };
        let mut starts = vec![fit.clone()];
        if !are_calm(fit) {
            let calm = |noise: &Noise| Noise {
                air: 0.0,
                sensor: 0.0,
                ..*noise
            };
            let noise = fit.noises().iter().map(calm).collect();
            let mut quiet = fit.with_gain(task)?;
            quiet.point = with_noise(&quiet.point, noise);
            let (plant, runs) = (fit.plant.clone(), fit.runs.clone());
            starts.push(FlightFit::new(plant, runs, false, quiet, fit.given_gain)?);
        }
        for start in &mut starts {
            *start = search.started(start, sample_time)?;
        }
        let mut best: Option<(f64, FlightFit)> = None;
        for start in starts {
            let own = search.searched(start)?;
            let criterion = own.criterion(task)?;
            if best.as_ref().is_none_or(|(least, _)| criterion < *least) {
                best = Some((criterion, own));
            }
        }
        let Some((_, best)) = best else {
            return Ok(None);
        };
        let Some(mut covariance) = search.covariance(&best)? else {
            return Ok(None);
        };
        let wider = if are_calm(&best) { 1.0 } else { SEARCH.in_air };
        for (place, entry) in covariance.iter_mut().enumerate() {
            *entry *= wider * wider * search.sizes[place / n] * search.sizes[place % n];
        }
        Ok(Some((best, covariance)))
    }

    /// The fit at the likeliest point of a grid over the delay and the gain.
    ///
    /// The likelihood has a maximum of its own in each sample time of the delay.
    fn started(&mut self, fit: &FlightFit, sample_time: f64) -> Result<FlightFit, Error> {
        let quantities = fit.plant.common();
        let mut axes = Vec::new();
        for (quantity, now) in quantities.iter().zip(common_of(fit, self.task)?) {
            axes.push(match quantity {
                Quantity::Delay => SEARCH.delays.map(|away| now + sample_time * away).to_vec(),
                Quantity::Gain => SEARCH.gains.map(|factor| factor * now).to_vec(),
                _ => vec![now],
            });
        }
        let mut best: Option<(f64, FlightFit)> = None;
        for point in grid(&axes) {
            let own = with_common(fit, &point, self.task)?;
            let value = self.objective(&own)?;
            if best.as_ref().is_none_or(|(least, _)| value < *least) {
                best = Some((value, own));
            }
        }
        Ok(best.map_or_else(|| fit.clone(), |(_, own)| own))
    }

    /// The likeliest fit near this one.
    fn searched(&mut self, mut fit: FlightFit) -> Result<FlightFit, Error> {
        let count = self.sizes.len();
        for step in SEARCH.steps {
            let (close, most) = ((SEARCH.accuracy, SEARCH.accuracy), SEARCH.most * count);
            let from = fit.clone();
            let cost = |at: &[f64]| self.objective_at(&from, at);
            let place = least_around(&vec![0.0; count], step, close, most, cost)?;
            let own = self.moved(&fit, &place)?;
            let known = self.known(&own)?;
            let noise = known.refit(SEARCH.exact, true, self.task)?;
            let mut found = own.with_gain(self.task)?;
            found.point = with_noise(&found.point, noise.noises().to_vec());
            found.objective = f64::INFINITY;
            fit = own.moved(found);
        }
        let rows = self.refilling.rows(&fit, self.task)?;
        fit.on(rows)
    }

    /// The fit with its common numbers changed by so many of their steps.
    fn moved(&self, fit: &FlightFit, by: &[f64]) -> Result<FlightFit, Error> {
        let now = common_of(fit, self.task)?;
        let changes = self.sizes.iter().zip(by).map(|(size, by)| size * by);
        let values: Vec<f64> = now.iter().zip(changes).map(|(x, by)| x + by).collect();
        with_common(fit, &values, self.task)
    }

    fn objective_at(&mut self, fit: &FlightFit, by: &[f64]) -> Result<f64, Error> {
        let own = self.moved(fit, by)?;
        self.objective(&own)
    }

    /// −2 ln L with the commands of this plant.
    fn objective(&mut self, fit: &FlightFit) -> Result<f64, Error> {
        let point = &fit.fit.point;
        if point.delay() < 0.0 || point.lags.iter().any(|lag| *lag < 0.0) {
            return Ok(f64::INFINITY);
        }
        let known = self.known(fit)?;
        let at = fit.with_gain(self.task)?.point;
        known.model().objective(&at, self.task)
    }

    /// The fit with the commands of its plant, of which nothing is free.
    fn known(&mut self, fit: &FlightFit) -> Result<FlightFit, Error> {
        let rows = self.refilling.rows(fit, self.task)?;
        let mut plant = fit.plant.clone();
        plant.free.delay = false;
        plant.free.gain = false;
        plant.free.zero = false;
        plant.free.lags.fill(false);
        FlightFit::new(
            plant,
            rows,
            fit.trim,
            fit.with_gain(self.task)?,
            fit.given_gain,
        )
    }

    /// The inverse of half the curvature, over about the length of an interval, in squares of the steps.
    ///
    /// The likelihood has kinks: of two lengths, the one that says less counts.
    fn covariance(&mut self, best: &FlightFit) -> Result<Option<Vec<f64>>, Error> {
        let n = self.sizes.len();
        let (mut scale, mut found) = (vec![1.0; n], None::<Vec<f64>>);
        for _ in 0..SEARCH.wider {
            let curvature = self.curvature(best, &scale)?;
            let is_finite = curvature.iter().all(|entry| entry.is_finite());
            let half: Vec<f64> = curvature.iter().map(|entry| 0.5 * entry).collect();
            let inverse = Some(half).filter(|_| is_finite);
            let inverse = inverse.and_then(|half| inverse_of_positive(&half, n, 0.0));
            match (inverse, &found) {
                (Some(own), Some(before)) => {
                    let wider = volume(&own, n) > volume(before, n);
                    return Ok(Some(if wider { own } else { before.clone() }));
                }
                (Some(own), None) => {
                    scale = (0..n)
                        .map(|i| SEARCH.ends * own[i * n + i].sqrt())
                        .collect();
                    found = Some(own);
                }
                (None, Some(_)) => return Ok(found),
                (None, None) => {
                    // Where a step leads beyond a bound, such as a lag below zero, shorter ones do not.
                    let factor = if is_finite { 2.0 } else { 0.5 };
                    scale.iter_mut().for_each(|one| *one *= factor);
                }
            }
        }
        Ok(found)
    }

    /// Second derivatives around a minimum, by steps of such lengths.
    fn curvature(&mut self, best: &FlightFit, scale: &[f64]) -> Result<Vec<f64>, Error> {
        let n = scale.len();
        let step = |pairs: &[(usize, f64)]| {
            let mut at = vec![0.0; n];
            for (i, way) in pairs {
                at[*i] += way * scale[*i];
            }
            at
        };
        let least = self.objective_at(best, &vec![0.0; n])?;
        let mut found = vec![0.0; n * n];
        for i in 0..n {
            let sides = self.objective_at(best, &step(&[(i, 1.0)]))?;
            let sides = sides + self.objective_at(best, &step(&[(i, -1.0)]))?;
            found[i * n + i] = (sides - 2.0 * least) / (scale[i] * scale[i]);
        }
        for i in 0..n {
            for j in 0..i {
                let mut mixed = [0.0; 2];
                for (sum, way) in mixed.iter_mut().zip([1.0, -1.0]) {
                    *sum = self.objective_at(best, &step(&[(i, 1.0), (j, way)]))?;
                    *sum += self.objective_at(best, &step(&[(i, -1.0), (j, -way)]))?;
                }
                let own = 0.25 * (mixed[0] - mixed[1]) / (scale[i] * scale[j]);
                found[i * n + j] = own;
                found[j * n + i] = own;
            }
        }
        Ok(found)
    }
}

fn are_calm(fit: &FlightFit) -> bool {
    (0..fit.runs.len()).all(|run| is_calm(fit, run))
}

/// The numbers that all recordings share.
fn common_of(fit: &FlightFit, task: &Task) -> Result<Vec<f64>, Error> {
    let point = fit.with_gain(task)?.point;
    let common = fit.plant.common();
    Ok(common.iter().map(|one| one.value(&point)).collect())
}

/// The fit with other common numbers.
fn with_common(fit: &FlightFit, values: &[f64], task: &Task) -> Result<FlightFit, Error> {
    let mut own = fit.with_gain(task)?;
    own.objective = f64::INFINITY;
    let (point, mut delay) = (&mut own.point, fit.fit.point.delay());
    for (quantity, value) in fit.plant.common().iter().zip(values) {
        match quantity {
            Quantity::Delay | Quantity::Total => delay = *value,
            Quantity::Gain => point.gain = *value,
            Quantity::Zero => point.zero = *value,
            Quantity::Lag(i) => point.lags[*i] = *value,
        }
    }
    point.timing = Timing::Delay(delay);
    let gain = point.gain;
    let mut found = fit.moved(own);
    found.given_gain = Some(gain);
    Ok(found)
}

/// Determinant of a covariance.
fn volume(matrix: &[f64], n: usize) -> f64 {
    Symmetric::new(matrix, n).values.iter().product()
}
