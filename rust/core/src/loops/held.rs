//! Sampled loops over two of their numbers, in rows along which a gain varies.
//!
//! The feedback is linear in the gains of the controller, and the command in the gain of the plant.
//! Along a row one of these varies, if the map is over one of them; every other number may change from
//! row to row. Where it is none of them, every cell is a row of its own.

use crate::Error;
use crate::dde::Equations;
use crate::stability::LoopRows;

use super::control_loop::{ControlLoop, Place, Values};
use super::equations::Input;
use super::plant::{Fraction, Plant};

/// The arrays of [`LoopRows`].
#[derive(Debug, Clone, Default)]
pub struct HeldRows {
    rows: usize,
    states: usize,
    used: Vec<f64>,
    a: Vec<f64>,
    b: Vec<f64>,
    k: Vec<f64>,
    l: Vec<f64>,
    k_slope: Vec<f64>,
    l_slope: Vec<f64>,
    delay: Vec<f64>,
    sample_time: Vec<f64>,
    points: Vec<f64>,
}

/// Numbers that change from row to row: their values, one for each row.
pub type Moving<'a> = [(Place, &'a [f64])];

/// The polynomials of a [`Plant::Given`] for its numbers, the gain left out.
pub type Polynomials<'a> = dyn FnMut(&[f64]) -> Result<Fraction<f64>, Error> + 'a;

/// One loop at gain 1, and the feedback K and L of each gain of the controller alone at 1.
struct Model {
    equations: Equations,
    shares: Vec<(Vec<f64>, f64)>,
}

/// The place of the plant's gain.
const GAIN: Place = Place::Plant(0);

impl ControlLoop {
    /// Of two axes, the gain that varies along rows: one that moves a pole at z = 1, or else the one
    /// with more points; none where neither is a gain.
    pub fn along(&self, axes: [(Place, usize); 2]) -> Option<usize> {
        let kind = self.controller().kind;
        let moves_rest = |place: Place| match place {
            Place::Controller(0) => !kind.integrates(),
            Place::Controller(1) => kind.integrates(),
            other => other == GAIN,
        };
        let rank = |index: &usize| {
            axes.get(*index)
                .map(|(place, points)| (moves_rest(*place), *points, axes.len() - index))
        };
        let is_gain = |index: &usize| axes.get(*index).is_some_and(|axis| self.is_gain(axis.0));
        (0..axes.len()).filter(is_gain).max_by_key(rank)
    }

    fn model(&self, values: &Values) -> Result<Model, Error> {
        let gains = self.controller().kind.gains().len();
        let mut alone = values.clone();
        alone.set(GAIN, 1.0);
        (0..gains).for_each(|gain| alone.set(Place::Controller(gain), 0.0));
        let of = |values: &Values| self.equations(values, Input::Reference, None);
        let mut shares = Vec::with_capacity(gains);
        for gain in 0..gains {
            let mut one = alone.clone();
            one.set(Place::Controller(gain), 1.0);
            let found = of(&one)?;
            shares.push((found.k, found.l));
        }
        Ok(Model {
            equations: of(&alone)?,
            shares,
        })
    }

