//! Boundaries of a map: the crossings of its rows joined to curves.
//!
//! Along a curve ω and the gain k change continuously from row to row, and the direction of
//! crossing stays the same until the curve turns back. A crossing is joined to the one in the next
//! row that is closest to the point extrapolated from the last two, if the same holds in the other
//! direction and their directions agree. Where two curves of opposite directions end side by side
//! in the same row, they are the two arms of one curve that turns back there. Every point is a
//! proved crossing; only the order of the points is heuristic.
//!
//! A curve that runs along the rows meets few of them or none. Where the crossings of the columns
//! are known too, those that no joined curve passes make curves of their own.

use crate::order::sort_up;
use crate::stability::crossings::Crossing;

/// Neighbours in the next row that are compared, on either side.
const WINDOW: usize = 3;

/// Two points further apart than this share of the range, in k or in ω relative to the largest, are
/// not joined.
const FARTHEST: f64 = 0.2;

/// Largest gap, in lengths of their last steps, at which two arms are joined. For a parabola whose
/// top lies less than a row, h, above the last one, by δ, the gap is 2√δ/(√(δ + h) − √δ) ≤ 2/(√2 −
/// 1) = 4.83 steps.
const TURN: f64 = 5.5;

/// How far ω may leave the values at both ends of a step of a curve, as a share of their difference,
/// and of the highest ω. More takes points of other curves for its own; less shows points twice.
const BEYOND: f64 = 1.0;
const ROUNDING: f64 = 1e-9;

/// A point of a boundary.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Vertex {
    /// The parameter along the rows.
    pub gain: f64,
    /// Index of the row.
    pub row: usize,
    /// Imaginary part of the root on the line, 1/s.
    pub omega: f64,
    /// Roots that cross to the right as the parameter grows, less those that cross to the left.
    pub jump: i32,
}

/// A curve under construction: its last two points in (k, ω).
struct Arm {
    vertices: Vec<Vertex>,
}

impl Arm {
    /// The frequency at its end.
    fn omega(&self) -> f64 {
        self.last().map_or(0.0, |last| last.omega)
    }

    fn last(&self) -> Option<&Vertex> {
        self.vertices.last()
    }

    /// The expected point in the next row.
    fn expected(&self) -> Option<(f64, f64)> {
        let last = self.last()?;
        let before = self.vertices.len().checked_sub(2);
        let before = before
            .and_then(|index| self.vertices.get(index))
            .unwrap_or(last);
        Some((
            2.0 * last.gain - before.gain,
            2.0 * last.omega - before.omega,
        ))
    }

    /// Length of the last step.
    fn stride(&self, scale: (f64, f64)) -> f64 {
        match self.vertices.as_slice() {
            [.., a, b] => distance((a.gain, a.omega), (b.gain, b.omega), scale),
            _ => 0.0,
        }
    }
}

fn distance(p: (f64, f64), q: (f64, f64), scale: (f64, f64)) -> f64 {
    ((p.0 - q.0) / scale.0).abs() + ((p.1 - q.1) / scale.1).abs()
}

/// Lines of a map along which one parameter varies: the crossings of each, and the values on them.
pub(crate) struct Lines<'a> {
    pub(crate) crossings: Vec<Vec<Crossing>>,
    pub(crate) points: &'a [f64],
}

impl Lines<'_> {
    /// The least and the largest value.
    fn range(&self) -> (f64, f64) {
        let end = |point: Option<&f64>| point.copied().unwrap_or_default();
        (end(self.points.first()), end(self.points.last()))
    }
}

/// Join the crossings of the rows, and those of the columns that these curves do not pass.
pub(crate) fn join_both(rows: &Lines<'_>, columns: Option<&Lines<'_>>) -> [Vec<Vec<Vertex>>; 2] {
    let curves = join(&rows.crossings, rows.range());
    let others = columns.map_or_else(Vec::new, |columns| {
        join(&missed(&curves, rows.points, columns), columns.range())
    });
    [curves, others]
}

