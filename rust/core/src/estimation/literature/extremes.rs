//! Peaks and valleys of a response around its reference.
//!
//! An extreme is the vertex of a cubic fitted around it, so it may lie between samples and averages
//! noise. In a stable linear loop each is smaller than the one before by a constant factor.

use crate::linear_algebra::lu::Lu;

/// What counts as an extreme.
struct Reading {
    /// Smallest height in deviations of the noise: the largest of some hundred samples of noise, part of
    /// it amplified by the loop, stays below. More misses small ones.
    clear: f64,
    /// Heights below this share of the step are rounding.
    smallest: f64,
    /// Part of a half period to which a cubic is fitted on either side: more averages more noise, and
    /// deviates more from a cosine: by 1.6 % at these ends and far less at the vertex.
    fitted: f64,
    /// Fewest samples of a fit.
    fewest: usize,
}

const READING: Reading = Reading {
    clear: 5.0,
    smallest: 1e-6,
    fitted: 0.25,
    fewest: 5,
};

/// When extremes decay.
struct Decaying {
    /// Fewest, the first included, from which it is decided.
    fewest: usize,
    /// Each is smaller than the one before by this share, as 4 % below the largest stable gain.
    least: f64,
    /// … and by so many standard errors.
    clearance: f64,
    /// Or the last is below this share of the first.
    decayed: f64,
    /// Or half periods vary by more than this share, as no limit cycle does.
    uneven: f64,
}

const DECAYING: Decaying = Decaying {
    fewest: 4,
    least: 0.05,
    clearance: 2.0,
    decayed: 0.7,
    uneven: 0.25,
};

/// A peak or valley.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extreme {
    /// s.
    pub time: f64,
    /// Beyond the reference, as a share of the step.
    pub height: f64,
    /// Standard error.
    pub time_error: f64,
    /// Standard error.
    pub height_error: f64,
}

/// Peaks and valleys of `beyond` above the noise, from the first peak on.
pub fn extremes(since: &[f64], beyond: &[f64], noise: f64) -> Vec<Extreme> {
    let least = (READING.clear * noise).max(READING.smallest);
    let mut places: Vec<usize> = Vec::new();
    let mut side = -1.0;
    for (row, value) in beyond.iter().enumerate() {
        if side * value < -least {
            // Clearly on the other side of the reference.
            side = -side;
            places.push(row);
        } else if let Some(last) = places.last_mut()
            && side * value > side * beyond[*last]
        {
            *last = row;
        }
    }
    let mut found = Vec::new();
    for (index, place) in places.iter().enumerate() {
        let near = &places[index.saturating_sub(1)..(index + 2).min(places.len())];
        let half = match near {
            [first, .., last] => (since[*last] - since[*first]) / (near.len() - 1) as f64,
            _ => since[*place],
        };
        match vertex(since, beyond, noise, *place, READING.fitted * half) {
            Some(extreme) => found.push(extreme),
            None => break,
        }
    }
    found
}

/// Vertex of a cubic through what lies within `reach` of a sample; none where there is none.
fn vertex(since: &[f64], beyond: &[f64], noise: f64, place: usize, reach: f64) -> Option<Extreme> {
    let rows = 0..since.len();
    let within = |row: &usize| (since[*row] - since[place]).abs() <= reach;
    let mut near: Vec<usize> = rows.clone().filter(within).collect();
    if near.len() < READING.fewest {
        near = rows.filter(|row| row.abs_diff(place) <= 2).collect();
    }
    // The window may end before the extreme is over.
    if near.len() < READING.fewest || near.last() == Some(&(since.len() - 1)) {
        return None;
    }
    let times: Vec<f64> = near
        .iter()
        .map(|row| (since[*row] - since[place]) / reach)
        .collect();
    let values: Vec<f64> = near.iter().map(|row| beyond[*row]).collect();
    // With noise a cubic may have no vertex; a parabola always has one.
    let degrees: &[usize] = if times.len() > READING.fewest {
        &[3, 2]
    } else {
        &[2]
    };
    for degree in degrees {
        let (curve, cov) = polynomial(&times, &values, *degree)?;
        if let Some(at) = nearest_extreme(&curve) {
            let n = curve.len();
            let powers: Vec<f64> = (0..n).map(|k| at.powi(k as i32)).collect();
            let rates: Vec<f64> = (0..n)
                .map(|k| {
                    if k == 0 {
                        0.0
                    } else {
                        k as f64 * powers[k - 1]
                    }
                })
                .collect();
            let size = |x: &[f64]| {
                let sum: f64 = (0..n * n).map(|i| x[i / n] * cov[i] * x[i % n]).sum();
                sum.sqrt()
            };
            let noise = noise.max(READING.smallest);
            return Some(Extreme {
                time: since[place] + reach * at,
                height: value(&curve, at).abs(),
                time_error: noise * size(&rates) / bend(&curve, at).abs() * reach,
                height_error: noise * size(&powers),
            });
        }
    }
    None
}

