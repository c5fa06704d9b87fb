//! A minimum with the errors of its numbers and how many of them the input tells.

use super::along_zero::Along;
use super::between::{Open, open};
use super::class::{Class, Numbers};
use super::dispersion::{dispersion, whiteness};
use super::flexible::flexible;
use super::information::{covariance, products};
use super::loop_view::Seen;
use super::minima::Minimum;
use super::model::Point;
use super::noise::{Coefficients, Noise};
use super::tolerances::{ALONG, EVIDENCE};
use crate::estimation::statistics::student_reach;
use crate::linear_algebra::eigenvalues::eigenvalues;
use crate::linear_algebra::vectors::dot;
use crate::{Error, Task};

/// Share by which two sums of the same squares differ at most, as the records are added up.
const ALIKE: f64 = 1e-9;

/// One class of plants, fitted.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// The class of the plant.
    pub class: Class,
    /// The numbers that are searched.
    pub numbers: Numbers,
    /// The static gain, or that of the integrator.
    pub gain: f64,
    /// What a loop feels of it, with what the command explains beside the class.
    seen: Seen,
    /// The noise that suits it best, and its coefficients.
    pub noise: Noise,
    /// Its coefficients.
    pub coefficients: Coefficients,
    /// Values in the order of [`Class::numbers`].
    pub values: Vec<f64>,
    /// Their covariance, row-major, with the dispersion.
    pub covariance: Vec<f64>,
    /// The factor of the variance by which numbers scatter more than the likelihood says.
    pub dispersion: f64,
    /// The quantile that goes with the standard errors.
    pub quantile: f64,
    freedom: f64,
    /// −2 ln L.
    pub deviance: f64,
    /// −2 ln L and ln n for each number.
    pub bic: f64,
    /// How many numbers that are.
    pub parameters: usize,
    /// How many numbers of the plant the input tells.
    pub told: usize,
    /// The number at the end of its range, if one is.
    pub limit: Option<&'static str>,
    /// Probability that white residuals are correlated as much.
    pub white: f64,
    /// Standard deviation of the residuals, and of one-step errors.
    pub deviation: f64,
    /// That of one-step errors.
    pub innovation: f64,
    /// Of each record: output less model, NaN where no row counts.
    pub residuals: Vec<Vec<f64>>,
    /// Of each record: the output of the model, NaN where no row counts.
    pub fitted: Vec<Vec<f64>>,
    /// Of each record: standard deviation of the residuals.
    pub deviations: Vec<f64>,
    /// Covariance of ln gain, delay, ln of the numbers of the lags, zero.
    pub(super) inner: Vec<f64>,
    /// The plant and the covariance without an error of its class.
    plain: Option<(Seen, Vec<f64>)>,
    /// Where its numbers are no straight lines, the class with other zeros.
    along: Option<Along>,
    row: f64,
}

