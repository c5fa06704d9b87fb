//! Is the delay the same over the window?
//!
//! A command that comes later than the fitted delay says moves the output later. Beside the fitted
//! model, the delays of the commands are taken to wander around it: with a standard deviation and a
//! correlation time of their own, from a small part of the window, as in a busy network, to the whole
//! of it, as in a drift. To first order, the rows then have the noise of the fit and a further Gaussian
//! part: the change of the rows by these delays, less what the fitted numbers follow. The ratio of its
//! likelihood (Patterson & Thompson 1971) with the likeliest such delays and with none is the test.
//!
//! Air, scattered times or a coloured sensor may stand for the change where they were fitted. There the
//! delays also wander beside a fit without these, which has to be about as likely.

use std::f64::consts::PI;

use super::super::fit::{FlightFit, FlightRun, with_noise};
use super::super::start::is_long;
use super::draws::Draws;
use super::tolerances::CHANGE;
use crate::elementary::{exp, log};
use crate::estimation::fit::Search;
use crate::estimation::likelihood::Noise;
use crate::estimation::statistics::chi_squared_beyond;
use crate::linear_algebra::singular::Singular;
use crate::linear_algebra::vectors::dot;
use crate::{Error, Task};

/// How the delay changes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct DelayChange {
    /// Probability of residuals as much like such a change where the delay is constant.
    pub(super) p_value: f64,
    /// Standard deviation of the likeliest delay over the changes of the command, s.
    pub(super) spread: f64,
}

/// Where no change can be seen.
const NONE_SEEN: DelayChange = DelayChange {
    p_value: 1.0,
    spread: 0.0,
};

/// The test for one of the recordings.
pub(super) fn delay_change(fit: &FlightFit, run: usize, task: &Task) -> Result<DelayChange, Error> {
    let rows = &fit.runs[run];
    let commands = &rows.rows.commands.value;
    let jumps: Vec<f64> = commands.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let power = dot(&jumps, &jumps);
    if !fit.plant.free.delay || power == 0.0 || number(rows) == 0 {
        return Ok(NONE_SEEN);
    }
    let mut found = Wandering::beside(fit, run, task)?;
    let own = fit.noises()[run];
    let moved = [own.air, own.sensor, own.stamps, own.arrivals];
    if moved.iter().any(|size| *size > 0.0) && !is_long(&fit.runs) {
        let mut noises = fit.noises().to_vec();
        noises[run] = Noise {
            air: 0.0,
            sensor: 0.0,
            stamps: 0.0,
            arrivals: 0.0,
            ..own
        };
        let model = fit.model();
        let start = model.timed(with_noise(&fit.with_gain(task)?.point, noises));
        let calm = model.fit(&start, None, Search::Mean, CHANGE.rough, task)?;
        let calm = fit.moved(calm);
        // Else the rows do not tell the gain there.
        if calm.gain(task)?.is_finite() {
            let beside = Wandering::beside(&calm, run, task)?;
            let less_likely = calm.fit.objective - beside.fall() - fit.fit.objective;
            if less_likely < CHANGE.as_likely && beside.fall() > found.fall() {
                found = beside;
            }
        }
    }
    if found.fall() <= 0.0 {
        return Ok(NONE_SEEN);
    }
    Ok(DelayChange {
        spread: spread(&found.delays(), rows, &jumps, power),
        p_value: found.p_value(task)?,
    })
}

/// Standard deviation of delays that are so large a sum of waves, weighted by the jumps of the command.
fn spread(sizes: &[f64], run: &FlightRun, jumps: &[f64], power: f64) -> f64 {
    let (first, span) = (run.rows.time[0], run.rows.span());
    let times = run.rows.commands.time.iter().skip(1);
    let delays = times.map(|time| {
        let share = ((time - first) / span).clamp(0.0, 1.0);
        let waves = sizes.iter().zip(1_u32..);
        waves
            .map(|(size, k)| size * libm::cos(PI * f64::from(k) * share))
            .sum::<f64>()
    });
    let weighted: Vec<(f64, f64)> = jumps
        .iter()
        .map(|jump| jump * jump / power)
        .zip(delays)
        .collect();
    let mean: f64 = weighted.iter().map(|(weight, delay)| weight * delay).sum();
    let squares = weighted
        .iter()
        .map(|(weight, delay)| weight * (delay - mean) * (delay - mean));
    squares.sum::<f64>().sqrt()
}

/// How many waves these rows can tell.
fn number(run: &FlightRun) -> usize {
    CHANGE.waves.min(run.count() / CHANGE.rows)
}

/// Delays that wander beside a fit.
struct Wandering {
    /// For each correlation time.
    times: Vec<CorrelationTime>,
    /// The residuals along the waves.
    along: Vec<f64>,
    /// Sum of squares of all residuals.
    freedom: f64,
    /// By how much −2 ln L falls with the likeliest, its correlation time, and its size.
    likeliest: (f64, usize, usize),
}

/// Delays of one correlation time.
struct CorrelationTime {
    /// Standard deviations of the waves.
    sizes: Vec<f64>,
    /// The waves in their sizes by singular values, in white deviations.
    waves: Singular,
    /// For each size of the delays, variances along the singular directions.
    added: Vec<Vec<f64>>,
}

