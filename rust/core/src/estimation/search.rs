//! Minimum of a function of a few variables within bounds, by a quasi-Newton method.
//!
//! The inverse Hessian is that of Broyden, Fletcher, Goldfarb and Shanno from a diagonal of
//! difference quotients, of which the caller may know more; variables at a bound that would leave it are held there (Bertsekas 1982).
//! Gradients are central difference quotients, for which the function may have kinks in its second
//! derivative.

use crate::Error;

/// Most iterations.
const ITERATIONS: usize = 60;

/// Most halvings of a step.
const HALVINGS: usize = 12;

/// Share of the predicted decrease that a step has to reach (Armijo).
const SUFFICIENT: f64 = 1e-4;

/// Longest step of a variable, in its units of difference quotients.
const LONGEST: f64 = 60.0;

/// Largest change of the gradient over a step of difference quotients, times that step: where the
/// function is steep, a long step sees its third derivative.
const STEEPEST: f64 = 0.04;

/// Smallest second derivative by the units of difference quotients.
const FLATTEST: f64 = 1e-4;

/// A variable: where it starts and may go, and the longest step of its difference quotients.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Variable {
    pub(super) start: f64,
    pub(super) low: f64,
    pub(super) high: f64,
    pub(super) step: f64,
}

/// Where the function is least.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Minimum {
    pub(super) place: Vec<f64>,
    pub(super) value: f64,
}

/// Search from the starting point until a step promises less than `tolerance`.
///
/// `metric` is given a point and the diagonal there, and puts in what it knows of the inverse Hessian.
pub(super) fn minimise(
    variables: &[Variable],
    tolerance: f64,
    metric: impl Fn(&[f64], &mut [f64]) -> Result<(), Error>,
    mut function: impl FnMut(&[f64]) -> Result<f64, Error>,
) -> Result<Minimum, Error> {
    let n = variables.len();
    let mut x: Vec<f64> = variables
        .iter()
        .map(|v| v.start.clamp(v.low, v.high))
        .collect();
    let mut value = function(&x)?;
    if n == 0 {
        return Ok(Minimum { place: x, value });
    }
    let mut steps: Vec<f64> = variables.iter().map(|v| v.step).collect();
    let (mut gradient, mut curvature) = derivatives(variables, &steps, &x, value, &mut function)?;
    if shorten(variables, &curvature, &mut steps) {
        (gradient, curvature) = derivatives(variables, &steps, &x, value, &mut function)?;
    }
    let mut inverse = diagonal(&curvature);
    metric(&x, &mut inverse)?;
    let mut fresh = true;
    for _ in 0..ITERATIONS {
        let moving: Vec<bool> = (0..n)
            .map(|i| {
                !((x[i] <= variables[i].low && gradient[i] > 0.0)
                    || (x[i] >= variables[i].high && gradient[i] < 0.0))
            })
            .collect();
        let direction = direction(variables, &inverse, &gradient, &moving);
        let slope = product(&direction, &gradient);
        if slope.is_nan() || -0.5 * slope <= tolerance {
            if fresh {
                break;
            }
            inverse = diagonal(&curvature);
            metric(&x, &mut inverse)?;
            fresh = true;
            continue;
        }
        let mut share = 1.0;
        let mut next = None;
        for _ in 0..HALVINGS {
            let trial: Vec<f64> = (0..n)
                .map(|i| (x[i] + share * direction[i]).clamp(variables[i].low, variables[i].high))
                .collect();
            let moved: Vec<f64> = trial.iter().zip(&x).map(|(a, b)| a - b).collect();
            let found = function(&trial)?;
            if found < value + SUFFICIENT * product(&gradient, &moved) && found < value {
                next = Some((trial, moved, found));
                break;
            }
            share *= 0.4;
        }
        let Some((trial, moved, found)) = next else {
            if fresh {
                break;
            }
            inverse = diagonal(&curvature);
            metric(&x, &mut inverse)?;
            fresh = true;
            continue;
        };
        let (slopes, bends) = derivatives(variables, &steps, &trial, found, &mut function)?;
        let change: Vec<f64> = slopes.iter().zip(&gradient).map(|(a, b)| a - b).collect();
        update(&mut inverse, &moved, &change);
        fresh = false;
        (x, value, gradient, curvature) = (trial, found, slopes, bends);
        shorten(variables, &curvature, &mut steps);
    }
    Ok(Minimum { place: x, value })
}

