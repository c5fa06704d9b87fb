//! The bank: a Kalman filter for each delay and set of lags, its weights, and a second bank of
//! delays that the vehicle may have changed to.

use super::super::propagation::Propagation;
use super::answer::Answer;
use super::cell::{Cell, Column, Look};
use super::cells::Cells;
use super::change::{change, inject};
use super::history::{History, Jump};
use super::judge::{AGES, Judge, Scale};
use super::layer::Layer;
use super::posterior::known;
use super::refine::Focus;
use super::row_by_row::Online;
use super::settings::Settings;
use crate::Error;

/// Deviations of what a level or a state that is not known may be, in those of the white noise.
const UNKNOWN: f64 = 1e3;

/// Time over which the information about the delay has to tell it to the width of the gate, s.
const SPELL: f64 = 5.0;

/// Time over which information about the delay is averaged, s.
const RECENT: f64 = 2.0;

/// Innovations beyond so many deviations in every cell are outliers, at most so many in a row.
const OUTLIER: f64 = 6.0;
const MOST_OUTLIERS: u32 = 2;

/// Over this time the weights of the second bank fade, s: what began before it is no change now.
const WINDOW: f64 = 30.0;

/// Weight below which a cell has no say whether a row is an outlier.
const NO_SAY: f64 = 1e-6;

/// Weight below which a cell rests until its neighbours or a change of the delay give it a new one.
/// Larger ones might forget what the rows still allow; smaller ones cost time.
const RESTS: f64 = 1e-60;

/// A delay within so many posterior deviations of the mean is no change of it: the walk leads there.
const AWAY: f64 = 3.0;

/// Longest memory of the judge, s.
const MOST_MEMORY: f64 = 30.0;

/// Changes of the command are looked at for so many lags beyond the longest delay.
const AFTER_LAGS: f64 = 3.0;

/// A bank of filters of N states; those beyond `Settings::states` stay zero.
pub(super) struct Bank<const N: usize> {
    settings: Settings,
    layers: Vec<Layer<N>>,
    /// Places of gain, trim and offset among the states.
    gain: usize,
    trim: Option<usize>,
    offset: Option<usize>,
    main: Cells<N>,
    /// After a change: the weights are Σ ρ Λ, the hazard times the likelihood ratio.
    changed: Cells<N>,
    columns: Vec<Column<N>>,
    looks: Vec<Look<N>>,
    logs: Vec<f64>,
    jumps: Vec<Jump>,
    history: History,
    /// Those of the settings and those between them.
    delays: Vec<f64>,
    focus: Focus,
    /// Largest distance of delays of the second bank, s.
    apart: f64,
    scale: Scale,
    judge: Judge,
    now: Option<f64>,
    /// Time of the last row that was used.
    used: Option<f64>,
    first: Option<f64>,
    largest: f64,
    rate: f64,
    outliers: u32,
    evidence: f64,
    last_change: Option<f64>,
}

impl<const N: usize> Bank<N> {
    pub(super) fn new(settings: Settings) -> Result<Self, Error> {
        let mut layers = Vec::new();
        for one in &settings.layers {
            layers.push(Layer::new(&settings, one)?);
        }
        let last = settings.states() - 1;
        let states = last - usize::from(settings.trim > 0.0) - usize::from(settings.has_offset());
        let trim = (settings.trim > 0.0).then_some(states + 1);
        let offset = settings.has_offset().then_some(last);
        let count = settings.delays.len();
        let sets = layers.len();
        let main = Cells::new(&settings.delays, (0..count).collect(), sets);
        let every = settings.every.clamp(1, count.div_ceil(3).max(1));
        let first = ((count - 1) % every) / 2;
        let changed = Cells::new(
            &settings.delays,
            (first..count).step_by(every).collect(),
            sets,
        );
        let pairs = changed.places.windows(2);
        let distances = pairs.map(|pair| settings.delays[pair[1]] - settings.delays[pair[0]]);
        let apart = distances.fold(0.0, f64::max);
        let longest = settings.delays[count - 1];
        let lag = layers.iter().map(|layer| layer.total).fold(0.0, f64::max);
        let history = History::new(&settings.delays, 2.0 * longest + AFTER_LAGS * lag + 1.0);
        let none = Column {
            moved: [0.0; N],
            slope: [0.0; N],
            seen: [0.0; N],
        };
        Ok(Self {
            scale: Scale::new(settings.white, settings.freedom, settings.memory),
            judge: Judge::new(settings.memory.min(MOST_MEMORY)),
            columns: vec![none; sets * count],
            looks: Vec::new(),
            logs: Vec::new(),
            jumps: Vec::new(),
            layers,
            gain: states,
            trim,
            offset,
            main,
            changed,
            history,
            delays: settings.delays.clone(),
            focus: Focus::NONE,
            apart,
            settings,
            now: None,
            used: None,
            first: None,
            largest: 0.0,
            rate: 0.0,
            outliers: 0,
            evidence: 0.0,
            last_change: None,
        })
    }

