//! What lasts of a deviation of a sampled loop, sample by sample.
//!
//! A deviation z is the states, the command that is held, and those under way, the oldest first. In one
//! sample the oldest command acts and the newest one goes to the end, so that the response to each unit
//! of z costs as much as its states alone, however many commands are under way.

use std::collections::VecDeque;

use super::contraction::{Bounds, DOUBLINGS, Matrix, contracts, identity, later, most, times};
use super::lasting::{change_within, held};
use crate::Error;
use crate::dde::control_loop::sampled::{Timing, transition_matrix};
use crate::dde::propagator::Propagator;
use crate::dde::{Equations, LinearLoop};

/// Points in each part of a sample at which the output is bounded: more give a tighter bound.
const WITHIN: usize = 16;

/// One sample of a loop: x₊ = T x + b u of states and held command, with the command u that acts, and the
/// newest command c x.
struct Sample {
    t: Matrix,
    b: Vec<f64>,
    c: Vec<f64>,
    /// Number of commands under way, and the part of a sample until the oldest one acts, s.
    whole: usize,
    part: f64,
    period: f64,
}

impl Sample {
    fn of(linear: &LinearLoop) -> Result<Self, Error> {
        let model = linear.equations();
        let n = model.states();
        let period = linear.sample_time().unwrap_or(f64::INFINITY);
        let timing = Timing::new(linear.delay(), period);
        // With a sample more of delay the newest command is a state beside the oldest one.
        let more = LinearLoop::new(model.clone(), timing.early + period, Some(period), None)?;
        let (closed, side) = transition_matrix(&more)?;
        let kept = |k: usize| if k < n { k } else { n + 1 };
        let entry = |row: usize, column: usize| closed[row * side + column];
        let m = n + 1;
        let mut t = vec![0.0; m * m];
        for row in 0..n {
            for column in 0..m {
                t[row * m + column] = entry(row, kept(column));
            }
        }
        Ok(Self {
            t,
            b: (0..n).map(|row| entry(row, n)).chain([1.0]).collect(),
            c: (0..m).map(|column| entry(n, kept(column))).collect(),
            whole: timing.samples,
            part: timing.early,
            period,
        })
    }

    /// The sizes of z after a step from zero, at `end`.
    fn sizes_at(&self, rest: &[f64], limit: f64, end: f64) -> Vec<f64> {
        let m = self.b.len();
        let command = rest[m - 1];
        let mut state: Vec<f64> = rest.iter().map(|x| -x).collect();
        let mut under_way = VecDeque::from(vec![-command; self.whole]);
        for _ in 0..(end / self.period).ceil() as usize {
            let wanted = times(&self.c, &state, m)[0] + command;
            let newest = wanted.min(limit).max(-limit) - command;
            under_way.push_back(newest);
            let acts = under_way.pop_front().unwrap_or(newest);
            state = times(&self.t, &state, m);
            state
                .iter_mut()
                .zip(&self.b)
                .for_each(|(x, b)| *x += b * acts);
        }
        state.iter().chain(&under_way).map(|x| x.abs()).collect()
    }

    /// Rows for the newest command and for state, command and output at points of a sample, of states,
    /// held command and the one that comes to act; and the change from each point to the next.
    fn cells(&self, model: &Equations) -> (Matrix, Vec<Matrix>) {
        let m = self.b.len();
        let width = m + 1;
        let mut rows: Matrix = self.c.iter().copied().chain([0.0]).collect();
        let mut now = identity(width);
        let (mut changes, output): (Vec<Matrix>, Vec<f64>) = (
            Vec::new(),
            model.c.iter().copied().chain([model.d]).collect(),
        );
        now.truncate(m * width);
        for (length, acts) in [(self.part, m - 1), (self.period - self.part, m)] {
            now[(m - 1) * width..].copy_from_slice(&identity(width)[acts * width..][..width]);
            let h = length / WITHIN as f64;
            let step = Propagator::new(&held(model), &[], h).phi();
            for _ in 0..WITHIN {
                rows.extend_from_slice(&now);
                rows.extend(times(&output, &now, m));
                now = times(&step, &now, m);
            }
            changes.push(change_within(model, h));
        }
        (rows, changes)
    }
}