/// Where a curve passes a column: after which row, and between which frequencies.
struct Passage {
    row: usize,
    omega: (f64, f64),
}

/// The crossings of columns, at `gains`, that no curve passes.
fn missed(curves: &[Vec<Vertex>], gains: &[f64], columns: &Lines<'_>) -> Vec<Vec<Crossing>> {
    let highest = curves
        .iter()
        .flatten()
        .fold(0.0, |most, vertex| vertex.omega.max(most));
    let mut passages: Vec<Vec<Passage>> = gains.iter().map(|_| Vec::new()).collect();
    for pair in curves.iter().flat_map(|curve| curve.windows(2)) {
        let [a, b] = pair else { continue };
        let (low, high) = (a.omega.min(b.omega), a.omega.max(b.omega));
        let slack = BEYOND * (high - low) + ROUNDING * highest;
        let first = gains.partition_point(|gain| *gain < a.gain.min(b.gain));
        let last = gains.partition_point(|gain| *gain <= a.gain.max(b.gain));
        // A curve that turns back does so before or after its row.
        let turns = (a.row == b.row).then(|| a.row.saturating_sub(1));
        for passages in passages.get_mut(first..last).into_iter().flatten() {
            for row in [Some(a.row.min(b.row)), turns].into_iter().flatten() {
                passages.push(Passage {
                    row,
                    omega: (low - slack, high + slack),
                });
            }
        }
    }
    let crossings = columns.crossings.iter().zip(&mut passages);
    let left = crossings.map(|(crossings, passages)| {
        let is_missed = |crossing: &&Crossing| {
            let row = columns
                .points
                .partition_point(|point| *point <= crossing.gain);
            let row = row.saturating_sub(1);
            let own = passages.iter().position(|passage| {
                passage.row == row && (passage.omega.0..=passage.omega.1).contains(&crossing.omega)
            });
            // Each passage is that of one crossing.
            own.map(|place| passages.swap_remove(place)).is_none()
        };
        crossings.iter().filter(is_missed).copied().collect()
    });
    left.collect()
}