impl Candidate {
    /// Errors of a minimum; where it may be, with that of its class.
    pub(super) fn new(found: &Minimum<'_>, level: f64, may_be_wrong: bool) -> Self {
        let model = &found.model;
        let (rows, point) = (model.rows, &found.point);
        let mut seen = Seen {
            class: model.class,
            gain: model.gain(point),
            numbers: model.numbers(&point.x),
            series: None,
        };
        let noise = model.noise.coefficients(&point.x[model.plant_numbers()..]);
        let count = rows.count();
        let free = count.saturating_sub(model.parameters()).max(1) as f64;
        let variance = point.squares / free;
        let sensitivities = model.sensitivities(point);
        let scales: Vec<f64> = (0..seen.count())
            .map(|at| seen.scale(at, rows.row))
            .collect();
        let flexible = if may_be_wrong && rows.flexible {
            flexible(found)
        } else {
            None
        };
        let mut bic = found.bic;
        let places = rows.places();
        let information = products(&sensitivities, &scales, variance);
        let known = covariance(&information, &scales, 1.0);
        let open = open(model, point, &sensitivities, &known, variance);
        let white = if is_rounding(point) {
            1.0
        } else {
            whiteness(&point.whitened, model.noise.searched())
        };
        let mut plain = None;
        let (inner, factor, freedom) = if let Some(own) = flexible {
            plain = Some((seen, known));
            seen = own.seen;
            bic = own.bic;
            own.errors(rows.row, free, &places)
        } else {
            let is_white = white >= EVIDENCE.white;
            let (factor, freedom) =
                dispersion(&sensitivities, &point.whitened, variance, is_white, &places);
            let rest = factor / explained(&open, &information, &scales);
            if open.share > 0.0 {
                (
                    with_open(&open, known, rest.max(1.0)),
                    rest.max(1.0),
                    freedom,
                )
            } else {
                (covariance(&information, &scales, factor), factor, freedom)
            }
        };
        let scatter = |residual: &[f64]| {
            let known: Vec<f64> = residual.iter().copied().filter(|y| y.is_finite()).collect();
            (dot(&known, &known) / known.len().max(1) as f64).sqrt()
        };
        // Of one record the weight is 1, of several their sum of squares is that of white noise of size 1.
        let weights = &rows.weights;
        let mean_weight = (dot(weights, weights) / weights.len().max(1) as f64).sqrt();
        let mut out = Self {
            class: model.class,
            numbers: model.numbers(&point.x),
            gain: model.gain(point),
            seen,
            noise: model.noise,
            coefficients: noise,
            values: Vec::new(),
            covariance: Vec::new(),
            dispersion: factor,
            quantile: student_reach(level, freedom),
            freedom,
            deviance: found.deviance,
            bic,
            parameters: model.parameters(),
            told: told(&information, scales.len()),
            limit: found.limit(),
            white,
            deviation: 0.0,
            innovation: variance.sqrt() / mean_weight,
            residuals: Vec::new(),
            fitted: Vec::new(),
            deviations: Vec::new(),
            inner,
            plain,
            along: None,
            row: rows.row,
        };
        for (part, place) in rows.parts.iter().zip(rows.places()) {
            let own = &point.residual[place];
            let mut residuals = vec![f64::NAN; part.time.len()];
            let mut fitted = residuals.clone();
            let (own, output) = part.shown(own);
            for ((at, residual), output) in part.used.iter().zip(&own).zip(output) {
                residuals[*at] = *residual;
                fitted[*at] = output + part.mean - residual;
            }
            out.deviations.push(scatter(&own));
            out.residuals.push(residuals);
            out.fitted.push(fitted);
        }
        let each = rows.parts.iter().zip(rows.places());
        let each = each.map(|(part, place)| part.shown(&point.residual[place]).0);
        out.deviation = scatter(&each.flatten().collect::<Vec<f64>>());
        out.name_values();
        out
    }

    /// Values and covariance of the named numbers.
    fn name_values(&mut self) {
        let seen = self.seen();
        let names = self.class.numbers();
        let number = |name: &str| {
            if name == "gain" {
                self.gain
            } else {
                self.numbers.named(name)
            }
        };
        self.values = names.iter().map(|name| number(name)).collect();
        // The order inside is ln gain, delay, …; d value/d ln value is the value.
        let places: Vec<(usize, f64)> = names
            .iter()
            .enumerate()
            .map(|(at, name)| match *name {
                "delay" => (1, 1.0),
                "gain" => (0, self.gain),
                "zero" => (at, 1.0),
                _ => (at, self.values[at]),
            })
            .collect();
        let n = seen.count();
        self.covariance = places
            .iter()
            .flat_map(|(i, left)| {
                places
                    .iter()
                    .map(move |(j, right)| (i * n + j, left * right))
            })
            .map(|(at, factor)| factor * self.inner[at])
            .collect();
    }

    /// The same with intervals of another level.
    pub(super) fn at_level(&self, level: f64) -> Self {
        Self {
            quantile: student_reach(level, self.freedom),
            ..self.clone()
        }
    }

    /// Standard errors of the values.
    pub fn errors(&self) -> Vec<f64> {
        let n = self.values.len();
        (0..n)
            .map(|at| self.covariance[at * (n + 1)].max(0.0).sqrt())
            .collect()
    }

    /// Frequency and damping of a pair of complex poles, NaN where there is none.
    pub fn poles(&self) -> (f64, f64) {
        self.numbers.pair().unwrap_or((f64::NAN, f64::NAN))
    }

    /// Does the record show an error of its class?
    pub(super) const fn errs(&self) -> bool {
        self.seen.series.is_some()
    }

    /// The residuals as a share of what the model moves.
    pub(super) fn unexplained(&self) -> f64 {
        let pairs = self.residuals.iter().zip(&self.fitted);
        let (mut left, mut moved) = (0.0, 0.0);
        for (residuals, fitted) in pairs {
            left += squares_about_mean(residuals);
            moved += squares_about_mean(fitted);
        }
        (left / moved).sqrt()
    }

    pub(super) const fn seen(&self) -> Seen {
        self.seen
    }

    /// A quantity and its interval.
    pub(super) fn interval(&self, of: impl Fn(&Seen) -> f64) -> (f64, f64, f64) {
        self.interval_by(&self.seen, &self.inner, &of)
    }

    /// A number of the class and its interval. Where the class is in error, its numbers are less well known than
    /// what a loop feels: they are those with the error and those without it.
    pub(super) fn interval_of_class(&self, of: impl Fn(&Seen) -> f64) -> (f64, f64, f64) {
        if let Some(along) = &self.along {
            return self.interval_along(along, &of);
        }
        let with = self.interval(&of);
        let Some((seen, inner)) = &self.plain else {
            return with;
        };
        let without = self.interval_by(seen, inner, &of);
        (without.0, with.1.min(without.1), with.2.max(without.2))
    }

