//! Minimum of a function of a few variables within bounds, by a quasi-Newton method.
//!
//! By its first variables the largest part of the function has a slope and a curvature of Gauss and
//! Newton, which cost no evaluation: they are searched alone first, and their curvature is the first
//! guess of the Hessian. That of the others is made of difference quotients. The inverse Hessian is
//! then that of Broyden, Fletcher, Goldfarb and Shanno; variables at a bound that would leave it are
//! held there (Bertsekas 1982), and steps across a bound on several variables end on it, at the least
//! value of the quadratic model there (Nocedal & Wright, Numerical Optimization, 18.1). What the known
//! slopes lack is a difference quotient at the start and at the end of the search.

use super::likelihood::Wanted;
use super::quotients::{Function, Quotients, Slack, Value, Variable, keep_within, shorten};
use crate::Error;

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

/// Search from the starting point until a step promises less than `tolerance`.
///
/// `known_inverse` is the inverse of the Hessian at the end of a search near by, if there was one, and then
/// that of this one: neighbours need fewer steps with it.
pub(super) fn minimise(
    variables: &[Variable],
    tolerance: f64,
    known_inverse: &mut Option<Vec<f64>>,
    mut function: impl Function,
) -> Result<Minimum, Error> {
    let mut x: Vec<f64> = variables
        .iter()
        .map(|v| v.start.clamp(v.low, v.high))
        .collect();
    keep_within(variables, &mut x, &function);
    let mut found = function.at(&x, Wanted::Slopes)?;
    let (n, known) = (x.len(), found.slope.len());
    for _ in 0..FIRST_ITERATIONS {
        let Some(inverse) = inverted(&found.curvature, known) else {
            break;
        };
        let slack = function.slack(&x);
        let step = direction(variables, &x, &inverse, &found.slope, slack.as_ref());
        if promised(&step, &found.slope) <= tolerance.max(WORTHWHILE) {
            break;
        }
        let slope = found.slope.clone();
        let Some((next, _)) =
            line_search(variables, &mut x, found.value, &slope, &step, &mut function)?
        else {
            break;
        };
        let decrease = found.value - next.value;
        found = next;
        if decrease <= tolerance.max(WORTHWHILE) {
            break;
        }
    }
    // What the known slopes lack is less than a coarse tolerance.
    if n == 0 || (n == known && tolerance >= WORTHWHILE) {
        let value = found.value;
        return Ok(Minimum { place: x, value });
    }
    let mut steps: Vec<f64> = variables.iter().map(|v| v.step).collect();
    let (mut gradient, mut inverse) =
        by_quotients(variables, &mut steps, &x, &found, &mut function)?;
    let mut lacking = difference(&gradient, &found.slope);
    // Are the gradient, and the Hessian, quotients made here?
    let (mut exact, mut fresh) = (true, true);
    if let Some(near) = known_inverse.take_if(|near| near.len() == n * n) {
        (inverse, fresh) = (near, false);
    }
    let mut stalled = 0;
    for _ in 0..ITERATIONS {
        let slack = function.slack(&x);
        let step = direction(variables, &x, &inverse, &gradient, slack.as_ref());
        if promised(&step, &gradient) <= tolerance {
            if exact {
                break;
            }
            // The slopes by the others are quotients already.
            let quotients = Quotients::new(variables, &steps, &x, &found, 0..known, &mut function)?;
            lacking = difference(&quotients.slope, &found.slope);
            gradient[..known].copy_from_slice(&quotients.slope);
            exact = true;
            continue;
        }
        let next = line_search(
            variables,
            &mut x,
            found.value,
            &gradient,
            &step,
            &mut function,
        )?;
        if let Some((next, moved)) = next {
            let decrease = found.value - next.value;
            let is_poor = decrease < WORTHWHILE && decrease < POOR * promised(&step, &gradient);
            stalled = if is_poor { stalled + 1 } else { 0 };
            found = next;
            if stalled >= STALLED {
                break;
            }
            let parts = found.slope.iter().zip(&lacking);
            let mut slopes: Vec<f64> = parts.map(|(a, b)| a + b).collect();
            let others = Quotients::new(variables, &steps, &x, &found, known..n, &mut function)?;
            shorten(&variables[known..], &others.curvature, &mut steps[known..]);
            slopes.extend(others.slope);
            update(&mut inverse, &moved, &difference(&slopes, &gradient));
            gradient = slopes;
            (exact, fresh) = (known == 0, false);
        } else if fresh {
            break;
        } else {
            (gradient, inverse) = by_quotients(variables, &mut steps, &x, &found, &mut function)?;
            lacking = difference(&gradient, &found.slope);
            (exact, fresh) = (true, true);
        }
    }
    *known_inverse = Some(inverse);
    Ok(Minimum {
        place: x,
        value: found.value,
    })
}