    /// The rows of a map. `given` finds the polynomials of a [`Plant::Given`] for numbers of the plant.
    ///
    /// # Errors
    /// As [`equations`](Self::equations), and for a filter that runs on samples.
    pub fn held_rows(
        &self,
        moving: &Moving<'_>,
        along: Option<(Place, &[f64])>,
        given: &mut Polynomials<'_>,
    ) -> Result<HeldRows, Error> {
        refuse_if!(
            self.controller().is_discretised(),
            "a map cannot have a filter that runs on samples: leave discretisation out, or test \
             the loops one by one"
        );
        let count = moving
            .iter()
            .map(|(_, points)| points.len())
            .max()
            .unwrap_or(1);
        let at = |row: usize| {
            let mut values = self.values().clone();
            for (place, points) in moving {
                if let Some(value) = points.get(row).or(points.first()) {
                    values.set(*place, *value);
                }
            }
            values
        };
        let shapes = |place: Place| {
            !self.is_gain(place) && !matches!(place, Place::Delay | Place::SampleTime)
        };
        let moves = |which: &dyn Fn(Place) -> bool| moving.iter().any(|(place, _)| which(*place));
        let each = |own: bool| if own { count } else { count.min(1) };
        let is_given = *self.plant() == Plant::Given
            && moves(&|place| matches!(place, Place::Plant(_)) && place != GAIN);
        let mut models = Vec::new();
        for row in 0..each(moves(&shapes)) {
            let mut values = at(row);
            if is_given {
                values.given = Some(given(&values.plant)?);
            }
            models.push(self.model(&values)?);
        }
        // With a lag of zero there is one state less.
        let states = models.iter().map(|model| model.equations.b.len()).max();
        let states = states.unwrap_or(0);
        let mut rows = HeldRows {
            rows: count,
            states,
            points: along.map_or_else(|| vec![0.0], |(_, points)| points.to_vec()),
            ..HeldRows::default()
        };
        for model in &models {
            let Equations { a, b, .. } = &model.equations;
            rows.used.push(b.len() as f64);
            rows.a.extend(padded(a, b.len(), states));
            rows.b.extend(padded(b, b.len(), states).take(states));
        }
        let times = [Place::Delay, Place::SampleTime];
        for (place, column) in times
            .into_iter()
            .zip([&mut rows.delay, &mut rows.sample_time])
        {
            let own = each(moves(&|other| other == place));
            column.extend((0..own).map(|row| at(row).get(place).unwrap_or(0.0)));
        }
        let feeds = |place: Place| self.is_gain(place) || shapes(place);
        let along = along.map(|(place, _)| place);
        for row in 0..each(moves(&feeds)) {
            if let Some(model) = models.get(row).or(models.first()) {
                rows.feed(model, &at(row), along);
            }
        }
        Ok(rows)
    }
}

impl HeldRows {
    /// Append the feedback of one row.
    fn feed(&mut self, model: &Model, values: &Values, along: Option<Place>) {
        let mut parts = [(vec![0.0; self.states], 0.0), (vec![0.0; self.states], 0.0)];
        let gain = match along {
            Some(GAIN) => 1.0,
            _ => values.get(GAIN).unwrap_or(1.0),
        };
        for (index, (k, l)) in model.shares.iter().enumerate() {
            let place = Place::Controller(index);
            let own = if along == Some(place) {
                gain
            } else {
                gain * values.get(place).unwrap_or(0.0)
            };
            let varies = along == Some(place) || along == Some(GAIN);
            let (row, direct) = &mut parts[usize::from(varies)];
            for (sum, k) in row.iter_mut().zip(k) {
                *sum += own * k;
            }
            *direct += own * l;
        }
        let [(k, l), (k_slope, l_slope)] = parts;
        self.k.extend(k);
        self.l.push(l);
        self.k_slope.extend(k_slope);
        self.l_slope.push(l_slope);
    }

    /// The rows as `stability` takes them.
    pub fn view(&self) -> LoopRows<'_> {
        LoopRows {
            rows: self.rows,
            states: self.states,
            used: &self.used,
            a: &self.a,
            b: &self.b,
            k: &self.k,
            l: &self.l,
            k_slope: &self.k_slope,
            l_slope: &self.l_slope,
            delay: &self.delay,
            sample_time: &self.sample_time,
            points: &self.points,
        }
    }
}

/// A matrix of rows of `own` entries among `size` × `size`, zeros after the last entry of each row and
/// after the last row; of a vector, the first `size` of these.
fn padded(matrix: &[f64], own: usize, size: usize) -> impl Iterator<Item = f64> {
    let row = move |row: &[f64]| {
        let mut row = row.to_vec();
        row.resize(size, 0.0);
        row
    };
    let mut all: Vec<f64> = matrix.chunks(own.max(1)).flat_map(row).collect();
    all.resize(size * size, 0.0);
    all.into_iter()
}
