//! Minimum of a function of a few variables within bounds, by a quasi-Newton method.
//!
//! By its first variables the largest part of the function has a slope and a curvature of Gauss and
//! Newton, which cost no evaluation: they are searched alone first, and their curvature is the first
//! guess of the Hessian. That of the others is made of difference quotients. The inverse Hessian is
//! then that of Broyden, Fletcher, Goldfarb and Shanno; variables at a bound that would leave it are
//! held there (Bertsekas 1982), and steps across a bound on several variables end on it, at the least
//! value of the quadratic model there (Nocedal & Wright, Numerical Optimization, 18.1). What the known
//! slopes lack is a difference quotient at the start and at the end of the search.

use std::ops::Range;

use super::likelihood::Wanted;
use super::quotients::{Around, Function, Quotients, Slack, Value, Variable, keep_within, shorten};
use crate::Error;
use crate::linear_algebra::cholesky::inverse_of_positive;

/// Most iterations, and those over the first variables alone.
const ITERATIONS: usize = 60;
const FIRST_ITERATIONS: usize = 10;

/// Share of what a step promises below which it is poor, and the poor steps in a row after which the
/// search ends: the function is then rougher than its derivatives.
const POOR: f64 = 0.1;
const STALLED: usize = 3;

/// Most shortenings of a step, and by how much.
const SHORTENINGS: usize = 12;
const SHORTER: f64 = 0.4;

/// Share of the predicted decrease that a step has to reach (Armijo).
const SUFFICIENT: f64 = 1e-4;

/// Added to a known curvature of unit diagonal: bounds its condition.
const RIDGE: f64 = 1e-7;

/// Decrease that matters: a step over the first variables alone has to promise and bring it.
const WORTHWHILE: f64 = 0.02;

/// Where the function is least.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Minimum {
    pub(super) place: Vec<f64>,
    pub(super) value: f64,
}

/// How close to the minimum a search goes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Accuracy {
    /// The search ends where a step promises less.
    pub(super) tolerance: f64,
    /// Are the known slopes taken as they are? What they lack costs difference quotients.
    pub(super) takes_known: bool,
}

impl Accuracy {
    /// What the known slopes lack is less than a coarse tolerance.
    pub(super) fn of(tolerance: f64) -> Self {
        Self {
            tolerance,
            takes_known: tolerance >= WORTHWHILE,
        }
    }
}

/// Search from the starting point until a step promises less than the tolerance.
///
/// `known_inverse` is the inverse of the Hessian at the end of a search near by, if there was one, and then
/// that of this one: neighbours need fewer steps with it.
pub(super) fn minimise(
    variables: &[Variable],
    accuracy: Accuracy,
    known_inverse: &mut Option<Vec<f64>>,
    mut function: impl Function,
) -> Result<Minimum, Error> {
    let mut place: Vec<f64> = variables
        .iter()
        .map(|v| v.start.clamp(v.low, v.high))
        .collect();
    keep_within(variables, &mut place, &function);
    let mut start = |x: Vec<f64>| descend(variables, x, accuracy, known_inverse, &mut function);
    let (found, is_stuck) = start(place)?;
    if is_stuck {
        return Ok(start(found.place)?.0);
    }
    Ok(found)
}

