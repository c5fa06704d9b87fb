//! Where the searches of a class start: a grid of delays and time constants, and the minima of the
//! classes that it contains, so that none is less likely than those.

use super::class::{Class, Numbers};
use super::model::{Model, Point};
use super::tolerances::{RANGES, STARTS};
use crate::elementary::{exp, log};
use crate::{Error, Task};

/// Numbers of the noise under which a drift explains little: a correlation near one.
const DRIFTING: f64 = 10.0;

/// The best points of a grid for a class without a zero, under white noise or a drift.
pub(super) fn grid(model: &Model<'_>, task: &Task) -> Result<Vec<Vec<f64>>, Error> {
    let class = model.class;
    if class.has_zero {
        return Ok(Vec::new());
    }
    let mut noise = vec![0.0; model.noise.searched()];
    if let Some(correlation) = noise.first_mut() {
        *correlation = DRIFTING;
    }
    let delays = if class.order == 0 {
        STARTS.delays
    } else {
        STARTS.few_delays
    };
    let mut points: Vec<(f64, Vec<f64>)> = Vec::new();
    for step in 0..delays {
        task.check()?;
        // Denser at small delays.
        let share = step as f64 / (delays - 1) as f64;
        let delay = model.rows.largest_delay * share * share;
        for shape in shapes(model) {
            let x = model.point_of(&Numbers { delay, ..shape }, &noise);
            let squares = model.at(x.clone()).squares;
            points.push((squares, x));
        }
    }
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut out: Vec<Vec<f64>> = Vec::new();
    for (_, x) in points {
        if out.len() < class.starts(STARTS.gridded)
            && out.iter().all(|known| are_apart(model, known, &x))
        {
            out.push(x);
        }
    }
    Ok(out)
}

/// Do two points belong to different minima, as far as their delays say?
pub(super) fn are_apart(model: &Model<'_>, one: &[f64], other: &[f64]) -> bool {
    let far = (one[0] - other[0]).abs() > STARTS.apart * model.rows.row;
    let shapes = one[1..].iter().zip(&other[1..]).take(model.class.order);
    far || shapes
        .into_iter()
        .any(|(one, other)| (one - other).abs() > 1.0)
}

fn shapes(model: &Model<'_>) -> Vec<Numbers> {
    let none = Numbers::of_delay(0.0);
    if model.class.order == 0 {
        return vec![none];
    }
    let (low, high) = (log(model.rows.row), log(model.rows.span));
    let mut out = Vec::new();
    for step in 0..STARTS.lags {
        let time = exp(low + (high - low) * step as f64 / (STARTS.lags - 1) as f64);
        if model.class.order == 1 {
            out.push(Numbers { sum: time, ..none });
            continue;
        }
        for damping in STARTS.dampings {
            out.push(Numbers {
                sum: 2.0 * damping * time,
                product: time * time,
                ..none
            });
        }
    }
    out
}

/// Numbers of a class from a minimum of one that it contains; none if it does not contain it.
pub(super) fn nested(model: &Model<'_>, smaller: Class, numbers: &Numbers) -> Vec<Numbers> {
    let class = model.class;
    if smaller == class {
        return vec![*numbers];
    }
    if !smaller.leads_to(class) {
        return Vec::new();
    }
    let mut current = vec![*numbers];
    let mut kind = smaller;
    if kind.integrating && !class.integrating {
        // An integrator is the slowest lag.
        let slow = 0.25 * RANGES.slowest * model.rows.span;
        current
            .iter_mut()
            .for_each(|numbers| *numbers = with_lag(numbers, slow));
        kind.integrating = false;
        kind.order += 1;
    }
    while kind.order < class.order {
        current = current
            .iter()
            .flat_map(|numbers| lagged(model, numbers))
            .collect();
        kind.order += 1;
    }
    if class.has_zero && !kind.has_zero {
        let zeros = |numbers: &Numbers| {
            let with = |zero: f64, delay: f64| Numbers {
                zero,
                delay,
                ..*numbers
            };
            // Also one that answers the wrong way at first, in the place of a half of the delay.
            let half = 0.5 * numbers.delay;
            let lead = 0.5 * numbers.sum;
            [
                with(0.0, numbers.delay),
                with(lead, numbers.delay),
                with(-half, half),
            ]
        };
        current = current.iter().flat_map(zeros).collect();
    }
    current
}

/// With one lag more.
fn with_lag(numbers: &Numbers, lag: f64) -> Numbers {
    Numbers {
        product: numbers.product + numbers.sum * lag,
        sum: numbers.sum + lag,
        ..*numbers
    }
}

/// With a lag in the place of a part of the delay: almost none of it, and a half.
fn lagged(model: &Model<'_>, numbers: &Numbers) -> [Numbers; 2] {
    let least = 2.0 * RANGES.fastest * model.rows.row;
    [0.0, 0.5].map(|share| {
        let lag = (share * numbers.delay).max(least);
        let delay = (numbers.delay - lag).max(0.0);
        with_lag(&Numbers { delay, ..*numbers }, lag)
    })
}

/// The better noise to start from, for residuals: numbers of this model, from those of the one before.
pub(super) fn noise(model: &Model<'_>, from: &Point, known: &[f64]) -> Vec<f64> {
    const CORRELATIONS: [f64; 3] = [0.3, 1.5, 4.0];
    const AVERAGES: [f64; 2] = [0.0, -0.5];
    // Noise that is integrated twice, or a wave.
    const RESONANT: f64 = -2.0;
    let mut candidates: Vec<Vec<f64>> = Vec::new();
    for ar in CORRELATIONS {
        for ma in AVERAGES {
            candidates.push(match model.noise.order() {
                0 => Vec::new(),
                1 => vec![ar, ma],
                _ => vec![ar, 0.0, ma, 0.0],
            });
        }
        if model.noise.order() == 2 {
            candidates.push(vec![ar, RESONANT, 0.0, 0.0]);
        }
    }
    if let [ar, ma] = known
        && model.noise.order() == 2
    {
        candidates.push(vec![*ar, 0.0, *ma, 0.0]);
    }
    let mut best = (f64::INFINITY, Vec::new());
    for candidate in candidates {
        let squares = model.squares_of(&from.residual, &candidate);
        if squares < best.0 {
            best = (squares, candidate);
        }
    }
    best.1
}
