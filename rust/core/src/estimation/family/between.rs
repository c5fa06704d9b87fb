//! What a straight command leaves open between its rows.
//!
//! A command that is known at two times only may have been anything between them. A plant that is slow
//! against the interval h answers to the area A between it and the straight line. Of one jump at any
//! time of the interval, and of a Brownian bridge, var A = h² e²/12, with e the change over the interval
//! beyond that of its neighbours: a smooth command leaves little open. A command that the controller
//! holds for a while is known for so long of each interval.
//!
//! With W the whitened sensitivities, C their covariance and g the whitened response to A, the numbers
//! move by C Wᵀg/σ², and their covariance grows by that of all intervals. Their own part of the residuals
//! is no noise of the output.

use super::model::{Model, Point};
use super::response::pulse;
use super::rows::Part;
use crate::linear_algebra::vectors::dot;

/// Most areas of a record that are followed, the largest; the others count as if they were alike: more are
/// nearer to all and take longer.
const FOLLOWED: usize = 200;

/// Most of the variance of residuals that is taken for open areas: the rest is noise.
const MOST_SHARE: f64 = 0.8;

/// The intervals of a record whose areas count, with the standard deviation of each.
fn areas(part: &Part) -> Vec<((f64, f64), f64)> {
    let changes: Vec<f64> = part.command.windows(2).map(|two| two[1] - two[0]).collect();
    let change = |at: usize| changes.get(at).copied();
    let beyond = |at: usize| {
        let own = changes[at];
        let before = at.checked_sub(1).and_then(change).unwrap_or(own);
        let after = change(at + 1).unwrap_or(own);
        let median = before.max(own).min(before.min(own).max(after));
        own - median
    };
    let times = part.sent.windows(2);
    let mut out: Vec<((f64, f64), f64)> = times
        .enumerate()
        .map(|(at, two)| {
            let open = (two[1] - two[0] - part.hold).max(0.0);
            ((two[0], two[1]), open * beyond(at).abs() / 12.0_f64.sqrt())
        })
        .collect();
    out.sort_by(|a, b| b.1.total_cmp(&a.1));
    let squares =
        |some: &[((f64, f64), f64)]| some.iter().map(|(_, size)| size * size).sum::<f64>();
    let all = squares(&out);
    out.truncate(FOLLOWED);
    out.retain(|(_, size)| *size > 0.0);
    let scale = (all / squares(&out).max(f64::MIN_POSITIVE)).sqrt();
    out.iter_mut().for_each(|(_, size)| *size *= scale);
    out
}

/// What the open areas do to the numbers, and to the residuals.
pub(super) struct Open {
    /// The covariance that they add, row-major.
    pub(super) covariance: Vec<f64>,
    /// Their share of the variance of the whitened residuals.
    pub(super) share: f64,
}

/// What the open areas add to the covariance `inner` of the numbers; `scale` is the variance of the
/// whitened residuals with its dispersion.
pub(super) fn open(
    model: &Model<'_>,
    point: &Point,
    sensitivities: &[Vec<f64>],
    inner: &[f64],
    scale: f64,
) -> Open {
    let n = sensitivities.len();
    let mut out = Open {
        covariance: vec![0.0; n * n],
        share: 0.0,
    };
    if !model.rows.straight || !model.responds || scale.is_nan() || scale <= 0.0 {
        return out;
    }
    let (numbers, gain) = (model.numbers(&point.x), model.gain(point));
    let mut squares = 0.0;
    for (at, part) in model.rows.parts.iter().enumerate() {
        let (place, whitener) = model.whitener_of(at, point);
        for (interval, size) in areas(part) {
            let mut response = pulse(part, interval, model.class, &numbers);
            response.iter_mut().for_each(|y| *y *= gain * size);
            let whitened = whitener.whiten(&response);
            squares += dot(&whitened, &whitened);
            let score: Vec<f64> = sensitivities
                .iter()
                .map(|column| dot(&column[place.clone()], &whitened) / scale)
                .collect();
            let moved: Vec<f64> = (0..n).map(|i| dot(&inner[i * n..][..n], &score)).collect();
            for (i, left) in moved.iter().enumerate() {
                for (j, right) in moved.iter().enumerate() {
                    out.covariance[i * n + j] += left * right;
                }
            }
        }
    }
    out.share = (squares / dot(&point.whitened, &point.whitened)).min(MOST_SHARE);
    out
}

#[cfg(test)]
mod tests {
    use super::super::rows::{Record, Rows, Start};
    use super::*;

    fn part_of(command: &[f64], hold: f64) -> Part {
        let time: Vec<f64> = (0..command.len()).map(|at| 0.1 * at as f64).collect();
        let record = Record {
            output: vec![0.0; command.len()],
            command: command.to_vec(),
            earlier: 0,
            sent: None,
            hold,
            time,
        };
        let mut rows = Rows::new(&[record], &[Start::Held], 0.1, true, false);
        rows.parts.remove(0)
    }

    #[test]
    fn a_jump_leaves_open_when_it_came_and_a_ramp_nothing() {
        let jump = areas(&part_of(&[0.0, 0.0, 0.0, 2.0, 2.0, 2.0], 0.0));
        assert_eq!(jump.len(), 1);
        let ((start, end), size) = jump[0];
        assert!((start - 0.2).abs() < 1e-12 && (end - 0.3).abs() < 1e-12);
        // Uniform over the interval: its area is 2 J (t − h/2), with the variance (J h)²/12.
        assert!((size - 2.0 * 0.1 / 12.0_f64.sqrt()).abs() < 1e-12);
        let known = areas(&part_of(&[0.0, 0.0, 0.0, 2.0, 2.0, 2.0], 0.075));
        assert!((known[0].1 - 0.25 * size).abs() < 1e-12);
        assert!(
            areas(&part_of(&[0.0, 1.0, 2.0, 3.0, 4.0], 0.0))
                .iter()
                .all(|one| one.1 < 1e-12)
        );
    }
}
