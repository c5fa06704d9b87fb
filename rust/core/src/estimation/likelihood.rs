//! Likelihood of the rows of one recording, with all linear unknowns eliminated.
//!
//! With V the covariance of the rows for white noise of unit variance and X the columns of the linear
//! unknowns,
//!
//! ```text
//! −2 ln L = m ln(r/m) + ln det V + ln det XᵀV⁻¹X − ln det XᵀX,   m = n − columns of X,
//! ```
//!
//! r the least sum of squares of the whitened rows over the linear unknowns. It is the likelihood of
//! the residuals (Patterson & Thompson 1971, Harville 1977), so that the numbers of the noise are not
//! biased by the linear unknowns. The last term makes it independent of the scale of the columns,
//! which changes with the lags. The variance of the white noise counts delay and lags as unknowns
//! too.
//!
//! Half of the file is its tests, which compare with the same formula written with dense matrices.

use super::disturbance::{Disturbance, Entry, Joint};
use super::kicks::kicks;
use super::mean::{Derivatives, Gain, Mean, Values, sizes};
use super::noises::{One, Shared, triangles};
use super::orthogonal::Triangle;
use super::path::dot;
use super::plant::Plant;
use super::rows::Rows;
use super::whiten::{Known, whiten_in_place};
use crate::{Error, Task, memory};

/// Smallest sum of squares, as a share of that of the output: below is rounding.
const ROUNDING: f64 = 1e-26;

/// What memory is asked for.
const WHAT: &str = "the residuals of the likelihood";

/// Numbers of the noise, in standard deviations of the white noise; zero where there is none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// Time constant of the air, s.
    pub air_time: f64,
    /// Standard deviation of the air, at the input of the plant.
    pub air: f64,
    /// Time constant of the coloured sensor noise, s.
    pub sensor_time: f64,
    /// Its standard deviation.
    pub sensor: f64,
    /// Scatter of the times of the rows and of their commands, s, times the gain.
    pub stamps: f64,
    /// Scatter of the times at which commands arrive, s, times the gain.
    pub arrivals: f64,
}

impl Noise {
    fn parts(&self) -> [Disturbance; 2] {
        [
            (Entry::Input, self.air_time, self.air),
            (Entry::Output, self.sensor_time, self.sensor),
        ]
        .map(|(entry, time_constant, deviation)| Disturbance {
            entry,
            time_constant,
            deviation,
        })
    }

    /// An error unless the numbers are those of noise.
    pub(super) fn check(&self) -> Result<(), Error> {
        for (what, scatter) in [("rows", self.stamps), ("commands", self.arrivals)] {
            refuse_if!(
                !(scatter.is_finite() && scatter >= 0.0),
                "the times of {what} scatter by {scatter}: give a finite number of at least zero"
            );
        }
        self.parts().iter().try_for_each(Disturbance::check)
    }

    pub(super) fn disturbances(&self) -> Vec<Disturbance> {
        let parts = self.parts().into_iter();
        parts.filter(|part| part.deviation > 0.0).collect()
    }

    /// Variance of the white noise of each row; empty where it is one.
    fn variances(&self, rows: &Rows) -> Result<Vec<f64>, Error> {
        if self.stamps == 0.0 {
            return Ok(Vec::new());
        }
        let variance = |speed: &f64| (self.stamps * speed).mul_add(self.stamps * speed, 1.0);
        memory::collected(WHAT, rows.speed.iter().map(variance))
    }
}

/// The likelihood at one set of numbers, and the best linear unknowns there.
#[derive(Debug, Clone, PartialEq)]
pub struct Evaluation {
    /// −2 ln L, but for a constant; infinite where one unknown cannot be told from others.
    pub objective: f64,
    /// ln det V.
    pub log_det: f64,
    /// Variance of the white noise.
    pub variance: f64,
    /// m: rows less unknowns of the mean.
    pub freedom: usize,
    /// The gain.
    pub gain: f64,
    /// Linear unknowns: gain if eliminated, offset if unknown, trim if there, unknown commands.
    pub linear: Vec<f64>,
    /// (JᵀV⁻¹J)⁻¹, row-major: the linear unknowns, a searched gain, delay, lags and zero.
    pub inverse: Vec<f64>,
    /// The whitened derivative by the delay, orthogonal to the linear unknowns, of norm one; empty
    /// where the delay is known.
    pub score: Vec<f64>,
    /// Whitened residuals in units of the white noise, zero in rows that are not used.
    pub whitened: Vec<f64>,
    /// Recorded output minus the mean.
    pub residuals: Vec<f64>,
    /// Slope of the response of a plant of this gain at the rows.
    pub rate: Vec<f64>,
    /// Derivatives by the searched numbers: gain, delay, lags, zero.
    pub(super) searched: Searched,
}

