//! Delay, gain and lag of a plant from one recording, with intervals and tests.
//!
//! The search, the criterion and the intervals are those of the package's method `output_error` for one
//! recording with given commands: a grid over delay and lag in calm and in strong air, the likeliest of
//! the fits from there, intervals of the profile with the quantile of Student's distribution. Of its
//! tests for adequacy this has whiteness, a further lag, and air that changes within a row.

use deadtime::estimation::{
    Commands, Evaluation, Fit, Free, Limits, Model, Noise, Plant, Point, Quantity, Rows, Search,
    Timing,
};
use deadtime::{Error, Task};

use crate::request::Request;
use crate::statistics::{chi_squared_beyond, student_quantile, whiteness};

/// See `likelihood/_search.py`: longest delay, steps of the grid, lags in rows, sizes of the air.
const LONGEST: f64 = 0.6;
const GRID_GROWTH: f64 = 0.1;
const LAGS: [f64; 3] = [0.5, 3.0, 8.0];
const AIR_TIME: f64 = 0.13;
const SLOW: f64 = 10.0;
const REFINED: usize = 2;
const PRICE_OF_TRIM: f64 = 9.0;
const ROUGH: f64 = 0.02;
const FINE: f64 = 1e-6;

/// Air that may be there unseen, as factors on the weak air of the search.
const UNSEEN: [i32; 11] = [-6, -5, -4, -3, -2, -1, 0, 1, 2, 3, 4];

/// Step of the noise's logarithms, least curvature in them, fewest degrees of freedom.
const LOG_STEP: f64 = 0.1;
const LEAST_CURVATURE: f64 = 0.25;
const LEAST_FREEDOM: f64 = 4.0;

/// Starts of a further lag, in rows, and the levels of its test: in air without a lag, and else.
const FURTHER: [f64; 2] = [0.7, 3.0];
const LEVEL_IN_AIR: f64 = 0.04;
const LEVEL: f64 = 0.01;

/// A recording and the plant that is fitted to it.
struct Recorded {
    num: Vec<f64>,
    den: Vec<f64>,
    has_lag: bool,
    rows: Rows,
    between: f64,
    span: f64,
}

/// One fit, with the model it is of.
struct Found {
    model: Model,
    trim: bool,
    fit: Fit,
}

/// Read the lists num and den, descending, of a plant with unit gain; whether a lag is fitted (0 or 1);
/// the lists of times, outputs, command times and commands. The answer: delay, lag, sum and gain, each
/// with the ends of its interval; the deviation of the white noise; whether there are air and trim; the
/// probability of such residuals if they are white, and of such a further lag if there is none;
/// whether the fit is adequate; then the fitted outputs.
pub(crate) fn estimate(request: &mut Request<'_>) -> Result<Vec<f64>, Error> {
    let recorded = Recorded::read(request)?;
    let task = Task::new();
    let best = recorded.search(&task)?;
    let part = best.model.at(0, &best.fit.point, &task)?;
    let (white, further) = (
        whiteness(&part.whitened),
        recorded.further_lag(&best, &task)?,
    );
    let air = best.noise();
    let level = if air.air > 0.0 && !recorded.has_lag {
        LEVEL_IN_AIR
    } else {
        LEVEL
    };
    let is_restless = air.air > 0.0 && air.air_time < recorded.between;
    let is_adequate = white > LEVEL && further > level && !is_restless;
    let mut answer = Vec::new();
    let intervals = recorded.intervals(&best, &part, &task)?;
    let point = &best.fit.point;
    let lag = point.lags.first().copied().unwrap_or(0.0);
    let values = [point.delay(), lag, point.total(), part.gain];
    for (value, (low, high)) in values.into_iter().zip(intervals) {
        answer.extend([value, low, high]);
    }
    let flag = |is: bool| f64::from(u8::from(is));
    answer.extend([part.variance.sqrt(), flag(air.air > 0.0), flag(best.trim)]);
    answer.extend([white, further, flag(is_adequate)]);
    let fitted = recorded.rows.output.iter().zip(&part.residuals);
    answer.extend(fitted.map(|(output, residual)| output - residual));
    Ok(answer)
}

