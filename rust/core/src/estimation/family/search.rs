//! Levenberg and Marquardt's search for a minimum of −2 ln L of one class.

use super::model::{Model, Point};
use super::tolerances::SEARCH;
use crate::linear_algebra::lu::Lu;
use crate::linear_algebra::vectors::dot;
use crate::{Error, Task};

/// Damping added where a number changes nothing, as a share of the largest.
const FLOOR: f64 = 1e-12;

/// The minimum from a start; it ends where −2 ln L would not fall to `hopeless` in time.
pub(super) fn minimum(
    model: &Model<'_>,
    start: Point,
    hopeless: f64,
    task: &Task,
) -> Result<Point, Error> {
    let mut best = start;
    let mut damping = SEARCH.damping;
    let count = model.rows.count() as f64;
    for _ in 0..SEARCH.steps {
        task.check()?;
        let columns = model.slopes(&best);
        let mut fallen = None;
        while damping < SEARCH.most_damping {
            let Some(x) = stepped(model, &best, &columns, damping) else {
                break;
            };
            let point = model.at(x);
            if point.squares < best.squares {
                fallen = Some(count * (best.squares - point.squares) / best.squares);
                best = point;
                damping /= SEARCH.change;
                break;
            }
            damping *= SEARCH.change * SEARCH.change;
        }
        let behind = model.deviance(&best) - hopeless;
        if fallen.is_none_or(|fall| fall < SEARCH.fall || SEARCH.catch_up * fall < behind) {
            break;
        }
    }
    task.advance(1);
    Ok(best)
}

/// The next point; `None` where nothing moves.
fn stepped(
    model: &Model<'_>,
    from: &Point,
    columns: &[Vec<f64>],
    damping: f64,
) -> Option<Vec<f64>> {
    let mut free: Vec<usize> = (0..columns.len()).collect();
    // A number that its range stops is left out, and the others step again.
    loop {
        let step = damped(columns, &from.whitened, &free, damping)?;
        let mut x = from.x.clone();
        for (at, step) in free.iter().zip(&step) {
            x[*at] += step;
        }
        let mut inside = x.clone();
        model.clamp(&mut inside);
        let stopped = |at: &usize| inside[*at] == from.x[*at] && x[*at] != from.x[*at];
        let moving: Vec<usize> = free.iter().copied().filter(|at| !stopped(at)).collect();
        if moving.len() == free.len() {
            return (inside != from.x).then_some(inside);
        }
        if moving.is_empty() {
            return None;
        }
        free = moving;
    }
}

fn damped(
    columns: &[Vec<f64>],
    residual: &[f64],
    free: &[usize],
    damping: f64,
) -> Option<Vec<f64>> {
    let n = free.len();
    let mut matrix = vec![0.0; n * n];
    for (i, left) in free.iter().enumerate() {
        for (j, right) in free.iter().enumerate() {
            matrix[i * n + j] = dot(&columns[*left], &columns[*right]);
        }
    }
    for i in 0..n {
        let own = matrix[i * n + i];
        matrix[i * n + i] = own * (1.0 + damping) + FLOOR * own + f64::MIN_POSITIVE;
    }
    let mut right: Vec<f64> = free.iter().map(|at| dot(&columns[*at], residual)).collect();
    Lu::regular(matrix, n)?.solve(&mut right);
    right.iter().all(|step| step.is_finite()).then_some(right)
}
