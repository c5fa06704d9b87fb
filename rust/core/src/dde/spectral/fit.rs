//! Polynomial pieces for a history that is given as a function.
//!
//! The function is sampled evenly first, at no more than a given gap, and every piece must agree
//! with the samples within it: a feature that lasts longer than the gap is found, a shorter one may
//! be missed. Each piece is interpolated at 20 Chebyshev points of the first kind, which do not
//! include its ends, so that the value exactly at a jump does not matter. Where the last
//! coefficients are not below the tolerance, or a sample is missed, the piece is halved. The
//! tolerance is at least the error that rounding of the time causes in the values. Around an
//! undeclared kink or jump the pieces become very short, and the shortest of a sequence of them is
//! taken as a breaking point. Close to a joint, where there are no points, a kink shows in values
//! or slopes that differ there, and is found by bisection.

use super::breaks::BreakingPoint;
use super::chebyshev;
use super::history::Piece;
use crate::Error;

const POINTS: usize = 20;
/// Coefficients at the end that must be small.
const TAIL: usize = 4;
/// Upper limit on the halvings of a stretch, at which a jump is located up to rounding errors.
const DEEPEST: u32 = 44;
/// Number of halvings from which on a piece indicates a kink.
const KINKED: u32 = 14;
/// Differences at a joint, in tolerances, that indicate a break.
const LOUD: f64 = 100.0;
/// Breaking points closer than this share of the history are merged.
const SAME: f64 = 1e-9;
/// Distance from the ends at which a piece is checked, as a share of it.
const EDGE: f64 = 1e-7;
/// Largest error there, in tolerances: the sum of what the tail neglects.
const NEAR: f64 = 20.0;
/// Share of a piece at its ends without points.
const MARGIN: f64 = 2e-3;
/// Upper limit on the rounds in which the pieces are computed again with more breaking points.
const ROUNDS: u32 = 3;
/// Upper limit on the pieces of one history.
const MOST: usize = 20_000;
/// Upper limit on the even samples of one history.
const MOST_SAMPLES: f64 = 1e6;
/// Error of a function in units of its time: its arithmetic has rounding errors as well.
pub(super) const UNITS: f64 = 8.0 * f64::EPSILON;
/// Largest error of the values from rounding of the time, as a share of their variation on a piece.
/// Where it is larger, the piece is too short to be distinguished from a jump.
const BLURRED: f64 = 1e-3;

/// Rounding error of a value relative to its size.
const VALUE_ROUNDING: f64 = 1e-15;

/// Pieces of a function, and the breaking points found in it.
#[derive(Debug, Clone, Default)]
pub struct Approximation {
    /// In the order of time.
    pub pieces: Vec<Piece>,
    /// Kinks and jumps.
    pub breaks: Vec<BreakingPoint>,
    /// Bounds on the components.
    pub(super) sizes: Vec<f64>,
}

/// Approximate `function`, which writes `dim` values for each of some times, on [start, end] to `tolerance`, with joints
/// at the `breaks` in between. A deviation from a smooth function that lasts longer than `gap` is
/// found.
pub fn approximate(
    (start, end): (f64, f64),
    gap: f64,
    breaks: &[f64],
    dim: usize,
    tolerance: impl Fn(usize, f64) -> f64,
    mut function: impl FnMut(&[f64], &mut [f64]) -> Result<(), Error>,
) -> Result<Approximation, Error> {
    let mut breaks = breaks.to_vec();
    let samples = Samples::new(&joints((start, end), &breaks), gap, dim, &mut function)?;
    for _ in 0..ROUNDS {
        let joints = joints((start, end), &breaks);
        let found = divide(&joints, &samples, dim, &tolerance, &mut function)?;
        let known = breaks.len();
        for pair in found.pieces.windows(2) {
            if !joins(&pair[0], &pair[1], &found.sizes, &tolerance) {
                let time = meeting(&pair[0], &pair[1], dim, &mut function)?;
                if breaks
                    .iter()
                    .all(|other| (other - time).abs() > SAME * (end - start))
                {
                    breaks.push(time);
                }
            }
        }
        if breaks.len() == known {
            return Ok(found);
        }
    }
    let joints = joints((start, end), &breaks);
    divide(&joints, &samples, dim, &tolerance, &mut function)
}

