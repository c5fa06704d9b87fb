//! One class under one noise: −2 ln L with the linear numbers eliminated, and its sensitivities.
//!
//! Linear are gain, offset, the trend of an integrating plant and the free responses. What is searched
//! are T, ln p, ln q, z and the numbers of the noise (variable projection, Golub & Pereyra 1973, with
//! Kaufman's derivative 1975).

use super::class::{Class, Numbers};
use super::noise::{Noise, Whitener};
use super::projection::{Column, Projection};
use super::response::{Response, free_responses, response};
use super::rows::{Part, Rows, Start};
use super::tolerances::{RANGES, SEARCH};
use crate::elementary::{exp, log};
use crate::linear_algebra::vectors::{add_multiple, dot};

/// A class of plants under a model of the noise.
#[derive(Debug, Clone, Copy)]
pub(super) struct Model<'a> {
    pub(super) rows: &'a Rows,
    pub(super) class: Class,
    pub(super) noise: Noise,
    /// Is there a plant at all? Without one, the command does nothing.
    pub(super) responds: bool,
    /// Is the output (of an integrator the slope) that goes with a command of zero free? It is zero
    /// otherwise.
    pub(super) level: bool,
    /// The zero, where it is given.
    pub(super) zero: Option<f64>,
}

/// The likelihood at one point.
#[derive(Debug, Clone)]
pub(super) struct Point {
    pub(super) x: Vec<f64>,
    /// The sum of squares of the whitened residuals, not below that of rounding, and that of each
    /// record.
    pub(super) squares: f64,
    parts: Vec<f64>,
    /// Coefficients of the linear columns, the gain last.
    pub(super) linear: Vec<f64>,
    /// Whitened residuals.
    pub(super) whitened: Vec<f64>,
    /// Output less model.
    pub(super) residual: Vec<f64>,
    response: Response,
    /// Of each cause.
    asides: Vec<Response>,
    free: Vec<Column>,
    pub(super) projection: Projection,
}

impl Point {
    /// The speed of the output of unit gain at the rows of a record.
    pub(super) fn speed(&self, place: std::ops::Range<usize>) -> impl Iterator<Item = f64> {
        self.response.by_delay[place].iter().map(|slope| -slope)
    }

    /// Factors of the causes, in units of the output.
    pub(super) fn of_causes(&self) -> &[f64] {
        &self.linear[..self.asides.len()]
    }
}