/// Slope and curvature of m ln r, by far the largest part of −2 ln L, by the numbers of the mean that
/// are searched; the curvature is that of Gauss and Newton.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Searched {
    pub(super) slope: Vec<f64>,
    /// Row-major.
    pub(super) curvature: Vec<f64>,
}

/// What is asked of an evaluation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Wanted {
    /// The objective alone, which is finite also where the numbers that are searched cannot be told
    /// apart.
    Value,
    /// With its slope and curvature.
    Slopes,
    /// All of it.
    All,
}

/// The numbers of rows and unknowns that an objective depends on.
pub(super) struct Counts {
    /// Rows that are used.
    pub(super) used: usize,
    /// Columns of J.
    pub(super) count: usize,
    /// Those that are linear; a gain that is searched is.
    pub(super) first: usize,
    /// Those that are eliminated.
    pub(super) linear: usize,
    /// Sum of squares of the output.
    pub(super) power: f64,
}

impl Counts {
    /// The rows and unknowns of a mean, whose columns are cleared in rows that are not used.
    fn of(rows: &Rows, mean: &mut Mean, values: &Values, count: usize) -> Self {
        let n = rows.time.len();
        let used = rows.used.iter().filter(|used| **used).count();
        if used < n {
            for column in mean.columns.chunks_exact_mut(n) {
                clear(column, &rows.used);
            }
        }
        let recorded = rows.output.iter().zip(&rows.used);
        Self {
            used,
            count,
            // The derivatives of the others follow it.
            first: mean.linear + usize::from(matches!(values.gain, Gain::Searched(_))),
            linear: mean.linear,
            power: recorded
                .filter(|(_, used)| **used)
                .map(|(y, _)| y * y)
                .sum(),
        }
    }

    /// The least sum of squares, and −2 ln L for these ln det V and ln det XᵀV⁻¹X − ln det XᵀX.
    pub(super) fn objective(&self, triangle: &Triangle, log_det: f64, log_gram: f64) -> (f64, f64) {
        let rest = &triangle.column(self.count)[self.linear..];
        let squares = rest
            .iter()
            .map(|e| e * e)
            .sum::<f64>()
            .max(ROUNDING * self.power);
        let m = (self.used - self.first) as f64;
        let objective = m * (squares / m).max(f64::MIN_POSITIVE).ln() + log_det + log_gram;
        let is_certain = objective.is_finite() && !triangle.is_dependent(self.count);
        (squares, if is_certain { objective } else { f64::INFINITY })
    }
}

/// −2 ln L under each of these noises, as `evaluate` for `Wanted::Value`.
pub(super) fn objectives(
    rows: &Rows,
    plant: &Plant,
    values: &Values,
    noises: &[Noise],
    by: &Derivatives,
    task: &Task,
) -> Result<Vec<f64>, Error> {
    let parts: Vec<Vec<Disturbance>> = noises.iter().map(Noise::disturbances).collect();
    let alike = parts.windows(2).all(|pair| pair[0].len() == pair[1].len());
    if noises.len() < 2 || !alike || !rows.commands.uncertain.is_empty() {
        let one = |noise| evaluate(rows, plant, values, noise, by, Wanted::Value, task);
        return noises
            .iter()
            .map(|noise| Ok(one(noise)?.objective))
            .collect();
    }
    let n = rows.time.len();
    let by = Derivatives::none();
    let (_, count) = sizes(rows, values, &by);
    let space = plant.space(&values.lags, values.zero);
    let mut mean = Mean::new(rows, plant, &space, values, &by, task)?;
    let counts = Counts::of(rows, &mut mean, values, count);
    let plain = Triangle::new(&mean.columns, n, counts.first, task)?.log_det(counts.first);
    let scatters = |noise: &Noise| noise.arrivals.hypot(noise.stamps);
    let kicked = noises.iter().any(|noise| scatters(noise) > 0.0);
    let kicks = kicks(rows, &space, values.delay, f64::from(u8::from(kicked)), 1.0)?;
    let shared = Shared {
        time: &rows.time,
        used: &rows.used,
        speed: &rows.speed,
        columns: &mean.columns,
        kicks: &kicks,
    };
    let each: Result<Vec<One>, Error> = noises
        .iter()
        .zip(&parts)
        .map(|(noise, parts)| {
            Ok(One {
                joint: Joint::new(&space, parts)?,
                stamps: noise.stamps,
                kick: scatters(noise),
            })
        })
        .collect();
    let triangles = triangles(shared, &each?, task)?;
    let objective = |(log_det, triangle): (f64, Triangle)| {
        let log_gram = triangle.log_det(counts.first) - plain;
        counts.objective(&triangle, log_det, log_gram).1
    };
    Ok(triangles.into_iter().map(objective).collect())
}

