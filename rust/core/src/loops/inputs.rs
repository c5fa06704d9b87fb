//! Inputs of a loop as states of their own.
//!
//! An input that is piecewise a polynomial of degree k is the first of k + 1 states p, p_i′ = p_{i+1},
//! p_k′ = 0, which jump where its pieces join ([`Kick`](crate::dde::Kick)). They come last in x, so that
//! all steppers treat any inputs alike. The reference acts as r does; a load is added to the command
//! where it reaches the plant; a disturbance of the output is added to it; noise is added to what the
//! controller sees of it alone.

use crate::Error;
use crate::dde::{Equations, LinearLoop, Update};

use super::control_loop::{ControlLoop, Values};
use super::drive::{Columns, Drive};
use super::equations::Input;
use super::filter::Sampled;

impl ControlLoop {
    /// The loop for the kernels that take steps in time, with inputs and their degrees.
    ///
    /// # Errors
    /// As [`linear`](Self::linear).
    pub fn driven(&self, drives: &[(Drive, usize)]) -> Result<LinearLoop, Error> {
        let values = self.values();
        let (mut equations, mut update) = self.on_samples(values, Input::Reference)?;
        if !drives.is_empty() {
            let columns = self.columns(values)?;
            let filter = self.driven_filter(values)?;
            add(&mut equations, update.as_mut(), drives, &columns, &filter);
        }
        self.bounded(equations, update, values)
    }

    /// Gd of the filter on samples, empty without one.
    fn driven_filter<S: Sampled>(&self, values: &Values<S>) -> Result<Vec<S>, Error> {
        let controller = self.controller();
        let sampled = controller.sampled(&values.controller, values.sample_time.as_ref())?;
        Ok(sampled.map_or_else(Vec::new, |filter| filter.g))
    }
}

/// Append the states of inputs; `filter` is the gain of what it sees on a filter on samples.
fn add(
    equations: &mut Equations,
    update: Option<&mut Update>,
    drives: &[(Drive, usize)],
    columns: &Columns,
    filter: &[f64],
) {
    let n = equations.states();
    let extra: usize = drives.iter().map(|(_, degree)| degree + 1).sum();
    let side = n + extra;
    let mut a = widened(&equations.a, n, side);
    let mut states = update
        .as_ref()
        .map(|update| widened(&update.states, n, side));
    let mut place = n;
    for (drive, degree) in drives {
        let column = columns.of(*drive);
        for (row, entry) in column.states.iter().enumerate() {
            a[row * side + place] = *entry;
        }
        equations.k.push(column.command);
        equations.c.push(column.output);
        equations.impulses.push(column.impulse);
        if let Some(states) = &mut states {
            let first = n - filter.len();
            for (i, gain) in filter.iter().enumerate() {
                states[(first + i) * side + place] = gain * column.seen;
            }
        }
        for next in place..place + degree {
            a[next * side + next + 1] = 1.0;
            // The ideal derivative of the input itself, whose rate is the second state.
            let of_rate = if next == place { column.impulse } else { 0.0 };
            equations.k.push(of_rate);
            equations.c.push(0.0);
            equations.impulses.push(0.0);
        }
        place += degree + 1;
    }
    equations.a = a;
    for column in [&mut equations.b, &mut equations.e] {
        column.resize(side, 0.0);
    }
    if !equations.excess.is_empty() {
        equations.excess.resize(side, 0.0);
    }
    if let (Some(update), Some(mut states)) = (update, states) {
        (n..side).for_each(|i| states[i * side + i] = 1.0);
        update.states = states;
        update.command.resize(side, 0.0);
        update.reference.resize(side, 0.0);
    }
}

/// A square matrix with zeros behind its rows and below them.
fn widened(matrix: &[f64], n: usize, side: usize) -> Vec<f64> {
    let mut out = vec![0.0; side * side];
    for (row, entries) in matrix.chunks_exact(n.max(1)).enumerate() {
        out[row * side..row * side + n].copy_from_slice(entries);
    }
    out
}