/// Start, breaks in between and end, in order.
fn joints((start, end): (f64, f64), breaks: &[f64]) -> Vec<f64> {
    let mut joints = vec![start];
    joints.extend(breaks.iter().filter(|time| **time > start && **time < end));
    joints.push(end);
    joints.sort_by(f64::total_cmp);
    joints.dedup();
    joints
}

/// Even samples of a function between its joints.
struct Samples {
    times: Vec<f64>,
    /// One time after the other.
    values: Vec<f64>,
}

impl Samples {
    /// At the middles of equal parts no longer than `gap`, hence never at a joint.
    fn new(
        joints: &[f64],
        gap: f64,
        dim: usize,
        function: &mut impl FnMut(&[f64], &mut [f64]) -> Result<(), Error>,
    ) -> Result<Self, Error> {
        let whole = joints
            .last()
            .zip(joints.first())
            .map_or(0.0, |(b, a)| b - a);
        let gap = gap.max(whole / MOST_SAMPLES);
        let mut times = Vec::new();
        for pair in joints.windows(2) {
            let parts = ((pair[1] - pair[0]) / gap).ceil().max(1.0);
            let width = (pair[1] - pair[0]) / parts;
            times.extend((0..parts as usize).map(|i| pair[0] + (i as f64 + 0.5) * width));
        }
        let mut values = vec![0.0; dim * times.len()];
        function(&times, &mut values)?;
        Ok(Self { times, values })
    }

    /// Those within a piece, with their times.
    fn within(&self, piece: &Piece, dim: usize) -> impl Iterator<Item = (f64, &[f64])> {
        let first = self.times.partition_point(|time| *time <= piece.start);
        let beyond = self.times.partition_point(|time| *time < piece.end);
        let values = self.values.chunks_exact(dim.max(1));
        let times = self.times.iter().copied().zip(values);
        times.take(beyond).skip(first)
    }
}

/// The time near a joint at which a function passes from one piece to the next; neither piece has
/// points there.
fn meeting(
    left: &Piece,
    right: &Piece,
    dim: usize,
    function: &mut impl FnMut(&[f64], &mut [f64]) -> Result<(), Error>,
) -> Result<f64, Error> {
    let mut low = left.end - MARGIN * (left.end - left.start);
    let mut high = right.start + MARGIN * (right.end - right.start);
    let (mut value, mut before, mut after) = (vec![0.0; dim], vec![0.0; dim], vec![0.0; dim]);
    let mut middle = left.end;
    while low < middle && middle < high {
        function(&[middle], &mut value)?;
        left.value(middle, &mut before);
        right.value(middle, &mut after);
        let distance =
            |to: &[f64]| -> f64 { value.iter().zip(to).map(|(a, b)| (a - b).abs()).sum() };
        if distance(&before) <= distance(&after) {
            low = middle;
        } else {
            high = middle;
        }
        middle = 0.5 * (low + high);
    }
    Ok(high)
}