impl Recorded {
    fn read(request: &mut Request<'_>) -> Result<Self, Error> {
        let (num, den) = (request.list()?.to_vec(), request.list()?.to_vec());
        let has_lag = request.flag()?;
        let (time, output) = (request.list()?.to_vec(), request.list()?.to_vec());
        let (command_time, command) = (request.list()?.to_vec(), request.list()?.to_vec());
        let rows = Rows {
            used: vec![true; time.len()],
            time,
            output,
            speed: Vec::new(),
            commands: Commands {
                time: command_time,
                value: command,
                unknown: Vec::new(),
                uncertain: Vec::new(),
            },
            offset: true,
            trim: false,
        }
        .checked()?;
        let mut steps: Vec<f64> = rows.time.windows(2).map(|pair| pair[1] - pair[0]).collect();
        steps.sort_by(f64::total_cmp);
        let between = steps.get(steps.len() / 2).copied().unwrap_or(1.0);
        let span = rows.time.last().unwrap_or(&0.0) - rows.time.first().unwrap_or(&0.0);
        Ok(Self {
            num,
            den,
            has_lag,
            rows,
            between,
            span,
        })
    }

    fn integrates(&self) -> bool {
        self.den.len() > 1 && self.den.last() == Some(&0.0)
    }

    fn model(&self, lags: usize, trim: bool) -> Result<Model, Error> {
        let free = Free {
            delay: true,
            gain: true,
            lags: vec![true; lags],
            zero: false,
        };
        let rows = Rows {
            trim,
            ..self.rows.clone()
        };
        let plant = Plant::new(&self.num, &self.den)?;
        Model::new(plant, vec![rows], free, LONGEST * self.span)
    }

    /// Strong air, and weak air that is slow.
    fn airs(&self) -> (Noise, Noise) {
        let air = |a_row: f64, flat: f64, slow: f64| Noise {
            air_time: slow * AIR_TIME * self.span,
            air: if self.integrates() {
                a_row / self.between
            } else {
                flat
            },
            ..Noise::QUIET
        };
        (air(0.65, 3.0, 1.0), air(0.02, 0.3, SLOW))
    }

    /// The likeliest points of a grid over delay and lag under this noise, the likeliest first.
    fn grid(&self, model: &Model, noise: Noise, task: &Task) -> Result<Vec<Point>, Error> {
        let mut delays = vec![0.0];
        let mut last = 0.0;
        while last < LONGEST * self.span {
            last += f64::max(self.between, GRID_GROWTH * last);
            delays.push(last);
        }
        let lags: Vec<Vec<f64>> = if self.has_lag {
            LAGS.iter().map(|lag| vec![lag * self.between]).collect()
        } else {
            vec![Vec::new()]
        };
        let mut minima: Vec<(f64, Point)> = Vec::new();
        for some in lags {
            let at = |delay: f64| point(delay, some.clone(), noise);
            let values = model.over_delays(&at(0.0), &delays, task)?;
            for (i, (value, delay)) in values.iter().zip(&delays).enumerate() {
                let before = i.checked_sub(1).and_then(|i| values.get(i));
                let beside = [before, values.get(i + 1)];
                let is_least = beside.into_iter().flatten().all(|other| value <= other);
                if is_least && value.is_finite() && model.objective(&at(*delay), task)?.is_finite()
                {
                    minima.push((*value, at(*delay)));
                }
            }
        }
        minima.sort_by(|one, other| one.0.total_cmp(&other.0));
        Ok(minima.into_iter().take(REFINED).map(|(_, at)| at).collect())
    }

    fn search(&self, task: &Task) -> Result<Found, Error> {
        let (strong, slow) = self.airs();
        let weak = Noise {
            air_time: slow.air_time / SLOW,
            ..slow
        };
        let lags = usize::from(self.has_lag);
        let plain = self.model(lags, false)?;
        let calms = self.grid(&plain, Noise::QUIET, task)?;
        let airs = self.grid(&plain, strong, task)?;
        let trims: &[bool] = if self.integrates() {
            &[false, true]
        } else {
            &[false]
        };
        let mut best: Option<(f64, Found)> = None;
        for &trim in trims {
            let model = self.model(lags, trim)?;
            let Some(calm) = likeliest(&model, &calms, task)? else {
                continue;
            };
            let mut starts = vec![calm.point.clone()];
            starts.extend([weak, slow].map(|noise| with_noise(&calm.point, noise)));
            starts.extend(airs.iter().cloned());
            let Some(fit) = likeliest(&model, &starts, task)? else {
                continue;
            };
            let part = model.at(0, &fit.point, task)?;
            let price = if trim { PRICE_OF_TRIM } else { 0.0 };
            let criterion = price + self.criterion(&part);
            if best.as_ref().is_none_or(|(least, _)| criterion < *least) {
                best = Some((criterion, Found { model, trim, fit }));
            }
        }
        let Some((_, mut best)) = best else {
            return Err(Error::argument(
                "the recording tells nothing about the delay: the output must follow a command that \
                 changes",
            ));
        };
        best.fit = best.fitted(&best.fit.point, FINE, task)?;
        best.leave_idle_air(task)?;
        Ok(best)
    }