/// Join the crossings of all rows.
fn join(rows: &[Vec<Crossing>], range: (f64, f64)) -> Vec<Vec<Vertex>> {
    let all = || rows.iter().flatten();
    let highest = all().fold(0.0, |most, crossing| crossing.omega.max(most));
    let scale = (
        (range.1 - range.0).max(f64::MIN_POSITIVE),
        if highest > 0.0 { highest } else { 1.0 },
    );
    let mut done: Vec<Vec<Vertex>> = Vec::new();
    let mut arms: Vec<Arm> = Vec::new();
    for (row, crossings) in rows.iter().enumerate() {
        let mut vertices: Vec<Vertex> = crossings
            .iter()
            .filter_map(|crossing| {
                Some(Vertex {
                    gain: crossing.gain,
                    row,
                    omega: crossing.omega,
                    jump: crossing.jump?,
                })
            })
            .collect();
        sort_up(&mut vertices, |vertex| vertex.omega);
        let heads: Vec<(f64, f64, i32)> = arms
            .iter()
            .map(|arm| {
                let jump = arm.last().map_or(0, |last| last.jump);
                let (gain, omega) = arm.expected().unwrap_or((f64::NAN, f64::NAN));
                (gain, omega, jump)
            })
            .collect();
        let forward: Vec<Option<usize>> = heads
            .iter()
            .map(|head| closest(*head, &vertices, |v| (v.gain, v.omega, v.jump), scale))
            .collect();
        let backward: Vec<Option<usize>> = vertices
            .iter()
            .map(|v| closest((v.gain, v.omega, v.jump), &heads, |head| *head, scale))
            .collect();
        let mut taken = vec![false; vertices.len()];
        let mut going: Vec<Arm> = Vec::with_capacity(vertices.len());
        let mut ended: Vec<Arm> = Vec::new();
        for (index, mut arm) in std::mem::take(&mut arms).into_iter().enumerate() {
            let next = forward.get(index).copied().flatten();
            let next = next.filter(|place| backward.get(*place).copied().flatten() == Some(index));
            match next.and_then(|place| Some((place, vertices.get(place)?))) {
                Some((place, vertex)) => {
                    arm.vertices.push(*vertex);
                    if let Some(flag) = taken.get_mut(place) {
                        *flag = true;
                    }
                    going.push(arm);
                }
                None => ended.push(arm),
            }
        }
        done.extend(turned(ended, scale));
        let fresh = vertices.iter().zip(&taken).filter(|(_, taken)| !**taken);
        going.extend(fresh.map(|(vertex, _)| Arm {
            vertices: vec![*vertex],
        }));
        sort_up(&mut going, Arm::omega);
        arms = going;
    }
    done.extend(arms.into_iter().map(|arm| arm.vertices));
    // Arms that began side by side in the same row are one curve as well.
    let mut reversed: Vec<Arm> = Vec::new();
    let mut whole = Vec::new();
    for mut vertices in done {
        let turns = vertices
            .windows(2)
            .any(|pair| matches!(pair, [a, b] if a.row == b.row));
        if turns {
            whole.push(vertices);
        } else {
            vertices.reverse();
            reversed.push(Arm { vertices });
        }
    }
    reversed.sort_by_key(|arm| arm.last().map(|last| last.row));
    let mut group: Vec<Arm> = Vec::new();
    for arm in reversed {
        let row = |arm: &Arm| arm.last().map(|last| last.row);
        if group.first().is_some_and(|first| row(first) != row(&arm)) {
            whole.extend(turned(std::mem::take(&mut group), scale));
        }
        group.push(arm);
    }
    whole.extend(turned(group, scale));
    // In the order of the rows, as far as a curve has one.
    for curve in &mut whole {
        if let (Some(first), Some(last)) = (curve.first(), curve.last())
            && first.row > last.row
        {
            curve.reverse();
        }
    }
    whole
}

/// Index of the candidate closest to `from` with the same direction.
fn closest<T>(
    from: (f64, f64, i32),
    candidates: &[T],
    place: impl Fn(&T) -> (f64, f64, i32),
    scale: (f64, f64),
) -> Option<usize> {
    let omega = |index: usize| candidates.get(index).map(|candidate| place(candidate).1);
    let middle = candidates.partition_point(|candidate| place(candidate).1 < from.1);
    let mut start = middle.saturating_sub(2 * WINDOW);
    let mut end = (middle + 2 * WINDOW).min(candidates.len());
    // One frequency has many delays.
    while start > 0 && omega(start - 1) == omega(start) {
        start -= 1;
    }
    while end < candidates.len() && end > 0 && omega(end) == omega(end - 1) {
        end += 1;
    }
    (start..end)
        .filter_map(|index| {
            let (gain, omega, jump) = place(candidates.get(index)?);
            let off = distance((gain, omega), (from.0, from.1), scale);
            (jump == from.2 && off < FARTHEST).then_some((off, index))
        })
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, index)| index)
}

/// Curves that end in the same row, two arms of opposite directions joined where they meet.
fn turned(mut ended: Vec<Arm>, scale: (f64, f64)) -> Vec<Vec<Vertex>> {
    sort_up(&mut ended, Arm::omega);
    let mut curves = Vec::with_capacity(ended.len());
    let mut rest = ended.into_iter().peekable();
    while let Some(mut arm) = rest.next() {
        let meets = rest
            .peek()
            .is_some_and(|other| match (arm.last(), other.last()) {
                (Some(a), Some(b)) => {
                    let gap = distance((a.gain, a.omega), (b.gain, b.omega), scale);
                    a.jump == -b.jump && gap <= TURN * arm.stride(scale).max(other.stride(scale))
                }
                _ => false,
            });
        if meets && let Some(other) = rest.next() {
            arm.vertices.extend(other.vertices.into_iter().rev());
        }
        curves.push(arm.vertices);
    }
    curves
}