pub(super) fn evaluate(
    rows: &Rows,
    plant: &Plant,
    values: &Values,
    noise: &Noise,
    by: &Derivatives,
    wanted: Wanted,
    task: &Task,
) -> Result<Evaluation, Error> {
    let n = rows.time.len();
    let used = rows.used.iter().filter(|used| **used).count();
    let (_, count) = sizes(rows, values, by);
    refuse_if!(
        used <= count,
        "{used} rows for {count} unknowns: the likelihood needs more rows than unknowns"
    );
    let none = Derivatives::none();
    let by = if wanted == Wanted::Value { &none } else { by };
    let (_, count) = sizes(rows, values, by);
    let space = plant.space(&values.lags, values.zero);
    let mut mean = Mean::new(rows, plant, &space, values, by, task)?;
    let (linear, all) = (mean.linear, count + 1);
    let mut raw = Vec::new();
    if wanted == Wanted::All {
        // The linear columns and the output, to compute residuals from.
        raw = memory::copied(WHAT, &mean.columns[..linear * n])?;
        memory::append(WHAT, &mut raw, &mean.columns[count * n..])?;
    }
    let counts = Counts::of(rows, &mut mean, values, count);
    let first = counts.first;
    let disturbances = noise.disturbances();
    let kicks = kicks(
        rows,
        &space,
        values.delay,
        noise.arrivals.hypot(noise.stamps),
        noise.sensor.hypot(1.0),
    )?;
    let variances = noise.variances(rows)?;
    let mut log_det = 0.0;
    let mut log_gram = 0.0;
    let is_white = disturbances.is_empty() && kicks.is_empty() && variances.is_empty();
    if !is_white {
        log_gram = -Triangle::new(&mean.columns, n, first, task)?.log_det(first);
        let joint = Joint::new(&space, &disturbances)?;
        log_det = whiten_in_place(
            &rows.time,
            Known {
                used: &rows.used,
                variances: &variances,
            },
            &mut mean.columns,
            &joint,
            &kicks,
            task,
        )?;
    }
    let triangle = Triangle::new(&mean.columns, n, all, task)?;
    if !is_white {
        log_gram += triangle.log_det(first);
    }
    let (squares, objective) = counts.objective(&triangle, log_det, log_gram);
    let freedom = used - count;
    let variance = (squares / freedom as f64).max(f64::MIN_POSITIVE);
    let m = (used - first) as f64;
    let solved = triangle.solve(&triangle.column(count)[..linear]);
    let gain = match values.gain {
        Gain::Eliminated => solved.first().copied().unwrap_or(0.0),
        Gain::Searched(gain) | Gain::Known(gain) => gain,
    };
    // The derivatives by delay, lags and zero are those of a plant of unit gain.
    let factors: Vec<f64> = (linear..count)
        .map(|column| if column < first { 1.0 } else { gain })
        .collect();
    let mut found = Evaluation {
        objective,
        log_det,
        variance,
        freedom,
        gain,
        linear: Vec::new(),
        searched: searched(&triangle, linear, &factors, 2.0 * m / squares),
        inverse: Vec::new(),
        score: Vec::new(),
        whitened: Vec::new(),
        residuals: Vec::new(),
        rate: Vec::new(),
    };
    if wanted != Wanted::All {
        return Ok(found);
    }
    found.linear = solved;
    found.inverse = triangle.inverse(count)?;
    for (row, entries) in found.inverse.chunks_exact_mut(count.max(1)).enumerate() {
        for (column, entry) in entries.iter_mut().enumerate() {
            for _ in [row, column].iter().filter(|place| **place >= first) {
                *entry /= found.gain;
            }
        }
    }
    if by.delay {
        let mut unit = vec![0.0; first + 1];
        unit[first] = 1.0;
        found.score = memory::filled(WHAT, 0.0, n)?;
        subtract(&mut found.score, &triangle.solve(&unit), &mean.columns);
        found.score.iter_mut().for_each(|entry| *entry = -*entry);
    }
    found.whitened = memory::copied(WHAT, &mean.columns[count * n..])?;
    subtract(&mut found.whitened, &found.linear, &mean.columns);
    let deviation = variance.sqrt();
    found
        .whitened
        .iter_mut()
        .for_each(|entry| *entry /= deviation);
    found.residuals = memory::copied(WHAT, &raw[linear * n..])?;
    subtract(&mut found.residuals, &found.linear, &raw);
    found.rate = mean.rate;
    found.rate.iter_mut().for_each(|rate| *rate *= found.gain);
    Ok(found)
}

