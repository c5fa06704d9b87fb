//! The filters of a bank and their weights.

use super::cell::Cell;
use super::refine::moved;
use super::walk::Walk;

/// Cells by set of lags and delay, and their weights.
pub(super) struct Cells<const N: usize> {
    pub(super) cells: Vec<Cell<N>>,
    pub(super) weights: Vec<f64>,
    /// Delays by their places among all.
    pub(super) places: Vec<usize>,
    walk: Walk,
}

impl<const N: usize> Cells<N> {
    pub(super) fn new(delays: &[f64], places: Vec<usize>, layers: usize) -> Self {
        let own: Vec<f64> = places.iter().map(|place| delays[*place]).collect();
        let none = Cell {
            mean: [0.0; N],
            cov: [[0.0; N]; N],
            slope: [0.0; N],
        };
        Self {
            cells: vec![none; layers * places.len()],
            weights: vec![0.0; layers * places.len()],
            walk: Walk::new(&own),
            places,
        }
    }

    /// Go over to other delays.
    pub(super) fn follow(&mut self, from: &[f64], to: &[f64]) {
        let count = self.places.len();
        let groups = self.cells.chunks(count).zip(self.weights.chunks(count));
        let (cells, weights): (Vec<_>, Vec<_>) = groups
            .map(|(cells, weights)| moved(from, cells, weights, to))
            .unzip();
        *self = Self {
            cells: cells.concat(),
            weights: weights.concat(),
            places: (0..to.len()).collect(),
            walk: Walk::new(to),
        };
    }

    /// The same delays at their places among others.
    pub(super) fn renumber(&mut self, from: &[f64], to: &[f64]) {
        for place in &mut self.places {
            *place = to.partition_point(|one| *one < from[*place]);
        }
    }

    pub(super) fn mix(&mut self, variance: f64, white: f64) {
        let count = self.places.len();
        let groups = self.cells.chunks_mut(count);
        for (cells, weights) in groups.zip(self.weights.chunks_mut(count)) {
            self.walk.mix(cells, weights, variance, white);
        }
    }

    /// Set of lags and place of the delay of each cell.
    pub(super) fn indices(&self, delays: usize) -> impl Iterator<Item = (usize, usize)> + '_ {
        let count = self.places.len();
        (0..self.cells.len())
            .map(move |i| (i / count, (i / count) * delays + self.places[i % count]))
    }
}