    /// Akaike's criterion without its prices.
    fn criterion(&self, part: &Evaluation) -> f64 {
        let count = self.rows.time.len() as f64;
        count * (part.variance * part.freedom as f64 / count).ln() + part.log_det
    }

    /// The probability of such a likelihood of a further lag where there is none.
    fn further_lag(&self, best: &Found, task: &Task) -> Result<f64, Error> {
        let lags = best.fit.point.lags.len();
        let model = self.model(lags + 1, best.trim)?;
        let behind = |rows: f64, noise: Noise| {
            let lag = rows * self.between;
            let mut lags = best.fit.point.lags.clone();
            lags.push(lag);
            point((best.fit.point.delay() - lag).max(0.0), lags, noise)
        };
        let least = 1e-3;
        let without = model.timed(behind(least, best.noise()));
        let objective = model.objective(&without, task)?;
        let near = Fit {
            point: without,
            objective,
        };
        let quantity = Quantity::Lag(lags);
        let without = model.held(&near, quantity, least * self.between, task)?;
        let mut noises = vec![best.noise()];
        if best.noise().air > 0.0 {
            noises.push(Noise::QUIET);
        }
        let starts = noises.into_iter().flat_map(|noise| {
            let behind = &behind;
            FURTHER.into_iter().map(move |rows| behind(rows, noise))
        });
        let starts: Vec<Point> = starts.collect();
        let found = likeliest(&model, &starts, task)?;
        let ratio = found.map_or(0.0, |found| without.objective - found.objective);
        Ok(if ratio > 0.0 {
            0.5 * chi_squared_beyond(ratio, 1.0)
        } else {
            1.0
        })
    }

    /// Ends of the 95 % intervals of delay, lag, sum and gain.
    fn intervals(
        &self,
        best: &Found,
        part: &Evaluation,
        task: &Task,
    ) -> Result<Vec<(f64, f64)>, Error> {
        let rows = part.freedom as f64;
        let lag = best.fit.point.lags.first().copied();
        let quantities = [
            (Quantity::Delay, vec![0.0, 1.0, 0.0], 0.0),
            (Quantity::Lag(0), vec![0.0, 0.0, 1.0], 1e-3 * self.between),
            (Quantity::Total, vec![0.0, 1.0, 1.0], 0.0),
            (Quantity::Gain, vec![1.0, 0.0, 0.0], f64::NEG_INFINITY),
        ];
        let mut centre = best.fit.clone();
        centre.point.gain = part.gain;
        let mut ends = Vec::new();
        for (quantity, weights, floor) in quantities {
            if quantity == Quantity::Lag(0) && lag.is_none() {
                ends.push((0.0, 0.0));
                continue;
            }
            let variance = |part: &Evaluation| square(part, &weights);
            let unseen = self.unseen_air(best, &variance, task)?;
            let freedom = best.freedom(&variance, rows, task)?;
            let quantile = student_quantile(freedom);
            let rise = rows * (unseen * quantile * quantile / rows).ln_1p();
            let error = (variance(part) * unseen).sqrt();
            let reach = (error * rise.sqrt()).max(1e-9);
            if !reach.is_finite() {
                return Err(Error::argument(
                    "the recording does not tell these numbers apart: fit no lag, or take a \
                     recording with more rows while the output moves",
                ));
            }
            let limits = Limits::floor(floor);
            let end = |reach: f64| {
                let (end, _) = best
                    .model
                    .end(&centre, quantity, reach, rise, limits, task)?;
                Ok::<_, Error>(if end == floor { 0.0 } else { end })
            };
            ends.push((end(-reach)?, end(reach)?));
        }
        Ok(ends)
    }

    /// Factor on a variance for air that is too weak to be seen.
    fn unseen_air(
        &self,
        best: &Found,
        variance: &impl Fn(&Evaluation) -> f64,
        task: &Task,
    ) -> Result<f64, Error> {
        if !self.integrates() || best.noise().air > 0.0 {
            return Ok(1.0);
        }
        let (_, slow) = self.airs();
        let own = variance(&best.model.at(0, &best.fit.point, task)?);
        let (mut total, mut sum) = (0.0, 0.0);
        for step in UNSEEN {
            let step = f64::powi(2.0, step);
            let noise = Noise {
                air: step * slow.air,
                ..slow
            };
            let moved = with_noise(&best.fit.point, noise);
            let part = best.model.at(0, &moved, task)?;
            let rise = part.objective - best.fit.objective;
            let weight = step.sqrt() * (-0.5 * rise.max(-1.0)).exp();
            total += weight;
            sum += weight * variance(&part);
        }
        Ok((sum / total / own).max(1.0))
    }
}

impl Found {
    fn noise(&self) -> Noise {
        self.fit
            .point
            .noise
            .first()
            .copied()
            .unwrap_or(Noise::QUIET)
    }