    /// What the input does in every set of lags and delay up to `time`.
    fn arrive(&mut self, time: f64, length: f64) {
        let count = self.delays.len();
        for delay in 0..count {
            let (before, input) = self.history.arrive(delay, time, length, &mut self.jumps);
            for (set, layer) in self.layers.iter().enumerate() {
                let mut moved = [0.0; N];
                let mut slope = [0.0; N];
                if before != 0.0 {
                    moved = layer.response.at(length).map(|gamma| before * gamma);
                }
                for jump in &self.jumps {
                    let gamma = layer.response.at(jump.age);
                    let rate = layer.response.rate(&gamma);
                    for i in 0..N {
                        moved[i] += jump.size * gamma[i];
                        slope[i] -= jump.size * rate[i];
                    }
                }
                let mut seen = layer.seen;
                seen[self.gain] = layer.direct * input;
                self.columns[set * count + delay] = Column { moved, slope, seen };
            }
        }
    }

    /// Begin at the first row at which every delay has had its first command, or from rest.
    fn start(&mut self, time: f64, output: f64) {
        self.arrive(time, f64::INFINITY);
        let (white, count) = (self.settings.white, self.settings.delays.len());
        let (gain, spread) = self.settings.gain;
        for (set, layer) in self.layers.iter().enumerate() {
            for delay in 0..count {
                let column = &self.columns[set * count + delay];
                let mut cell = Cell {
                    mean: [0.0; N],
                    cov: layer.start,
                    slope: column.slope.map(|slope| gain * slope),
                };
                cell.mean[self.gain] = gain;
                let mut reach = column.moved;
                reach[self.gain] = 1.0;
                let variance = (spread / white).powi(2);
                for i in 0..N {
                    if i != self.gain {
                        cell.mean[i] = gain * column.moved[i];
                    }
                    for j in 0..N {
                        cell.cov[i][j] += variance * reach[i] * reach[j];
                    }
                }
                if !self.settings.at_rest {
                    let unknown = (gain.abs() + spread) * self.largest / white;
                    for i in 0..layer.plant {
                        cell.cov[i][i] += unknown * unknown;
                    }
                }
                if let Some(trim) = self.trim {
                    cell.cov[trim][trim] = (self.settings.trim / white).powi(2);
                }
                // The level is unknown: the offset, or the state that integrates.
                let place = self
                    .offset
                    .unwrap_or_else(|| layer.integrates(&self.settings));
                let seen = if layer.seen[place] == 0.0 {
                    1.0
                } else {
                    layer.seen[place]
                };
                let expected: f64 = column.seen.iter().zip(&cell.mean).map(|(c, x)| c * x).sum();
                cell.mean[place] += (output - expected) / seen;
                cell.cov[place][place] += (UNKNOWN / seen).powi(2);
                self.main.cells[set * count + delay] = cell;
            }
        }
        let logs = self
            .settings
            .layers
            .iter()
            .flat_map(|layer| &layer.log_prior);
        let top = logs.clone().copied().fold(f64::NEG_INFINITY, f64::max);
        self.main.weights = logs.map(|log| (log - top).exp()).collect();
        let total: f64 = self.main.weights.iter().sum();
        self.main
            .weights
            .iter_mut()
            .for_each(|weight| *weight /= total);
        self.used = Some(time);
    }

    /// The share of the walk and of the hazard that there is: both need information.
    fn gate(&self) -> f64 {
        let enough = 1.0 / (SPELL * self.settings.width.powi(2));
        self.rate / (self.rate + enough)
    }

    /// Go to `time` without looking.
    fn go(&mut self, time: f64, length: f64) {
        let gate = self.gate();
        let white = self.scale.variance();
        let walked = self.settings.drift.powi(2) * length * gate;
        self.main.mix(walked, white);
        if self.settings.alarm.is_finite() {
            let fade = (-length / WINDOW).exp();
            self.changed
                .weights
                .iter_mut()
                .for_each(|weight| *weight *= fade);
            inject(&self.main, &mut self.changed, length * gate, white);
            self.changed.mix(walked, white);
        }
        self.arrive(time, length);
        let wander = (self.settings.gain_walk).powi(2) * length * gate / white;
        let delays = self.delays.len();
        let steps: Vec<Propagation<N>> = self
            .layers
            .iter_mut()
            .map(|layer| {
                let (a, noise) = (layer.a, layer.noise);
                layer
                    .steps
                    .at(length, time, || Propagation::new(&a, &noise, length))
                    .clone()
            })
            .collect();
        for bank in [&mut self.main, &mut self.changed] {
            let indices: Vec<(usize, usize)> = bank.indices(delays).collect();
            let cells = bank.cells.iter_mut().zip(&bank.weights).zip(indices);
            for ((cell, _), (set, column)) in cells.filter(|((_, weight), _)| **weight > 0.0) {
                cell.go(&steps[set], &self.columns[column], self.gain);
                cell.cov[self.gain][self.gain] += wander;
            }
        }
    }

