//! Levenberg and Marquardt's search for a minimum of −2 ln L of one class.

use super::super::damped::{Normal, stepped};
use super::model::{Model, Point};
use super::tolerances::SEARCH;
use crate::{Error, Task};

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
        let normal = Normal::new(&model.slopes(&best), &best.whitened);
        let mut fallen = None;
        while damping < SEARCH.most_damping {
            let clamp = |x: &mut [f64]| model.clamp(x);
            let next = stepped(&normal, &best.x, clamp, damping);
            let Some(x) = next else {
                break;
            };
            // A step that a range cuts short may promise more where it is shorter.
            if count * normal.promised(&best.x, &x) < SEARCH.fall * best.squares {
                damping *= SEARCH.change * SEARCH.change;
                continue;
            }
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
