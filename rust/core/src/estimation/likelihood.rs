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

use super::disturbance::{Disturbance, Entry, Joint};
use super::kicks::kicks;
use super::mean::{Derivatives, Gain, Mean, Values, sizes};
use super::noises::{One, Shared, triangles};
use super::plant::{Plant, PlantSpace};
use super::rows::Rows;
use super::whiten::{Kick, Known, whiten_in_place};
use crate::linear_algebra::triangle::Triangle;
use crate::linear_algebra::vectors::dot;
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
    /// White noise alone.
    pub const QUIET: Self = Self {
        air_time: 1.0,
        air: 0.0,
        sensor_time: 1.0,
        sensor: 0.0,
        stamps: 0.0,
        arrivals: 0.0,
    };

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
                "the times of {what} have a standard deviation of {scatter}: give a finite \
                 number, zero or more"
            );
        }
        self.parts().iter().try_for_each(Disturbance::check)
    }

    pub(super) fn disturbances(&self) -> Vec<Disturbance> {
        let parts = self.parts().into_iter();
        parts.filter(|part| part.deviation > 0.0).collect()
    }

    /// With the lags and the zero of the mean.
    pub(super) fn through(self, values: &Values) -> Through {
        Through {
            noise: self,
            lags: values.lags.clone(),
            zero: values.zero,
        }
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

/// Noise, and the lags and the zero that its air passes: those of the mean but for difference quotients.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Through {
    pub(super) noise: Noise,
    pub(super) lags: Vec<f64>,
    pub(super) zero: f64,
}

impl Through {
    fn joint(&self, plant: &Plant) -> Result<Joint, Error> {
        let space = plant.space(&self.lags, self.zero);
        Joint::new(&space, &self.noise.disturbances())
    }
}

/// What makes noise that is not white alone white.
pub(super) struct Whitening<'a> {
    rows: &'a Rows,
    variances: Vec<f64>,
    joint: Joint,
    kicks: Vec<Kick>,
}

impl<'a> Whitening<'a> {
    /// None where the noise is white alone.
    pub(super) fn new(
        rows: &'a Rows,
        plant: &Plant,
        space: &PlantSpace,
        values: &Values,
        through: &Through,
    ) -> Result<Option<Self>, Error> {
        let noise = through.noise;
        let scatter = noise.arrivals.hypot(noise.stamps);
        let kicks = kicks(rows, space, values.delay, scatter, noise.sensor.hypot(1.0))?;
        let variances = noise.variances(rows)?;
        if noise.disturbances().is_empty() && kicks.is_empty() && variances.is_empty() {
            return Ok(None);
        }
        Ok(Some(Self {
            rows,
            variances,
            joint: through.joint(plant)?,
            kicks,
        }))
    }