/// The responses to all units of z beside each other, one column each.
struct Units<'a> {
    of: &'a Sample,
    columns: usize,
    states: Matrix,
    /// One row a command: those under way at first, then the newest of each sample.
    commands: Matrix,
    samples: usize,
}

impl<'a> Units<'a> {
    fn new(of: &'a Sample) -> Self {
        let m = of.b.len();
        let columns = m + of.whole;
        let mut states = identity(columns);
        let commands = states.split_off(m * columns);
        Self {
            of,
            columns,
            states,
            commands,
            samples: 0,
        }
    }

    /// Take one sample, and raise the largest moduli of rows of states, held and acting command; the
    /// first row is that of the newest command.
    fn advance(&mut self, rows: &[f64], largest: &mut [f64]) {
        let (m, columns) = (self.of.b.len(), self.columns);
        let newest = times(&self.of.c, &self.states, m);
        raise(&newest, &mut largest[..columns]);
        self.commands.extend(newest);
        let acts = &self.commands[self.samples * columns..][..columns];
        let each = rows
            .chunks_exact(m + 1)
            .zip(largest.chunks_exact_mut(columns));
        for (row, largest) in each.skip(1) {
            let mut sums: Vec<f64> = acts.iter().map(|u| row[m] * u).collect();
            for (weight, state) in row.iter().zip(self.states.chunks_exact(columns)) {
                sums.iter_mut()
                    .zip(state)
                    .for_each(|(sum, x)| *sum += weight * x);
            }
            raise(&sums, largest);
        }
        let mut after = times(&self.of.t, &self.states, m);
        for (row, b) in after.chunks_exact_mut(columns).zip(&self.of.b) {
            row.iter_mut().zip(acts).for_each(|(x, u)| *x += b * u);
        }
        self.states = after;
        self.samples += 1;
    }

    /// The moduli of z of all responses.
    fn sizes(&self) -> Matrix {
        let under_way = &self.commands[self.samples * self.columns..];
        self.states
            .iter()
            .chain(under_way)
            .map(|x| x.abs())
            .collect()
    }
}

fn raise(values: &[f64], largest: &mut [f64]) {
    for (largest, value) in largest.iter_mut().zip(values) {
        *largest = largest.max(value.abs());
    }
}

/// Bounds on output and command about the rest, for all times after `end`; none where nothing contracts.
pub(super) fn bounds(
    linear: &LinearLoop,
    rest: &[f64],
    limit: f64,
    end: f64,
) -> Result<Option<Bounds>, Error> {
    let model = linear.equations();
    let sample = Sample::of(linear)?;
    let (rows, changes) = sample.cells(model);
    let m = sample.b.len();
    let mut units = Units::new(&sample);
    let mut largest = vec![0.0; rows.len() / (m + 1) * units.columns];
    for doubling in 0..DOUBLINGS {
        while units.samples < 1 << doubling {
            units.advance(&rows, &mut largest);
        }
        let period = units.sizes();
        if !contracts(&period, units.columns) {
            continue;
        }
        let Some(sizes) = later(&period, &sample.sizes_at(rest, limit, end)) else {
            return Ok(None);
        };
        let cells = times(&largest, &sizes, units.columns);
        let Some((command, cells)) = cells.split_first() else {
            return Ok(None);
        };
        let weights: Vec<f64> = model.c.iter().chain([&model.d]).map(|c| c.abs()).collect();
        let each = cells.chunks_exact(m + 1).enumerate().map(|(place, cell)| {
            let drift = times(&changes[place / WITHIN], &cell[..m], m);
            cell[m] + times(&weights, &drift, m)[0]
        });
        let output: Vec<f64> = each.collect();
        return Ok(Some((most(&output), *command)));
    }
    Ok(None)
}