/// Halve until every piece is resolved.
fn divide(
    joints: &[f64],
    samples: &Samples,
    dim: usize,
    tolerance: &impl Fn(usize, f64) -> f64,
    function: &mut impl FnMut(&[f64], &mut [f64]) -> Result<(), Error>,
) -> Result<Approximation, Error> {
    let mut found = Approximation::default();
    let mut fitter = Fitter::new(dim);
    // Largest values found of each component: near a zero the accuracy of a function is relative to
    // them.
    let mut sizes = vec![0.0_f64; dim];
    for values in samples.values.chunks_exact(dim.max(1)) {
        for (size, value) in sizes.iter_mut().zip(values) {
            *size = size.max(value.abs());
        }
    }
    for pair in joints.windows(2) {
        if pair[0] > joints[0] {
            let time = pair[0];
            found.breaks.push(BreakingPoint { time, order: 0 });
        }
        // (start, end, depth), the earliest on top.
        let mut open = vec![(pair[0], pair[1], 0)];
        let mut tiniest: Option<(u32, f64)> = None;
        while let Some((start, end, depth)) = open.pop() {
            let mut piece = fitter.piece(start, end, function)?;
            let middle = 0.5 * (start + end);
            let splits = depth < DEEPEST && start < middle && middle < end;
            for (largest, c) in sizes
                .iter_mut()
                .zip(piece.coefficients.chunks_exact(POINTS))
            {
                *largest = f64::max(*largest, size(c));
            }
            let allowed: Vec<f64> = (0..dim)
                .map(|d| allowed(tolerance(d, sizes[d]), sizes[d]).max(fitter.blur(d, &piece)))
                .collect();
            let good = resolved(&piece, &allowed)
                && holds_at_samples(&piece, samples, &allowed)
                && holds_at_ends(&piece, &allowed, function)?;
            if splits && !good {
                if found.pieces.len() + open.len() > MOST {
                    return Err(Error::TooMuch {
                        what: "the history",
                        limit: MOST as u64,
                        unit: "polynomial pieces",
                        advice: format!(
                            "it is too rough near t = {middle}. Give the times of its kinks and \
                             jumps in history_breaks, smooth it, or raise rtol and atol"
                        ),
                    });
                }
                open.push((middle, end, depth + 1));
                open.push((start, middle, depth + 1));
                continue;
            }
            if !good {
                // It contains a jump, and no number between its ends locates it better.
                piece = fitter.last_value(&piece);
            }
            match tiniest {
                Some((deepest, _)) if depth >= KINKED && depth > deepest => {
                    tiniest = Some((depth, start));
                }
                Some((_, time)) if depth < KINKED => {
                    found.breaks.push(BreakingPoint { time, order: 0 });
                    tiniest = None;
                }
                None if depth >= KINKED => tiniest = Some((depth, start)),
                _ => {}
            }
            found.pieces.push(piece);
        }
        if let Some((_, time)) = tiniest.filter(|(_, time)| *time > pair[0]) {
            found.breaks.push(BreakingPoint { time, order: 0 });
        }
    }
    found.sizes = sizes;
    Ok(found)
}

/// Do two neighbours agree at their joint, in value and slope, as parts of one smooth function
/// approximated to the tolerance would?
fn joins(
    left: &Piece,
    right: &Piece,
    sizes: &[f64],
    tolerance: &impl Fn(usize, f64) -> f64,
) -> bool {
    let ends = |c: &[f64], x: f64| {
        let mut slopes = vec![0.0; c.len()];
        chebyshev::derivative(c, 1.0, &mut slopes);
        (chebyshev::value(c, x), chebyshev::value(&slopes, x))
    };
    let rows = left.coefficients.chunks_exact(POINTS);
    let pairs = rows.zip(right.coefficients.chunks_exact(POINTS)).zip(sizes);
    let (before, after) = (left.end - left.start, right.end - right.start);
    let shorter = before.min(after);
    pairs.enumerate().all(|(component, ((a, b), &size))| {
        let ((value, slope), (next, beyond)) = (ends(a, 1.0), ends(b, -1.0));
        let rate = 2.0 * (slope / before).abs().min((beyond / after).abs());
        let blur = UNITS * left.end.abs() * rate;
        let noise = LOUD * allowed(tolerance(component, size), size).max(blur);
        let turn = (slope / before - beyond / after).abs() * shorter;
        (value - next).abs() <= noise && turn <= noise * (POINTS * POINTS) as f64
    })
}

/// A bound on the values of a polynomial.
fn size(coefficients: &[f64]) -> f64 {
    coefficients.iter().map(|c| c.abs()).sum()
}

/// The tolerance, but at least the rounding error of the values.
fn allowed(tolerance: f64, size: f64) -> f64 {
    tolerance.max(VALUE_ROUNDING * size)
}

/// Are the last coefficients below the allowed size?
fn resolved(piece: &Piece, allowed: &[f64]) -> bool {
    let rows = piece.coefficients.chunks_exact(piece.terms).zip(allowed);
    rows.into_iter().all(|(c, allowed)| {
        let tail = c[POINTS - TAIL..].iter();
        tail.fold(0.0_f64, |tail, c| tail.max(c.abs())) <= *allowed
    })
}

/// Does the piece agree with the samples within it?
fn holds_at_samples(piece: &Piece, samples: &Samples, allowed: &[f64]) -> bool {
    let mut found = vec![0.0; allowed.len()];
    samples
        .within(piece, allowed.len())
        .all(|(time, values)| agrees(piece, time, values, &mut found, allowed))
}

