//! Delayed values at the nodes of an element.
//!
//! For each delay the shifted nodes are assigned to the stored pieces that contain them, and each
//! piece is evaluated at its nodes. The first and the last node belong to the pieces inside the
//! shifted element, even where rounding errors put them slightly outside, because values at a
//! breaking point are one-sided. Where a delay is shorter than the element, shifted nodes lie in
//! the element itself; their values follow from the iterate and are computed again in each sweep.

use super::chebyshev;
use super::history::History;
use super::nodes::Nodes;
use super::products::{Rows, multiply};
use crate::Error;

/// Shift of end nodes towards the inside when their piece is searched for, in gaps between nodes.
const INWARDS: f64 = 0.01;

/// Nodes from `first` on whose delayed value lies in the element itself.
#[derive(Debug, Default)]
struct Inner {
    delay: usize,
    first: usize,
    table: Vec<f64>,
}

/// Memory for one run.
#[derive(Debug, Default)]
pub(super) struct Delayed {
    inner: Vec<Inner>,
    points: Vec<f64>,
    table: Vec<f64>,
}

/// The place of an element.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place<'a> {
    pub(super) start: f64,
    pub(super) end: f64,
    pub(super) t: &'a [f64],
    pub(super) nodes: &'a Nodes,
}

impl Delayed {
    /// Do delays shorter than the element make its delayed values depend on itself?
    pub(super) fn overlaps(&self) -> bool {
        !self.inner.is_empty()
    }

    /// Does the last node read its own element through this delay?
    pub(super) fn reaches_itself(&self, delay: usize) -> bool {
        self.inner.iter().any(|inner| inner.delay == delay)
    }

    /// Values (and slopes, unless `dz` is empty) from the stored pieces.
    pub(super) fn gather(
        &mut self,
        history: &History,
        delays: &[f64],
        place: Place<'_>,
        dim: usize,
        z: &mut [f64],
        dz: &mut [f64],
    ) -> Result<(), Error> {
        self.inner.clear();
        let n = place.t.len();
        for (j, delay) in delays.iter().enumerate() {
            let block = j * dim * n;
            let mut first = 0;
            while first < n {
                let time = inwards(place.t, first) - delay;
                if time > place.start {
                    self.inside(j, first, *delay, place);
                    break;
                }
                let index = history.locate(time);
                let Some(piece) = index.and_then(|index| history.piece(index)) else {
                    refuse!("the history is empty: give at least one entry");
                };
                let mut beyond = first + 1;
                while beyond < n && inwards(place.t, beyond) - delay < piece.end {
                    beyond += 1;
                }
                let m = beyond - first;
                let shifted = place.t[first..beyond]
                    .iter()
                    .map(|t| piece.place(t - delay));
                self.points.clear();
                self.points.extend(shifted);
                let table = if m == n && piece.terms == n && same(&self.points, &place.nodes.points)
                {
                    &place.nodes.basis
                } else {
                    chebyshev::basis(&self.points, piece.terms, &mut self.table);
                    &self.table
                };
                let rows = Rows::of(piece.terms);
                let places = Rows {
                    skip: first,
                    stride: n,
                };
                let z = &mut z[block..block + dim * n];
                multiply((&piece.coefficients, rows), table, m, (z, places));
                if !dz.is_empty() {
                    let dz = &mut dz[block..block + dim * n];
                    multiply((&piece.slopes, rows), table, m, (dz, places));
                }
                first = beyond;
            }
        }
        Ok(())
    }

    /// Record that nodes from `first` on read the element itself.
    fn inside(&mut self, delay: usize, first: usize, shift: f64, place: Place<'_>) {
        let length = place.end - place.start;
        let shifted = place.t[first..]
            .iter()
            .map(|t| 2.0 * ((t - shift) - place.start) / length - 1.0);
        self.points.clear();
        self.points.extend(shifted);
        let mut table = Vec::new();
        chebyshev::basis(&self.points, place.t.len(), &mut table);
        self.inner.push(Inner {
            delay,
            first,
            table,
        });
    }

    /// Compute again what depends on the iterate, given its coefficients.
    pub(super) fn renew(&self, coefficients: &[f64], n: usize, z: &mut [f64]) {
        for inner in &self.inner {
            let block = inner.delay * coefficients.len();
            let places = Rows {
                skip: inner.first,
                stride: n,
            };
            let z = &mut z[block..block + coefficients.len()];
            let rows = (coefficients, Rows::of(n));
            multiply(rows, &inner.table, n - inner.first, (z, places));
        }
    }
}

/// The time at which the piece of a node is searched for: end nodes slightly inside.
fn inwards(t: &[f64], index: usize) -> f64 {
    let last = t.len() - 1;
    if index == 0 {
        t[0] + INWARDS * (t[1] - t[0])
    } else if index == last {
        t[last] - INWARDS * (t[last] - t[last - 1])
    } else {
        t[index]
    }
}

/// Are the shifted nodes equal to the nodes of the piece, up to rounding errors?
fn same(points: &[f64], nodes: &[f64]) -> bool {
    const ROUNDING: f64 = 1e-13;
    let pairs = points.iter().zip(nodes);
    pairs.fold(0.0_f64, |worst, (a, b)| worst.max((a - b).abs())) < ROUNDING
}