/// A search from x, and whether it ended where a step promised much and led nowhere.
fn descend(
    variables: &[Variable],
    mut x: Vec<f64>,
    Accuracy {
        tolerance,
        takes_known,
    }: Accuracy,
    known_inverse: &mut Option<Vec<f64>>,
    function: &mut impl Function,
) -> Result<(Minimum, bool), Error> {
    let mut values = function.at(std::slice::from_ref(&x), Wanted::Slopes)?;
    let mut found = values.swap_remove(0);
    let (n, known) = (x.len(), found.slope.len());
    let mut steps: Vec<f64> = variables.iter().map(|v| v.step).collect();
    let is_all = takes_known && n == known;
    let enough = if is_all {
        tolerance
    } else {
        tolerance.max(WORTHWHILE)
    };
    for _ in 0..FIRST_ITERATIONS {
        let Some(inverse) = inverse_of_positive(&found.curvature, known, RIDGE) else {
            break;
        };
        let slack = function.slack(&x);
        let step = direction(variables, &x, &inverse, &found.slope, slack.as_ref());
        if promised(&step, &found.slope) <= enough {
            break;
        }
        let line = Line {
            value: found.value,
            gradient: &found.slope,
            step: &step,
        };
        let by = (steps.as_slice(), n..n);
        let Some((next, ..)) = line_search(variables, &mut x, line, by, function)? else {
            break;
        };
        let decrease = found.value - next.value;
        found = next;
        if decrease <= enough {
            break;
        }
    }
    if n == 0 || is_all {
        let value = found.value;
        return Ok((Minimum { place: x, value }, false));
    }
    let mut near = Near::new(variables, &mut steps, &x, &found, takes_known, function)?;
    // Are the gradient, and the Hessian, quotients made here?
    let (mut exact, mut fresh) = (true, true);
    if let Some(known) = known_inverse.take_if(|known| known.len() == n * n) {
        (near.inverse, fresh) = (known, false);
    }
    let (mut stalled, mut is_stuck) = (0, false);
    for _ in 0..ITERATIONS {
        let slack = function.slack(&x);
        let step = direction(variables, &x, &near.inverse, &near.gradient, slack.as_ref());
        let promise = promised(&step, &near.gradient);
        if promise <= tolerance {
            if exact {
                break;
            }
            // The slopes by the others are quotients already.
            let quotients = Quotients::new(variables, &steps, &x, &found, 0..known, function)?;
            near.lacking = difference(&quotients.slope, &found.slope);
            near.gradient[..known].copy_from_slice(&quotients.slope);
            exact = true;
            continue;
        }
        let line = Line {
            value: found.value,
            gradient: &near.gradient,
            step: &step,
        };
        let by = (steps.as_slice(), known..n);
        let next = line_search(variables, &mut x, line, by, function)?;
        if let Some((next, moved, others)) = next {
            let decrease = found.value - next.value;
            let is_poor = decrease < WORTHWHILE && decrease < POOR * promise;
            stalled = if is_poor { stalled + 1 } else { 0 };
            found = next;
            if stalled >= STALLED {
                break;
            }
            if !is_poor || fresh {
                shorten(&variables[known..], &others.curvature, &mut steps[known..]);
                near.follow(&moved, &found.slope, others.slope);
                (exact, fresh) = (known == 0 || takes_known, false);
                continue;
            }
        } else if fresh {
            is_stuck = promise > WORTHWHILE;
            break;
        }
        // What was gathered on the way misleads here.
        near = Near::new(variables, &mut steps, &x, &found, takes_known, function)?;
        (exact, fresh) = (true, true);
    }
    *known_inverse = Some(near.inverse);
    let value = found.value;
    Ok((Minimum { place: x, value }, is_stuck))
}

/// A step from a place at which the function has this value and gradient.
struct Line<'a> {
    value: f64,
    gradient: &'a [f64],
    step: &'a [f64],
}

/// The first point along a step, ever shorter, at which the function is lower; x moves there. With how
/// far it moves, and the quotients there with these steps `by` some of the variables.
fn line_search(
    variables: &[Variable],
    x: &mut [f64],
    line: Line<'_>,
    by: (&[f64], Range<usize>),
    function: &mut impl Function,
) -> Result<Option<(Value, Vec<f64>, Quotients)>, Error> {
    let mut share = 1.0;
    let mut trial = x.to_vec();
    for _ in 0..SHORTENINGS {
        let places = trial.iter_mut().zip(x.iter()).zip(variables).zip(line.step);
        for (((trial, x), variable), step) in places {
            *trial = (x + share * step).clamp(variable.low, variable.high);
        }
        keep_within(variables, &mut trial, function);
        let moved = difference(&trial, x);
        let mut around = Around::new(variables, by.0, &trial, by.1.clone(), function);
        around.places.insert(0, trial.clone());
        let mut values = function.at(&around.places, Wanted::Slopes)?;
        let found = values.remove(0);
        let enough = line.value + SUFFICIENT * product(line.gradient, &moved);
        if found.value < enough && found.value < line.value {
            x.copy_from_slice(&trial);
            let quotients = around.quotients(found.value, &values);
            return Ok(Some((found, moved, quotients)));
        }
        share *= SHORTER;
    }
    Ok(None)
}

/// The function near a place.
struct Near {
    gradient: Vec<f64>,
    /// Of the Hessian.
    inverse: Vec<f64>,
    /// What the known slopes lack.
    lacking: Vec<f64>,
}

impl Near {
    /// By difference quotients: the Hessian is the known curvature of the first variables, and the quotient
    /// by each of the others alone; by each of all where the known one is not positive.
    ///
    /// Mixed derivatives by the others are left to the update: where two of them have almost the same
    /// effect, steps of Newton's run along the valley, past minima. A coarse search takes the known
    /// slopes as they are, where their curvature is positive.
    fn new(
        variables: &[Variable],
        steps: &mut [f64],
        x: &[f64],
        found: &Value,
        takes_known: bool,
        function: &mut impl Function,
    ) -> Result<Self, Error> {
        let (n, known) = (x.len(), found.slope.len());
        let first = inverse_of_positive(&found.curvature, known, RIDGE);
        let from = if takes_known && first.is_some() {
            known
        } else {
            0
        };
        let mut quotients = Quotients::new(variables, steps, x, found, from..n, function)?;
        if shorten(&variables[from..], &quotients.curvature, &mut steps[from..]) {
            quotients = Quotients::new(variables, steps, x, found, from..n, function)?;
        }
        let mut gradient = found.slope[..from].to_vec();
        gradient.extend(quotients.slope);
        let mut inverse = vec![0.0; n * n];
        for (i, bend) in quotients.curvature.iter().enumerate() {
            inverse[(from + i) * (n + 1)] = 1.0 / bend;
        }
        let rows = first
            .iter()
            .flat_map(|first| first.chunks_exact(known.max(1)));
        for (to, from) in inverse.chunks_exact_mut(n).zip(rows) {
            to[..known].copy_from_slice(from);
        }
        Ok(Self {
            lacking: difference(&gradient[..known], &found.slope),
            gradient,
            inverse,
        })
    }