/// Is the piece accurate next to its ends too, where it has no points?
fn holds_at_ends(
    piece: &Piece,
    allowed: &[f64],
    function: &mut impl FnMut(&[f64], &mut [f64]) -> Result<(), Error>,
) -> Result<bool, Error> {
    let rounding = 4.0 * f64::EPSILON * piece.start.abs().max(piece.end.abs());
    let length = piece.end - piece.start;
    let inset = (EDGE * length).max(rounding).min(0.5 * length);
    let dim = allowed.len();
    let (mut values, mut found) = (vec![0.0; 2 * dim], vec![0.0; dim]);
    let times = [piece.start + inset, piece.end - inset];
    function(&times, &mut values)?;
    let mut ends = times.iter().zip(values.chunks_exact(dim.max(1)));
    Ok(ends.all(|(time, values)| agrees(piece, *time, values, &mut found, allowed)))
}

/// Does a piece have these values?
fn agrees(piece: &Piece, time: f64, values: &[f64], found: &mut [f64], allowed: &[f64]) -> bool {
    piece.value(time, found);
    let mut pairs = values.iter().zip(&*found).zip(allowed);
    pairs.all(|((value, found), allowed)| (value - found).abs() <= NEAR * allowed)
}

/// Interpolation at the Chebyshev points, with its tables.
struct Fitter {
    dim: usize,
    points: Vec<f64>,
    basis: Vec<f64>,
    values: Vec<f64>,
}

impl Fitter {
    fn new(dim: usize) -> Self {
        let points: Vec<f64> = (0..POINTS)
            .map(|i| {
                let angle = std::f64::consts::PI * (i as f64 + 0.5) / POINTS as f64;
                -angle.cos()
            })
            .collect();
        let mut basis = Vec::new();
        chebyshev::basis(&points, POINTS, &mut basis);
        Self {
            dim,
            points,
            basis,
            values: vec![0.0; dim * POINTS],
        }
    }

    fn piece(
        &mut self,
        start: f64,
        end: f64,
        function: &mut impl FnMut(&[f64], &mut [f64]) -> Result<(), Error>,
    ) -> Result<Piece, Error> {
        let time = |x: &f64| 0.5 * (start + end) + 0.5 * (end - start) * x;
        let times: Vec<f64> = self.points.iter().map(time).collect();
        function(&times, &mut self.values)?;
        let mut coefficients = vec![0.0; self.dim * POINTS];
        for (component, out) in coefficients.chunks_exact_mut(POINTS).enumerate() {
            for (k, out) in out.iter_mut().enumerate() {
                let row = &self.basis[k * POINTS..(k + 1) * POINTS];
                let values = self.values[component..].iter().step_by(self.dim);
                let sum: f64 = row.iter().zip(values).map(|(t, value)| t * value).sum();
                *out = sum * if k == 0 { 1.0 } else { 2.0 } / POINTS as f64;
            }
        }
        Ok(Piece::new(start, end, POINTS, coefficients))
    }

    /// Error that rounding of the time causes in a component of the current piece.
    fn blur(&self, component: usize, piece: &Piece) -> f64 {
        let values = || self.values[component..].iter().step_by(self.dim);
        let half = 0.5 * (piece.end - piece.start);
        let places = self
            .points
            .windows(2)
            .map(|pair| half * (pair[1] - pair[0]));
        let steps = values().zip(values().skip(1)).zip(places);
        let rate = steps.fold(0.0_f64, |rate, ((a, b), gap)| rate.max((b - a).abs() / gap));
        let low = values().fold(f64::INFINITY, |low, value| low.min(*value));
        let high = values().fold(f64::NEG_INFINITY, |high, value| high.max(*value));
        let time = piece.start.abs().max(piece.end.abs());
        (UNITS * time * rate).min(BLURRED * (high - low))
    }

    /// The constant continuation of the last values of the current piece.
    fn last_value(&self, piece: &Piece) -> Piece {
        let mut coefficients = vec![0.0; piece.coefficients.len()];
        let last = &self.values[self.values.len() - self.dim..];
        for (row, value) in coefficients.chunks_exact_mut(POINTS).zip(last) {
            row[0] = *value;
        }
        Piece::new(piece.start, piece.end, POINTS, coefficients)
    }
}

#[cfg(test)]
mod tests;