impl CorrelationTime {
    /// Of waves that do R to the rows, for a correlation time as a share of the window.
    fn new(factor: &[f64], number: usize, time: f64) -> Self {
        // Variances of the waves of a first-order noise; those of each correlation time add to one.
        let phases = (1..=number).map(|k| PI * time * k as f64);
        let variances: Vec<f64> = phases.map(|phase| 1.0 / (1.0 + phase * phase)).collect();
        let all: f64 = variances.iter().sum();
        let sizes: Vec<f64> = variances.iter().map(|one| (one / all).sqrt()).collect();
        let columns = sizes.iter().cycle();
        let scaled: Vec<f64> = factor
            .iter()
            .zip(columns)
            .map(|(r, size)| r * size)
            .collect();
        let waves = Singular::new(&scaled, number);
        let largest = waves.values.first().copied().unwrap_or(0.0);
        let largest = largest.max(f64::MIN_POSITIVE);
        let added = (0..CHANGE.added).map(|i| {
            let decades = i as f64 / CHANGE.added_a_decade;
            let size = CHANGE.least_added * exp(decades * log(10.0));
            let shares = waves.values.iter().map(|value| value / largest);
            shares.map(|share| size * share * share).collect()
        });
        Self {
            added: added.collect(),
            sizes,
            waves,
        }
    }

    /// Squares of residuals along the singular directions.
    fn squares(&self, along: &[f64]) -> Vec<f64> {
        let parts = self.waves.left.iter().map(|left| dot(left, along));
        parts.map(|part| part * part).collect()
    }
}

/// What variances of delays explain of squares of residuals, and their ln det.
fn explained(added: &[f64], squares: &[f64]) -> f64 {
    let shares = added.iter().map(|one| one / (1.0 + one));
    shares
        .zip(squares)
        .map(|(share, square)| share * square)
        .sum()
}

fn log_det(added: &[f64]) -> f64 {
    added.iter().map(|one| libm::log1p(*one)).sum()
}

impl Wandering {
    /// Delays that wander beside the fit of one recording.
    fn beside(fit: &FlightFit, run: usize, task: &Task) -> Result<Self, Error> {
        let number = number(&fit.runs[run]);
        let point = fit.with_gain(task)?.point;
        let found = fit.model().waves(run, &point, number, task)?;
        let times = CHANGE.correlation_times.iter();
        let times: Vec<CorrelationTime> = times
            .map(|time| CorrelationTime::new(&found.factor, number, *time))
            .collect();
        let freedom = found.freedom as f64;
        let mut likeliest = (f64::NEG_INFINITY, 0, 0);
        for (place, time) in times.iter().enumerate() {
            let squares = time.squares(&found.along);
            for (size, added) in time.added.iter().enumerate() {
                let left = -explained(added, &squares) / freedom;
                let fall = -freedom * libm::log1p(left) - log_det(added);
                if fall > likeliest.0 {
                    likeliest = (fall, place, size);
                }
            }
        }
        if times
            .iter()
            .all(|time| time.waves.values.iter().all(|value| *value == 0.0))
        {
            likeliest.0 = 0.0;
        }
        Ok(Self {
            times,
            along: found.along,
            freedom,
            likeliest,
        })
    }

    /// By how much −2 ln L falls with the likeliest; zero where none shows.
    const fn fall(&self) -> f64 {
        self.likeliest.0
    }

    /// Probability of such a fall where the delay is constant (Dufour 2006), drawn until it is known
    /// well enough (Besag & Clifford 1991).
    fn p_value(&self, task: &Task) -> Result<f64, Error> {
        if self.fall() <= CHANGE.drawn {
            return Ok(CHANGE.some * chi_squared_beyond(self.fall(), 1.0));
        }
        // What has to be explained for as large a fall, by correlation time and size.
        let least = |added: &Vec<f64>| {
            -libm::expm1(-(self.fall() + log_det(added)) / self.freedom) * self.freedom
        };
        let shares = |added: &Vec<f64>| added.iter().map(|one| one / (1.0 + one)).collect();
        let sizes: Vec<Vec<(f64, Vec<f64>)>> = self
            .times
            .iter()
            .map(|time| {
                time.added
                    .iter()
                    .map(|one| (least(one), shares(one)))
                    .collect()
            })
            .collect();
        let mut draws = Draws::new(0);
        let mut larger = 0;
        for drawn in 1..=CHANGE.draws {
            task.check()?;
            let along: Vec<f64> = self.along.iter().map(|_| draws.normal()).collect();
            let rest = draws.chi_squared(self.freedom - along.len() as f64);
            let scale = self.freedom / (dot(&along, &along) + rest);
            let is_larger = self.times.iter().zip(&sizes).any(|(time, sizes)| {
                let squares = time.squares(&along);
                let mut each = sizes.iter();
                each.any(|(least, shares)| scale * dot(shares, &squares) >= *least)
            });
            larger += usize::from(is_larger);
            if larger == CHANGE.enough {
                return Ok(larger as f64 / drawn as f64);
            }
        }
        Ok((1.0 + larger as f64) / (CHANGE.draws as f64 + 1.0))
    }

    /// The likeliest delays, as sizes of the waves, s.
    fn delays(&self) -> Vec<f64> {
        let (_, time, size) = self.likeliest;
        let CorrelationTime {
            sizes,
            waves,
            added,
        } = &self.times[time];
        let mut delays = vec![0.0; sizes.len()];
        for (place, (value, added)) in waves.values.iter().zip(&added[size]).enumerate() {
            if *value <= CHANGE.shows * waves.values[0] {
                continue;
            }
            let part = dot(&self.along, &waves.left[place]) / value * added / (1.0 + added);
            for (delay, right) in delays.iter_mut().zip(&waves.right[place]) {
                *delay += part * right;
            }
        }
        delays
            .iter()
            .zip(sizes)
            .map(|(delay, size)| delay * size)
            .collect()
    }
}