    /// Take an output in. Has the delay changed?
    fn see(&mut self, time: f64, output: f64) -> bool {
        let delays = self.delays.len();
        let variance = self.scale.variance();
        self.looks.clear();
        self.logs.clear();
        let mut top = f64::NEG_INFINITY;
        let mut least = f64::INFINITY;
        for (number, bank) in [&self.main, &self.changed].into_iter().enumerate() {
            for (i, (_, column)) in bank.indices(delays).enumerate() {
                if bank.weights[i] == 0.0 {
                    self.looks.push(Look::NONE);
                    self.logs.push(f64::NEG_INFINITY);
                    continue;
                }
                let look = bank.cells[i].look(&self.columns[column], output);
                let log = self.scale.log_density(look.innovation, look.variance);
                if number == 0 {
                    top = top.max(log);
                }
                if bank.weights[i] > NO_SAY || number == 1 {
                    least = least.min(look.innovation.powi(2) / look.variance);
                }
                self.looks.push(look);
                self.logs.push(log);
            }
        }
        if least > OUTLIER * OUTLIER * variance && self.outliers < MOST_OUTLIERS {
            self.outliers += 1;
            return false;
        }
        self.outliers = 0;
        let length = self.used.map_or(0.0, |used| time - used);
        self.used = Some(time);
        self.judge_by(time, length, variance);
        let split = self.main.cells.len();
        let mut total = 0.0;
        for (weight, log) in self.main.weights.iter_mut().zip(&self.logs) {
            *weight *= (log - top).exp();
            if *weight < RESTS {
                *weight = 0.0;
            }
            total += *weight;
        }
        self.evidence += top + total.ln();
        let mut square = 0.0;
        let mut known = 0.0;
        for (weight, look) in self.main.weights.iter_mut().zip(&self.looks) {
            *weight /= total;
            square += *weight * look.innovation.powi(2) / look.variance;
            known += *weight * look.slope.powi(2) / (look.variance * variance);
        }
        if length > 0.0 {
            let fade = (-length / RECENT).exp();
            self.rate = fade * self.rate + (1.0 - fade) * known / length;
        }
        self.scale.hear(square, length);
        let own = self.main.cells.iter_mut().zip(&self.main.weights);
        for ((cell, weight), look) in own.zip(&self.looks) {
            if *weight > 0.0 {
                cell.take(look);
            }
        }
        let mut sum = 0.0;
        let (mean, deviation) = self.posterior();
        for i in 0..self.changed.cells.len() {
            let place = self.changed.places[i % self.changed.places.len()];
            let away = (self.delays[place] - mean).abs();
            if away < f64::max(0.5 * self.apart, AWAY * deviation) {
                self.changed.weights[i] = 0.0;
            } else if self.changed.weights[i] > 0.0 {
                let ratio = (self.logs[split + i] - top).min(500.0).exp() / total;
                self.changed.weights[i] = (self.changed.weights[i] * ratio).min(1e200);
                self.changed.cells[i].take(&self.looks[split + i]);
                sum += self.changed.weights[i];
            }
        }
        if sum < self.settings.alarm {
            return false;
        }
        change(
            &mut self.main,
            &mut self.changed,
            &self.delays,
            sum,
            variance,
        );
        self.forget_doubts(time);
        self.last_change = Some(time);
        true
    }

    /// Begin to judge anew, unless the delay has changed of late: a second change so soon is rather one
    /// of what the plant lacks.
    fn forget_doubts(&mut self, time: f64) {
        let memory = self.settings.memory.min(MOST_MEMORY);
        if self.last_change.is_none_or(|last| time - last > memory) {
            self.judge.forget();
        }
    }

    /// Mean and deviation of the delays by their weights.
    fn posterior(&self) -> (f64, f64) {
        let (mut mean, mut square) = (0.0, 0.0);
        for weights in self.main.weights.chunks_exact(self.delays.len()) {
            for (weight, delay) in weights.iter().zip(&self.delays) {
                mean += weight * delay;
                square += weight * delay * delay;
            }
        }
        (mean, (square - mean * mean).max(0.0).sqrt())
    }

