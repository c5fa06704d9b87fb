//! A number that several recordings share, and the ends of intervals of statistics that are called.
//!
//! Each statistic is the squared quantile t² for which a value is the end of an interval. Their sum over
//! independent recordings is least at the shared number, and its interval ends where the sum has risen
//! by the square of the quantile.

use super::statistics::normal_beyond;
use crate::between::{minimum, zero};
use crate::linear_algebra::symmetric::Symmetric;
use crate::{Error, Task};

/// Most evaluations of a search for the minimum.
const MOST: usize = 500;

/// Factor on the way from the start to each further place that is tried for an end.
const WIDER: f64 = 2.0;

/// Farthest end of a shared number beyond the grid, in steps of it.
const BEYOND: f64 = 1e10;

/// Least deviation of an estimate in a mixture.
const LEAST: f64 = 1e-12;

/// Where the end of an interval is searched.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Search {
    /// The first step from the start, below zero for a lower end.
    pub step: f64,
    /// The least end.
    pub floor: f64,
    /// Farthest way from the start that is tried.
    pub farthest: f64,
    /// Accuracy of the end.
    pub tolerance: f64,
}

/// Where the excess, below zero at the start, becomes zero on one side, or the floor where it does not;
/// and the farthest place that was tried, where it is below zero all the way.
///
/// # Errors
///
/// Those of the excess, and a stop of the task.
pub fn interval_end(
    mut excess: impl FnMut(f64) -> Result<f64, Error>,
    start: f64,
    search: Search,
    task: &Task,
) -> Result<Result<f64, f64>, Error> {
    let mut near = (start, excess(start)?);
    let mut way = search.step;
    while way.abs() <= search.farthest {
        task.check()?;
        let place = (start + way).max(search.floor);
        let far = (place, excess(place)?);
        if far.1 > 0.0 {
            return Ok(Ok(zero(&mut excess, near, far, search.tolerance)?));
        }
        if place == search.floor {
            return Ok(Ok(place));
        }
        near = far;
        way *= WIDER;
    }
    Ok(Err(near.0))
}

/// A number, and the ends of its interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shared {
    /// Where the sum is least.
    pub value: f64,
    /// The sum there.
    pub least: f64,
    /// The interval.
    pub ends: (f64, f64),
}

/// The number of the least sum between two ends, first on a grid of so many steps, with the ends where
/// the sum has risen by this; all to a tolerance, and none below the floor.
///
/// # Errors
///
/// Those of the sum, and where it does not rise so far.
pub fn shared_number(
    mut sum: impl FnMut(f64) -> Result<f64, Error>,
    (low, high): (f64, f64),
    steps: usize,
    (rise, floor, tolerance): (f64, f64, f64),
    task: &Task,
) -> Result<Shared, Error> {
    let step = (high - low) / steps as f64;
    let grid: Vec<f64> = (0..steps)
        .map(|i| low + step * i as f64)
        .chain([high])
        .collect();
    let totals = grid.iter().map(|place| sum(*place));
    let totals = totals.collect::<Result<Vec<f64>, Error>>()?;
    let lowest = (0..=steps).fold(0, |best, i| if totals[i] < totals[best] { i } else { best });
    let near = (
        grid[lowest.saturating_sub(1)],
        grid[(lowest + 1).min(steps)],
    );
    let found = minimum(&mut sum, near, tolerance, MOST)?;
    let (value, least) = if found.1 < totals[lowest] {
        found
    } else {
        (grid[lowest], totals[lowest])
    };
    let limit = least + rise;
    let inside = grid
        .iter()
        .zip(&totals)
        .filter(|(_, total)| **total < limit);
    let (first, last) = inside.fold((value, value), |(first, last), (place, _)| {
        (first.min(*place), last.max(*place))
    });
    let mut end = |start: f64, step: f64| {
        let search = Search {
            step,
            floor,
            farthest: BEYOND * step.abs(),
            tolerance,
        };
        match interval_end(|place| Ok(sum(place)? - limit), start, search, task)? {
            Ok(end) => Ok(end),
            Err(near) => refuse!("no end of the interval was found from {start:.6} to {near:.6}"),
        }
    };
    let ends = (end(first, -step)?, end(last, step)?);
    Ok(Shared { value, least, ends })
}

/// One of the estimates in a mixture: its weight, its value, and the ends of its interval of one deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Part {
    /// Its probability; those of all add up to one.
    pub weight: f64,
    /// Its value.
    pub value: f64,
    /// One deviation below and above it.
    pub ends: (f64, f64),
}