/// The first point along a step, ever shorter, at which the function is lower; x moves there.
fn line_search(
    variables: &[Variable],
    x: &mut [f64],
    value: f64,
    gradient: &[f64],
    step: &[f64],
    function: &mut impl Function,
) -> Result<Option<(Value, Vec<f64>)>, Error> {
    let mut share = 1.0;
    let mut trial = x.to_vec();
    for _ in 0..SHORTENINGS {
        let places = trial.iter_mut().zip(x.iter()).zip(variables).zip(step);
        for (((trial, x), variable), step) in places {
            *trial = (x + share * step).clamp(variable.low, variable.high);
        }
        keep_within(variables, &mut trial, function);
        let moved = difference(&trial, x);
        let found = function.at(&trial, Wanted::Slopes)?;
        if found.value < value + SUFFICIENT * product(gradient, &moved) && found.value < value {
            x.copy_from_slice(&trial);
            return Ok(Some((found, moved)));
        }
        share *= SHORTER;
    }
    Ok(None)
}

/// The gradient, and the inverse of the Hessian: the known curvature of the first variables, and that
/// of the quotients by each of the others alone; by each of all where the known one is not positive.
///
/// Mixed derivatives by the others are left to the update: where two of them have almost the same
/// effect, steps of Newton's run along the valley, past minima.
fn by_quotients(
    variables: &[Variable],
    steps: &mut [f64],
    x: &[f64],
    found: &Value,
    function: &mut impl Function,
) -> Result<(Vec<f64>, Vec<f64>), Error> {
    let (n, known) = (x.len(), found.slope.len());
    let mut quotients = Quotients::new(variables, steps, x, found, 0..n, function)?;
    if shorten(variables, &quotients.curvature, steps) {
        quotients = Quotients::new(variables, steps, x, found, 0..n, function)?;
    }
    let mut inverse = vec![0.0; n * n];
    for (i, bend) in quotients.curvature.iter().enumerate() {
        inverse[i * n + i] = 1.0 / bend;
    }
    if let Some(first) = inverted(&found.curvature, known) {
        for (to, from) in inverse
            .chunks_exact_mut(n)
            .zip(first.chunks_exact(known.max(1)))
        {
            to[..known].copy_from_slice(from);
        }
    }
    Ok((quotients.slope, inverse))
}

/// The inverse of a matrix of this size, by Cholesky's method on its unit diagonal; none for one that
/// is not positive definite.
fn inverted(matrix: &[f64], n: usize) -> Option<Vec<f64>> {
    let scales: Vec<f64> = (0..n).map(|i| matrix[i * n + i].sqrt().recip()).collect();
    if !scales.iter().all(|scale| scale.is_finite() && *scale > 0.0) {
        return None;
    }
    let mut l = vec![0.0; n * n];
    for i in 0..n {
        for j in 0..=i {
            let scaled = matrix[i * n + j] * scales[i] * scales[j];
            let left = scaled - product(&l[i * n..][..j], &l[j * n..][..j]);
            l[i * n + j] = if i > j {
                left / l[j * n + j]
            } else if left + RIDGE > 0.0 {
                (left + RIDGE).sqrt()
            } else {
                return None;
            };
        }
    }
    // The solutions for the unit vectors.
    let mut inverse = vec![0.0; n * n];
    for unit in 0..n {
        let mut column = vec![0.0; n];
        for i in unit..n {
            let done: f64 = (unit..i).map(|k| l[i * n + k] * column[k]).sum();
            column[i] = (f64::from(u8::from(i == unit)) - done) / l[i * n + i];
        }
        for i in (0..n).rev() {
            let done: f64 = (i + 1..n).map(|k| l[k * n + i] * column[k]).sum();
            column[i] = (column[i] - done) / l[i * n + i];
            inverse[unit * n + i] = column[i] * scales[unit] * scales[i];
        }
    }
    Some(inverse)
}