/// The derivatives from the triangle of the columns J and the output; `factors` scale those columns.
fn searched(triangle: &Triangle, linear: usize, factors: &[f64], scale: f64) -> Searched {
    let count = linear + factors.len();
    // What the linear unknowns leave of a column.
    let left = |column: usize| &triangle.column(column)[linear..];
    let rest = left(count);
    let mut slope = Vec::with_capacity(factors.len());
    let mut curvature = Vec::with_capacity(factors.len() * factors.len());
    for (i, factor) in factors.iter().enumerate() {
        let own = left(linear + i);
        slope.push(-scale * factor * dot(own, &rest[..own.len()]));
        for (j, other) in factors.iter().enumerate() {
            let column = left(linear + j);
            let both = own.len().min(column.len());
            curvature.push(scale * factor * other * dot(&own[..both], &column[..both]));
        }
    }
    Searched { slope, curvature }
}

/// Subtract the first columns, as many as factors, each times its factor.
fn subtract(from: &mut [f64], factors: &[f64], columns: &[f64]) {
    for (factor, column) in factors.iter().zip(columns.chunks_exact(from.len().max(1))) {
        for (from, entry) in from.iter_mut().zip(column) {
            *from -= factor * entry;
        }
    }
}

fn clear(column: &mut [f64], used: &[bool]) {
    for (entry, used) in column.iter_mut().zip(used) {
        if !used {
            *entry = 0.0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{
        cholesky, coloured, commands, forward, gaussian, gram, integral, integrated, log_det,
        recording, solve,
    };
    use super::*;

    const QUIET: Noise = Noise {
        air_time: 1.0,
        air: 0.0,
        sensor_time: 1.0,
        sensor: 0.0,
        stamps: 0.0,
        arrivals: 0.0,
    };
    const WINDY: Noise = Noise {
        air_time: 0.8,
        air: 3.0,
        sensor_time: 0.2,
        sensor: 0.5,
        stamps: 0.0,
        arrivals: 0.0,
    };
    const DELAY: f64 = 0.31;

    fn integrator() -> Plant {
        Plant::new(&[1.0], &[1.0, 0.0]).unwrap()
    }

    fn values(gain: Gain, lags: &[f64]) -> Values {
        Values {
            delay: DELAY,
            lags: lags.to_vec(),
            zero: 0.0,
            gain,
        }
    }

    fn by_delay(lags: usize) -> Derivatives {
        Derivatives {
            delay: true,
            lags: vec![true; lags],
            zero: false,
        }
    }

    /// Rows with a hole, noise, trim and a time of unknown command.
    fn rows(count: usize) -> Rows {
        let mut rows = recording(count);
        let sent = commands(&rows);
        let noise = gaussian(5, count);
        for (i, output) in rows.output.iter_mut().enumerate() {
            *output = 0.3 + 0.85 * integral(&sent, DELAY, rows.time[i]) + 0.01 * noise[i];
            rows.used[i] = !(20..26).contains(&i);
        }
        rows.trim = true;
        rows.commands.unknown = vec![(1.3, 1.69)];
        rows.checked().unwrap()
    }

    fn at(rows: &Rows, values: &Values, noise: &Noise) -> Evaluation {
        let by = by_delay(values.lags.len());
        evaluate(
            rows,
            &integrator(),
            values,
            noise,
            &by,
            Wanted::All,
            &Task::new(),
        )
        .unwrap()
    }

    /// −2 ln L by dense matrices, the linear unknowns, and the mean there.
    fn dense(
        rows: &Rows,
        noise: &Noise,
        kicks: &[(usize, f64)],
        known: Option<f64>,
    ) -> (f64, Vec<f64>) {
        let sent = commands(rows);
        let place: Vec<usize> = (0..rows.time.len()).filter(|i| rows.used[*i]).collect();
        let column = |of: &dyn Fn(f64) -> f64| -> Vec<f64> {
            place.iter().map(|i| of(rows.time[*i])).collect()
        };
        let response = column(&|t| integral(&sent, DELAY, t));
        let mut x = vec![column(&|_| 1.0), column(&|t| t - rows.time[0])];
        for (start, end) in &rows.commands.unknown {
            x.push(column(&|t| {
                integral(&[(*start, 1.0), (*end, 0.0)], DELAY, t)
            }));
        }
        if known.is_none() {
            x.insert(0, response.clone());
        }
        let y: Vec<f64> = place
            .iter()
            .zip(&response)
            .map(|(i, response)| rows.output[*i] - known.unwrap_or(0.0) * response)
            .collect();
        let v: Vec<Vec<f64>> = place
            .iter()
            .map(|i| {
                let entry = |j: &usize| {
                    let (s, t) = (rows.time[*i] - rows.time[0], rows.time[*j] - rows.time[0]);
                    let kicked = kicks.iter().filter(|(row, _)| row <= i && row <= j);
                    let moved = noise.stamps * rows.speed.get(*i).copied().unwrap_or(0.0);
                    f64::from(u8::from(i == j)) * (1.0 + moved * moved)
                        + integrated(noise.air, noise.air_time, s, t)
                        + coloured(noise.sensor, noise.sensor_time, s, t)
                        + kicked.map(|(_, size)| size * size).sum::<f64>()
                };
                place.iter().map(entry).collect()
            })
            .collect();
        let l = cholesky(&v);
        let white = |columns: &[Vec<f64>]| -> Vec<Vec<f64>> {
            columns.iter().map(|column| forward(&l, column)).collect()
        };
        let target = forward(&l, &y);
        let whitened = white(&x);
        let product = |a: &[f64]| -> f64 { a.iter().zip(&target).map(|(a, b)| a * b).sum() };
        let right: Vec<f64> = whitened.iter().map(|column| product(column)).collect();
        let linear = solve(&gram(&whitened), &right);
        let explained: f64 = linear.iter().zip(&right).map(|(a, b)| a * b).sum();
        let m = (place.len() - x.len()) as f64;
        let objective = m * ((product(&target) - explained) / m).ln()
            + log_det(&l)
            + log_det(&cholesky(&gram(&whitened)))
            - log_det(&cholesky(&gram(&x)));
        (objective, linear)
    }

    #[test]
    fn the_objective_is_that_of_dense_matrices() {
        let rows = rows(90);
        for noise in [QUIET, WINDY] {
            for known in [None, Some(0.8)] {
                let gain = known.map_or(Gain::Eliminated, Gain::Known);
                let found = at(&rows, &values(gain, &[]), &noise);
                let (objective, linear) = dense(&rows, &noise, &[], known);
                assert!((found.objective - objective).abs() < 1e-7, "{found:?}");
                assert_eq!(found.linear.len(), linear.len());
                for (found, expected) in found.linear.iter().zip(&linear) {
                    assert!((found - expected).abs() < 1e-9);
                }
            }
        }
    }

    #[test]
    fn the_error_of_a_command_is_in_the_objective() {
        let mut rows = rows(90);
        rows.commands.unknown.clear();
        // The first ends when row 40 is read; the second has no row any more.
        rows.commands.uncertain = vec![(2.0, 2.6 - DELAY, 0.5), (5.0, 9.0, 1.0)];
        let rows = rows.checked().unwrap();
        for noise in [QUIET, WINDY] {
            let found = at(&rows, &values(Gain::Eliminated, &[]), &noise);
            let size = 0.5 * noise.sensor.hypot(1.0) * (2.6 - DELAY - 2.0);
            let (objective, _) = dense(&rows, &noise, &[(40, size)], None);
            assert!((found.objective - objective).abs() < 1e-7);
        }
    }

    #[test]
    fn scattered_times_are_in_the_objective() {
        let mut rows = rows(90);
        rows.speed = rows.time.iter().map(|t| (3.0 * t).sin()).collect();
        let rows = rows.checked().unwrap();
        let sent = commands(&rows);
        for noise in [QUIET, WINDY] {
            let noise = Noise {
                stamps: 1.5,
                arrivals: 2.0,
                ..noise
            };
            // Every command that changes moves the rows after its arrival, both scatters together.
            let kicks: Vec<(usize, f64)> = sent
                .windows(2)
                .map(|pair| {
                    let row = rows.time.partition_point(|time| *time < pair[1].0 + DELAY);
                    (row, 2.5 * (pair[1].1 - pair[0].1))
                })
                .collect();
            let found = at(&rows, &values(Gain::Eliminated, &[]), &noise);
            let (objective, _) = dense(&rows, &noise, &kicks, None);
            assert!((found.objective - objective).abs() < 1e-7);
        }
    }

    #[test]
    fn delay_and_zero_of_a_response_that_jumps_are_dependent_at_any_lag() {
        // Commands arrive between the same rows, whatever the delay in between.
        let mut rows = recording(300);
        let step = 0.05;
        rows.time = (0..300).map(|i| step * f64::from(i)).collect();
        rows.commands.time = (0..30).map(|i| 10.0 * step * f64::from(i)).collect();
        rows.commands.value = (0..30).map(|i| f64::from(i % 3) - 0.7).collect();
        rows.output = gaussian(3, 300);
        rows.used = vec![true; 300];
        let rows = rows.checked().unwrap();
        let by = Derivatives {
            zero: true,
            ..by_delay(1)
        };
        let plant = Plant::new(&[1.0], &[1.0]).unwrap();
        for lag in [1e-3, 0.01, 0.03, 0.1, 0.5] {
            for zero in [-0.1, 1e-3, 0.2] {
                for noise in [QUIET, WINDY] {
                    let at = Values {
                        delay: 0.12,
                        zero,
                        ..values(Gain::Eliminated, &[lag])
                    };
                    let (wanted, task) = (Wanted::Slopes, Task::new());
                    let found = evaluate(&rows, &plant, &at, &noise, &by, wanted, &task).unwrap();
                    assert_eq!(found.objective, f64::INFINITY, "{lag} {zero}");
                }
            }
        }
    }

    #[test]
    fn several_noises_at_once_have_the_objective_of_each() {
        // More rows than a block, more noises than lanes; some scatter, and two have no air.
        let mut rows = rows(300);
        rows.speed = rows.time.iter().map(|t| (3.0 * t).sin()).collect();
        let mut computed = rows.clone();
        computed.commands.uncertain = vec![(2.0, 2.3, 0.5)];
        let noise = |k: u32| Noise {
            air: if k < 2 { 0.0 } else { 0.3 * f64::from(k) },
            stamps: f64::from(k % 3),
            arrivals: f64::from(k % 4),
            ..WINDY
        };
        let (plant, task) = (integrator(), Task::new());
        for rows in [rows, computed] {
            let rows = rows.checked().unwrap();
            for gain in [Gain::Eliminated, Gain::Searched(0.8), Gain::Known(0.8)] {
                for noises in [(0..2), (2..13), (0..13)] {
                    let noises: Vec<Noise> = noises.map(noise).collect();
                    let (values, by) = (values(gain, &[0.1, 0.03]), by_delay(2));
                    let found = objectives(&rows, &plant, &values, &noises, &by, &task).unwrap();
                    assert_eq!(found.len(), noises.len());
                    for (found, noise) in found.iter().zip(&noises) {
                        let one =
                            evaluate(&rows, &plant, &values, noise, &by, Wanted::Value, &task);
                        let expected = one.unwrap().objective;
                        assert!((found - expected).abs() < 1e-9 * expected.abs());
                    }
                }
            }
        }
    }

    #[test]
    fn residuals_score_and_covariance_are_those_of_the_fit() {
        let rows = rows(90);
        let found = at(&rows, &values(Gain::Eliminated, &[0.1]), &WINDY);
        let norm = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>();
        assert!((norm(&found.score) - 1.0).abs() < 1e-12);
        let unused = rows.used.iter().zip(&found.score).zip(&found.whitened);
        assert!(
            unused
                .filter(|((used, _), _)| !**used)
                .all(|((_, s), w)| *s == 0.0 && *w == 0.0)
        );
        // Gain, offset, trim and the unknown command are eliminated; delay and lag are searched.
        assert_eq!(found.freedom, 84 - 6);
        assert!((norm(&found.whitened) / found.freedom as f64 - 1.0).abs() < 1e-9);
        assert_eq!(found.gain, found.linear[0]);
        assert_eq!(found.inverse.len(), 36);
        // Without noise beside the white the residuals are those, but for their scale.
        let white = at(&rows, &values(Gain::Eliminated, &[0.1]), &QUIET);
        for i in (0..90).filter(|i| rows.used[*i]) {
            let expected = white.whitened[i] * white.variance.sqrt();
            assert!((white.residuals[i] - expected).abs() < 1e-12);
        }
        // The delay is known as well as the part of its derivative that no linear unknown explains.
        let alone = at(&rows, &values(Gain::Eliminated, &[]), &QUIET);
        let sent = commands(&rows);
        let slope: f64 = rows
            .time
            .iter()
            .zip(&rows.used)
            .zip(&alone.score)
            .filter(|((_, used), _)| **used)
            .map(|((t, _), score)| {
                let arrived = sent.iter().rev().find(|(from, _)| from + DELAY <= *t);
                -arrived.map_or(0.0, |(_, value)| *value) * score
            })
            .sum();
        let stretch = slope * alone.gain;
        assert!((alone.inverse[24] * stretch * stretch - 1.0).abs() < 1e-9);
    }

    #[test]
    fn rows_that_are_not_used_have_no_influence() {
        let first = rows(90);
        let expected = at(&first, &values(Gain::Eliminated, &[0.1]), &WINDY);
        for value in [f64::NAN, f64::INFINITY, -1e300, 0.0] {
            let mut other = first.clone();
            for (output, used) in other.output.iter_mut().zip(&first.used) {
                if !used {
                    *output = value;
                }
            }
            let found = at(
                &other.checked().unwrap(),
                &values(Gain::Eliminated, &[0.1]),
                &WINDY,
            );
            assert_eq!(found.objective, expected.objective);
            assert_eq!(found.linear, expected.linear);
            assert_eq!(found.inverse, expected.inverse);
            assert_eq!(found.whitened, expected.whitened);
        }
    }

    #[test]
    fn differences_of_the_objective_do_not_depend_on_units() {
        let first = rows(90);
        let mut other = first.clone();
        other.output.iter_mut().for_each(|y| *y *= 1e3);
        other.commands.value.iter_mut().for_each(|u| *u *= 250.0);
        let difference = |rows: &Rows| {
            at(rows, &values(Gain::Eliminated, &[0.1]), &WINDY).objective
                - at(rows, &values(Gain::Eliminated, &[0.3]), &QUIET).objective
        };
        assert!((difference(&first) - difference(&other)).abs() < 1e-6);
    }

    #[test]
    fn fewer_rows_than_unknowns_are_refused() {
        let mut rows = rows(40);
        rows.used.iter_mut().skip(5).for_each(|used| *used = false);
        let by = by_delay(0);
        let values = values(Gain::Eliminated, &[]);
        let found = evaluate(
            &rows,
            &integrator(),
            &values,
            &QUIET,
            &by,
            Wanted::Slopes,
            &Task::new(),
        );
        assert!(found.is_err_and(|error| error.to_string().starts_with("5 rows for 5 unknowns")));
    }

    #[test]
    fn an_unknown_that_shows_in_no_row_makes_the_objective_infinite() {
        let mut rows = rows(90);
        rows.commands.value.fill(0.0);
        let found = at(&rows, &values(Gain::Eliminated, &[]), &WINDY);
        assert_eq!(found.objective, f64::INFINITY);
    }
}
