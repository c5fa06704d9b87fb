//! What lasts of a deviation of a continuous loop with a delay, period by period.
//!
//! With S(t) the responses of all states to unit states, nothing being under way, a deviation x at time 0
//! and commands w(t) under way until the delay T give
//!
//!   x(t) = S(t) x + ∫₀ᵀ X(t − s) w(s) ds,   X(t) = S(t) B + L S(t − T) B + L² S(t − 2 T) B + …,
//!
//! u = K x + L w. From values on a grid that divides the delay follow bounds on whole cells: within one of
//! length h states change by at most (e^(|A| h) − I) |x| and what the commands drive.

use super::contraction::{Matrix, identity, moduli, most};
use crate::dde::propagator::Propagator;
use crate::dde::{Equations, LinearLoop, Request, Start};
use crate::linear_algebra::eigenvalues::eigenvalues;
use crate::{Error, Task};

/// Least number of cells in a delay, cells in the fastest time constant, and most cells in a delay: more
/// cells make the bounds tighter and cost time in proportion.
const CELLS: f64 = 8.0;
const FASTEST: f64 = 6.0;
const MOST_CELLS: f64 = 512.0;

/// Upper limit on the number of grid points (bounds memory).
const MOST_POINTS: usize = 400_000;

/// The unit responses of one loop, simulated as far as they are asked for.
#[derive(Debug)]
pub(super) struct Fundamental {
    linear: LinearLoop,
    /// Number of cells in a delay, and their length, s.
    cells: usize,
    h: f64,
    /// Change within a cell, per unit of the states at its beginning and of the command in it.
    within: Matrix,
}

/// Q, and the rows of R for output and command, of a period: of the states, and of integral and size of
/// the command under way.
#[derive(Debug)]
pub(super) struct PeriodBounds {
    pub(super) period: Matrix,
    pub(super) output: Vec<f64>,
    pub(super) command: Vec<f64>,
}

/// Bounds on each cell of one response.
#[derive(Debug, Default)]
struct Cells {
    /// State by state.
    states: Vec<Vec<f64>>,
    command: Vec<f64>,
    output: Vec<f64>,
}

impl Fundamental {
    /// Of a loop with a delay.
    ///
    /// # Errors
    /// [`Error::Argument`] where the eigenvalues of the loop are not found.
    pub(super) fn new(linear: &LinearLoop) -> Result<Self, Error> {
        let model = linear.equations();
        let n = model.states();
        let mut undelayed = model.a.clone();
        for (row, b) in undelayed.chunks_exact_mut(n).zip(&model.b) {
            row.iter_mut().zip(&model.k).for_each(|(x, k)| *x += b * k);
        }
        let mut rate: f64 = 0.0;
        for matrix in [&model.a, &undelayed] {
            let Some(found) = eigenvalues(matrix, n) else {
                refuse!(
                    "the eigenvalues of the loop were not found: choose other units for its gains \
                     and time constants"
                );
            };
            rate = found.iter().map(|value| value.norm()).fold(rate, f64::max);
        }
        let cells = (FASTEST * rate * linear.delay())
            .ceil()
            .clamp(CELLS, MOST_CELLS);
        let h = linear.delay() / cells;
        Ok(Self {
            linear: linear.clone(),
            cells: cells as usize,
            h,
            within: change_within(model, h),
        })
    }

    fn times(&self, count: usize) -> Vec<f64> {
        (0..=count).map(|k| self.h * k as f64).collect()
    }

    /// |x − rest| at `end` or soon after it, and integral and size of what is under way; none where that
    /// takes too many points.
    pub(super) fn sizes_at(
        &self,
        amplitude: f64,
        rest: &[f64],
        limit: Option<f64>,
        end: f64,
        task: &Task,
    ) -> Result<Option<Vec<f64>>, Error> {
        let n = self.linear.equations().states();
        let count = (end / self.h).ceil();
        if count > MOST_POINTS as f64 {
            return Ok(None);
        }
        let count = (count as usize).max(self.cells);
        let start = vec![0.0; n];
        let times = self.times(count);
        let mut away = states_at(&self.linear, &times, start, amplitude, limit, task)?;
        for (row, rest) in away.chunks_exact_mut(count + 1).zip(rest) {
            row.iter_mut().for_each(|x| *x -= rest);
        }
        // The limit takes commands nearer to that of the rest.
        let before = rest.get(n).map_or(0.0, |command| command.abs());
        let command = self.bounded(&away, count, before).command;
        let late = &command[count - self.cells..];
        let ends = away.chunks_exact(count + 1).map(|row| row[count].abs());
        let mut found: Vec<f64> = ends.collect();
        found.push(late.iter().sum::<f64>() * self.h);
        found.push(most(late));
        Ok(Some(found))
    }

    /// The bounds of a period of `delays` delays; none where that takes too many points.
    pub(super) fn bounds(&self, delays: usize, task: &Task) -> Result<Option<PeriodBounds>, Error> {
        let model = self.linear.equations();
        let (n, count) = (model.states(), delays * self.cells);
        if count > MOST_POINTS / (n + 1) {
            return Ok(None);
        }
        let (times, width) = (self.times(count), count + 1);
        let mut every = Vec::with_capacity(n + 1);
        for start in identity(n).chunks_exact(n) {
            every.push(states_at(
                &self.linear,
                &times,
                start.to_vec(),
                0.0,
                None,
                task,
            )?);
        }
        // X is S B, and its echoes a delay, two delays and more later.
        let mut plain = vec![0.0; n * width];
        for (states, b) in every.iter().zip(&model.b) {
            plain
                .iter_mut()
                .zip(states)
                .for_each(|(sum, x)| *sum += b * x);
        }
        let mut driven = plain.clone();
        let mut factor = 1.0;
        for late in (1..=delays).map(|echo| echo * self.cells) {
            factor *= model.l;
            if factor == 0.0 {
                break;
            }
            for (row, plain) in driven
                .chunks_exact_mut(width)
                .zip(plain.chunks_exact(width))
            {
                let shifted = row[late..].iter_mut().zip(plain);
                shifted.for_each(|(sum, x)| *sum += factor * x);
            }
        }
        every.push(driven);
        let cells: Vec<Cells> = every
            .iter()
            .map(|one| self.bounded(one, count, 0.0))
            .collect();
        Ok(Some(self.period(&every, &cells, count, factor.abs())))
    }