/// −H g over the variables that may move, no longer than allowed; zero for those at a bound that
/// would leave it. Where it crosses the bound on several variables, the least on that.
fn direction(
    variables: &[Variable],
    x: &[f64],
    inverse: &[f64],
    gradient: &[f64],
    slack: Option<&Slack>,
) -> Vec<f64> {
    let n = gradient.len();
    let moving: Vec<bool> = (0..n)
        .map(|i| {
            !((x[i] <= variables[i].low && gradient[i] > 0.0)
                || (x[i] >= variables[i].high && gradient[i] < 0.0))
        })
        .collect();
    // H times a vector, over those that may move.
    let times = |vector: &[f64]| -> Vec<f64> {
        let moved = |i: usize| {
            let others = (0..vector.len()).filter(|j| moving[*j]);
            others.map(|j| inverse[i * n + j] * vector[j]).sum::<f64>()
        };
        (0..n)
            .map(|i| if moving[i] { moved(i) } else { 0.0 })
            .collect()
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
    let mut scale: f64 = 1.0;
    for (entry, variable) in out.iter().zip(variables) {
        scale = scale.min(variable.longest / entry.abs());
    }
    out.iter_mut().for_each(|entry| *entry *= scale);
    out
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
mod tests {
    use super::*;

    fn variable(start: f64, low: f64, high: f64) -> Variable {
        Variable {
            start,
            low,
            high,
            step: 1e-3,
            longest: 0.06,
        }
    }

    /// A function of which no slope is known.
    fn unknown(value: f64) -> Result<Value, Error> {
        Ok(Value::new(value, 0))
    }

    #[test]
    fn a_curved_valley_is_followed_to_its_minimum() {
        let rosenbrock =
            |x: &[f64], _| unknown((1.0 - x[0]).powi(2) + 10.0 * (x[1] - x[0] * x[0]).powi(2));
        let around = [variable(-0.5, -9.0, 9.0), variable(0.5, -9.0, 9.0)];
        let found = minimise(&around, 1e-12, &mut None, rosenbrock);
        assert!(found.is_ok_and(|found| (found.place[0] - 1.0).abs() < 1e-3 && found.value < 1e-6));
    }

    #[test]
    fn the_inverse_of_a_search_near_by_saves_evaluations_and_changes_no_minimum() {
        // Two variables that almost have the same effect.
        let evaluations = std::cell::Cell::new(0);
        let valley = |place: f64, from: f64, near: &mut Option<Vec<f64>>| {
            evaluations.set(0);
            let around = [variable(from, -9.0, 9.0), variable(from + 0.4, -9.0, 9.0)];
            let around = around.map(|one| Variable {
                longest: 1.0,
                ..one
            });
            minimise(&around, 1e-9, near, |x: &[f64], _| {
                evaluations.set(evaluations.get() + 1);
                let (a, b) = (x[0] + x[1] - place, x[0] - x[1] + 0.3);
                unknown(50.0 * a * a + 0.5 * b * b + 0.01 * a.powi(4))
            })
            .unwrap()
        };
        let mut near = None;
        let first = valley(1.0, 0.0, &mut near);
        let after_first = valley(1.2, first.place[0], &mut near);
        let with_it = evaluations.get();
        let alone = valley(1.2, first.place[0], &mut None);
        assert!(
            with_it < evaluations.get(),
            "{with_it} of {}",
            evaluations.get()
        );
        assert!((after_first.value - alone.value).abs() < 1e-8);
    }

    #[test]
    fn a_minimum_beyond_a_bound_is_found_on_it() {
        let bowl = |x: &[f64], _| unknown((x[0] + 1.0).powi(2) + (x[1] - x[0] - 2.0).powi(2));
        let found = minimise(
            &[variable(1.0, 0.0, 9.0), variable(1.5, -9.0, 9.0)],
            1e-12,
            &mut None,
            bowl,
        );
        assert!(
            found.is_ok_and(|found| found.place[0] == 0.0 && (found.place[1] - 2.0).abs() < 1e-4)
        );
    }

    /// A function of a sum and the logarithm of a part of it, the rest of which is not below zero.
    struct Parts<F: Fn(f64, f64) -> f64>(F);

    impl<F: Fn(f64, f64) -> f64> Function for Parts<F> {
        fn slack(&self, place: &[f64]) -> Option<Slack> {
            let part = place[1].exp();
            Some(Slack {
                value: place[0] - part,
                slope: vec![1.0, -part],
            })
        }

        fn at(&mut self, place: &[f64], _: Wanted) -> Result<Value, Error> {
            let rest = self.slack(place).map_or(0.0, |slack| slack.value);
            assert!(rest > -1e-12, "{place:?}");
            unknown(self.0(rest, place[1].exp()))
        }
    }

    /// Where it is least: the rest, and the part.
    fn parts(start: (f64, f64), function: impl Fn(f64, f64) -> f64) -> (f64, f64) {
        let (rest, part) = start;
        let logarithm = Variable {
            step: 0.02,
            longest: 1.2,
            ..variable(part.ln(), -9.0, 9.0)
        };
        let around = [variable(rest + part, 0.0, 9.0), logarithm];
        let found = minimise(&around, 1e-12, &mut None, Parts(function)).unwrap();
        let part = found.place[1].exp();
        (found.place[0] - part, part)
    }

    #[test]
    fn a_minimum_beyond_a_bound_on_two_variables_is_found_on_it() {
        // Known best is the sum, and without the bound the rest would be −0.02 or −0.3.
        for far in [0.02, 0.3] {
            let valley = |rest: f64, part: f64| {
                let (sum, rest) = (rest + part - 0.5, rest + far);
                1e4 * sum * sum + rest * rest
            };
            for start in [(0.4, 0.1), (0.1, 0.1), (0.0, 0.9), (0.2, 0.05), (-0.3, 0.5)] {
                let (rest, part) = parts(start, valley);
                // The slope by the part is zero on the bound.
                assert!(rest.abs() < 1e-12, "{start:?} {rest}");
                assert!((part - 0.5).abs() < 1e-5, "{start:?} {part}");
            }
        }
    }

    #[test]
    fn a_bound_on_two_variables_is_left_where_the_function_falls_inwards() {
        let bowl = |rest: f64, part: f64| {
            100.0 * (rest - 0.2).powi(2) + 400.0 * (rest + part - 0.7).powi(2)
        };
        for start in [(0.0, 0.1), (0.0, 0.9), (0.01, 0.3)] {
            let (rest, part) = parts(start, bowl);
            assert!((rest - 0.2).abs() < 1e-3, "{start:?} {rest}");
            assert!((part - 0.5).abs() < 1e-3, "{start:?} {part}");
        }
    }

    #[test]
    fn a_known_slope_saves_evaluations_and_what_it_lacks_is_found() {
        // The sum of squares of a line and a curve, and a part whose slope is not known.
        let mut evaluations = 0;
        let function = |x: &[f64], _| {
            evaluations += 1;
            let (line, curve) = (x[0] + 2.0 * x[1] - 3.0, 10.0 * (x[1] - 0.1 * x[0] * x[0]));
            let by = [[1.0, -2.0 * x[0]], [2.0, 10.0]];
            let mut found = Value::new(line * line + curve * curve + 0.1 * x[0], 2);
            for i in 0..2 {
                found.slope[i] = 2.0 * (by[i][0] * line + by[i][1] * curve);
                for j in 0..2 {
                    found.curvature[2 * i + j] = 2.0 * (by[i][0] * by[j][0] + by[i][1] * by[j][1]);
                }
            }
            Ok(found)
        };
        let free = |start| Variable {
            longest: 10.0,
            ..variable(start, -9.0, 9.0)
        };
        let found = minimise(&[free(0.0), free(2.0)], 1e-10, &mut None, function);
        let from_nothing = minimise(&[free(0.0), free(2.0)], 1e-10, &mut None, |x: &[f64], _| {
            let (line, curve) = (x[0] + 2.0 * x[1] - 3.0, 10.0 * (x[1] - 0.1 * x[0] * x[0]));
            unknown(line * line + curve * curve + 0.1 * x[0])
        });
        let (Ok(found), Ok(expected)) = (found, from_nothing) else {
            unreachable!("the function has a value everywhere")
        };
        assert!((found.value - expected.value).abs() < 1e-8);
        assert!(evaluations < 25, "{evaluations} evaluations");
    }

    #[test]
    fn the_inverse_is_one_and_only_of_definite_matrices() {
        let matrix = [4.0, 1e-3, 2.0, 1e-3, 1e-6, 1e-4, 2.0, 1e-4, 3.0];
        let inverse = inverted(&matrix, 3).unwrap();
        for i in 0..3 {
            for j in 0..3 {
                let sum: f64 = (0..3).map(|k| matrix[i * 3 + k] * inverse[k * 3 + j]).sum();
                let size = (inverse[j * 3 + j] * matrix[i * 3 + i]).sqrt();
                let unit = if i == j { 1.0 } else { 0.0 };
                assert!((sum - unit).abs() < 1e-5 * size, "{i} {j} {sum}");
            }
        }
        assert_eq!(inverted(&[1.0, 2.0, 2.0, 1.0], 2), None);
        assert_eq!(inverted(&[f64::NAN], 1), None);
        assert_eq!(inverted(&[0.0], 1), None);
    }
}