/// Coefficients, ascending, and their covariance for noise of unit size.
fn polynomial(times: &[f64], values: &[f64], degree: usize) -> Option<(Vec<f64>, Vec<f64>)> {
    let n = degree + 1;
    let mut matrix = vec![0.0; n * n];
    let mut right = vec![0.0; n];
    for (t, value) in times.iter().zip(values) {
        for i in 0..n {
            right[i] += t.powi(i as i32) * value;
            for j in 0..n {
                matrix[i * n + j] += t.powi((i + j) as i32);
            }
        }
    }
    let factors = Lu::regular(matrix, n)?;
    factors.solve(&mut right);
    Some((right, factors.inverse()))
}

fn value(curve: &[f64], x: f64) -> f64 {
    curve.iter().rev().fold(0.0, |sum, c| sum * x + c)
}

fn bend(curve: &[f64], x: f64) -> f64 {
    let cubic = curve.get(3).copied().unwrap_or(0.0);
    2.0 * curve[2] + 6.0 * cubic * x
}

/// The extreme of the absolute value of the curve within −1 to 1 that is nearest to 0.
fn nearest_extreme(curve: &[f64]) -> Option<f64> {
    let (a, b, c) = (
        3.0 * curve.get(3).copied().unwrap_or(0.0),
        2.0 * curve[2],
        curve[1],
    );
    let roots = if a == 0.0 {
        vec![-c / b]
    } else {
        let root = (b * b - 4.0 * a * c).sqrt();
        let q = -0.5 * (b + root.copysign(b));
        vec![q / a, c / q]
    };
    let fits = |x: &f64| x.abs() <= 1.0 && bend(curve, *x) * value(curve, *x) < 0.0;
    let found = roots.into_iter().filter(fits);
    found.min_by(|one, other| one.abs().total_cmp(&other.abs()))
}

/// Do the extremes after the first decay? Where they are too few to decide, they do.
pub fn decay(extremes: &[Extreme]) -> bool {
    if extremes.len() < DECAYING.fewest {
        return true;
    }
    // The first one belongs to the step itself, which a limit may prolong.
    let index: Vec<f64> = (0..extremes.len() - 1).map(|i| i as f64).collect();
    let logs: Vec<f64> = extremes[1..].iter().map(|e| libm::log(e.height)).collect();
    let errors: Vec<f64> = extremes[1..]
        .iter()
        .map(|e| e.height_error / e.height)
        .collect();
    let (slope, error) = weighted_slope(&index, &logs, &errors);
    let half: Vec<f64> = extremes
        .windows(2)
        .map(|pair| pair[1].time - pair[0].time)
        .collect();
    let mean = half.iter().sum::<f64>() / half.len() as f64;
    let square: f64 = half.iter().map(|h| (h - mean).powi(2)).sum();
    let first = extremes.first().map_or(0.0, |e| e.height);
    let last = extremes.last().map_or(0.0, |e| e.height);
    last < DECAYING.decayed * first
        || -slope > DECAYING.least.max(DECAYING.clearance * error)
        || (square / half.len() as f64).sqrt() > DECAYING.uneven * mean
}

/// Slope of a weighted line, and its standard error.
pub(super) fn weighted_slope(index: &[f64], values: &[f64], errors: &[f64]) -> (f64, f64) {
    let weights: Vec<f64> = errors.iter().map(|e| 1.0 / (e * e)).collect();
    let total: f64 = weights.iter().sum();
    let centre = weights.iter().zip(index).map(|(w, x)| w * x).sum::<f64>() / total;
    let mut power = 0.0;
    let mut sum = 0.0;
    for ((w, x), y) in weights.iter().zip(index).zip(values) {
        power += w * (x - centre).powi(2);
        sum += w * (x - centre) * y;
    }
    (sum / power, 1.0 / power.sqrt())
}