/// The interval of a mixture of estimates, each Gaussian on either side, at a level; between two ends, to a
/// tolerance.
///
/// # Errors
///
/// For ends that do not hold it.
pub fn mixture_interval(
    parts: &[Part],
    level: f64,
    (low, high): (f64, f64),
    tolerance: f64,
) -> Result<(f64, f64), Error> {
    let below = |place: f64| -> f64 {
        let share = |part: &Part| {
            let (down, up) = (part.value - part.ends.0, part.ends.1 - part.value);
            let size = if place < part.value { down } else { up };
            part.weight * normal_beyond((part.value - place) / size.max(LEAST))
        };
        parts.iter().map(share).sum()
    };
    let end = |probability: f64| {
        let excess = |place: f64| below(place) - probability;
        let (first, last) = (excess(low), excess(high));
        if first >= 0.0 {
            return Ok(low);
        }
        if last <= 0.0 {
            return Ok(high);
        }
        zero(
            |place| Ok(excess(place)),
            (low, first),
            (high, last),
            tolerance,
        )
    };
    Ok((end(0.5 - 0.5 * level)?, end(0.5 + 0.5 * level)?))
}

/// Lower and upper ends of quantities of numbers with a covariance: each from the moves of `reach` deviations
/// along its axes that lead there. `moved` has the change of each quantity by steps of the numbers.
///
/// # Errors
///
/// Those of `moved`.
pub fn secant_ends(
    mut moved: impl FnMut(&[f64]) -> Result<Vec<f64>, Error>,
    cov: &[f64],
    reach: f64,
) -> Result<(Vec<f64>, Vec<f64>), Error> {
    let n = cov.len().isqrt();
    let Symmetric { values, vectors } = Symmetric::new(cov, n);
    let (mut below, mut above) = (Vec::new(), Vec::new());
    for (value, vector) in values.iter().zip(&vectors) {
        let size = reach * value.max(0.0).sqrt();
        let mut each = Vec::new();
        for sign in [size, -size] {
            let step: Vec<f64> = vector.iter().map(|x| sign * x).collect();
            each.push(moved(&step)?);
        }
        let count = each[0].len();
        below.resize(count, 0.0_f64);
        above.resize(count, 0.0_f64);
        for i in 0..count {
            // Where there is no value beside one that is, the interval is open.
            let changes = each.iter().map(|one| {
                if one[i].is_nan() {
                    f64::INFINITY
                } else {
                    one[i]
                }
            });
            let (least, most) = changes.fold((0.0_f64, 0.0_f64), |(low, high), change| {
                (low.min(change), high.max(change))
            });
            below[i] += least * least;
            above[i] += most * most;
        }
    }
    let root = |squares: Vec<f64>| squares.into_iter().map(f64::sqrt).collect();
    Ok((root(below), root(above)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_of_a_line_are_those_of_the_delta_method() {
        // 2 x + y with standard errors of 1 and 2 and a correlation of a half: √(4 + 4 + 4).
        let line = |step: &[f64]| Ok(vec![2.0 * step[0] + step[1]]);
        let (below, above) = secant_ends(line, &[1.0, 1.0, 1.0, 4.0], 1.0).unwrap();
        assert!((below[0] - 12.0_f64.sqrt()).abs() < 1e-12);
        assert!((above[0] - 12.0_f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn a_mixture_of_one_has_its_own_interval() {
        let part = Part {
            weight: 1.0,
            value: 2.0,
            ends: (1.9, 2.2),
        };
        let found = mixture_interval(&[part], 0.95, (0.0, 5.0), 1e-12).unwrap();
        let reach = 1.959_963_984_540_054;
        assert!((found.0 - (2.0 - 0.1 * reach)).abs() < 1e-9);
        assert!((found.1 - (2.0 + 0.2 * reach)).abs() < 1e-9);
    }

    #[test]
    fn two_parabolas_share_the_number_between_them() {
        // Two measurements of 1 and 3 with an error of one each: 2, with an error of 1/√2.
        let sum = |x: f64| Ok((x - 1.0).powi(2) + (x - 3.0).powi(2));
        let found = shared_number(
            sum,
            (-1.0, 5.0),
            24,
            (1.0, f64::NEG_INFINITY, 1e-9),
            &Task::new(),
        );
        let found = found.unwrap();
        assert!((found.value - 2.0).abs() < 1e-8 && (found.least - 2.0).abs() < 1e-12);
        let half = 0.5_f64.sqrt();
        assert!((found.ends.0 - (2.0 - half)).abs() < 1e-8);
        assert!((found.ends.1 - (2.0 + half)).abs() < 1e-8);
    }

    #[test]
    fn an_end_is_no_lower_than_the_floor_and_may_be_beyond_what_is_tried() {
        let search = |floor, farthest| Search {
            step: -1.0,
            floor,
            farthest,
            tolerance: 1e-9,
        };
        let flat = |_| Ok(-1.0);
        let at = |search| interval_end(flat, 5.0, search, &Task::new()).unwrap();
        assert_eq!(at(search(0.0, 100.0)), Ok(0.0));
        assert_eq!(at(search(f64::NEG_INFINITY, 10.0)), Err(-3.0));
    }
}