    /// Whiten columns in place. Returns ln det V.
    pub(super) fn whiten(&self, columns: &mut [f64], task: &Task) -> Result<f64, Error> {
        let known = Known {
            used: &self.rows.used,
            variances: &self.variances,
        };
        whiten_in_place(
            &self.rows.time,
            known,
            columns,
            &self.joint,
            &self.kicks,
            task,
        )
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
    /// With the covariance of the unknowns, too.
    Covariance,
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
    pub(super) fn of(rows: &Rows, mean: &mut Mean, values: &Values, count: usize) -> Self {
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

    /// What is wanted but for the rows.
    fn evaluation(
        &self,
        triangle: &Triangle,
        gain: Gain,
        (log_det, log_gram): (f64, f64),
        wanted: Wanted,
    ) -> Result<Evaluation, Error> {
        let Self {
            used,
            count,
            first,
            linear,
            ..
        } = *self;
        let (squares, objective) = self.objective(triangle, log_det, log_gram);
        let freedom = used - count;
        let m = (used - first) as f64;
        let solved = triangle.solve(&triangle.column(count)[..linear]);
        let gain = match gain {
            Gain::Eliminated => solved.first().copied().unwrap_or(0.0),
            Gain::Searched(gain) | Gain::Known(gain) => gain,
        };
        // The derivatives by delay, lags and zero are those of a plant of unit gain.
        let factors: Vec<f64> = (linear..count)
            .map(|column| if column < first { 1.0 } else { gain })
            .collect();
        let mut inverse = Vec::new();
        if matches!(wanted, Wanted::Covariance | Wanted::All) {
            inverse = triangle.inverse(count)?;
        }
        for (row, entries) in inverse.chunks_exact_mut(count.max(1)).enumerate() {
            for (column, entry) in entries.iter_mut().enumerate() {
                for _ in [row, column].iter().filter(|place| **place >= first) {
                    *entry /= gain;
                }
            }
        }
        Ok(Evaluation {
            objective,
            log_det,
            variance: (squares / freedom as f64).max(f64::MIN_POSITIVE),
            freedom,
            gain,
            linear: solved,
            searched: searched(triangle, linear, &factors, 2.0 * m / squares),
            inverse,
            score: Vec::new(),
            whitened: Vec::new(),
            residuals: Vec::new(),
            rate: Vec::new(),
        })
    }
}

/// As `evaluate` under each of these noises; the rows are not wanted.
pub(super) fn evaluations(
    rows: &Rows,
    plant: &Plant,
    values: &Values,
    noises: &[Through],
    by: &Derivatives,
    wanted: Wanted,
    task: &Task,
) -> Result<Vec<Evaluation>, Error> {
    let parts = |one: &Through| one.noise.disturbances().len();
    let alike = noises
        .windows(2)
        .all(|pair| parts(&pair[0]) == parts(&pair[1]));
    if noises.len() < 2 || !alike || !rows.commands.uncertain.is_empty() {
        let one = |noise| evaluate(rows, plant, values, noise, by, wanted, task);
        return noises.iter().map(one).collect();
    }
    check_count(rows, values, by)?;
    let n = rows.time.len();
    let none = Derivatives::none();
    let by = if wanted == Wanted::Value { &none } else { by };
    let (_, count) = sizes(rows, values, by);
    let space = plant.space(&values.lags, values.zero);
    let mut mean = Mean::new(rows, plant, &space, values, by, task)?;
    let counts = Counts::of(rows, &mut mean, values, count);
    let plain = Triangle::new(&mean.columns, n, counts.first, task)?.log_det(counts.first);
    let scatters = |noise: &Noise| noise.arrivals.hypot(noise.stamps);
    let kicked = noises.iter().any(|one| scatters(&one.noise) > 0.0);
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
        .map(|one| {
            Ok(One {
                joint: one.joint(plant)?,
                stamps: one.noise.stamps,
                kick: scatters(&one.noise),
            })
        })
        .collect();
    let triangles = triangles(shared, &each?, task)?;
    let evaluation = |(log_det, triangle): (f64, Triangle)| {
        let log_gram = triangle.log_det(counts.first) - plain;
        counts.evaluation(&triangle, values.gain, (log_det, log_gram), wanted)
    };
    triangles.into_iter().map(evaluation).collect()
}

/// An error unless there are more rows than unknowns.
pub(super) fn check_count(rows: &Rows, values: &Values, by: &Derivatives) -> Result<(), Error> {
    let used = rows.used.iter().filter(|used| **used).count();
    let (_, count) = sizes(rows, values, by);
    refuse_if!(
        used <= count,
        "{used} rows are too few for {count} unknowns: the likelihood needs more rows than \
         unknowns"
    );
    Ok(())
}

/// The likelihood under one noise; all of it only if wanted.
pub(super) fn evaluate(
    rows: &Rows,
    plant: &Plant,
    values: &Values,
    through: &Through,
    by: &Derivatives,
    wanted: Wanted,
    task: &Task,
) -> Result<Evaluation, Error> {
    let n = rows.time.len();
    check_count(rows, values, by)?;
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
    let mut log_det = 0.0;
    let mut log_gram = 0.0;
    let whitening = Whitening::new(rows, plant, &space, values, through)?;
    if let Some(whitening) = &whitening {
        log_gram = -Triangle::new(&mean.columns, n, first, task)?.log_det(first);
        log_det = whitening.whiten(&mut mean.columns, task)?;
    }
    let triangle = Triangle::new(&mean.columns, n, all, task)?;
    if whitening.is_some() {
        log_gram += triangle.log_det(first);
    }
    let mut found = counts.evaluation(&triangle, values.gain, (log_det, log_gram), wanted)?;
    if wanted != Wanted::All {
        return Ok(found);
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
    let deviation = found.variance.sqrt();
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

pub(super) fn clear(column: &mut [f64], used: &[bool]) {
    for (entry, used) in column.iter_mut().zip(used) {
        if !used {
            *entry = 0.0;
        }
    }
}

#[cfg(test)]
mod tests;