    /// The same over all zeros that the record leaves open.
    fn interval_along(&self, along: &Along, of: &dyn Fn(&Seen) -> f64) -> (f64, f64, f64) {
        let (seen, inner, factor) = self.without_error();
        let beside = self.beside_zero(inner, seen.count());
        let (value, low, high) = self.interval_by(&seen, &beside, of);
        let half_width = |rise: f64| 0.5 * (high - low) * (rise / factor).sqrt() / self.quantile;
        let ends = along.ends(factor * self.quantile * self.quantile, of, half_width);
        let (mut low, mut high) = (low.min(ends.0), high.max(ends.1));
        if self.plain.is_some() {
            let beside = self.beside_zero(&self.inner, self.seen.count());
            let with = self.interval_by(&self.seen, &beside, of);
            (low, high) = (low.min(with.1), high.max(with.2));
        }
        (value, low, high)
    }

    /// The plant without an error of its class, the covariance of its numbers, and the dispersion in it.
    fn without_error(&self) -> (Seen, &[f64], f64) {
        match &self.plain {
            Some((seen, inner)) => (*seen, inner, 1.0),
            None => (self.seen, &self.inner, self.dispersion),
        }
    }

    /// A covariance of so many numbers where the zero is given.
    fn beside_zero(&self, inner: &[f64], count: usize) -> Vec<f64> {
        let zero = self.class.searched();
        let variance = inner[zero * (count + 1)];
        let mut out = inner.to_vec();
        for i in 0..count {
            for j in 0..count {
                out[i * count + j] -= inner[i * count + zero] * inner[zero * count + j] / variance;
            }
        }
        out
    }

    /// Follow the class along its zero, where slopes at one point do not say what its numbers are.
    pub(super) fn follow_zero(&mut self, found: &Minimum<'_>, task: &Task) -> Result<(), Error> {
        if !self.class.has_zero {
            return Ok(());
        }
        let (seen, inner, factor) = self.without_error();
        let zero = self.class.searched();
        let half = self.quantile * inner[zero * (seen.count() + 1)].sqrt();
        let is_wide = half > ALONG.wide * seen.scale(zero, self.row);
        if is_wide || self.told < self.values.len() {
            self.along = Some(Along::new(found, seen, factor * ALONG.rise, task)?);
        }
        Ok(())
    }

    fn interval_by(
        &self,
        seen: &Seen,
        inner: &[f64],
        of: &dyn Fn(&Seen) -> f64,
    ) -> (f64, f64, f64) {
        let gradient = seen.gradient(self.row, of);
        let n = gradient.len();
        let mut variance = 0.0;
        for (i, left) in gradient.iter().enumerate() {
            variance += left * dot(&inner[i * n..][..n], &gradient);
        }
        let reach = self.quantile * variance.max(0.0).sqrt();
        let value = of(seen);
        (value, value - reach, value + reach)
    }
}

/// The covariance with what the rows of the command leave open, times a dispersion.
fn with_open(open: &Open, mut noise: Vec<f64>, factor: f64) -> Vec<f64> {
    for (entry, more) in noise.iter_mut().zip(&open.covariance) {
        *entry = factor * (*entry * (1.0 - open.share) + more);
    }
    noise
}

/// The dispersion that open areas explain: they are a part of the scatter that blocks of rows show.
fn explained(open: &Open, information: &[f64], scales: &[f64]) -> f64 {
    let n = scales.len();
    let mut trace = 0.0;
    for i in 0..n {
        for j in 0..n {
            trace += information[i * n + j] * open.covariance[j * n + i] / (scales[i] * scales[j]);
        }
    }
    (1.0 - open.share + trace / n.max(1) as f64).max(1.0)
}

/// The sum of squares about the mean of the values that are known.
fn squares_about_mean(values: &[f64]) -> f64 {
    let known = || values.iter().filter(|value| value.is_finite());
    let mean = known().sum::<f64>() / known().count().max(1) as f64;
    known().map(|value| (value - mean).powi(2)).sum()
}

/// Are the residuals smaller than what is taken for the rounding of the output?
fn is_rounding(point: &Point) -> bool {
    dot(&point.whitened, &point.whitened) < (1.0 - ALIKE) * point.squares
}

/// How many combinations of numbers stand out of the noise.
fn told(information: &[f64], n: usize) -> usize {
    let least = EVIDENCE.told * EVIDENCE.told;
    eigenvalues(information, n).map_or(0, |values| {
        values.iter().filter(|value| value.re > least).count()
    })
}
