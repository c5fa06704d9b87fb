//! The commands of a controller from the output that a plant predicts between rows.

use super::super::super::path::{Held, respond};
use super::super::super::plant::{Plant, PlantSpace};
use super::super::fit::FlightFit;
use super::controlled::{Assumed, Controlled};
use super::gaps::Gap;
use super::sent::{Sent, range};
use super::smoothed::smoothed;
use super::tolerances::{GAPS, PREDICTED};
use crate::{Error, Task};

/// How an output is predicted.
#[derive(Debug, Clone, Copy)]
pub(super) struct How {
    /// See `Assumed`.
    pub(super) step: Option<usize>,
    /// Is the mean command over many missing rows unknown all the same?
    pub(super) unsure: bool,
    /// Does nothing but the commands move the output? Then, across many missing rows, it is predicted from
    /// those before. Otherwise what moves it besides is interpolated between rows.
    pub(super) calm: bool,
}

/// The plant of a fit.
pub(super) struct Response {
    space: PlantSpace,
    at_rest: Option<f64>,
    gain: f64,
    delay: f64,
}

impl Response {
    pub(super) fn of(fit: &FlightFit, task: &Task) -> Result<Self, Error> {
        let plant = Plant::new(&fit.plant.num, &fit.plant.den)?;
        let numbers = fit.loop_numbers(task)?;
        Ok(Self {
            space: plant.space(&numbers.lags, numbers.zero),
            at_rest: plant.rest_gain(),
            gain: numbers.gain,
            delay: numbers.delay,
        })
    }

    /// The output under commands, at rest under the first one if it comes to rest.
    pub(super) fn under(&self, sent: &Sent, times: &[f64], task: &Task) -> Result<Vec<f64>, Error> {
        let first = sent.command.first().copied().unwrap_or(0.0);
        let (base, rest) = self
            .at_rest
            .map_or((0.0, 0.0), |gain| (first, gain * first));
        let moved: Vec<f64> = sent.command.iter().map(|one| one - base).collect();
        let mut out = self.moved(&sent.time, &moved, times, task)?;
        out.iter_mut().for_each(|y| *y = self.gain * (*y + rest));
        Ok(out)
    }

    /// The output by a command that lasts a sample, after whole samples since its start.
    pub(super) fn to_sample(
        &self,
        sample_time: f64,
        samples: usize,
        task: &Task,
    ) -> Result<Vec<f64>, Error> {
        let ages: Vec<f64> = (0..samples).map(|k| sample_time * k as f64).collect();
        let mut out = self.moved(&[0.0, sample_time], &[1.0, 0.0], &ages, task)?;
        out.iter_mut().for_each(|y| *y *= self.gain);
        Ok(out)
    }

    /// The output of unit gain by inputs from zero.
    fn moved(
        &self,
        time: &[f64],
        value: &[f64],
        times: &[f64],
        task: &Task,
    ) -> Result<Vec<f64>, Error> {
        let times: Vec<f64> = times.iter().map(|time| time - self.delay).collect();
        let mut out = vec![0.0; times.len()];
        let held = Held { time, value };
        respond([&self.space], held, 0.0, &times, [&mut out], None, task)?;
        Ok(out)
    }
}

impl Controlled {
    /// Commands between rows from the output that a plant predicts there, starting from those before.
    pub(super) fn predicted(
        &self,
        plant: &Response,
        before: &Sent,
        how: How,
        task: &Task,
    ) -> Result<Sent, Error> {
        let gaps = self.gaps();
        let Some(sample_time) = self.sample_time.filter(|_| !gaps.is_empty()) else {
            return Ok(before.clone());
        };
        let is_hole = |row: usize| {
            let apart = (self.time[row + 1] - self.time[row]) / sample_time;
            how.calm && apart > GAPS.hole as f64 + 0.5
        };
        let holes: Vec<usize> = (0..self.time.len() - 1)
            .filter(|row| is_hole(*row))
            .collect();
        let places: Vec<f64> = gaps.iter().flat_map(|gap| gap.places.clone()).collect();
        let longest = gaps.iter().map(Gap::count).max().unwrap_or(0);
        let answer = if how.calm {
            Some(plant.to_sample(sample_time, longest, task)?)
        } else {
            None
        };
        let mut sent = before.clone();
        for _ in 0..PREDICTED.rounds + if how.calm { before.longest } else { 0 } {
            let modelled = plant.under(&sent, &self.time, task)?;
            let mut there = plant.under(&sent, &places, task)?;
            let rows = self.output.iter().zip(&modelled);
            let beside: Vec<f64> = rows.map(|(y, modelled)| y - modelled).collect();
            let (left, mut error) = smoothed(&beside);
            let means = means_before(&beside, &holes);
            if !holes.is_empty() {
                let least = means.iter().map(|(_, count)| *count).min().unwrap_or(1);
                error = 1.0 / (least as f64).sqrt();
            }
            let mut next = there.iter_mut();
            for gap in &gaps {
                let added = match holes.binary_search(&gap.row) {
                    Ok(hole) => vec![means[hole].0; gap.count()],
                    Err(_) => self.between(&left, gap),
                };
                for (y, added) in next.by_ref().take(gap.count()).zip(added) {
                    *y += added;
                }
            }
            let assumed = Assumed {
                step: how.step,
                shared: (!how.unsure).then_some(error),
            };
            let again = self.filled(&gaps, &there, assumed, answer.as_deref());
            let pairs = again.command.iter().zip(&sent.command);
            let moved = pairs.map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
            sent = again;
            if moved <= PREDICTED.settled * range(&self.command) {
                break;
            }
        }
        Ok(sent)
    }
}

/// Mean and number of the values after the hole before, up to each hole.
fn means_before(values: &[f64], holes: &[usize]) -> Vec<(f64, usize)> {
    let mut begin = 0;
    let mean = |hole: &usize| {
        let piece = &values[begin..=*hole];
        begin = hole + 1;
        (piece.iter().sum::<f64>() / piece.len() as f64, piece.len())
    };
    holes.iter().map(mean).collect()
}