impl Model<'_> {
    /// How many numbers are searched.
    pub(super) fn searched(&self) -> usize {
        self.plant_numbers() + self.noise.searched()
    }

    pub(super) fn plant_numbers(&self) -> usize {
        if self.responds {
            self.class.searched()
        } else {
            0
        }
    }

    /// How many numbers there are, with the variance of the noise.
    pub(super) fn parameters(&self) -> usize {
        let (class, level) = (self.class, usize::from(self.level));
        let own = |part: &Part| {
            let free = match part.start {
                Start::Rest => 1,
                _ => class.order + usize::from(class.integrating) + level,
            };
            free + 1
        };
        let own: usize = self.rows.parts.iter().map(own).sum();
        let causes = self.rows.causes.iter().map(|cause| cause.parameters());
        let causes: usize = if self.responds { causes.sum() } else { 0 };
        let smooth = self.rows.parts.iter().any(|part| part.smoothing.is_some());
        self.searched() + usize::from(self.responds) + own + causes + usize::from(smooth)
    }

    pub(super) fn numbers(&self, x: &[f64]) -> Numbers {
        let mut out = Numbers::of_delay(x.first().copied().unwrap_or(0.0));
        if self.class.order > 0 {
            out.sum = exp(x[1]);
        }
        if self.class.order > 1 {
            out.product = exp(x[2]);
        }
        if self.class.has_zero {
            out.zero = x[1 + self.class.order];
        }
        out
    }

    /// What is searched, from the numbers of a plant and of the noise.
    pub(super) fn point_of(&self, numbers: &Numbers, noise: &[f64]) -> Vec<f64> {
        let mut x = vec![numbers.delay];
        if self.class.order > 0 {
            x.push(log(numbers.sum));
        }
        if self.class.order > 1 {
            x.push(log(numbers.product));
        }
        if self.class.has_zero {
            x.push(numbers.zero);
        }
        x.extend_from_slice(noise);
        self.clamp(&mut x);
        x
    }

    /// Move a point into the ranges of its numbers.
    pub(super) fn clamp(&self, x: &mut [f64]) {
        if !self.responds {
            return;
        }
        let rows = self.rows;
        let fastest = if rows.in_loop {
            RANGES.fastest_in_loop
        } else {
            RANGES.fastest
        } * rows.row;
        let slowest = RANGES.slowest * rows.span;
        let least = if rows.in_loop && rows.straight {
            rows.row
        } else {
            0.0
        };
        x[0] = x[0].clamp(least, rows.largest_delay.max(least));
        if self.class.order > 0 {
            x[1] = x[1].clamp(log(fastest), log(slowest));
        }
        if self.class.order > 1 {
            // 2 ζ √q = p.
            let most = 2.0 * (x[1] - log(2.0 * RANGES.least_damping));
            x[2] = x[2].clamp(x[1] + log(RANGES.fastest * rows.row), most);
        }
        if self.class.has_zero {
            let at = 1 + self.class.order;
            let most = RANGES.slowest_zero * rows.span;
            x[at] = self.zero.unwrap_or(x[at].clamp(-most, most));
        }
    }

    /// The linear columns beside the response, the free responses of the lags last.
    fn beside(&self, free: &[Column]) -> Vec<Column> {
        let mut columns = Vec::with_capacity(2 * self.rows.parts.len() + free.len());
        for (part, place) in self.rows.parts.iter().zip(self.rows.places()) {
            let from = place.start;
            if self.level || self.class.integrating {
                let values = vec![1.0; place.len()];
                columns.push(Column { from, values });
            }
            if part.start != Start::Rest && self.class.integrating && self.level {
                let half = 0.5 * part.span;
                let middle = part.time[0] + half;
                let slope = part.used.iter().map(|at| (part.time[*at] - middle) / half);
                let values = slope.collect();
                columns.push(Column { from, values });
            }
        }
        columns.extend(free.iter().cloned());
        columns
    }

    /// The response of unit gain, with that to the command of the first row where no level is free.
    fn response(&self, numbers: &Numbers) -> Response {
        let mut out = Response::default();
        for part in &self.rows.parts {
            let mut own = response(part, self.class, numbers);
            if !self.level {
                for (value, at) in own.value.iter_mut().zip(&part.used) {
                    *value += if self.class.integrating {
                        part.base * (part.time[*at] - part.time[0])
                    } else {
                        part.base
                    };
                }
            }
            out.append(own);
        }
        out
    }

    /// What each cause adds, times one.
    fn asides(&self, numbers: &Numbers) -> Vec<Response> {
        let of_one = |at: usize| {
            let mut out = Response::default();
            for part in &self.rows.parts {
                out.append(part.asides[at].as_ref().map_or_else(
                    || Response::zero(part.used.len()),
                    |aside| aside.response(part, self.class, numbers),
                ));
            }
            out
        };
        let columns = self.rows.causes.iter().map(|cause| cause.columns());
        (0..columns.sum()).map(of_one).collect()
    }

    /// The output, less its mean where a level is free.
    pub(super) fn output(&self) -> Vec<f64> {
        let has_level = self.level || self.class.integrating;
        self.rows.joined(|part| {
            let mean = if has_level { 0.0 } else { part.mean };
            part.output.iter().map(|y| y + mean).collect()
        })
    }

    /// The free responses of the lags, one column a record and state.
    fn free(&self, numbers: &Numbers) -> Vec<Column> {
        let mut columns = Vec::new();
        for (part, place) in self.rows.parts.iter().zip(self.rows.places()) {
            if part.start != Start::Rest {
                let own = free_responses(part, self.class, numbers).into_iter();
                let from = place.start;
                columns.extend(own.map(|values| Column { from, values }));
            }
        }
        columns
    }

    fn whiteners(&self, noise: &[f64]) -> Whiteners<'_> {
        let pairs = self.rows.parts.iter().zip(&self.rows.weights);
        let own = pairs.map(|(part, weight)| {
            let own = Whitener::new(&part.gaps, self.noise, noise, *weight);
            own.behind(part.smoothing.as_ref())
        });
        Whiteners {
            own: own.collect(),
            places: self.rows.places(),
        }
    }

    pub(super) fn whitener(&self, x: &[f64]) -> Whiteners<'_> {
        self.whiteners(&x[self.plant_numbers()..])
    }

    /// The whitener of one record, and where its rows stand among those of all.
    pub(super) fn whitener_of(
        &self,
        part: usize,
        point: &Point,
    ) -> (std::ops::Range<usize>, Whitener<'_>) {
        let noise = &point.x[self.plant_numbers()..];
        let (own, weight) = (&self.rows.parts[part], self.rows.weights[part]);
        let smoothing = own.smoothing.as_ref();
        let own = Whitener::new(&own.gaps, self.noise, noise, weight).behind(smoothing);
        (self.rows.places()[part].clone(), own)
    }

    /// The sum of squares of residuals under other numbers of the noise.
    pub(super) fn squares_of(&self, residual: &[f64], noise: &[f64]) -> f64 {
        let whitened = self.whiteners(noise).whiten(residual);
        dot(&whitened, &whitened)
    }

    /// The sum of squares of whitened residuals, not below that of rounding.
    pub(super) fn floored(&self, x: &[f64], whitened: &[f64]) -> f64 {
        self.whitener(x).squares(whitened, self.rows).iter().sum()
    }

    /// The likelihood at a point.
    pub(super) fn at(&self, x: Vec<f64>) -> Point {
        let numbers = self.numbers(&x);
        let (response, asides, free) = if self.responds {
            let (own, free) = (self.response(&numbers), self.free(&numbers));
            (own, self.asides(&numbers), free)
        } else {
            (Response::default(), Vec::new(), Vec::new())
        };
        let whitener = self.whitener(&x);
        let mut raw: Vec<Column> = asides.iter().map(|own| own.value.clone().into()).collect();
        raw.extend(self.beside(&free));
        if self.responds {
            raw.push(response.value.clone().into());
        }
        let projection = Projection::new(raw.iter().map(|column| whitener.column(column)));
        let output = self.output();
        let mut left = whitener.whiten(&output);
        let parts = projection.taken(&mut left);
        let linear = projection.coefficients(&parts);
        let mut residual = output;
        for (column, factor) in raw.iter().zip(&linear) {
            column.add_to(&mut residual, -factor);
        }
        let parts = whitener.squares(&left, self.rows);
        Point {
            x,
            squares: parts.iter().sum(),
            parts,
            linear,
            whitened: left,
            residual,
            response,
            asides,
            free,
            projection,
        }
    }

    /// −2 ln L.
    pub(super) fn deviance(&self, point: &Point) -> f64 {
        let sizes = point.parts.iter().zip(&self.rows.weights);
        let own = sizes
            .zip(&self.rows.parts)
            .map(|((squares, weight), part)| {
                let count = part.used.len() as f64;
                let variance = squares / (count * weight * weight);
                count * (log(variance) + 1.0 + log(std::f64::consts::TAU))
            });
        own.sum()
    }

    /// One over the size of the noise of each record, as these residuals show it.
    pub(super) fn weights(&self, point: &Point) -> Vec<f64> {
        let sizes = point.parts.iter().zip(&self.rows.weights);
        let own = sizes.zip(&self.rows.parts);
        own.map(|((squares, weight), part)| weight * (part.used.len() as f64 / squares).sqrt())
            .collect()
    }

    /// The gain, zero where there is no plant.
    pub(super) fn gain(&self, point: &Point) -> f64 {
        match point.linear.last() {
            Some(gain) if self.responds => *gain,
            _ => 0.0,
        }
    }

    /// Derivatives of the whitened model with respect to what is searched, beside the linear columns.
    pub(super) fn slopes(&self, point: &Point) -> Vec<Vec<f64>> {
        let whitener = self.whitener(&point.x);
        let mut columns = Vec::with_capacity(self.searched());
        if self.responds {
            for raw in self.raw_slopes(point) {
                columns.push(whitener.whiten(&raw));
            }
        }
        let before = whitener.whiten(&point.residual);
        for at in self.plant_numbers()..self.searched() {
            let mut x = point.x.clone();
            x[at] += SEARCH.step;
            let after = self.whitener(&x).whiten(&point.residual);
            let change = before.iter().zip(&after);
            columns.push(change.map(|(b, a)| (b - a) / SEARCH.step).collect());
        }
        for column in &mut columns {
            point.projection.taken(column);
        }
        columns
    }

    /// What the command and the causes explain at a point, from responses times one.
    fn explained(&self, point: &Point, response: &Response, asides: &[Response]) -> Response {
        let mut out = Response::zero(response.value.len());
        out.add(self.gain(point), response);
        for (factor, aside) in point.of_causes().iter().zip(asides) {
            out.add(*factor, aside);
        }
        out
    }

    /// Derivatives of the model's output with respect to the numbers of the plant.
    pub(super) fn raw_slopes(&self, point: &Point) -> Vec<Vec<f64>> {
        let own = self.explained(point, &point.response, &point.asides);
        let mut columns: Vec<Vec<f64>> = vec![own.by_delay];
        for at in 1..=self.class.order {
            let mut x = point.x.clone();
            x[at] += SEARCH.step;
            let numbers = self.numbers(&x);
            let after = self.explained(point, &self.response(&numbers), &self.asides(&numbers));
            let mut change = vec![0.0; after.value.len()];
            add_multiple(&mut change, 1.0 / SEARCH.step, &after.value);
            add_multiple(&mut change, -1.0 / SEARCH.step, &own.value);
            if !point.free.is_empty() {
                let places = point.linear.len() - 1 - point.free.len()..;
                let later = self.free(&numbers);
                for ((factor, after), before) in
                    point.linear[places].iter().zip(&later).zip(&point.free)
                {
                    after.add_to(&mut change, factor / SEARCH.step);
                    before.add_to(&mut change, -factor / SEARCH.step);
                }
            }
            columns.push(change);
        }
        if self.class.has_zero {
            columns.push(own.by_zero);
        }
        columns
    }

    /// The standard error of the factor of a cause, beside all other numbers.
    pub(super) fn error_of_cause(&self, point: &Point, at: usize) -> f64 {
        let whitener = self.whitener(&point.x);
        let mut others = self.beside(&point.free);
        let asides = point.asides.iter().enumerate();
        let asides = asides.filter(|(own, _)| *own != at);
        others.extend(asides.map(|(_, own)| own.value.clone().into()));
        others.push(point.response.value.clone().into());
        others.extend(self.raw_slopes(point).into_iter().map(Column::from));
        let mut own = whitener.whiten(&point.asides[at].value);
        Projection::new(others.iter().map(|column| whitener.column(column))).taken(&mut own);
        let free = self.rows.count().saturating_sub(self.parameters()).max(1);
        (point.squares / (free as f64 * dot(&own, &own))).sqrt()
    }

    /// What the command explains of the output.
    pub(super) fn commanded(&self, point: &Point) -> Vec<f64> {
        let gain = self.gain(point);
        point
            .response
            .value
            .iter()
            .map(|entry| gain * entry)
            .collect()
    }

    /// Whitened columns without what the linear numbers explain, apart from the gain.
    pub(super) fn beside_linear(&self, point: &Point, raw: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
        let whitener = self.whitener(&point.x);
        let asides = point.asides.iter().map(|own| own.value.clone().into());
        let beside = asides.chain(self.beside(&point.free));
        let nuisance = Projection::new(beside.map(|column| whitener.column(&column)));
        raw.iter()
            .map(|raw| {
                let mut column = whitener.whiten(raw);
                nuisance.taken(&mut column);
                column
            })
            .collect()
    }

    /// The slopes of the plant's numbers without what the other linear numbers explain: ln gain, delay,
    /// those of the lags, zero.
    pub(super) fn sensitivities(&self, point: &Point) -> Vec<Vec<f64>> {
        let mut raw = vec![self.commanded(point)];
        raw.extend(self.raw_slopes(point));
        self.beside_linear(point, raw)
    }
}