    /// Bounds on each cell of states, command and output of one response; `before` bounds the command
    /// that is under way at first.
    fn bounded(&self, states: &[f64], count: usize, before: f64) -> Cells {
        let model = self.linear.equations();
        let n = model.states();
        let mut found = Cells {
            states: vec![Vec::with_capacity(count); n],
            ..Cells::default()
        };
        for cell in 0..count {
            let acts = match cell.checked_sub(self.cells) {
                Some(earlier) => found.command[earlier],
                None => before,
            };
            let x = |i: usize| states[i * (count + 1) + cell];
            let drift = |row: usize| {
                let change = &self.within[row * (n + 1)..][..=n];
                let own: f64 = (0..n).map(|i| change[i] * x(i).abs()).sum();
                own + change[n] * acts
            };
            let drifts: Vec<f64> = (0..n).map(drift).collect();
            for (i, states) in found.states.iter_mut().enumerate() {
                states.push(x(i).abs() + drifts[i]);
            }
            let bound = |row: &[f64], direct: f64| {
                let here: f64 = row.iter().enumerate().map(|(i, c)| c * x(i)).sum();
                let moved: f64 = row
                    .iter()
                    .zip(&drifts)
                    .map(|(c, drift)| c.abs() * drift)
                    .sum();
                here.abs() + moved + direct.abs() * acts
            };
            found.command.push(bound(&model.k, model.l));
            found.output.push(bound(&model.c, model.d));
        }
        found
    }

    /// From the responses to unit states and to an impulse of the command, which is the last one.
    fn period(&self, every: &[Matrix], cells: &[Cells], count: usize, echo: f64) -> PeriodBounds {
        let model = self.linear.equations();
        let (n, h) = (model.states(), self.h);
        let late = |row: &Vec<f64>| row[count - self.cells..].to_vec();
        let side = n + 2;
        let mut q = vec![0.0; side * side];
        for (start, (states, bounds)) in every.iter().zip(cells).take(n).enumerate() {
            for i in 0..n {
                q[i * side + start] = states[i * (count + 1) + count].abs();
            }
            let command = late(&bounds.command);
            q[n * side + start] = command.iter().sum::<f64>() * h;
            q[(n + 1) * side + start] = most(&command);
        }
        if let Some(impulse) = cells.get(n) {
            // An impulse comes at any time within the delay.
            for (i, states) in impulse.states.iter().enumerate() {
                q[i * side + n] = most(&late(states));
            }
            let longer = &impulse.command[count.saturating_sub(2 * self.cells)..];
            let ends = 0..longer.len() + self.cells;
            let sums = ends.map(|end| {
                let first = end.saturating_sub(self.cells);
                longer[first.min(longer.len())..(end + 1).min(longer.len())]
                    .iter()
                    .sum()
            });
            q[n * side + n] = sums.fold(0.0, f64::max) * h + echo;
            q[(n + 1) * side + n] = most(longer);
        }
        q[(n + 1) * side + n + 1] = echo;
        let rows = |of: fn(&Cells) -> &Vec<f64>, last: f64| {
            let each = cells.iter().map(|bounds| most(of(bounds)));
            each.chain([last.abs()]).collect()
        };
        PeriodBounds {
            period: q,
            output: rows(|bounds| &bounds.output, model.d),
            command: rows(|bounds| &bounds.command, model.l),
        }
    }
}

/// A with the command held behind the states.
pub(super) fn held(model: &Equations) -> Matrix {
    let n = model.states();
    let mut matrix = vec![0.0; (n + 1) * (n + 1)];
    for (i, (row, b)) in model.a.chunks_exact(n).zip(&model.b).enumerate() {
        matrix[i * (n + 1)..][..n].copy_from_slice(row);
        matrix[i * (n + 1) + n] = *b;
    }
    matrix
}

/// e^(|A| h) − I of the states with the command held behind them.
pub(super) fn change_within(model: &Equations, h: f64) -> Matrix {
    Propagator::new(&moduli(&held(model)), &[], h)
        .growth()
        .to_vec()
}

/// Every state of a continuous loop after a step at each time, nothing under way at time 0; state by
/// state.
pub(super) fn states_at(
    linear: &LinearLoop,
    times: &[f64],
    start: Vec<f64>,
    amplitude: f64,
    limit: Option<f64>,
    task: &Task,
) -> Result<Matrix, Error> {
    let n = start.len();
    let start = Start {
        state: start,
        ..Start::default()
    };
    let asked = Request {
        time: times,
        output_lead: 0.0,
        reference_before: 0.0,
        reference_time: &[0.0],
        reference: &[amplitude],
    };
    let mut found = Vec::with_capacity(n * times.len());
    for state in 0..n {
        let mut equations = linear.equations().clone();
        equations.c = (0..n).map(|i| f64::from(u8::from(i == state))).collect();
        equations.d = 0.0;
        let made = LinearLoop::new(equations, linear.delay(), None, limit)?;
        found.extend(made.respond(&start, &asked, task)?.outputs);
    }
    Ok(found)
}