/// Fit the steps of difference quotients to these second derivatives; is one much shorter?
fn shorten(variables: &[Variable], curvature: &[f64], steps: &mut [f64]) -> bool {
    let mut is_shorter = false;
    for ((variable, bend), step) in variables.iter().zip(curvature).zip(steps) {
        let before = *step;
        *step = variable.step.min((STEEPEST / bend).sqrt());
        is_shorter |= *step < 0.5 * before;
    }
    is_shorter
}

/// Gradient and second derivatives by difference quotients, one-sided at a bound.
fn derivatives(
    variables: &[Variable],
    steps: &[f64],
    x: &[f64],
    value: f64,
    function: &mut impl FnMut(&[f64]) -> Result<f64, Error>,
) -> Result<(Vec<f64>, Vec<f64>), Error> {
    let mut gradient = Vec::with_capacity(x.len());
    let mut curvature = Vec::with_capacity(x.len());
    let mut at = x.to_vec();
    for (i, (variable, step)) in variables.iter().zip(steps).enumerate() {
        let flattest = FLATTEST / (variable.step * variable.step);
        let (up, down) = (
            step.min(variable.high - x[i]),
            step.min(x[i] - variable.low),
        );
        at[i] = x[i] + up;
        let higher = if up > 0.0 { function(&at)? } else { value };
        at[i] = x[i] - down;
        let lower = if down > 0.0 { function(&at)? } else { value };
        at[i] = x[i];
        if up > 0.0 && down > 0.0 && higher.is_finite() && lower.is_finite() {
            let (right, left) = ((higher - value) / up, (value - lower) / down);
            gradient.push((right * down + left * up) / (up + down));
            curvature.push((2.0 * (right - left) / (up + down)).max(flattest));
        } else {
            let (far, distance) = if up > 0.0 && higher.is_finite() {
                (higher, up)
            } else {
                (lower, -down)
            };
            let slope = (far - value) / distance;
            gradient.push(if slope.is_finite() { slope } else { 0.0 });
            curvature.push((slope.abs() / step).max(flattest));
        }
    }
    Ok((gradient, curvature))
}

fn diagonal(curvature: &[f64]) -> Vec<f64> {
    let n = curvature.len();
    let mut out = vec![0.0; n * n];
    for (i, bend) in curvature.iter().enumerate() {
        out[i * n + i] = 1.0 / bend;
    }
    out
}

/// −H g over the moving variables, no longer than allowed.
fn direction(
    variables: &[Variable],
    inverse: &[f64],
    gradient: &[f64],
    moving: &[bool],
) -> Vec<f64> {
    let n = gradient.len();
    let mut out = vec![0.0; n];
    let mut scale: f64 = 1.0;
    for i in (0..n).filter(|i| moving[*i]) {
        for j in (0..n).filter(|j| moving[*j]) {
            out[i] -= inverse[i * n + j] * gradient[j];
        }
        scale = scale.min(LONGEST * variables[i].step / out[i].abs());
    }
    out.iter_mut().for_each(|entry| *entry *= scale);
    out
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
        }
    }

    #[test]
    fn a_curved_valley_is_followed_to_its_minimum() {
        let rosenbrock = |x: &[f64]| Ok((1.0 - x[0]).powi(2) + 10.0 * (x[1] - x[0] * x[0]).powi(2));
        let around = [variable(-0.5, -9.0, 9.0), variable(0.5, -9.0, 9.0)];
        let found = minimise(&around, 1e-12, |_, _| Ok(()), rosenbrock);
        assert!(found.is_ok_and(|found| (found.place[0] - 1.0).abs() < 1e-3 && found.value < 1e-6));
    }

    #[test]
    fn a_minimum_beyond_a_bound_is_found_on_it() {
        let bowl = |x: &[f64]| Ok((x[0] + 1.0).powi(2) + (x[1] - x[0] - 2.0).powi(2));
        let found = minimise(
            &[variable(1.0, 0.0, 9.0), variable(1.5, -9.0, 9.0)],
            1e-12,
            |_, _| Ok(()),
            bowl,
        );
        assert!(
            found.is_ok_and(|found| found.place[0] == 0.0 && (found.place[1] - 2.0).abs() < 1e-4)
        );
    }
}