/// The whiteners of all records.
pub(super) struct Whiteners<'a> {
    own: Vec<Whitener<'a>>,
    places: Vec<std::ops::Range<usize>>,
}

impl Whiteners<'_> {
    pub(super) fn whiten(&self, column: &[f64]) -> Vec<f64> {
        if let [own] = &self.own[..] {
            return own.whiten(column);
        }
        let pairs = self.own.iter().zip(&self.places);
        pairs
            .flat_map(|(own, place)| own.whiten(&column[place.clone()]))
            .collect()
    }

    /// A column of one record, or of all.
    fn column(&self, column: &Column) -> Column {
        let pairs = self.own.iter().zip(&self.places);
        let own = pairs
            .into_iter()
            .find(|(_, place)| **place == column.rows());
        let values = match own {
            Some((own, _)) => own.whiten(&column.values),
            None => self.whiten(&column.values),
        };
        Column {
            from: column.from,
            values,
        }
    }

    /// The sum of squares of each record, not below that of rounding.
    fn squares(&self, whitened: &[f64], rows: &Rows) -> Vec<f64> {
        let parts = self.own.iter().zip(&self.places).zip(&rows.parts);
        let own = parts.map(|((whitener, place), part)| {
            let own = &whitened[place.clone()];
            let floor = part.rounding * whitener.factor;
            dot(own, own).max(own.len() as f64 * floor * floor)
        });
        own.collect()
    }
}
