//! What loops must have in common to run side by side, and which loops cannot.
//!
//! A sample is cut at the arrival of a command, and each half into equal parts on which the output
//! is a short Taylor series. Loops whose delays hold the same number of whole samples and whose
//! samples have the same parts share a block.

use std::collections::BTreeMap;

use crate::Error;
use crate::dde::control_loop::row::Row;
use crate::dde::control_loop::sampled::Timing;
use crate::memory::push;

use super::piece::{LONG, degree_for};
use super::sets::Sets;
use super::trace::{SAMPLES, delays};
use super::transition;

/// Most states of a loop in a block.
pub(super) const MOST_STATES: usize = 4;

/// Loops with more samples than this run one by one, so that they can be cancelled.
const MOST_SAMPLES: f64 = 1e6;

/// The same for the parts of all delays of a continuous loop, each of which takes longer.
const MOST_ELEMENTS: f64 = 1e5;

/// Most parts of one half of a sample.
const MOST_PARTS: f64 = 64.0;

/// Largest direct gain from the delayed command to the command of a continuous loop in a block: the
/// rate of its signals grows beyond all bounds towards 1.
const MOST_DIRECT: f64 = 0.75;

/// Rate of a continuous loop times its delay up to which its parts are [`FINE`].
const SLOW: f64 = 1.0;

/// Longest parts of a continuous loop, times its rate, and a degree beyond which terms are below
/// 1e-17. On short parts, extrema and crossings are isolated in lanes almost always; where the
/// fastest rate is far above that of the output, long parts cost less.
const FINE: (f64, usize) = (0.35, 13);
const COARSE: (f64, usize) = (1.0, LONG);

/// What memory is requested for, in errors.
const SWEEP: &str = "the sweep";

/// The parts of a sample, and how the output behaves on them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Shape {
    /// Are the loops continuous? A sample is then one delay.
    pub(super) is_continuous: bool,
    /// Whole samples in the delay.
    pub(super) samples: u32,
    /// Parts from a sample to the arrival of a command; 0 where it arrives at the sample.
    pub(super) early: u8,
    /// Parts from there to the next sample.
    pub(super) late: u8,
    /// Does the output jump with the command that reaches the plant?
    pub(super) jumps: bool,
    /// Is the output not a line on every part (c A ≠ 0 or c E ≠ 0)?
    pub(super) is_curved: bool,
    /// Degree of the polynomials of a part.
    pub(super) degree: u8,
}

impl Shape {
    /// Columns of a trace that grow with the loop.
    pub(super) fn columns(&self) -> usize {
        if self.is_continuous {
            let parts = usize::from(self.late);
            (delays(parts) + 1) * parts * (LONG + 1)
        } else {
            self.samples as usize + SAMPLES
        }
    }

    /// Outputs in the trace of one sample.
    pub(super) fn corners(&self) -> usize {
        usize::from(self.early) + usize::from(self.jumps) + usize::from(self.late)
    }
}

/// The first states of all loops, on which the output depends: those of the plant. The others do not
/// reach them except through the command.
fn plant_states(sets: &Sets<'_>) -> usize {
    let n = sets.states();
    let entries = sets.entries();
    let is_nothing = |place: usize| entries.get(place).is_some_and(|entry| entry == &[0.0]);
    let c = n * n + 3 * n;
    (1..n)
        .find(|&p| (p..n).all(|j| is_nothing(c + j) && (0..p).all(|i| is_nothing(i * n + j))))
        .unwrap_or(n)
}

/// What follows from A, C and E.
#[derive(Debug, Clone, Copy)]
struct Plant {
    is_curved: bool,
    /// Bound on the rates of the plant, 1/s.
    rate: f64,
    /// ‖A‖₁, 1/s.
    norm: f64,
}

/// The shape of a loop in a block for `span` seconds of output, of which `plant` states are those of the
/// plant; none if it runs alone.
fn shape_of(sets: &Sets<'_>, set: usize, plant: usize, span: f64) -> Option<Shape> {
    let numbers = sets.row(set);
    let row = Row::new(sets.states(), &numbers).ok()?;
    let Row {
        delay,
        sample_time,
        limit,
        ..
    } = row;
    let (_, others) = numbers.split_last()?;
    let fits = others.iter().all(|number| number.is_finite())
        && (1..=MOST_STATES).contains(&sets.states())
        && limit > 0.0;
    if !fits {
        return None;
    }
    if sample_time == 0.0 {
        return continuous(&row, span);
    }
    if !(delay >= 0.0 && sample_time > 0.0 && span + delay < MOST_SAMPLES * sample_time) {
        return None;
    }
    let plant = plant_of(&row, plant);
    let timing = Timing::new(delay, sample_time);
    if plant.norm * sample_time > transition::MOST {
        return None;
    }
    let parts = |length: f64| (plant.rate * length).ceil();
    let (mut early, mut late) = (f64::from(timing.early > 0.0), 1.0);
    if plant.is_curved {
        early = parts(timing.early).max(early);
        late = parts(timing.late).max(late);
    }
    if early.max(late) > MOST_PARTS {
        return None;
    }
    Some(Shape {
        is_continuous: false,
        samples: u32::try_from(timing.samples).ok()?,
        early: early as u8,
        late: late as u8,
        jumps: row.d != 0.0,
        is_curved: plant.is_curved,
        // The same for all delays, so that more loops share a block.
        degree: degree_for((plant.rate * sample_time).min(1.0)) as u8,
    })
}