    /// Tell the judge how this row was predicted by all cells together.
    fn judge_by(&mut self, time: f64, length: f64, variance: f64) {
        let (mut mean, mut square) = (0.0, 0.0);
        for (weight, look) in self.main.weights.iter().zip(&self.looks) {
            mean += weight * look.innovation;
            square += weight * (look.variance * variance + look.innovation.powi(2));
        }
        let deviation = (square - mean * mean).max(f64::MIN_POSITIVE).sqrt();
        let longest = self.settings.delays[self.settings.delays.len() - 1];
        let lag = self
            .layers
            .iter()
            .map(|layer| layer.total)
            .fold(0.0, f64::max);
        let step = (longest + AFTER_LAGS * lag) / AGES as f64;
        let changes = std::array::from_fn(|k| {
            let age = k as f64 * step;
            self.history.at(time - age) - self.history.at(time - age - step)
        });
        self.judge.hear(mean / deviation, length, &changes);
    }

    /// Put cells where the posterior needs them after the row at `time`.
    fn follow(&mut self, time: f64, answer: &Answer) {
        let asked = self.focus.follow(answer.delay.mean, answer.delay.deviation);
        let Some(focus) = asked.filter(|_| self.settings.follow) else {
            return;
        };
        self.focus = focus;
        let delays = focus.delays(&self.settings.delays);
        if delays == self.delays {
            return;
        }
        if delays.len() > self.delays.len() {
            // What cells that were too far apart have left says nothing about the plant.
            self.forget_doubts(time);
        }
        self.main.follow(&self.delays, &delays);
        self.changed.renumber(&self.delays, &delays);
        self.history.follow(&delays, time);
        let none = self.columns[0];
        self.columns.resize(self.layers.len() * delays.len(), none);
        self.delays = delays;
    }

    fn answer(&self, time: f64, changed: bool) -> Answer {
        let totals: Vec<f64> = self.layers.iter().map(|layer| layer.total).collect();
        let weights = &self.main.weights;
        let count = self.delays.len();
        let tail = 0.5 * (1.0 - self.settings.level);
        let (delay, together) = known(&self.delays, &totals, weights, tail);
        let variance = self.scale.variance();
        let (mut gain, mut square, mut lag) = (0.0, 0.0, 0.0);
        let (mut lowest, mut highest) = (0.0, 0.0);
        for (i, (weight, cell)) in weights.iter().zip(&self.main.cells).enumerate() {
            gain += weight * cell.mean[self.gain];
            square +=
                weight * (variance * cell.cov[self.gain][self.gain] + cell.mean[self.gain].powi(2));
            lag += weight * totals[i / count];
            if i % count == 0 {
                lowest += weight;
            }
            if i % count == count - 1 {
                highest += weight;
            }
        }
        Answer {
            time,
            started: true,
            delay,
            together,
            lag,
            gain,
            gain_deviation: (square - gain * gain).max(0.0).sqrt(),
            gate: self.gate(),
            changed,
            white: variance.sqrt(),
            colour: self.judge.colour(),
            unexplained: self.judge.unexplained(),
            lowest,
            highest,
            evidence: self.evidence,
        }
    }
}

impl<const N: usize> Online for Bank<N> {
    fn command(&mut self, time: f64, value: f64) -> Result<(), Error> {
        self.history.push(time, value)?;
        self.first.get_or_insert(time);
        self.largest = self.largest.max(value.abs());
        Ok(())
    }

    fn row(&mut self, time: f64, output: Option<f64>) -> Result<Answer, Error> {
        refuse_if!(!time.is_finite(), "a time is {time}: give finite numbers");
        if let Some(output) = output.filter(|output| !output.is_finite()) {
            refuse!("the output at {time} s is {output}: give a finite number, or none");
        }
        if let Some(now) = self.now {
            refuse_if!(
                time <= now,
                "the time {time} s follows {now} s: give increasing times"
            );
        }
        let before = self.now.replace(time);
        let changed = if self.used.is_none() {
            let longest = self.settings.delays[self.settings.delays.len() - 1];
            let is_ready =
                self.settings.at_rest || self.first.is_some_and(|first| time >= first + longest);
            let Some(output) = output.filter(|_| is_ready) else {
                return Ok(Answer::none(time, &self.settings));
            };
            self.start(time, output);
            self.see(time, output)
        } else {
            self.go(time, before.map_or(0.0, |before| time - before));
            output.is_some_and(|output| self.see(time, output))
        };
        let answer = self.answer(time, changed);
        self.follow(time, &answer);
        self.history.tidy(time);
        Ok(answer)
    }
}