    fn fitted(&self, start: &Point, tolerance: f64, task: &Task) -> Result<Fit, Error> {
        let start = self.model.timed(start.clone());
        self.model.fit(&start, None, Search::All, tolerance, task)
    }

    /// Leave out air that makes the recording no likelier.
    fn leave_idle_air(&mut self, task: &Task) -> Result<(), Error> {
        if self.noise().air == 0.0 {
            return Ok(());
        }
        let without = with_noise(&self.fit.point, Noise::QUIET);
        let objective = self.model.objective(&without, task)?;
        if objective < self.fit.objective + 1e-3 {
            self.fit = Fit {
                point: without,
                objective,
            };
        }
        Ok(())
    }

    /// Degrees of freedom of a variance, over the size and the time constant of the air.
    fn freedom(
        &self,
        variance: &impl Fn(&Evaluation) -> f64,
        rows: f64,
        task: &Task,
    ) -> Result<f64, Error> {
        let noise = self.noise();
        if noise.air == 0.0 {
            return Ok(rows);
        }
        let at = |time: f64, size: f64| -> Result<(f64, f64), Error> {
            let moved = Noise {
                air_time: noise.air_time * (LOG_STEP * time).exp(),
                air: noise.air * (LOG_STEP * size).exp(),
                ..noise
            };
            let part = self
                .model
                .at(0, &with_noise(&self.fit.point, moved), task)?;
            Ok((part.objective, variance(&part).max(1e-300).ln()))
        };
        let (middle, _) = at(0.0, 0.0)?;
        let (later, sooner) = (at(1.0, 0.0)?, at(-1.0, 0.0)?);
        let (more, less) = (at(0.0, 1.0)?, at(0.0, -1.0)?);
        let both = at(1.0, 1.0)?.0;
        let step = LOG_STEP * LOG_STEP;
        let h11 = (later.0 - 2.0 * middle + sooner.0) / step;
        let h22 = (more.0 - 2.0 * middle + less.0) / step;
        let h12 = (both - later.0 - more.0 + middle) / step;
        let slopes = [
            (later.1 - sooner.1) / (2.0 * LOG_STEP),
            (more.1 - less.1) / (2.0 * LOG_STEP),
        ];
        if ![h11, h12, h22].iter().all(|h| h.is_finite()) {
            return Ok(LEAST_FREEDOM);
        }
        // Eigenvalues and vectors of the symmetric matrix of two rows.
        let (mean, half) = (0.5 * (h11 + h22), 0.5 * (h11 - h22));
        let radius = half.hypot(h12);
        let angle = 0.5 * h12.atan2(half);
        let (sin, cos) = angle.sin_cos();
        let along = [
            (mean + radius, cos * slopes[0] + sin * slopes[1]),
            (mean - radius, cos * slopes[1] - sin * slopes[0]),
        ];
        let spread: f64 = along
            .iter()
            .map(|(value, slope)| slope * slope / value.max(LEAST_CURVATURE))
            .sum();
        Ok((2.0 / (2.0 / rows + spread)).max(LEAST_FREEDOM))
    }
}

/// The variance of a weighted sum of gain, delay and lag.
fn square(part: &Evaluation, weights: &[f64]) -> f64 {
    let size = part.inverse.len().isqrt();
    let places = std::iter::once(0).chain(part.linear.len()..size);
    let own: Vec<(usize, f64)> = places.zip(weights.iter().copied()).collect();
    let entry = |i: usize, j: usize| part.inverse.get(i * size + j).copied().unwrap_or(0.0);
    let pairs = own
        .iter()
        .flat_map(|(i, w)| own.iter().map(move |(j, v)| (i, j, w * v)));
    part.variance * pairs.map(|(i, j, w)| w * entry(*i, *j)).sum::<f64>()
}

fn point(delay: f64, lags: Vec<f64>, noise: Noise) -> Point {
    Point {
        timing: Timing::Delay(delay),
        lags,
        zero: 0.0,
        gain: 1.0,
        noise: vec![noise],
    }
}

fn with_noise(point: &Point, noise: Noise) -> Point {
    Point {
        noise: vec![noise],
        ..point.clone()
    }
}

/// The likeliest of the fits from these starts.
fn likeliest(model: &Model, starts: &[Point], task: &Task) -> Result<Option<Fit>, Error> {
    let mut best: Option<Fit> = None;
    for start in starts {
        let start = model.timed(start.clone());
        let fit = model.fit(&start, None, Search::All, ROUGH, task)?;
        if best
            .as_ref()
            .is_none_or(|best| fit.objective < best.objective)
        {
            best = Some(fit);
        }
    }
    Ok(best)
}