/// Sets of one shape, and that shape.
pub(super) type Alike = (Shape, Vec<usize>);

/// The sets that run in blocks, by their shapes, and those that run alone.
pub(super) fn sorted(sets: &Sets<'_>, span: f64) -> Result<(Vec<Alike>, Vec<usize>), Error> {
    let plant = plant_states(sets);
    let (mut alike, mut alone) = (Vec::<Alike>::new(), Vec::new());
    let mut places = BTreeMap::new();
    for set in 0..sets.len() {
        let Some(shape) = shape_of(sets, set, plant, span) else {
            push(SWEEP, &mut alone, set)?;
            continue;
        };
        let place = *places.entry(shape).or_insert(alike.len());
        if place == alike.len() {
            push(SWEEP, &mut alike, (shape, Vec::new()))?;
        }
        if let Some((_, sets)) = alike.get_mut(place) {
            push(SWEEP, sets, set)?;
        }
    }
    Ok((alike, alone))
}

/// The shape of a continuous loop: its delay is cut into parts on which all signals are short Taylor
/// series, as long as nothing jumps but the reference and the command.
fn continuous(row: &Row<'_>, span: f64) -> Option<Shape> {
    let is_simple =
        row.delay > 0.0 && row.d == 0.0 && row.impulse == 0.0 && row.l.abs() <= MOST_DIRECT;
    if !is_simple {
        return None;
    }
    let rate = rate_of(row);
    let reach = rate * row.delay;
    let (longest, degree) = if reach <= SLOW { FINE } else { COARSE };
    let parts = (reach / longest).ceil().max(1.0);
    let fits = parts <= MOST_PARTS && parts * (span / row.delay + 1.0) < MOST_ELEMENTS;
    fits.then_some(Shape {
        is_continuous: true,
        samples: 0,
        early: 0,
        late: parts as u8,
        jumps: false,
        is_curved: true,
        degree: degree as u8,
    })
}

/// Bound on the growth of the derivatives of the states, 1/s: |x⁽ʲ⁾| ≤ Mʲ |x| with the earlier |x|
/// among them, where M = |A| + |B K|/(1 − |L|). The root of ‖M⁴‖ does not depend much on the units
/// of the states.
fn rate_of(row: &Row<'_>) -> f64 {
    let n = row.b.len();
    let mut m = [[0.0; MOST_STATES]; MOST_STATES];
    for (i, line) in m.iter_mut().enumerate().take(n) {
        for (j, entry) in line.iter_mut().enumerate().take(n) {
            *entry = row.a[i * n + j].abs() + (row.b[i] * row.k[j]).abs() / (1.0 - row.l.abs());
        }
    }
    if n == 1 {
        return m[0][0];
    }
    for _ in 0..2 {
        let old = m;
        for (i, line) in m.iter_mut().enumerate().take(n) {
            for (j, entry) in line.iter_mut().enumerate().take(n) {
                *entry = (0..n).map(|k| old[i][k] * old[k][j]).sum();
            }
        }
    }
    let norm = |j: usize| m.iter().map(|line| line[j]).sum::<f64>();
    (0..n).map(norm).fold(0.0, f64::max).sqrt().sqrt()
}

fn plant_of(row: &Row<'_>, p: usize) -> Plant {
    let n = row.b.len();
    let a = |i: usize, j: usize| row.a[i * n + j];
    let is_line = (0..n).all(|i| row.c[i] == 0.0 || row.e[i] == 0.0)
        && (0..n).all(|j| (0..n).all(|i| row.c[i] == 0.0 || a(i, j) == 0.0));
    // The norm of |A|², whose root depends less on the units of the states than that of A.
    let square = |j: usize| -> f64 {
        let column = |i: usize| (0..p).map(|k| (a(i, k) * a(k, j)).abs()).sum::<f64>();
        (0..p).map(column).sum()
    };
    let norm = |j: usize| (0..n).map(|i| a(i, j).abs()).sum::<f64>();
    Plant {
        is_curved: !is_line,
        rate: (0..p).map(square).fold(0.0, f64::max).sqrt(),
        norm: (0..n).map(norm).fold(0.0, f64::max),
    }
}
