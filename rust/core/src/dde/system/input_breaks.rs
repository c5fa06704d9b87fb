//! Breaks of history and inputs, and the break at the start.

use super::equations::Signal;
use super::jumps::{Break, Jumps};
use super::legendre::TERMS;
use super::terms::Feed;
use super::track::{Piece, Track};
use crate::dde::limits::slack;

/// The breaks of a given signal, with bounds from the pieces on both sides.
pub(super) fn passed_breaks(signal: &Signal, unit: f64) -> Vec<Break> {
    let width = signal.track.width();
    let pieces: Vec<&Piece> = signal.track.pieces().collect();
    let mut found = Vec::with_capacity(signal.breaks.len());
    for &start in &signal.breaks {
        let Some(([.., left], [right, ..])) = pieces.split_at_checked(start) else {
            continue;
        };
        let time = right.start;
        let mut bounds = vec![0.0; TERMS * width];
        let mut leap = vec![0.0; width];
        for i in 0..width {
            let (before, after) = (left.at(time, i), right.at(time, i));
            let noise = 64.0 * f64::EPSILON * (left.size[i][0] + right.size[i][0]);
            if (after - before).abs() > noise || left.degree.max(right.degree) < 2 {
                leap[i] = after - before;
            }
            let sides = [left, right].map(|piece| piece.taylor_bounds(time, i, unit));
            for k in 1..TERMS {
                bounds[k * width + i] = sides[0][k] + sides[1][k];
            }
            bounds[i] = leap[i].abs();
        }
        found.push(Break { time, bounds, leap });
    }
    found
}

/// The break at 0: before it the signal is given, after it the equation holds.
pub(super) fn first_break(
    jumps: &Jumps,
    feeds: &[Vec<Feed>; 3],
    tracks: [&Track; 3],
    x: &[f64],
) -> Break {
    let n = x.len();
    let unit = jumps.unit();
    let mut bounds = vec![0.0; TERMS * n];
    let mut source = vec![0.0; TERMS * n];
    for (feeds, track) in feeds.iter().zip(tracks) {
        for feed in feeds {
            let mut place = 0;
            track.seek(&mut place, -feed.delay, slack(0.0, feed.delay));
            for (row, column, factor) in feed.entries() {
                let sides = track.taylor_bounds(place, -feed.delay, column, unit);
                for (k, bound) in sides.iter().enumerate() {
                    source[k * n + row] += factor.abs() * bound;
                }
            }
        }
    }
    for (bound, x) in bounds.iter_mut().zip(x) {
        *bound = x.abs();
    }
    jumps.integrate(&mut bounds, &source);
    let mut leap = vec![0.0; n];
    if let Some(before) = tracks[0].pieces().next_back() {
        for i in 0..n {
            leap[i] = x[i] - before.at(0.0, i);
            bounds[i] = leap[i].abs();
            let left = before.taylor_bounds(0.0, i, unit);
            for k in 1..TERMS {
                bounds[k * n + i] += left[k];
            }
        }
    }
    if leap.iter().all(|leap| *leap == 0.0) {
        leap.clear();
    }
    Break {
        time: 0.0,
        bounds,
        leap,
    }
}
