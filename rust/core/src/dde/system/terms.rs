//! Matrices with their delays, applied to series.

use crate::Error;

use super::legendre::TERMS;
use super::track::{Sizes, Track};
use crate::dde::limits::{finite, slack};

/// A matrix, row-major, with a delay in s.
#[derive(Debug, Clone, PartialEq)]
pub struct Term {
    /// Delay τ_j ≥ 0.
    pub delay: f64,
    /// The entries.
    pub matrix: Vec<f64>,
}

impl Term {
    pub(super) fn check(&self, name: &str, rows: usize, columns: usize) -> Result<(), Error> {
        refuse_if!(
            !(self.delay.is_finite() && self.delay >= 0.0),
            "delay {} of {name}: give a finite number of seconds, zero or more",
            self.delay
        );
        refuse_if!(
            self.matrix.len() != rows * columns,
            "{name} with delay {} s has {} entries, not {rows} x {columns}",
            self.delay,
            self.matrix.len()
        );
        finite(name, &self.matrix)
    }
}

/// A column of a matrix: its index and its non-zero entries by their rows.
type Column = (usize, Vec<(usize, f64)>);

/// A delayed signal multiplied by a matrix.
#[derive(Debug)]
pub(super) struct Feed {
    pub(super) delay: f64,
    columns: Vec<Column>,
    place: usize,
}

impl Feed {
    /// The terms of a group with non-zero entries.
    pub(super) fn all(terms: &[Term], width: usize, sign: f64) -> Vec<Self> {
        terms
            .iter()
            .filter(|term| term.matrix.iter().any(|entry| *entry != 0.0))
            .map(|term| Self {
                delay: term.delay,
                columns: columns(&term.matrix, width, sign),
                place: 0,
            })
            .collect()
    }

    /// The non-zero entries: row, column, value.
    pub(super) fn entries(&self) -> impl Iterator<Item = (usize, usize, f64)> {
        self.columns.iter().flat_map(|(column, entries)| {
            entries.iter().map(|(row, value)| (*row, *column, *value))
        })
    }

    /// Add the matrix times the delayed track over [t, t + h] to the series `g`, and to `size` the
    /// size to which its rounding error is relative. Returns the degree of what was added, and the
    /// part of h on which it is valid.
    pub(super) fn add_series(
        &mut self,
        track: &Track,
        t: f64,
        h: f64,
        slack: f64,
        g: &mut [f64],
        size: &mut [Sizes],
    ) -> (usize, f64) {
        let s = t - self.delay;
        track.seek(&mut self.place, s, slack);
        let (mut highest, mut until) = (0, h);
        for (column, entries) in &self.columns {
            let (series, degree, read) = track.read(self.place, s, h, slack, *column);
            highest = highest.max(degree);
            until = until.min(read);
            let scale = track.size(self.place, *column);
            for (row, factor) in entries {
                for (size, scale) in size[*row].iter_mut().zip(&scale) {
                    *size += factor.abs() * scale;
                }
                let g = &mut g[row * TERMS..=row * TERMS + degree];
                for (g, c) in g.iter_mut().zip(&series) {
                    *g += factor * c;
                }
            }
        }
        (highest, until)
    }

    /// Add the matrix times the delayed track at time `t` to `y`.
    pub(super) fn add_value(&mut self, track: &Track, t: f64, longest: f64, y: &mut [f64]) {
        let s = t - self.delay;
        track.seek(&mut self.place, s, slack(t, longest));
        for (column, entries) in &self.columns {
            let value = track.at(self.place, s, *column);
            for (row, factor) in entries {
                y[*row] += factor * value;
            }
        }
    }
}

fn columns(matrix: &[f64], width: usize, sign: f64) -> Vec<Column> {
    (0..width)
        .filter_map(|column| {
            let entries: Vec<(usize, f64)> = matrix
                .iter()
                .skip(column)
                .step_by(width)
                .enumerate()
                .filter(|(_, entry)| **entry != 0.0)
                .map(|(row, entry)| (row, sign * entry))
                .collect();
            (!entries.is_empty()).then_some((column, entries))
        })
        .collect()
}

/// The largest delay of a group.
pub(super) fn longest(terms: &[Term]) -> f64 {
    terms
        .iter()
        .fold(0.0, |most, term| f64::max(most, term.delay))
}
