//! A class with its error: the numbers of the plant and the factors of its series, searched together.
//!
//! Around a point the output of k (1 + Σ c_j L_j) G is linear in all of them. Each step solves that with
//! c ~ N(0, s²), where s is as large as the marginal likelihood allows, and is shortened until the likelihood with
//! the prior rises: the misfit of a class may be many times the noise.

use std::ops::Range;

use super::dispersion::{dispersion, whiteness};
use super::information::{UNKNOWN, covariance, products};
use super::loop_view::Seen;
use super::minima::Minimum;
use super::model::{Model, Point};
use super::noise::Noise;
use super::projection::Projection;
use super::random::{Size, sizes};
use super::series::{Series, TERMS};
use super::tolerances::{EVIDENCE, SEARCH, SERIES};
use crate::elementary::{exp, log};
use crate::linear_algebra::vectors::{add_multiple, dot};

/// A class with the error that the record shows.
pub(super) struct Flexible {
    pub(super) seen: Seen,
    /// BIC with one number more, for the size of the error.
    pub(super) bic: f64,
    /// The noise, and what is searched of plant and noise.
    pub(super) noise: Noise,
    pub(super) x: Vec<f64>,
    here: Around,
    deviation: f64,
}

/// The model at a point: whitened columns beside the linear numbers, and what it leaves.
struct Around {
    /// Of the numbers of the plant.
    plant: Vec<Vec<f64>>,
    /// Of the terms of the series.
    terms: Vec<Vec<f64>>,
    left: Vec<f64>,
    squares: f64,
}

/// Plant and series.
#[derive(Clone)]
struct Place {
    x: Vec<f64>,
    gain: f64,
    series: Series,
}

impl Flexible {
    /// The whitened columns of all numbers, and what they leave.
    pub(super) fn columns(&self) -> (impl Iterator<Item = &Vec<f64>>, &[f64]) {
        let all = self.here.plant.iter().chain(&self.here.terms);
        (all, &self.here.left)
    }

    /// The covariance of all numbers, its factor of over-dispersion and the degrees of freedom of that.
    pub(super) fn errors(
        &self,
        row: f64,
        free: f64,
        places: &[Range<usize>],
    ) -> (Vec<f64>, f64, f64) {
        let variance = self.here.squares / free;
        let is_white = whiteness(&self.here.left, self.noise.searched()) >= EVIDENCE.white;
        let (factor, freedom) = dispersion(
            &self.here.plant,
            &self.here.left,
            variance,
            is_white,
            places,
        );
        let (columns, scales) = self.here.columns(&self.seen, row, self.deviation);
        let information = products(&columns, &scales, factor * variance);
        (covariance(&information, &scales, 1.0), factor, freedom)
    }
}

impl Around {
    fn new(model: &Model<'_>, start: &Point, place: &Place) -> Self {
        let mut point = model.at(place.x.clone());
        // Slopes beside the linear numbers of the class without a series.
        point.linear.clone_from(&start.linear);
        if let Some(gain) = point.linear.last_mut() {
            *gain = place.gain;
        }
        let commanded = model.commanded(&point);
        let terms = place.series.terms(model.rows, &commanded);
        let mut raw = vec![commanded];
        raw.extend(model.raw_slopes(&point));
        let mut raw: Vec<Vec<f64>> = raw
            .iter()
            .map(|column| place.series.passed(model.rows, column))
            .collect();
        let count = raw.len();
        raw.extend(terms);
        raw.push(model.output());
        let mut plant = model.beside_linear(&point, raw);
        let mut left = plant.pop().unwrap_or_default();
        let terms = plant.split_off(count);
        add_multiple(&mut left, -1.0, &plant[0]);
        let squares = model.floored(&place.x, &left);
        Self {
            plant,
            terms,
            left,
            squares,
        }
    }

    /// All columns, and the scale of each number.
    fn columns(&self, seen: &Seen, row: f64, deviation: f64) -> (Vec<Vec<f64>>, Vec<f64>) {
        let columns = self.plant.iter().chain(&self.terms).cloned().collect();
        let mut scales: Vec<f64> = (0..self.plant.len())
            .map(|at| seen.scale(at, row))
            .collect();
        scales.resize(self.plant.len() + TERMS, deviation / UNKNOWN);
        (columns, scales)
    }

    /// The output that plant and series have to explain.
    fn target(&self, series: &Series) -> Vec<f64> {
        let mut out = self.left.clone();
        for (factor, term) in series.factors.iter().zip(&self.terms) {
            add_multiple(&mut out, *factor, term);
        }
        out
    }