    /// Move along, to where the known slopes and those of the others are these.
    fn follow(&mut self, moved: &[f64], known: &[f64], others: Vec<f64>) {
        let parts = known.iter().zip(&self.lacking);
        let mut slopes: Vec<f64> = parts.map(|(a, b)| a + b).collect();
        slopes.extend(others);
        update(
            &mut self.inverse,
            moved,
            &difference(&slopes, &self.gradient),
        );
        self.gradient = slopes;
    }
}

/// −H g, no longer than allowed: the least of the quadratic model with the variables that would leave
/// the bound they are at held there, and on the bound on several variables where it would cross that.
fn direction(
    variables: &[Variable],
    x: &[f64],
    inverse: &[f64],
    gradient: &[f64],
    slack: Option<&Slack>,
) -> Vec<f64> {
    let n = gradient.len();
    let mut within = inverse.to_vec();
    let leaves = |i: usize, entry: f64| {
        (x[i] <= variables[i].low && entry < 0.0) || (x[i] >= variables[i].high && entry > 0.0)
    };
    let mut out = least(&within, gradient, slack);
    while let Some(i) = (0..n).find(|i| leaves(*i, out[*i])) {
        hold(&mut within, n, i);
        out = least(&within, gradient, slack);
    }
    let mut scale: f64 = 1.0;
    for ((entry, variable), x) in out.iter().zip(variables).zip(x) {
        let left = (if *entry < 0.0 {
            variable.low
        } else {
            variable.high
        } - x)
            .abs();
        // A step ends at a bound that is near, however far it would go beyond.
        if left > variable.longest {
            scale = scale.min(variable.longest / entry.abs());
        }
    }
    out.iter_mut().for_each(|entry| *entry *= scale);
    out
}

/// −H g, on the bound on several variables where it would cross that.
fn least(inverse: &[f64], gradient: &[f64], slack: Option<&Slack>) -> Vec<f64> {
    let n = gradient.len().max(1);
    let times = |vector: &[f64]| -> Vec<f64> {
        let rows = inverse.chunks_exact(n);
        rows.map(|row| product(row, vector)).collect()
    };
    let mut out = times(gradient);
    out.iter_mut().for_each(|entry| *entry = -*entry);
    if let Some(slack) = slack {
        let beyond = slack.value + product(&slack.slope, &out);
        let along = times(&slack.slope);
        let bend = product(&slack.slope, &along);
        if beyond < 0.0 && bend > 0.0 {
            let moved = out.iter_mut().zip(along);
            moved.for_each(|(entry, along)| *entry -= beyond / bend * along);
        }
    }
    out
}

/// Make of an inverse Hessian that of the function with one variable held.
fn hold(inverse: &mut [f64], n: usize, held: usize) {
    let row = inverse[held * n..][..n].to_vec();
    for (i, entries) in inverse.chunks_exact_mut(n).enumerate() {
        let share = if i == held { 1.0 } else { row[i] / row[held] };
        for (entry, by) in entries.iter_mut().zip(&row) {
            *entry -= share * by;
        }
        entries[held] = 0.0;
    }
}

/// The decrease that a step of a quasi-Newton method promises; none where it is not a number.
fn promised(step: &[f64], gradient: &[f64]) -> f64 {
    let slope = product(step, gradient);
    if slope.is_nan() { 0.0 } else { -0.5 * slope }
}

fn difference(x: &[f64], y: &[f64]) -> Vec<f64> {
    x.iter().zip(y).map(|(x, y)| x - y).collect()
}

fn product(x: &[f64], y: &[f64]) -> f64 {
    x.iter().zip(y).map(|(x, y)| x * y).sum()
}

/// The update of the inverse Hessian; none where the curvature along the step is not positive.
fn update(inverse: &mut [f64], moved: &[f64], change: &[f64]) {
    let n = moved.len();
    let along = product(moved, change);
    if along.is_nan() || along <= 0.0 {
        return;
    }
    let turned: Vec<f64> = inverse
        .chunks_exact(n)
        .map(|row| product(row, change))
        .collect();
    let stretch = (1.0 + product(change, &turned) / along) / along;
    for i in 0..n {
        for j in 0..n {
            inverse[i * n + j] += stretch * moved[i] * moved[j]
                - (turned[i] * moved[j] + moved[i] * turned[j]) / along;
        }
    }
}

#[cfg(test)]
mod tests;