    /// The largest deviation of the factors that is about as likely as the best, if that is not zero.
    fn size(&self, series: &Series, variance: f64) -> Option<Size> {
        let plant = Projection::new(self.plant.clone());
        let mut own = self.terms.clone();
        own.iter_mut().for_each(|column| {
            plant.taken(column);
        });
        let mut target = self.target(series);
        plant.taken(&mut target);
        let products = products(&own, &[1.0; TERMS], variance);
        let scores: Vec<f64> = own.iter().map(|one| dot(one, &target) / variance).collect();
        let tried = sizes(&products, &scores, (SERIES.least, SERIES.most));
        let most = tried.iter().fold(0.0_f64, |most, one| most.max(one.fall));
        let mut likely = tried
            .into_iter()
            .filter(|one| most > 0.0 && one.fall >= most - SERIES.slack);
        likely.next_back()
    }
}

impl Place {
    fn seen(&self, model: &Model<'_>) -> Seen {
        Seen {
            class: model.class,
            gain: self.gain,
            numbers: model.numbers(&self.x),
            series: Some(self.series),
        }
    }

    /// A share of the way to where a step ends: changes of the plant's numbers and the factors themselves.
    fn moved(&self, model: &Model<'_>, step: &[f64], share: f64) -> Self {
        let mut out = self.clone();
        let (plant, factors) = step.split_at(1 + model.plant_numbers());
        out.gain *= exp(share * plant[0]);
        for (x, step) in out.x.iter_mut().zip(&plant[1..]) {
            *x += share * step;
        }
        model.clamp(&mut out.x);
        for (own, factor) in out.series.factors.iter_mut().zip(factors) {
            *own += share * (factor - *own);
        }
        out
    }

    /// −2 ln of the likelihood with the prior, up to a constant.
    fn cost(&self, here: &Around, deviation: f64) -> f64 {
        here.left.len() as f64 * log(here.squares) + self.penalty(deviation)
    }

    fn penalty(&self, deviation: f64) -> f64 {
        let factors = &self.series.factors;
        dot(factors, factors) / (deviation * deviation)
    }
}

/// The class of a minimum with its error, if the record shows one; also under white noise, for coloured
/// noise may stand for the error of a class.
pub(super) fn flexible(found: &Minimum<'_>) -> Option<Flexible> {
    let own = likelier(found);
    if found.model.noise == Noise::White {
        return own;
    }
    let model = Model {
        noise: Noise::White,
        ..found.model
    };
    let x = found.point.x[..model.plant_numbers()].to_vec();
    let white = likelier(&Minimum::new(model, model.at(x)));
    let least = own.as_ref().map_or(found.bic, |own| own.bic);
    white.filter(|white| white.bic < least).or(own)
}

/// That of the likeliest pole.
fn likelier(found: &Minimum<'_>) -> Option<Flexible> {
    let each = SERIES.poles.iter();
    let each = each.filter_map(|pole| beside(found, *pole));
    each.min_by(|a, b| a.bic.total_cmp(&b.bic))
}

fn beside(found: &Minimum<'_>, pole: f64) -> Option<Flexible> {
    let (model, start) = (&found.model, &found.point);
    let rows = model.rows;
    let free = rows.count().saturating_sub(model.parameters()).max(1) as f64;
    let late = model.numbers(&start.x).latest();
    let mut place = Place {
        x: start.x.clone(),
        gain: model.gain(start),
        series: Series::beside(late, rows.row, pole),
    };
    let mut here = Around::new(model, start, &place);
    let before = here.squares;
    let mut size = here.size(&place.series, before / free)?;
    for _ in 0..SERIES.steps {
        let variance = here.squares / free;
        let (columns, scales) = here.columns(&place.seen(model), rows.row, size.deviation);
        let inner = covariance(&products(&columns, &scales, variance), &scales, 1.0);
        let target = here.target(&place.series);
        let scores: Vec<f64> = columns
            .iter()
            .map(|column| dot(column, &target) / variance)
            .collect();
        let step: Vec<f64> = inner
            .chunks_exact(scores.len())
            .map(|row| dot(row, &scores))
            .collect();
        let cost = place.cost(&here, size.deviation);
        let mut fallen = 0.0;
        let mut share = 1.0;
        for _ in 0..SERIES.shortened {
            let next = place.moved(model, &step, share);
            let there = Around::new(model, start, &next);
            fallen = cost - next.cost(&there, size.deviation);
            if fallen > 0.0 {
                (place, here) = (next, there);
                break;
            }
            share *= 0.4;
        }
        if fallen.is_nan() || fallen < SEARCH.fall {
            break;
        }
        size = here.size(&place.series, here.squares / free)?;
    }
    let rows = rows.count() as f64;
    let fall = rows * log(before / here.squares) - place.penalty(size.deviation) - size.log_volume;
    Some(Flexible {
        seen: place.seen(model),
        noise: model.noise,
        x: place.x,
        bic: found.bic - (fall - log(rows)).max(0.0),
        here,
        deviation: size.deviation,
    })
}
